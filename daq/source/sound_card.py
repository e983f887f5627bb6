"""A sound card as the acquisition device; one of its inputs may receive the trigger's edge.

A sound card has no trigger input. Wire the controller's output through a voltage divider to a
separate audio input. This input is recorded from the start and searched for the edge. Sample 0 is
the first one at or after the edge, whose time is known within one sample.
"""

import math
import queue
import re
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.errors import DaqError
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.samples import Scaling
from sautereau.daq.file.trigger_date import Counted
from sautereau.daq.source.connection import hold_card
from sautereau.daq.source.source import InputSettings, SourceSettings
from sautereau.daq.source.task import DATING, accepted_rate, plan_task
from sautereau.rig.acquisition import Channel, Daq
from sautereau.rig.schema import Rig

EDGE = 0.25  # Fraction of full scale that the trigger's input exceeds at an edge
FULL_SCALE = 2.0**31  # Counts of a sample at full scale, which is the channel's `range`, V

_Piece = tuple[NDArray[np.int32], bool, float]
"""Counts as PortAudio gives them, whether some were lost before, and the time of the first one."""
_Dated = tuple[NDArray[np.int32], tuple[int, float]]
"""Counts, and the time (s on `time.perf_counter`, NaN if unknown) at which one of them, by its
index, was at the converter."""


class SoundCard:
    """An acquisition with a sound card; see `sautereau.daq.source.source.Source`.

    The device is the first input whose name contains `daq.device`. The inputs are `in1`, `in2`
    and so on. `range` of a channel is the voltage of full scale at its input.
    """

    simulated = False

    def __init__(self, daq: Daq, duration_s: float | None, *, triggered: bool = True):
        self._daq = daq
        self._plan = plan_task(daq, duration_s, triggered)
        self.n_samples, self.rate = self._plan.total, daq.sample_rate
        self.device_description = ""
        terminals = [channel.terminal for channel in daq.channels]
        if triggered:
            terminals.append(daq.trigger_source)
        self._inputs = [_number(terminal) for terminal in terminals]
        rows = [[0.0, channel.range / FULL_SCALE] for channel in daq.channels]
        self.scaling = Scaling("int32", np.array(rows))
        self._stream: Any = None
        self._opened = ExitStack()
        self._queue: queue.SimpleQueue[_Piece] = queue.SimpleQueue()
        self._received = 0  # Samples of each input, counted on PortAudio's thread
        self._filled = threading.Event()
        """Set once enough samples before an edge are held."""

    def __enter__(self) -> "SoundCard":
        sounddevice = library()
        daq = self._daq
        with ExitStack() as opened:
            opened.enter_context(hold_card(daq, "an acquisition"))
            try:
                index, found = _device(sounddevice, daq.device)
                self._stream = sounddevice.InputStream(
                    device=index,
                    channels=max(self._inputs),
                    samplerate=daq.sample_rate,
                    blocksize=daq.block,
                    dtype="int32",
                    callback=self._take,
                )
            except sounddevice.PortAudioError as error:
                raise DaqError(
                    f"sound card {daq.device}: {error} while opening {max(self._inputs)} inputs at"
                    f" {daq.sample_rate:g} Hz; set daq.sample_rate and daq.channels.*.terminal to"
                    " what it supports"
                ) from error
            self.device_description = f"{found}, sound card"
            opened.callback(self._stream.close, ignore_errors=True)
            self.rate = accepted_rate(float(self._stream.samplerate), daq)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stream = None
        self._opened.close()

    def settings(self) -> SourceSettings:
        plan, daq = self._plan, self._daq
        self._entered()
        return SourceSettings(
            device=self.device_description,
            simulated=self.simulated,
            channels=tuple(_settings(channel) for channel in daq.channels),
            requested_rate=daq.sample_rate,
            rate=self.rate,
            n_samples=plan.total,
            pre_trigger_samples=plan.before,
            buffer=plan.buffer,
            block=daq.block,
            trigger=daq.trigger_source if plan.triggered else "",
        )

    def of_device(self, rig: Rig) -> Rig:
        """Return the rig unchanged: a sound card does not report the delay of its converters."""
        return rig

    def start(self) -> None:
        self._entered().start()
        daq = self._daq
        longest = daq.pre_trigger + daq.trigger_timeout
        if self._plan.before and not self._filled.wait(longest):
            raise DaqError(
                f"sound card {daq.device}: {self._received} samples after {longest:g} s, but"
                f" daq.pre_trigger needs {self._plan.before}; check whether it is still plugged in"
            )

    def stop(self) -> None:
        self._entered().stop(ignore_errors=True)

    def blocks(self) -> Iterator[Block]:
        """Yield the samples as they arrive, from `daq.pre_trigger` before the edge on.

        Raises:
            DaqError: No edge or no samples arrived within `daq.trigger_timeout`, or samples were
                lost.
        """
        plan = self._plan
        first = -plan.before
        pieces = self._from_edge() if plan.triggered else self._pieces()
        for piece, (index, date) in pieces:
            left = None if plan.after is None else plan.after - first
            counts = piece[:, :left]
            # Sample `index` of the piece was at the converter on this date.
            dated = (Counted(date, date, first + index + 1),)
            known = math.isfinite(date) and abs(first + index) < DATING * self.rate
            yield Block(
                first,
                counts[: len(self._daq.channels)],
                dated if known else (),
                scaling=self.scaling,
            )
            first += counts.shape[1]
            if first == plan.after:
                return

    def _from_edge(self) -> "Iterator[_Dated]":
        """Yield counts, shape (n_inputs, n), from the samples before the edge on."""
        before = self._plan.before
        sign = 1 if self._daq.trigger_edge == "rising" else -1
        held = np.empty((len(self._inputs), 0), dtype=np.int32)
        waited = 0
        for piece, (_, date) in (pieces := self._pieces()):
            held = np.concatenate([held, piece], axis=1)
            high = sign * held[-1, before:].astype(float) > EDGE * FULL_SCALE
            edges = np.flatnonzero(high[1:] & ~high[:-1])
            if len(edges):
                kept = held[:, int(edges[0]) + 1 :]
                yield kept, (kept.shape[1] - piece.shape[1], date)
                yield from pieces
                return
            waited += piece.shape[1]
            if waited > self._daq.trigger_timeout * self.rate:
                raise DaqError(
                    f"sound card {self._daq.device}: no edge on {self._daq.trigger_source} within"
                    f" {self._daq.trigger_timeout:g} s; check that the controller's output is wired"
                    f" to it and exceeds {100 * EDGE:.0f} % of its full scale, and that the press"
                    " started"
                )
            held = held[:, -before - 1 :]

    def _pieces(self) -> "Iterator[_Dated]":
        """Yield counts of all inputs as they arrive, shape (n_inputs, n)."""
        columns = np.array(self._inputs) - 1
        while True:
            try:
                counts, lost, date = self._queue.get(timeout=self._daq.trigger_timeout)
            except queue.Empty as error:
                raise DaqError(
                    f"sound card {self._daq.device}: no samples within"
                    f" {self._daq.trigger_timeout:g} s; check whether it is still plugged in"
                ) from error
            if lost:
                raise DaqError(
                    f"sound card {self._daq.device}: samples were lost because they are not read"
                    " fast enough; raise daq.block or free the machine, and record again"
                )
            yield counts[:, columns].T, (0, date)

    def _take(self, counts: NDArray[np.int32], _n: int, times: Any, status: Any) -> None:
        """Keep samples, shape (n, inputs); called on PortAudio's thread.

        `inputBufferAdcTime` is when the first of them was at the converter, by the same clock as
        `currentTime` is now. Host APIs that do not know it give 0.
        """
        converted = getattr(times, "inputBufferAdcTime", 0.0)
        age = getattr(times, "currentTime", 0.0) - converted
        date = time.perf_counter() - age if converted > 0 and age >= 0 else math.nan
        self._queue.put((counts.copy(), bool(status.input_overflow), date))
        self._received += len(counts)
        if self._received > self._plan.before:
            self._filled.set()

    def _entered(self) -> Any:
        if self._stream is None:
            raise DaqError("sound card: not open; use it inside `with`")
        return self._stream


