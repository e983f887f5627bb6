"""The messages of a recording in the order of their log times.

A block has the log time of its first sample. Previews and events before this time precede the
block. Messages that are given only after the samples of their time, such as the motion of the
joints, follow at the end. Previews are signals decimated without aliasing, for viewers that plot
scalars.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.file.container.durable import McapWriter, refuse_oversized
from sautereau.daq.file.recorded import Event, Signal
from sautereau.daq.file.samples import TOPIC, SampleLayout, Samples, block_head, write_volts
from sautereau.daq.file.schemas import (
    MOTION,
    encode,
    encode_log,
    encode_rows,
    encode_scene,
    encode_transforms,
)
from sautereau.rig.schema import Rig

ATTENUATION = 60.0  # Stop-band attenuation, from half the preview's rate up, dB
PASS_BAND = 0.2  # Dimensionless, fraction of the preview's rate up to which it is accurate to 0.2 %

Values = NDArray[np.float32]
"""A preview has single precision, as in the file; this halves the time of the filter."""


def low_pass(factor: int) -> NDArray[np.float64]:
    """Return the weights of the anti-aliasing filter: symmetric, of sum 1.

    A sinc with a Kaiser window (Oppenheim and Schafer, Discrete-Time Signal Processing,
    7.6): its length follows from the attenuation and the transition band, from `PASS_BAND` to
    half the preview's rate.

    Args:
        factor: Decimation factor: samples per sample of the preview.
    """
    if factor == 1:
        return np.ones(1)
    width = 2 * math.pi * (0.5 - PASS_BAND) / factor
    attenuation = ATTENUATION + 2  # the formulas reach 1 dB less than they are given
    half = math.ceil((attenuation - 8) / (2.285 * width) / 2)
    cutoff = (0.5 + PASS_BAND) / 2 / factor
    beta = 0.1102 * (attenuation - 8.7)
    n = np.arange(-half, half + 1)
    weights = np.sinc(2 * cutoff * n) * np.kaiser(len(n), beta)
    return weights / weights.sum()


class Decimator:
    """Low-pass filter and decimate signals given in blocks of any length."""

    def __init__(self, rate: float, n_channels: int):
        """Start with ``n_channels`` signals sampled at ``rate`` Hz."""
        self.factor = math.ceil(rate / 1000.0)  # Hz, of the preview
        """Samples per sample of the preview."""
        weights = low_pass(self.factor)
        self.margin = len(weights) // 2
        """Samples at either end without a preview: half the filter's length."""
        # One column for each stretch of `factor` weights; the last one ends with zeros.
        self._columns = np.zeros((-(-len(weights) // self.factor), self.factor), np.float32)
        self._columns.reshape(-1)[: len(weights)] = weights
        self._columns = self._columns.T.copy()
        self._length = len(weights)
        self._held = np.empty((n_channels, 0), np.float32)
        self._fill = 0
        self.place = self.margin
        """Index of the sample at the next value of the preview, counted from the very first."""

    def room(self, n: int) -> Values:
        """Return a buffer for the next ``n`` samples, shape (n_channels, n), to be filled."""
        start, self._fill = self._fill, self._fill + n
        if self._fill > self._held.shape[1]:
            held = self._held[:, :start]
            self._held = np.empty((len(held), self._fill + self._length), np.float32)
            self._held[:, :start] = held
        return self._held[:, start : self._fill]

    def feed(self, values: NDArray[np.float64]) -> tuple[NDArray[np.int64], Values]:
        """Add samples, shape (n_channels, n), in any unit; return places and values as `rest`."""
        first = self.place
        self.room(values.shape[1])[:] = values
        found = self.rest()
        return np.arange(first, self.place, self.factor), found

    def rest(self) -> Values:
        """Return the new values of the preview, shape (n_channels, n), in the unit of the samples.

        The filter has no delay.
        """
        n, fill = max(0, (self._fill - self._length) // self.factor + 1), self._fill
        values = self._filtered(n)
        used = n * self.factor
        self._held[:, : fill - used] = self._held[:, used:fill].copy()
        self.place, self._fill = self.place + used, fill - used
        return values

    def _filtered(self, n: int) -> Values:
        """Return ``n`` values; each sums the products of consecutive rows and columns."""
        columns = self._columns.shape[1]
        rows = n + columns - 1 if n else 0
        # The weights that the last row has beyond the samples are zero.
        self.room(max(0, rows * self.factor - self._fill))[:] = 0
        grouped = self._held[:, : rows * self.factor].reshape(len(self._held), rows, self.factor)
        # Samples may be inf or NaN, which makes the preview NaN without a warning.
        with np.errstate(invalid="ignore", over="ignore"):
            products = np.ascontiguousarray(grouped @ self._columns)
            signal, row, column = products.strides
            shape, strides = (len(products), n, columns), (signal, row, row + column)
            return np.ndarray(shape, np.float32, products, 0, strides).sum(2)


class _Pending(NamedTuple):
    """A message that waits for the samples of its time."""

    now: int
    """Date on which it was given, ns since 1970."""
    time: float
    """s after the trigger."""
    topic: str
    data: Callable[[int], bytes]
    """Given its log time, ns since 1970."""


class LogOrder:
    """Writes the messages of one recording; `topics` must be set before."""

    def __init__(self, rig: Rig, rate: float, layout: SampleLayout):
        """Prepare for samples at ``rate`` Hz."""
        self.topics: dict[str, int] = {}
        """Number of the MCAP channel, by topic."""
        self.t0: int | None = None
        """Date of the trigger, ns since 1970; None before `start`."""
        self._rate, self._layout, self._begin = rate, layout, 0
        self._linear = all(len(row) < 3 for row in layout.scaling)
        self._scale = _scale(rig, layout if self._linear else None)
        self._decimator = Decimator(rate, len(layout.names))
        self.margin = self._decimator.margin
        """Number of samples that a block needs so that the previews before it are complete."""
        self._values = np.empty((len(layout.names), 0), np.float32)
        self._pending: list[_Pending] = []

    def start(self, t0: int, begin: int) -> None:
        """Set the date of the trigger, ns since 1970, and the index of the first sample."""
        self.t0, self._begin = t0, begin

    def add_event(self, now: int, event: Event) -> None:
        """Add an event; without a trigger its date is ``now``."""
        self._pending.append(
            _Pending(now, event.time, "/events", lambda date: encode_log(date, event))
        )

    def add_series(self, now: int, message: str, columns: dict[str, Signal]) -> None:
        """Add a message of arrays, at the time of their first row; of Joints also the rows."""
        data = encode(message, **columns)
        refuse_oversized(len(data))
        times = columns["t"].tolist()
        first = times[0] if times else 0.0
        self._pending.append(_Pending(now, first, f"/{message.lower()}", lambda _: data))
        if message == "Joints":
            missing = np.full(len(times), np.nan)
            rows = encode_rows([columns.get(name, missing) for name in MOTION])
            self._pending += [
                _Pending(now, time, "/motion", lambda _, row=row: row)
                for time, row in zip(times, rows, strict=True)
            ]

    def add_scenes(
        self, now: int, times: Signal, lines: Mapping[str, Signal], frames: Mapping[str, Signal]
    ) -> None:
        """Add a drawing for each time; see `Recording.write_scenes`."""
        views = (("/scene", encode_scene, lines), ("/transforms", encode_transforms, frames))
        for i, time in enumerate(times.tolist()):
            for topic, encoded, every in views:
                here = {name: values[i] for name, values in every.items()}
                self._pending.append(
                    _Pending(now, time, topic, lambda date, e=encoded, h=here: e(date, h))
                )

    def write_block(self, writer: McapWriter, first: int, samples: Samples) -> None:
        """Write a block, after the previews and events up to its first sample."""
        with np.errstate(over="ignore", invalid="ignore"):  # samples may be any double
            room = self._decimator.room(samples.shape[1])
            if self._linear:
                room[:] = samples
            else:
                write_volts(samples, self._layout.scaling, room)
            offset, gain = self._scale
            values = self._decimator.rest() * gain + offset
        self._values = np.concatenate([self._values, values], axis=1)
        self.write_views(writer, first)
        head = block_head(self.t0 or 0, first, self._rate, self._begin, samples.nbytes)
        date = self._date(first / self._rate)
        writer.add_message(self.topics[TOPIC], date, head + samples.tobytes(), date)

    def write_views(self, writer: McapWriter, stop: int | None = None) -> None:
        """Write the previews and the pending messages up to a sample; None for all."""
        waiting, step = self._values.shape[1], self._decimator.factor
        place = self._begin + self._decimator.place - step * waiting
        n = waiting if stop is None else min(waiting, max(0, -((place - stop) // step)))
        rows, self._values = encode_rows(self._values[:, :n]), self._values[:, n:]
        since_trigger = np.arange(place, place + step * n, step) * (1e9 / self._rate)
        times = np.maximum(0, (self.t0 or 0) + np.rint(since_trigger).astype(np.int64))
        preview = self.topics["/preview"]
        previews = [(time, preview, row) for time, row in zip(times.tolist(), rows, strict=True)]
        due = self._due(math.inf if stop is None else stop / self._rate)
        for date, topic, data in sorted([*due, *previews], key=lambda one: one[0]):
            writer.add_message(topic, date, data, date)

    def _due(self, until: float) -> Iterator[tuple[int, int, bytes]]:
        """Remove the pending messages up to a time, s after the trigger; yield them with dates."""
        pending, self._pending = self._pending, []
        for one in pending:
            if one.time <= until:
                date = self._date(one.time, one.now)
                yield date, self.topics[one.topic], one.data(date)
            else:
                self._pending.append(one)

    def _date(self, time_s: float, now: int = 0) -> int:
        """Return the date of a time after the trigger, ns since 1970; ``now`` without a trigger.

        MCAP's dates start in 1970; earlier ones of a wrong host clock remain in the blocks.
        """
        date = now if self.t0 is None else self.t0 + round(time_s * 1e9)
        return min(max(0, date), 2**63 - 1)  # In the year 2262


def _scale(rig: Rig, layout: SampleLayout | None) -> NDArray[np.float32]:
    """Return offset and gain that convert samples to SI units, each of shape (n_channels, 1).

    Args:
        layout: Layout of the samples, with linear scaling; None for volts.
    """
    per_volt = np.array([channel.scale for channel in rig.daq.channels])
    rows = layout.scaling if layout and layout.scaling else [(0.0, 1.0)] * len(per_volt)
    volts = np.array([(*row, 0.0)[:2] for row in rows]).T
    return (volts * per_volt)[:, :, None].astype(np.float32)
