"""A recorded press as a table in SI units, on one time base."""

from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from math import ceil, pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.press.drift import (
    NO_DRIFT,
    RETURNED,
    Drift,
    find_rests,
    force_at_rest,
    without_drift,
)
from sautereau.daq.signals.calibration import calibration_warning, correct, to_si, white_noise
from sautereau.daq.signals.delays import undelayed
from sautereau.daq.signals.quality_flags import QualityFlag, find_quality_flags, quality_warnings
from sautereau.rig.acquisition import Channel
from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle, rise_slope
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

    from sautereau.daq.file.recorded import Recorded

UNITS = {
    "velocity": "m/s",
    "force": "N",
    "angle": "rad",
    "deflection": "m",
    "jack_rise": "m",
    "jack_speed": "m/s",
}
"""Of the columns of a press."""
LEAST_ROWS = 16
"""Rows that a press has at the least."""
STRETCH = 4096
"""Rows worked out at a time: arrays of all are asked of the system and given back each time."""
FORCE_DRIFT = 2e-3
"""1, share of the largest force by which a doubtful offset may bend it unsaid."""
FORCE_MEAN = 1e-3
"""s, of the mean whose noise may hide such a bend as well."""


@dataclass(frozen=True)
class Press:
    """One recorded press."""

    path: Path
    rig: Rig
    simulated: bool
    """Whether a stand-in made it; whatever is made from it has to say so."""
    data: "pd.DataFrame"
    """Columns of `UNITS`, index `time` in s from the trigger; `attrs` holds the units.

    `velocity` is the key's under the laser and `deflection` its integral, downwards;
    `force` is the finger's; `jack_rise` and `jack_speed` follow from the key's angle.
    """
    rate: float
    """Hz, of the rows."""
    quality_flags: tuple[QualityFlag, ...] = ()
    """Where a signal is not to be believed; the rows there are as they were recorded."""
    drift: Drift = NO_DRIFT
    """What was taken off at the press's own rests."""
    warnings: tuple[str, ...] = ()
    """Of what is lost, the calibrations, the marks and the drift."""

    def columns(self, *names: str) -> tuple[Floats, ...]:
        """Return columns of the data, shape (rows,), which pandas would copy `attrs` for."""
        place, columns = self.data.columns.get_loc, self.data.to_numpy().T
        return tuple(np.ascontiguousarray(columns[place(name)]) for name in names)


def load_press(path: str | Path) -> Press:
    """Load a recording: volts to SI, droop undone, every sensor's lag and drift taken back.

    Only instants that every sensor has seen are rows; nothing is filled in.

    Raises:
        daq.errors.RecordingError: The file is not a whole recording.
        AnalysisError: It has no velocity or no force channel, or is too short.
    """
    from sautereau.daq.file.reading import read_recording

    return press_of(read_recording(path))


def press_of(recorded: "Recorded") -> Press:
    """Return the press of what was recorded, wherever it came from; as `load_press`.

    Raises:
        AnalysisError: It has no velocity or no force channel, or is too short.
    """
    import pandas as pd

    path = recorded.path
    rig, rate = recorded.rig, recorded.rate
    velocity_channel, force_channel = (_channel(recorded, q) for q in ("velocity", "force"))
    rows = _rows(recorded, max(velocity_channel.lag, force_channel.lag))
    start = recorded.first_sample / rate

    def aligned(signal: Floats, channel: Channel) -> Floats:
        return undelayed(signal, channel.lag * rate)[:rows]

    velocity, force = (
        aligned(correct(recorded.volts[channel.name], channel, rate), channel)
        for channel in (velocity_channel, force_channel)
    )
    marks = [
        mark
        for channel in (velocity_channel, force_channel)
        for mark in find_quality_flags(
            recorded.volts[channel.name], channel, rate, recorded.first_sample
        )
    ]
    warnings = [
        *map(str, recorded.gaps),
        *_calibrations(recorded, velocity_channel, force_channel),
        *quality_warnings(marks),
    ]
    drift = NO_DRIFT
    if np.isfinite(velocity).all() and np.isfinite(force).all():
        rests = find_rests(velocity, rate)
        velocity, drift, doubts = without_drift(
            velocity, rests, rate, start, velocity_channel.high_pass, _returns(recorded)
        )
        at_rest = recorded.volts[force_channel.name][rests.before]
        force, level, doubtful = _from_rest(
            force, to_si(at_rest, force_channel), force_channel.high_pass, rate
        )
        drift = replace(drift, force=level)
        warnings += [*doubts, *doubtful]
    frame = pd.DataFrame(
        columns_of(rig.key, velocity, force, rate).T,
        columns=_names(),
        index=pd.Index(recorded.time[:rows], name="time"),
        copy=False,
    )
    frame.attrs = {"units": UNITS, "simulated": recorded.simulated, "path": str(path)}
    return Press(path, rig, recorded.simulated, frame, rate, tuple(marks), drift, tuple(warnings))