def library() -> Any:
    """Return the module sounddevice.

    Raises:
        DaqError: It, or the PortAudio library, is missing.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:  # OSError: the PortAudio library is missing
        raise DaqError(
            f"sound card: {error}; install sautereau[sound], and on Linux the library PortAudio"
            " (libportaudio2)"
        ) from error
    return sounddevice


def _device(sounddevice: Any, name: str) -> tuple[int, str]:
    """Return number and name of the first input device whose name contains a text."""
    devices = [device for device in sounddevice.query_devices() if device["max_input_channels"]]
    for device in devices:
        if name.lower() in device["name"].lower():
            return device["index"], device["name"]
    known = ", ".join(repr(device["name"]) for device in devices) or "none"
    raise DaqError(
        f"sound card {name!r}: there is no such input device; set daq.device to a part of one of"
        f" these names: {known}"
    )


def _number(terminal: str) -> int:
    """Return the number of an input."""
    found = re.fullmatch(r"in([1-9]\d{0,2})", terminal)
    if found is None:
        raise DaqError(
            f"sound card: {terminal!r} is not an input; write in1, in2, ... in"
            " daq.channels.*.terminal and daq.trigger_source"
        )
    return int(found[1])


def _settings(channel: Channel) -> InputSettings:
    return InputSettings(
        name=channel.name,
        terminal=channel.terminal,
        sensor=channel.sensor,
        range=channel.range,
        device_low=-channel.range,
        device_high=channel.range,
        terminal_configuration=None,
        coupling=None,
        excitation=None,
        delay=channel.input_delay,
    )
