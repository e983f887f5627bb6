"""Iterative learning control: the next press's correction from the measured speed of this one.

The jack slows down while the string is held, because the arm is compliant. The error of the speed,
low-pass filtered with zero phase and integrated to a rise, is added to the next plan:

    c[k+1]' = Q (sent speed - planned speed + gain (planned speed - measured speed)).

The sent speed is that of press k as rounded to encoder counts: its rounding errors, which the next
press does not repeat, are not learned. The filter Q limits learning to frequencies at which the arm
follows its plan, so that noise and errors that the arm cannot correct do not accumulate.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import JerkLaw, PressLaw, spline_law

CUTOFF = 200.0  # Cut-off frequency of Q (Hz)
GAIN = 1.0  # Dimensionless, fraction of the error that is corrected in one press
BANDWIDTH = 1000.0  # Bandwidth of the speed error (Hz). Above it the vibrometer's noise dominates.
KNOT = 2  # Controller samples between knots of a correction, the grain of PVT segments
FADE_IN = 4e-3  # s, over which learning is faded in from the start of the run-up
IMPROVEMENT = 0.05  # Dimensionless, fraction by which an error must fall to count as an improvement
PATIENCE = 2  # Presses without improvement after which learning stops
DIVERGENCE = 1.5  # Dimensionless, error relative to the best one above which learning stops at once


LEAST_INTERVAL = 0.999e-6  # s, between the knots of a correction
LARGEST_RISE = 1.0  # m, that a correction may add


@dataclass(frozen=True)
class Correction:
    """A smooth addition to the rise, zero at its ends and cubic between its knots.

    Raises:
        TrajectoryError: The knots are not increasing, the arrays do not fit, or the correction
            is not zero at its ends.
    """

    time: Floats
    """s from the start of motion, knots; shape (n,)."""
    rise: Floats
    """m, added at the knots; shape (n,)."""

    def __post_init__(self):
        fault = ""
        if self.time.ndim != 1 or self.time.shape != self.rise.shape or len(self.time) < 3:
            shapes = f"times of shape {self.time.shape} and rises of shape {self.rise.shape}"
            fault = f"{shapes}; give 3 or more of each"
        elif not (np.isfinite(self.time).all() and np.isfinite(self.rise).all()):
            fault = "a time or a rise is not finite; learn again"
        elif (np.diff(self.time) < LEAST_INTERVAL).any():
            fault = "its times do not increase by 1 us or more; sort them, or thin them out"
        elif np.abs(self.rise).max() > LARGEST_RISE:
            fault = (
                f"it adds up to {np.abs(self.rise).max() * 1e3:.4g} mm, more than"
                f" {LARGEST_RISE * 1e3:g} mm; learn again"
            )
        elif self.rise[0] != 0 or self.rise[-1] != 0:
            fault = (
                f"it adds {self.rise[0] * 1e3:.4g} and {self.rise[-1] * 1e3:.4g} mm at its ends,"
                " where it must be zero; learn again"
            )
        if fault:
            raise TrajectoryError(f"correction: {fault}")

    def onto(self, law: PressLaw) -> PressLaw:
        """Return a press's law with the correction added; its parts start as before.

        Raises:
            TrajectoryError: The correction exceeds the time from the run-up to the return.
        """
        if self.time[0] < law.start - 1e-9 or self.time[-1] > law.return_start + 1e-9:
            raise TrajectoryError(
                f"correction: it acts from {self.time[0]:.6g} to {self.time[-1]:.6g} s, and the"
                f" press lasts from {law.start:.6g} to {law.return_start:.6g} s; it was learned for"
                " another press: learn again"
            )
        return replace(law, law=_sum(law.law, spline_law(self.time, self.rise)))


def _sum(law: JerkLaw, added: JerkLaw) -> JerkLaw:
    """Return the sum of two laws, the second zero outside its times, as piecewise cubics."""
    times = np.union1d(law.times, added.times)
    times = times[np.concatenate([[True], np.diff(times) > 1e-12])]
    middles = (times[:-1] + times[1:]) / 2
    states = np.stack(law.at(times), -1)
    jerks = law.jerks[law.phase(middles)].astype(float)
    inside = (middles > added.times[0]) & (middles < added.times[-1])
    jerks[inside] += added.jerks[added.phase(middles[inside])]
    within = (times >= added.times[0]) & (times < added.times[-1])
    states[within] += np.stack(added.at(times[within]), -1)
    return JerkLaw(times, states, jerks)


def speed_error(law: PressLaw, time: Floats, speed: Floats) -> float:
    """Return the RMS error of the jack's speed in the cruise, relative to the planned speed.

    Args:
        time: s from the start of motion, equidistant; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).

    Raises:
        TrajectoryError: The times do not cover the cruise, or a speed is not finite.
    """
    _check(law, time, speed)
    filtered = _low_pass(speed, BANDWIDTH, time)
    cruise = (time >= law.cruise_start) & (time <= law.cruise_end)
    planned = law.law.at(time[cruise]).velocity
    error = filtered[cruise] - planned
    return float(np.sqrt(np.mean(error**2)) / np.abs(planned).max())


def corrected(
    law: PressLaw,
    time: Floats,
    sent: Floats,
    speed: Floats,
    period: float,
    *,
    gain: float = GAIN,
) -> Correction:
    """Return the next press's correction.

    Args:
        time: s from the start of motion, equidistant; shape (n,).
        sent: m/s, of the jack as sent to the controller, with the correction; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).
        period: s, of the controller's samples.
        gain: Dimensionless, fraction of the error that is corrected in one press.

    Raises:
        TrajectoryError: As `speed_error`.
    """
    _check(law, time, speed)
    planned = law.law.at(time).velocity
    deficit = sent - planned + gain * (planned - speed)
    deficit = deficit * np.clip((time - law.start) / FADE_IN, 0.0, 1.0) * (time < law.bottom)
    rate = _low_pass(deficit, CUTOFF, time)
    step = np.diff(time, prepend=time[0])
    added = np.cumsum(rate * step)
    knots = np.arange(law.start, law.return_start, KNOT * period)
    rise = np.interp(knots, time, added) - np.interp(law.start, time, added)
    # The added rise is removed after the stroke, while the key rests at the bottom.
    rest = max(law.return_start - law.bottom, KNOT * period)
    back = np.clip((knots - law.bottom) / (0.8 * rest), 0.0, 1.0)
    rise = rise * (1 - back**3 * (10 - 15 * back + 6 * back**2))
    rise[0] = rise[-1] = 0.0
    return Correction(knots, rise)


@dataclass
class Learner:
    """Decide after every press whether and how to continue.

    The best correction so far is kept. After a press that is no better, the next correction is
    computed from the best press again, with half the gain. Learning stops when the error no
    longer improves or grows.
    """

    law: PressLaw
    """Law of the press without a correction."""
    period: float
    """s, of the controller's samples."""
    errors: list[float] = field(default_factory=list)
    """Dimensionless, of every press so far; see `speed_error`."""
    best: Correction | None = None
    """Correction with the least error; None for the uncorrected plan."""
    stopped: str = ""
    """Reason why learning has stopped; empty while it continues."""
    gain: float = GAIN
    """Dimensionless, fraction of the error that is corrected in one press."""
    scatter: float | None = None
    """Dimensionless, RMS of what differs from press to press in the cruise and no correction
    removes: noise, the reading of the encoders, the instrument; None after one press."""
    _best: tuple[Floats, Floats, Floats] | None = None
    _deviation: tuple[Floats, Floats] | None = None

    def learn(
        self, used: Correction | None, time: Floats, sent: Floats, speed: Floats
    ) -> Correction | None:
        """Evaluate one press's measured speed; return the next correction, or None at the end.

        Args:
            used: The correction of this press; None for none.
            time: s from the start of motion, equidistant; shape (n,).
            sent: m/s, of the jack as sent to the controller; shape (n,).
            speed: m/s, of the jack as measured; shape (n,).
        """
        error = speed_error(self.law, time, speed)
        self._compare(time, speed - sent)
        least = min(self.errors, default=np.inf)
        self.errors.append(error)
        if error < least:
            self.best, self._best = used, (time, sent, speed)
        else:
            self.gain /= 2
        if error > DIVERGENCE * least:
            self.stopped = (
                f"the error grew to {error * 100:.3g} % from {least * 100:.3g} %; the best"
                " correction is kept"
            )
            return None
        if len(self.errors) > PATIENCE:
            earlier = min(self.errors[:-PATIENCE])
            if min(self.errors[-PATIENCE:]) > (1 - IMPROVEMENT) * earlier:
                self.stopped = f"no improvement over the last {PATIENCE} presses"
                return None
        best = self._best or (time, sent, speed)
        return corrected(self.law, *best, self.period, gain=self.gain)

    def _compare(self, time: Floats, deviation: Floats) -> None:
        """Update the scatter from the deviation [m/s] from the sent speed, by the press before.

        While corrections change much, so do deviations: the least difference is taken.
        """
        if self._deviation is not None:
            change = deviation - np.interp(time, *self._deviation)
            planned = self.law.law.at(time).velocity
            least = speed_error(self.law, time, planned + change) / np.sqrt(2)
            self.scatter = least if self.scatter is None else min(least, self.scatter)
        self._deviation = time, deviation


