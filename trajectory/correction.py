"""A correction of the jack's planned rise, added to the law of a press."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.jerk import JerkLaw, spline_law
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import PressLaw


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
        faults = []
        if self.time.ndim != 1 or self.time.shape != self.rise.shape or len(self.time) < 3:
            faults.append(
                f"times of shape {self.time.shape} and rises of shape {self.rise.shape}; give"
                " 3 or more of each"
            )
        elif not (np.isfinite(self.time).all() and np.isfinite(self.rise).all()):
            faults.append("a time or a rise is not finite; learn again")
        elif (np.diff(self.time) <= 0).any():
            faults.append("its times do not increase; sort them")
        elif self.rise[0] != 0 or self.rise[-1] != 0:
            faults.append(
                f"it adds {self.rise[0] * 1e3:.4g} and {self.rise[-1] * 1e3:.4g} mm at its ends,"
                " where it must be zero; learn again"
            )
        if faults:
            raise TrajectoryError("correction: " + "; ".join(faults))

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
    jerks = law.jerks[_phase(law, middles)].astype(float)
    inside = (middles > added.times[0]) & (middles < added.times[-1])
    jerks[inside] += added.jerks[_phase(added, middles[inside])]
    within = (times >= added.times[0]) & (times < added.times[-1])
    states[within] += np.stack(added.at(times[within]), -1)
    return JerkLaw(times, states, jerks)


def _phase(law: JerkLaw, time: Floats) -> NDArray[np.intp]:
    index = np.searchsorted(law.times, time, side="right") - 1
    return np.clip(index, 0, len(law.jerks) - 1)
