"""A recorded press as a table in SI units, on one time base."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from math import ceil, pi, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError, MissingSignalError
from sautereau.analysis.loading.drift import (
    AT_START,
    LEAST_REST,
    NO_DRIFT,
    RETURNED,
    Drift,
    Rests,
    departure,
    find_rests,
    force_at_rest,
    without_drift,
    without_line,
)
from sautereau.analysis.remark import Remark, divided
from sautereau.daq.file.recorded import UNCHECKED
from sautereau.daq.signals.calibration import (
    calibration_warning,
    median,
    restored,
    to_si,
    white_noise,
)
from sautereau.daq.signals.quality_flags import QualityFlag, find_quality_flags, quality_warnings
from sautereau.rig.acquisition import OF_STRING, Channel
from sautereau.rig.instrument import Key
from sautereau.rig.quantities import SECTIONS
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.key import contact_angle, jack_law
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

    from sautereau.daq.file.recorded import Event, Joints, Recorded

Signal = Literal["force", "velocity"]  # A signal of a press
SIGNALS: tuple[Signal, ...] = ("velocity", "force")  # Those that a press has
UNITS = {name: quantity.unit for name, quantity in SECTIONS["Samples of a press"].items()}
"""Unit of each column of a press."""
LEAST_RATE = 500.0
"""Hz, of the samples. At 512 Hz contact and release of presses of 0.07 m/s are uncertain by 1 ms
and more, of 20 ms; at 256 Hz contacts were found 3 ms late, and at 200 Hz no pluck."""
LEAST_ROWS = 16  # Fewest rows of a press
STRETCH = 16384  # Rows computed at a time: large arrays are allocated and freed by every operation
FORCE_DRIFT = 2e-3
"""Dimensionless, fraction of the largest force up to which nothing is said about a doubtful offset.
It is a warning above the channel's `gain_std`."""


@dataclass(frozen=True)
class Press:
    """One recorded press."""

    path: Path
    rig: Rig
    simulated: bool
    """Whether the stand-in made it; everything derived from it states so."""
    time: Floats
    """s after the trigger, or after the start of a motion that no edge has started; shape
    (rows,)."""
    samples: Mapping[str, Floats]
    """SI units, by the names of `UNITS`; shape (rows,) each.

    `velocity` is that of the key at the laser, positive downwards, and `deflection` its
    integral; `force` is that of the finger; `jack_rise` and `jack_speed` follow from the angle
    of the key.
    """
    rate: float
    """Hz, of the rows."""
    quality_flags: tuple[QualityFlag, ...] = ()
    """Quality flags; the flagged rows are as they were recorded."""
    drift: Drift = NO_DRIFT
    """Corrections from the rests before and after the press."""
    motion: "Event | None" = None
    """Start of the arm's motion, with its uncertainty; None where no arm was recorded."""
    joints: "Joints | None" = None
    """What the controller captured, with times as in `time`; None where it captured nothing."""
    warnings: tuple[str, ...] = ()
    """About lost samples, calibrations and drift."""
    missing: Signal | None = None
    """The signal that was not recorded; `samples` has nothing that depends on it."""
    remarks: tuple[str, ...] = ()
    """For information: about quality flags and slight drift."""
    string_signals: tuple[tuple[Channel, Floats], ...] = ()
    """Signals of sensors of the strings, SI, delays and AC coupling corrected; shape (rows,)
    each."""

    @cached_property
    def data(self) -> "pd.DataFrame":
        """The samples as a table with the index `time`; `attrs` holds the units.

        The analysis uses the arrays: importing pandas takes longer than analysing a press.
        """
        import pandas as pd

        frame = pd.DataFrame(dict(self.samples), index=pd.Index(self.time, name="time"))
        frame.attrs = {"units": UNITS, "simulated": self.simulated, "path": str(self.path)}
        return frame

    def between(self, start: float, stop: float) -> slice:
        """Return the rows from one time [s] to another, both included."""
        first, last = np.searchsorted(self.time, start), np.searchsorted(self.time, stop, "right")
        return slice(int(first), int(last))

    def from_contact(self, contact: float, start: float, stop: float) -> tuple[Floats, Floats]:
        """Return the key deflection since contact [m] and the finger force [N], shape (rows,).

        Args:
            contact: s after the trigger, at which the deflection counts as 0.
            start: s after the trigger, of the first row.
            stop: s after the trigger, of the last row.
        """
        deflection, rows = self.samples["deflection"], self.between(start, stop)
        at_contact = np.interp(contact, self.time, deflection)
        return deflection[rows] - at_contact, self.samples["force"][rows]


