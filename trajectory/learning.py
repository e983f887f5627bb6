"""Iterative learning control: the next press's correction from the measured speed of those before.

The jack slows down while the string is held, because the arm is compliant. What press k lacked
becomes the correction of the next one:

    c[k+1]' = Q (sent speed - measured speed).

The sent speed is that of press k as rounded to encoder counts: its rounding errors, which the next
press does not repeat, are not learned. The filter Q limits learning to frequencies at which the arm
follows its plan, so that noise and errors that the arm cannot correct do not accumulate.

A string is touched and released at a certain rise, and not at a certain time: what was measured
between these events is shifted in time to where the plan has the same rise.

By how much the arm yields depends not only on the force, but also on how fast it grows, and a jack
that slows down meets the force otherwise than the plan will. How the arm yields is therefore fitted
to the measured force F while a string is held: with the lag d of the jack behind what was sent,

    d + damping d' + inertia d'' = compliance F.

The correction is that of the plan, which meets the same force at the same rise; what the fit does
not explain is corrected as measured. What then remains is a fixed-point iteration, accelerated
where the arm follows a correction only in part or late: the next correction is the combination of
c[1] ... c[k+1] whose combined residuals c[j+1]' - c[j]' are least (D. G. Anderson, J. ACM 12 (1965)
547). Where the residuals are noise, that is their average.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import JerkLaw, PressLaw, spline_law

CUTOFF = 200.0  # Cut-off frequency of Q (Hz)
KNOT = 2  # Controller samples between knots of a correction, the grain of PVT segments
FADE_IN = 4e-3  # s, over which learning is faded in from the start of the run-up
IMPROVEMENT = 0.05  # Dimensionless, fraction by which an error must fall to count as an improvement
PATIENCE = 2  # Presses without improvement after which learning stops

LARGEST_RISE = 1.0  # m, that a correction may add
LEAST_APART = 1e-4  # s, between two events that are shifted on their own
NEVER: Floats = np.empty((0, 2))  # Contact and release of no string


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
        elif (np.diff(self.time) < 0.999e-6).any():
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


def speed_error(law: PressLaw, time: Floats, speed: Floats, held: Floats = NEVER) -> float:
    """Return the RMS error of the jack's speed while a string is held, relative to the plan.

    Args:
        time: s from the start of motion, equidistant; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).
        held: s from the start of motion, contact and release of each string; shape (k, 2). Without
            any, the error is that over the cruise.

    Raises:
        TrajectoryError: The times do not cover the cruise, or a speed is not finite.
    """
    _check(law, time, speed)
    filtered = _low_pass(speed, 1000.0, time)  # Hz; above it the vibrometer's noise dominates
    spans = held if len(held) else [(law.cruise_start, law.cruise_end)]
    inside = np.any([(time >= first) & (time <= last) for first, last in spans], axis=0)
    planned = law.law.at(time[inside]).velocity
    error = filtered[inside] - planned
    return float(np.sqrt(np.mean(error**2)) / np.abs(planned).max())


@dataclass(frozen=True)
class Residual:
    """What one press lacked, on the samples of the controller from run-up to return."""

    time: Floats
    """s from the start of motion; shape (n,)."""
    needed: Floats
    """m/s, speed of the correction that would replace it; shape (n,)."""
    lacking: Floats
    """m/s, the same less the speed of the correction that the press had; shape (n,)."""
    until: float
    """s, last planned release; without a string, end of the cruise."""
    plucked: bool

    def inside(self, law: PressLaw) -> NDArray[np.bool_]:
        """Return at which times the speed must be right: in the cruise, until the last release."""
        return (self.time >= law.cruise_start) & (self.time <= self.until)


def residual(
    law: PressLaw,
    time: Floats,
    sent: Floats,
    speed: Floats,
    period: float,
    held: Floats = NEVER,
    force: Floats | None = None,
) -> Residual:
    """Return what a press lacked.

    Args:
        time: s from the start of motion, equidistant; shape (n,).
        sent: m/s, of the jack as sent to the controller, with the correction; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).
        period: s, of the controller's samples.
        held: As in `speed_error`.
        force: N, of the finger on the key as measured; shape (n,). Without it, the presses alone
            show how the arm yields.

    Raises:
        TrajectoryError: As `speed_error`.
    """
    _check(law, time, speed)
    planned, measured = _events(law, time, speed, held)
    until = float(planned[-1]) if len(held) else law.cruise_end
    # Outside the events both times run alike.
    ends = np.array([-1.0, 1.0]) * time[-1]
    before, after = (
        np.concatenate([x[:1] + ends[:1], x, x[-1:] + ends[1:]]) for x in (planned, measured)
    )
    shifted = np.interp(time, before, after)
    step = time[1] - time[0]
    lag = np.cumsum(sent - speed) * step
    yielding = planned_yielding = np.zeros_like(lag)
    if force is not None and len(measured) > 2 and law.steady:
        respond = _response(time, sent - speed, force, measured[1] - FADE_IN, measured[-1])
        rises = np.maximum.accumulate(_rise(law, time, speed))
        same_rise = np.interp(law.law.at(time).position, rises, time)
        held_now = (time > planned[1]) & (time < until)
        met = np.where(held_now, np.minimum(same_rise, measured[-1]), shifted)
        yielding, planned_yielding = respond(force), respond(np.interp(met, time, force))
    lacked = np.gradient(np.interp(shifted, time, lag - yielding) + planned_yielding, step)
    if len(held):
        # The string may be released later than planned; until then the jack must keep its speed.
        # What follows is the jump of a soft arm: learned, it would pull the jack back too early.
        before = (time <= until) & (time > until - FADE_IN)
        lacked = np.where(time <= until, lacked, lacked[before].mean())
    within = np.clip((time - law.start) / FADE_IN, 0.0, 1.0) * (time < law.bottom)
    had = (sent - law.law.at(time).velocity) * within
    grid = np.arange(law.start, law.return_start, period)
    needed, had = (
        np.interp(grid, time, _low_pass(x, CUTOFF, time)) for x in (lacked * within, had)
    )
    return Residual(grid, needed, needed - had, until, len(held) > 0)


def _response(
    time: Floats, late: Floats, force: Floats, since: float, until: float
) -> Callable[[Floats], Floats]:
    """Return a function from forces [N] to the lag [m] of the jack by which the arm yields.

    It is 0 where the force does not explain the lag.

    Args:
        late: m/s, the sent less the measured speed of the jack.
        since: s, start of the fit; the constant lag of before is fitted, too.
        until: s, its end.
    """
    from scipy.optimize import lsq_linear
    from scipy.signal import lfilter

    step = time[1] - time[0]
    late, force = (_low_pass(x, CUTOFF, time) for x in (late, force))
    fitted = (time >= since) & (time <= until)
    columns = np.stack([force, -late, -np.gradient(late, step), np.ones_like(time)], -1)[fitted]
    scales = np.abs(columns).max(axis=0)
    scales[scales == 0] = 1.0
    least = [0.0, 0.0, 0.0, -np.inf]  # an arm that yields towards the force cannot be inverted
    lag = np.cumsum(late)[fitted] * step
    found = lsq_linear(columns / scales, lag, (least, np.inf))
    # Position loops of 3 to 27 N m/rad leave 0.03 to 0.28 of the lag; a coarse encoder or backlash
    # leaves 0.5 to 0.8, and there such a fit increases the error.
    if np.std(found.fun) > 0.3 * np.std(lag):
        return np.zeros_like
    compliance, damping, inertia, _ = found.x / scales
    # By the trapezoidal rule: d' is 2/step (1 - z)/(1 + z), with a delay z of one step.
    first, second = 2 * damping / step, 4 * inertia / step**2
    numerator = [compliance, 2 * compliance, compliance]
    denominator = [1 + first + second, 2 - 2 * second, 1 - first + second]
    return lambda force: np.asarray(lfilter(numerator, denominator, force - force[0]))


def _rise(law: PressLaw, time: Floats, speed: Floats) -> Floats:
    """Return the measured rise [m]; at the start of the cruise it is the planned one."""
    rise = np.cumsum(speed) * (time[1] - time[0])
    return (
        rise
        + law.law.at(np.array(law.cruise_start)).position
        - np.interp(law.cruise_start, time, rise)
    )


def _events(law: PressLaw, time: Floats, speed: Floats, held: Floats) -> tuple[Floats, Floats]:
    """Return times [s] of contacts and releases as planned, and as measured, with a start before.

    The string is touched and released at the same rise in both.
    """
    measured = np.concatenate([[law.cruise_start], np.sort(held, axis=None)])
    if not law.steady:  # a gesture may pass a rise twice
        return measured, measured
    down = time[(time >= law.cruise_start) & (time <= law.bottom)]
    planned = np.interp(
        np.interp(measured, time, _rise(law, time, speed)), law.law.at(down).position, down
    )
    later = np.concatenate([[True], np.diff(np.maximum.accumulate(planned)) > LEAST_APART])
    later &= np.concatenate([[True], np.diff(measured) > LEAST_APART])
    return planned[later], measured[later]


def corrected(law: PressLaw, residuals: Sequence[Residual], period: float) -> Correction:
    """Return the next press's correction.

    Args:
        residuals: Of the presses so far.
        period: s, of the controller's samples.
    """
    from scipy.integrate import cumulative_trapezoid

    last = residuals[-1]
    inside = last.inside(law)
    steps = [np.stack([last.needed - r.needed, last.lacking - r.lacking]) for r in residuals[:-1]]
    rate = last.needed
    if steps:
        needed, lacking = np.stack(steps, -1)
        parts, _, _, _ = np.linalg.lstsq(lacking[inside], last.lacking[inside], rcond=None)
        rate = rate - needed @ parts
    knots = last.time[::KNOT]
    rise = cumulative_trapezoid(rate, dx=period, initial=0)[::KNOT]
    # The added rise is removed after the last release, or while the key rests at the bottom.
    end = law.bottom + 0.8 * max(law.return_start - law.bottom, KNOT * period)
    begin = min(last.until if last.plucked else law.bottom, law.bottom)
    back = np.clip((knots - begin) / (end - begin), 0.0, 1.0)
    rise = rise * (1 - back**3 * (10 - 15 * back + 6 * back**2))
    rise[0] = rise[-1] = 0.0
    return Correction(knots, rise)


@dataclass
class Learner:
    """Decide after every press whether and how to continue.

    The best correction so far is kept. Learning stops when the error no longer improves or grows.
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
    scatter: float | None = None
    """Dimensionless, RMS up to `CUTOFF` of what differs from press to press and no correction
    removes: noise, the reading of the encoders, the instrument; None after one press."""
    fast: float = 0.0
    """Dimensionless, RMS of the part above `CUTOFF` of the best press's deviation from the sent
    speed, which no correction removes: after the release of one of two strings, noise."""
    _residuals: list[Residual] = field(default_factory=list)

    def learn(
        self,
        used: Correction | None,
        time: Floats,
        sent: Floats,
        speed: Floats,
        held: Floats = NEVER,
        force: Floats | None = None,
    ) -> Correction | None:
        """Evaluate one press's measured speed; return the next correction, or None at the end.

        Args:
            used: The correction of this press; None for none.
            time: s from the start of motion, equidistant; shape (n,).
            sent: m/s, of the jack as sent to the controller; shape (n,).
            speed: m/s, of the jack as measured; shape (n,).
            held: As in `speed_error`.
            force: As in `residual`.
        """
        error = speed_error(self.law, time, speed, held)
        found = residual(self.law, time, sent, speed, self.period, held, force)
        # While corrections change much, so may what is needed: the least difference is taken.
        if self._residuals:
            inside = found.inside(self.law)
            change = found.needed[inside] - self._residuals[-1].needed[inside]
            planned = np.abs(self.law.law.at(found.time[inside]).velocity).max()
            least = float(np.sqrt(np.mean(change**2) / 2) / planned)
            self.scatter = least if self.scatter is None else min(least, self.scatter)
        self._residuals.append(found)
        least = min(self.errors, default=np.inf)
        self.errors.append(error)
        if error < least:
            self.best, deviation = used, speed - sent
            fast = deviation - _low_pass(deviation, CUTOFF, time)
            planned = self.law.law.at(time).velocity
            self.fast = speed_error(self.law, time, planned + fast, held)
        if error > 1.5 * least:
            self.stopped = (
                f"the error grew to {error * 100:.3g} % from {least * 100:.3g} %; the best"
                " correction is kept"
            )
            return None
        earlier = self.errors[:-PATIENCE]
        if earlier and not is_better(min(self.errors[-PATIENCE:]), earlier):
            self.stopped = f"no improvement over the last {PATIENCE} presses"
            return None
        return corrected(self.law, self._residuals, self.period)


def is_better(error: float, earlier: Sequence[float]) -> bool:
    """Return whether an error is less than all earlier ones by at least `IMPROVEMENT`."""
    return error <= (1 - IMPROVEMENT) * min(earlier)


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