@cache
def _names() -> "pd.Index":
    """Return the names of the columns, for which pandas takes longer than for their samples."""
    import pandas as pd

    return pd.Index(UNITS)


def columns_of(key: Key, velocity: Floats, force: Floats, rate: float) -> Floats:
    """Return the columns of `UNITS`, shape (columns, rows).

    Args:
        key: The key.
        velocity: m/s, of the key under the laser, from rest on; shape (rows,).
        force: N, of the finger; shape (rows,).
        rate: Hz.
    """
    columns = np.empty((len(UNITS), len(velocity)))
    columns[0], columns[1] = velocity, force
    integral = np.cumsum(velocity)
    integral -= velocity[0] / 2
    for first in range(0, len(velocity), STRETCH):
        rows = slice(first, first + STRETCH)
        moved, spin = velocity[rows], velocity[rows] / key.laser_arm
        deflection = (integral[rows] - moved / 2) / rate  # by trapezia
        angle = deflection / key.laser_arm
        columns[2, rows], columns[3, rows] = angle, deflection
        columns[4, rows] = rise_of_angle(key, angle)
        columns[5, rows] = rise_slope(key, angle) * spin
    return columns


def _channel(recorded: "Recorded", quantity: str) -> Channel:
    channel = recorded.rig.daq.channel(quantity)
    if channel is None:
        raise AnalysisError(
            f"recording {recorded.path}: it has no {quantity} channel, and phases need both;"
            f" add a channel with quantity = {quantity!r} to the rig's [[daq.channels]]"
        )
    return channel


def _rows(recorded: "Recorded", longest: float) -> int:
    rows = recorded.n_samples - ceil(longest * recorded.rate - 1e-9)
    if rows < LEAST_ROWS:
        raise AnalysisError(
            f"recording {recorded.path}: {max(rows, 0)} samples are left once the delay of"
            f" {longest * 1e3:.4g} ms is taken back, too few for a press; record for longer"
        )
    return rows


def _calibrations(recorded: "Recorded", *channels: Channel) -> list[str]:
    """Return what is to be said of old calibrations; a stand-in has none."""
    if recorded.simulated:
        return []
    try:
        day = date.fromisoformat(recorded.session.started[:10])
    except ValueError:
        return ["its session has no date, so nobody knows the age of the calibrations then"]
    found = (calibration_warning(channel, day) for channel in channels)
    return [text for text in found if text]


def _returns(recorded: "Recorded") -> bool:
    """Return whether the plan brings the key back to where it was; without one it may."""
    if recorded.plan is None:
        return True
    rise = recorded.plan.jack_rise
    return bool(abs(rise[-1] - rise[0]) <= RETURNED * np.abs(rise - rise[0]).max())


def _from_rest(
    force: Floats, at_rest: Floats, corner: float, rate: float
) -> tuple[Floats, float, list[str]]:
    """Return the force above that at rest, what was taken off, and what is doubtful about it.

    A force without AC coupling is left alone: what it shows at rest may be there.

    Args:
        force: N, shape (n,), AC coupling undone.
        at_rest: N, in the rest before, as the sensor showed it; empty without a rest.
        corner: Hz, of the AC coupling.
        rate: Hz.
    """
    if not corner or not len(at_rest):
        return force, 0.0, []
    noise = white_noise(at_rest)
    level, is_offset = force_at_rest(at_rest, noise, rate, corner)
    slope = 2 * pi * corner * level / rate
    doubt = abs(slope) * (len(force) - 1)
    off = np.arange(len(force), dtype=float)
    off *= -slope * is_offset
    off -= level
    off += force
    force = off
    hidden = noise / np.sqrt(FORCE_MEAN * rate)
    largest = max(force.max(), -force.min())
    if doubt <= max(FORCE_DRIFT * largest, hidden):
        return force, level, []
    meant = "an offset of the sensor" if is_offset else "the rest of an earlier force"
    text = (
        f"force: {level * 1e3:.3g} mN at rest before the press are taken for {meant}; if they are"
        f" not, it is wrong by {doubt * 1e3:.3g} mN at the end; record for longer before the"
        " motion, or zero the amplifier"
    )
    return force, level, [text]