def load_press(path: str | Path) -> Press:
    """Load a recording: volts to SI, AC coupling inverted, delays and drift corrected.

    The rows are the instants at which every sensor has a sample; no sample is filled in.

    Raises:
        daq.errors.RecordingError: The file is not a complete recording.
        MissingSignalError: It has no velocity or no force channel.
        AnalysisError: As `partial_press_of`.
    """
    from sautereau.daq.file.reading import read_recording

    return press_of(read_recording(path))


def press_of(recorded: "Recorded") -> Press:
    """Return the press of a recording that was already read or imported; see `load_press`.

    Raises:
        MissingSignalError: It has no velocity or no force channel.
        AnalysisError: As `partial_press_of`.
    """
    channels = _channels(recorded)
    for missing in (name for name in SIGNALS if name not in channels):
        raise MissingSignalError(
            f"recording {recorded.path}: it has no {missing} channel, and this analysis needs"
            f" force and velocity; add a channel with quantity = {missing!r} to the rig's"
            " [[daq.channels]], or find contact and release in the other one with `sautereau"
            " phases`"
        )
    return partial_press_of(recorded)


def partial_press_of(recorded: "Recorded") -> Press:
    """Return the press of a recording that may lack the force or the velocity.

    Raises:
        AnalysisError: Its rig has `[daq]` alone, it has neither, it is too short, or its rate is
            below `LEAST_RATE`.
    """
    channels = _analysable(recorded)
    path, rig, rate = recorded.path, recorded.rig, recorded.rate
    of_strings = {c.name: c for c in rig.daq.channels if c.quantity in OF_STRING}
    lags = [channel.lag for channel in (*channels.values(), *of_strings.values())]
    # An input sampled later than the first has a negative lag: its first row lies before its data.
    early = ceil(max(0.0, -min(lags)) * rate - 1e-9)
    rows = _rows(recorded, max(lags), early)
    start = (recorded.first_sample + early) / rate - recorded.origin
    signals: dict[str, Floats] = {}
    marks: list[QualityFlag] = []
    for name, channel in (*channels.items(), *of_strings.items()):
        volts = recorded.volts[channel.name]
        flags = find_quality_flags(volts, channel, rate, recorded.first_sample)
        lost = lost_samples(flags, channel, rate, recorded.first_sample, len(volts))
        signals[name] = without_delay(volts, lost, channel, rate, early)[:rows]
        marks += flags
    string_signals = tuple((channel, signals.pop(name)) for name, channel in of_strings.items())
    said = [*map(Remark, map(str, recorded.gaps)), *_calibrations(recorded, *channels.values())]
    said += [] if recorded.checked else [Remark(UNCHECKED)]
    said += [Remark(text, doubt=False) for text in quality_warnings(marks)]
    if recorded.motion is not None:
        said += map(Remark, _coarse(rig))
    drift = NO_DRIFT
    if all(np.isfinite(signal).all() for signal in signals.values()):
        if "velocity" in signals:
            if recorded.after_press:  # which AC coupling still shows, as a constant
                signals["velocity"] -= median(signals["velocity"][: ceil(LEAST_REST * rate)])
            rests = find_rests(signals["velocity"], rate)
            corner = channels["velocity"].high_pass
            signals["velocity"], drift, found = without_drift(
                signals["velocity"],
                rests,
                rate,
                start,
                corner,
                place=_place_after(recorded, rests, rate, start),
                tolerance=channels["velocity"].gain_std,
            )
            rest = rests.before
            said += found
        else:
            rests = Rests(slice(0, departure(signals["force"], rate)), slice(0, 0))
            rest = rests.before
        if "force" in signals:
            channel = channels["force"]
            at_rest = to_si(recorded.volts[channel.name][rest], channel)
            signals["force"], level, found = _from_rest(
                signals["force"], at_rest, channel, rate, recorded.after_press
            )
            drift = replace(drift, force=level)
            said += found or _zero(signals["force"], rests, channel)
            signals["force"], found = _without_fixture(rig, signals, rate)
            said += found
    missing: Signal | None = next((name for name in SIGNALS if name not in channels), None)
    nothing = np.zeros(rows if missing else 0)
    columns = columns_of(
        rig.key, signals.get("velocity", nothing), signals.get("force", nothing), rate
    )
    samples = dict(zip(UNITS, columns, strict=True))
    if missing:
        samples = {n: c for n, c in samples.items() if (n == "force") == (missing == "velocity")}
    warnings, remarks = divided(said)
    return Press(
        path,
        rig,
        recorded.simulated,
        recorded.time[early : early + rows] - recorded.origin,
        samples,
        rate,
        tuple(marks),
        drift,
        recorded.motion and replace(recorded.motion, time=recorded.motion.time - recorded.origin),
        recorded.joints and replace(recorded.joints, t=recorded.joints.t - recorded.origin),
        warnings,
        missing,
        remarks,
        string_signals,
    )


