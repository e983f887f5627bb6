"""What is added to the jack's planned rise, and how it changes the law of a press."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.jerk import JerkLaw
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import PressLaw


@dataclass(frozen=True)
class Correction:
    """A smooth addition to the rise, nothing at its ends; cubic between its knots.

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
            faults.append("a time or a rise is not finite; learn anew")
        elif (np.diff(self.time) <= 0).any():
            faults.append("its times do not increase; sort them")
        elif self.rise[0] != 0 or self.rise[-1] != 0:
            faults.append(
                f"it adds {self.rise[0] * 1e3:.4g} and {self.rise[-1] * 1e3:.4g} mm at its ends,"
                " where it must add nothing; learn anew"
            )
        if faults:
            raise TrajectoryError("correction: " + "; ".join(faults))

    def onto(self, law: PressLaw) -> PressLaw:
        """Return a press's law with the correction added; its parts begin as before.

        Raises:
            TrajectoryError: It reaches beyond the press, from the run-up to the return.
        """
        if self.time[0] < law.start - 1e-9 or self.time[-1] > law.return_start + 1e-9:
            raise TrajectoryError(
                f"correction: it acts from {self.time[0]:.6g} to {self.time[-1]:.6g} s, and the"
                f" press goes from {law.start:.6g} to {law.return_start:.6g} s; it was learned for"
                " another press: learn anew"
            )
        return replace(law, law=_sum(law.law, self._law()))

    def _law(self) -> JerkLaw:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(self.time, self.rise, bc_type="clamped")
        states = np.stack([spline(self.time, order) for order in range(3)], -1)
        return JerkLaw(self.time, states, 6 * spline.c[0])


def _sum(law: JerkLaw, added: JerkLaw) -> JerkLaw:
    """Return the sum of two laws, the second zero outside its times: a piecewise cubic too."""
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
