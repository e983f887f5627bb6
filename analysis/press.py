"""A recorded press as a table in SI units, on one time base."""

from dataclasses import dataclass, replace
from datetime import date
from math import ceil, pi
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_trapezoid

from analysis.drift import NO_DRIFT, RETURNED, Drift, find_rests, force_at_rest, without_drift
from analysis.errors import AnalysisError
from daq.delays import undelayed
from daq.marks import Mark, find_marks, mark_warnings
from daq.sensors import calibration_warning, correct, to_si, white_noise
from rig.acquisition import Channel
from rig.schema import Rig
from trajectory.key import rise_of_angle, rise_slope
from trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

    from daq.recorded import Recorded

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
    marks: tuple[Mark, ...] = ()
    """Where a signal is not to be believed; the rows there are as they were recorded."""
    drift: Drift = NO_DRIFT
    """What was taken off at the press's own rests."""
    warnings: tuple[str, ...] = ()
    """Of what is lost, the calibrations, the marks and the drift."""


def load_press(path: str | Path) -> Press:
    """Load a recording: volts to SI, droop undone, every sensor's lag and drift taken back.

    Only instants that every sensor has seen are rows; nothing is filled in.

    Raises:
        daq.errors.RecordingError: The file is not a whole recording.
        AnalysisError: It has no velocity or no force channel, or is too short.
    """
    from daq.reading import read_recording

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
        for mark in find_marks(recorded.volts[channel.name], channel, rate, recorded.first_sample)
    ]
    warnings = [
        *map(str, recorded.gaps),
        *_calibrations(recorded, velocity_channel, force_channel),
        *mark_warnings(marks),
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
    spin = velocity / rig.key.laser_arm
    angle = cumulative_trapezoid(spin, dx=1 / rate, initial=0)
    frame = pd.DataFrame(
        {
            "velocity": velocity,
            "force": force,
            "angle": angle,
            "deflection": angle * rig.key.laser_arm,
            "jack_rise": rise_of_angle(rig.key, angle),
            "jack_speed": spin * rise_slope(rig.key, angle),
        },
        index=pd.Index(recorded.time[:rows], name="time"),
    )
    frame.attrs = {"units": UNITS, "simulated": recorded.simulated, "path": str(path)}
    return Press(path, rig, recorded.simulated, frame, rate, tuple(marks), drift, tuple(warnings))


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
    level, is_offset = force_at_rest(at_rest, rate, corner)
    ramp = 2 * pi * corner * level * np.arange(len(force)) / rate
    force = force - level - ramp * is_offset
    doubt = float(abs(ramp[-1]))
    hidden = white_noise(at_rest) / np.sqrt(FORCE_MEAN * rate)
    if doubt <= max(FORCE_DRIFT * np.abs(force).max(), hidden):
        return force, level, []
    meant = "an offset of the sensor" if is_offset else "the rest of an earlier force"
    text = (
        f"force: {level * 1e3:.3g} mN at rest before the press are taken for {meant}; if they are"
        f" not, it is wrong by {doubt * 1e3:.3g} mN at the end; record for longer before the"
        " motion, or zero the amplifier"
    )
    return force, level, [text]