def lost_samples(
    flags: Iterable[QualityFlag], channel: Channel, rate: float, first_sample: int, count: int
) -> NDArray[np.bool_]:
    """Return which raw samples of a channel lie in a drop-out, shape (count,).

    Args:
        channel: With its delay.
        rate: Hz.
        first_sample: Index of the first sample, counted from the trigger.
        count: Number of samples.
    """
    lost = np.zeros(count, bool)
    for flag in flags:
        if flag.kind == "drop-out":
            start, stop = (
                round((instant + channel.lag) * rate) - first_sample
                for instant in (flag.start, flag.stop)
            )
            lost[start:stop] = True
    return lost


def without_delay(
    volts: Floats, lost: NDArray[np.bool_], channel: Channel, rate: float, early: int
) -> Floats:
    """Return a signal in SI units, with AC coupling inverted and delay compensated.

    Each sample contributes to many values between samples. So lost samples are replaced by a line
    for all other values, and only the values beside a lost sample contain it as it was recorded.

    Args:
        volts: Raw, shape (n,), V.
        lost: Which samples are lost, shape (n,).
        channel: With its calibration.
        rate: Hz.
        early: Further delay to compensate, in samples.
    """
    recorded = restored(volts, channel, rate, early)
    if not lost.any() or lost.all():
        return recorded
    place = np.arange(len(volts))
    bridged = np.interp(place, place[~lost], volts[~lost])
    # A value lies between two samples, or on the first of them.
    beside = lost.copy()
    beside[:-1] |= lost[1:]
    beside = beside[int(channel.lag * rate + early) :][: len(recorded)]
    return np.where(beside, recorded, restored(bridged, channel, rate, early))


def columns_of(key: Key, velocity: Floats, force: Floats, rate: float) -> Floats:
    """Return the columns of `UNITS`, shape (columns, rows).

    Args:
        velocity: m/s, of the key at the laser, starting at rest; shape (rows,).
        force: N, of the finger; shape (rows,).
        rate: Hz.
    """
    columns = np.empty((len(UNITS), len(velocity)))
    columns[0], columns[1] = velocity, force
    angle, deflection = columns[2], np.cumsum(velocity, out=columns[3])
    deflection -= 0.5 * (velocity + velocity[:1])  # by trapezia
    deflection *= 1 / rate
    np.multiply(deflection, 1 / key.laser_arm, out=angle)
    for first in range(0, len(velocity), STRETCH):
        rows = slice(first, first + STRETCH)
        columns[4, rows], columns[5, rows] = jack_law(key, angle[rows])
    columns[5] *= velocity
    columns[5] *= 1 / key.laser_arm
    return columns


def _channels(recorded: "Recorded") -> dict[Signal, Channel]:
    """Return the channels of the signals that the recording has."""
    of = recorded.rig.daq.channel
    return {name: channel for name in SIGNALS if (channel := of(name))}


def _analysable(recorded: "Recorded") -> dict[Signal, Channel]:
    """Return the channels of the signals of a recording that can be analysed.

    Raises:
        AnalysisError: As `partial_press_of`.
    """
    path = recorded.path
    if recorded.rig.daq_only:
        raise AnalysisError(
            f"recording {path}: its rig file had [daq] alone, so that its key and string are"
            " unknown; `sautereau export` it, and `sautereau import --rig` it with a rig file that"
            " describes them"
        )
    if recorded.rate < LEAST_RATE:
        raise AnalysisError(
            f"recording {path}: it is sampled at {recorded.rate:.6g} Hz; contact and release are"
            f" found from LEAST_RATE = {LEAST_RATE:g} Hz on; record at a higher rate, or `sautereau"
            " export` it for other analyses"
        )
    channels = _channels(recorded)
    if not channels:
        raise AnalysisError(
            f"recording {path}: it has no force and no velocity channel; add one with quantity ="
            " 'force' or 'velocity' to the rig's [[daq.channels]]"
        )
    return channels