def _low_pass(values: Floats, cutoff: float, time: Floats) -> Floats:
    """Return values low-pass filtered with zero phase; unchanged if sampled too slowly."""
    from scipy.signal import butter, sosfiltfilt

    rate = (len(time) - 1) / (time[-1] - time[0])
    if cutoff >= rate / 2:
        return values
    sos = butter(2, cutoff, fs=rate, output="sos")
    pad = min(len(values) - 1, int(3 * rate / cutoff))
    return sosfiltfilt(sos, values, padlen=pad)


def _check(law: PressLaw, time: Floats, speed: Floats) -> None:
    fault = ""
    if time.ndim != 1 or time.shape != speed.shape or len(time) < 16:
        fault = f"times of shape {time.shape} and speeds of shape {speed.shape}; give 16 or more"
    elif not (np.isfinite(time).all() and np.isfinite(speed).all()):
        fault = "a time or a speed is not finite; omit this press"
    elif time[0] > law.start + 1e-9 or time[-1] < law.cruise_end - 1e-9:
        fault = (
            f"speeds from {time[0]:.6g} to {time[-1]:.6g} s do not cover the press from"
            f" {law.start:.6g} to {law.cruise_end:.6g} s; record for longer"
        )
    if fault:
        raise TrajectoryError(f"learning: {fault}")
