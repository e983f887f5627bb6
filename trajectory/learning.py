"""Iterative learning: the next press's correction from the speed that this one had.

The jack slows down where the string is held, because the arm gives way. What a press lacked in
speed, low-passed without phase and integrated to a rise, is added to the plan of the next:

    c[k+1]' = Q (c[k]' + gain (planned speed - measured speed)).

The filter Q bounds what is learned to frequencies at which the arm follows its plan, so that
noise and what the arm cannot do are not learned press after press.
"""

from dataclasses import dataclass, field

import numpy as np

from sautereau.trajectory.correction import Correction
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import PressLaw

CUTOFF = 200.0
"""Hz, of Q."""
GAIN = 1.0
"""1, share of the error that is corrected at once."""
SEEN = 1000.0
"""Hz, up to which an error of speed is counted: above it is the vibrometer's noise."""
KNOT = 2
"""Controller samples between knots of a correction, as a PVT segment wants it."""
ENTRANCE = 4e-3
"""s, over which learning sets in when the run-up begins."""
IMPROVEMENT = 0.05
"""1, share by which an error must fall to count as better."""
PATIENCE = 2
"""Presses without improvement after which learning stops."""
GROWTH = 1.5
"""1, error over the best one at which learning stops at once."""


def speed_error(law: PressLaw, time: Floats, speed: Floats) -> float:
    """Return the rms error of the jack's speed over the cruise, of the speed planned there.

    Args:
        law: Of the press, without any correction.
        time: s from the start of motion, even; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).

    Raises:
        TrajectoryError: The times do not cover the cruise, or a speed is no number.
    """
    _check(law, time, speed)
    seen = _low_pass(speed, SEEN, time)
    cruise = (time >= law.cruise_start) & (time <= law.cruise_end)
    planned = law.law.at(time[cruise]).velocity
    error = seen[cruise] - planned
    return float(np.sqrt(np.mean(error**2)) / np.abs(planned).max())


def corrected(
    law: PressLaw,
    before: Correction | None,
    time: Floats,
    speed: Floats,
    period: float,
    *,
    gain: float = GAIN,
    cutoff: float = CUTOFF,
) -> Correction:
    """Return the next press's correction.

    Args:
        law: Of the press, without any correction.
        before: The correction with which it was pressed; None for none.
        time: s from the start of motion, even; shape (n,).
        speed: m/s, of the jack as measured; shape (n,).
        period: s, of the controller's samples.
        gain: 1, share of the error that is corrected at once.
        cutoff: Hz, above which nothing is learned.

    Raises:
        TrajectoryError: As `speed_error`.
    """
    _check(law, time, speed)
    planned = law.law.at(time).velocity
    lacking = gain * (planned - speed)
    if before is not None:
        own = before.onto(law).law.at(time).velocity - planned
        lacking = lacking + own
    lacking = lacking * np.clip((time - law.start) / ENTRANCE, 0.0, 1.0) * (time < law.bottom)
    rate = _low_pass(lacking, cutoff, time)
    step = np.diff(time, prepend=time[0])
    added = np.cumsum(rate * step)
    knots = np.arange(law.start, law.return_start, KNOT * period)
    rise = np.interp(knots, time, added) - np.interp(law.start, time, added)
    # Once the press is over, what was added is given back while the key rests at the bottom.
    rest = max(law.return_start - law.bottom, KNOT * period)
    back = np.clip((knots - law.bottom) / (0.8 * rest), 0.0, 1.0)
    rise = rise * (1 - back**3 * (10 - 15 * back + 6 * back**2))
    rise[0] = rise[-1] = 0.0
    return Correction(knots, rise)


@dataclass
class Learner:
    """Decide after every press whether and how to go on.

    The best correction so far is kept. A press that is no better than the best is not learned
    from: the best one is again, with half the gain. Learning stops by itself when nothing
    improves or the error grows.
    """

    law: PressLaw
    """Of the press, without any correction."""
    period: float
    """s, of the controller's samples."""
    errors: list[float] = field(default_factory=list)
    """1, of every press so far; see `speed_error`."""
    best: Correction | None = None
    """With which the error was least; None for the plan itself."""
    stopped: str = ""
    """Why learning has ended; empty while it goes on."""
    gain: float = GAIN
    """1, share of the error that is corrected at once."""
    _best: tuple[Floats, Floats] | None = None

    def learn(self, used: Correction | None, time: Floats, speed: Floats) -> Correction | None:
        """Take one press's measured speed; return the next correction, or None at the end.

        Args:
            used: The correction with which it was pressed; None for none.
            time: s from the start of motion, even; shape (n,).
            speed: m/s, of the jack as measured; shape (n,).
        """
        error = speed_error(self.law, time, speed)
        least = min(self.errors, default=np.inf)
        self.errors.append(error)
        if error < least:
            self.best, self._best = used, (time, speed)
        else:
            self.gain /= 2
        if error > GROWTH * least:
            self.stopped = (
                f"the error grew to {error * 100:.3g} % from {least * 100:.3g} %; the best"
                " correction is kept"
            )
            return None
        if len(self.errors) > PATIENCE:
            earlier = min(self.errors[:-PATIENCE])
            if min(self.errors[-PATIENCE:]) > (1 - IMPROVEMENT) * earlier:
                self.stopped = f"nothing has improved over the last {PATIENCE} presses"
                return None
        time, speed = self._best or (time, speed)
        return corrected(self.law, self.best, time, speed, self.period, gain=self.gain)


def _low_pass(values: Floats, cutoff: float, time: Floats) -> Floats:
    """Return values low-passed without phase; those of slow sampling as they are."""
    from scipy.signal import butter, sosfiltfilt

    rate = (len(time) - 1) / (time[-1] - time[0])
    if cutoff >= rate / 2:
        return values
    sos = butter(2, cutoff, fs=rate, output="sos")
    pad = min(len(values) - 1, int(3 * rate / cutoff))
    return sosfiltfilt(sos, values, padlen=pad)


def _check(law: PressLaw, time: Floats, speed: Floats) -> None:
    faults = []
    if time.ndim != 1 or time.shape != speed.shape or len(time) < 16:
        faults.append(
            f"times of shape {time.shape} and speeds of shape {speed.shape}; give 16 or more"
        )
    elif not (np.isfinite(time).all() and np.isfinite(speed).all()):
        faults.append("a time or a speed is not finite; leave this press out")
    elif time[0] > law.start + 1e-9 or time[-1] < law.cruise_end - 1e-9:
        faults.append(
            f"speeds from {time[0]:.6g} to {time[-1]:.6g} s do not cover the press from"
            f" {law.start:.6g} to {law.cruise_end:.6g} s; record for longer"
        )
    if faults:
        raise TrajectoryError("learning: " + "; ".join(faults))