def _rows(recorded: "Recorded", longest: float, early: int) -> int:
    rows = recorded.n_samples - early - max(0, ceil(longest * recorded.rate - 1e-9))
    if rows < LEAST_ROWS:
        raise AnalysisError(
            f"recording {recorded.path}: only {max(rows, 0)} samples remain after the correction"
            f" of the delay of {longest * 1e3:.4g} ms, at least {LEAST_ROWS} are needed; record for"
            " longer"
        )
    return rows


def _calibrations(recorded: "Recorded", *channels: Channel) -> list[Remark]:
    """Return what is said about calibrations; nothing of the stand-in's.

    An unknown date is a remark: it says nothing about this press.
    """
    if recorded.simulated:
        return []
    try:
        day = date.fromisoformat(recorded.session.started[:10])
    except ValueError:
        text = "its session has no date, so the age of the calibrations is unknown"
        return [Remark(text, doubt=False)]
    said = ((calibration_warning(c, day), c.calibrated is not None) for c in channels)
    found = [Remark(text, doubt=doubt) for text, doubt in said if text]
    return found + [Remark(text) for text in map(_unknown_order, channels) if text]


def _unknown_order(channel: Channel) -> str | None:
    """Return a warning about a slow low-pass whose delay may be missing in `delay`."""
    if not channel.low_pass or channel.low_pass_order:
        return None
    first = 1 / (2 * pi * channel.low_pass)
    if sqrt(2) * first <= channel.delay_std:
        return None
    return (
        f"{channel.name}: `low_pass` is {channel.low_pass:g} Hz without `low_pass_order`, and thus"
        f" not corrected: if `delay` does not include it, instants are late by {first * 1e3:.2g} ms"
        f" (first order), {sqrt(2) * first * 1e3:.2g} ms (second order) or more, which the"
        " uncertainties contain only in part; give `low_pass_order`, or `low_pass` = 0 Hz if"
        " `delay` includes it"
    )


def _coarse(rig: Rig) -> list[str]:
    """Return a warning about an arm whose encoders limit the press."""
    resolution = rig.arm.resolution
    part = resolution / (rig.press.jack_rise * rig.key.press_arm / rig.key.jack_arm)
    # A resolution up to a thousandth of the fingertip's way gives no warning.
    if part <= 1e-3:
        return []
    return [
        f"arm: its encoders resolve {resolution * 1e3:.2g} mm at the fingertip, {100 * part:.1f} %"
        " of the press: its path and speed are no finer than that"
    ]


def _place_after(
    recorded: "Recorded", rests: Rests, rate: float, start: float
) -> tuple[float, float] | None:
    """Return where the key rests after the press, as `without_drift` takes it.

    The captured joints show by how much the servo leaves the finger below its start, to the
    resolution of their encoders. A finger that ends above its start has let the key return.
    """
    plan, joints = recorded.plan, recorded.joints
    if plan is not None:
        moved = np.abs(plan.jack_rise - plan.jack_rise[0])
        if moved[-1] > RETURNED * moved.max():
            return None
    if joints is None:
        return AT_START
    key, arm = recorded.rig.key, recorded.rig.arm
    ends = []
    for rest in (rests.before, rests.after):
        first, last = np.searchsorted(
            joints.t - recorded.origin - start, np.array([rest.start, rest.stop]) / rate
        )
        if first == last:
            return AT_START
        ends.append([joints.q1[first:last].mean(), joints.q2[first:last].mean()])
    # The last two rows are those of encoders that read one count more.
    angles = np.array([*ends, *(ends[1] + arm.radians_per_count * np.eye(2))])
    centres = fingertip_place(arm, angles)
    place = key.laser_arm * contact_angle(key.surface_height + arm.fingertip_radius, centres)
    place -= place[0]
    counts = place[2:] - place[1]
    # Two readings, each uniformly distributed over a count.
    return max(0.0, float(place[1])), float(np.sqrt(AT_START[1] ** 2 + counts @ counts / 6))


def _without_fixture(
    rig: Rig, signals: Mapping[str, Floats], rate: float
) -> tuple[Floats, list[Remark]]:
    """Return the force [N] on the key, without the inertia of the fixture before the transducer.

    The fixture moves with the key under the finger, whose acceleration is the slope of the
    velocity: of the fewest samples at which the noise of the velocity adds at most half of the
    force's own. A slope over 2 w + 1 samples has a standard deviation of
    sqrt(3 / (w (w + 1) (2 w + 1))) times that of a sample, times the rate.
    """
    force, mass = signals["force"], rig.arm.fixture_mass
    if not mass:
        return force, []
    if "velocity" not in signals:
        text = (
            f"force: the inertia of the fixture, {mass * 1e3:.3g} g, is contained in it, for there"
            " is no velocity channel"
        )
        return force, [Remark(text)]
    from scipy.signal import savgol_filter

    velocity = signals["velocity"]
    of_velocity = mass * rig.key.press_arm / rig.key.laser_arm
    noise, limit = of_velocity * white_noise(velocity) * rate, white_noise(force) / 2
    half = 1
    # The slope of the velocity, the acceleration, is taken over 1 ms on each side at most.
    while noise * sqrt(3 / (half * (half + 1) * (2 * half + 1))) > limit and half < rate * 1e-3:
        half += 1
    width = min(2 * half + 1, len(velocity) - 1 | 1)
    slope: Any = savgol_filter(velocity, width, 1, deriv=1, delta=1 / rate)
    return force - of_velocity * slope, []


def _zero(force: Floats, rests: Rests, channel: Channel) -> list[Remark]:
    """Return what is said about a force below 0 at rest, without AC coupling.

    A finger cannot pull at the key, so that such a force is an error of the sensor's zero.

    Args:
        force: N, shape (n,).
    """
    levels = {
        name: float(force[rows].mean())
        for name, rows in (("before", rests.before), ("after", rests.after))
        if rows.stop > rows.start
    }
    if channel.high_pass or not levels:
        return []
    name, largest = min(levels, key=levels.__getitem__), float(np.abs(force).max())
    if levels[name] >= -FORCE_DRIFT * largest:
        return []
    text = (
        f"force: {levels[name] * 1e3:.3g} mN at rest {name} the press, and a finger cannot pull:"
        " the zero of the sensor drifts, or it is AC-coupled, so that forces at contact, release"
        " and peak and the work are wrong by as much or more; zero the amplifier, or state"
        " `high_pass`"
    )
    return [Remark(text, doubt=-levels[name] > channel.gain_std * largest)]


def _from_rest(
    force: Floats, at_rest: Floats, channel: Channel, rate: float, after_press: bool
) -> tuple[Floats, float, list[Remark]]:
    """Return the force relative to that at rest, the correction, and what is said about it.

    A force without AC coupling is not corrected: a force at rest may be real.

    Args:
        force: N, shape (n,), AC coupling inverted.
        at_rest: N, as measured in the rest before the press; empty without a rest.
        channel: Of the force.
        rate: Hz.
        after_press: Whether an earlier press ended shortly before.
    """
    corner = channel.high_pass
    if not corner or not len(at_rest):
        return force, 0.0, []
    noise = white_noise(at_rest)
    level, is_offset = force_at_rest(at_rest, noise, rate, corner, after_press=after_press)
    slope = 2 * pi * corner * level / rate
    force = without_line(force, (level, slope * rate * is_offset), rate)
    hidden = noise / np.sqrt(1e-3 * rate)  # The noise of a mean over 1 ms hides it as well
    where = int(np.argmax(np.abs(force)))
    largest, doubt = abs(float(force[where])), abs(slope) * where
    if doubt <= max(FORCE_DRIFT * largest, hidden) or (after_press and not is_offset):
        return force, level, []
    meant = "an offset of the sensor" if is_offset else "the rest of an earlier force"
    text = (
        f"force: {level * 1e3:.3g} mN at rest before the press count as {meant}; if that is wrong,"
        f" the largest force, {largest:.3g} N, is wrong by {doubt * 1e3:.3g} mN; record for longer"
        " before the motion, or zero the amplifier"
    )
    return force, level, [Remark(text, doubt=doubt > channel.gain_std * largest)]
