"""Stiffness and damping of the position loops, from what the controller recorded in presses."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sautereau.daq.file.recorded import Recorded


@dataclass(frozen=True)
class PositionLoops:
    """Position loops of the two joints, as `arm.servo_stiffness` and `arm.servo_damping`."""

    stiffness: tuple[float, float]
    """N m/rad."""
    damping: tuple[float, float]
    """N m s/rad."""

    def __str__(self) -> str:
        (first, second), (slow, slower) = self.stiffness, self.damping
        return (
            f"arm.servo_stiffness about {first:.3g} and {second:.3g} N m/rad,"
            f" arm.servo_damping about {slow:.2g} and {slower:.2g} N m s/rad"
        )


def position_loops(presses: Iterable[Recorded]) -> PositionLoops | None:
    """Return the loops that presses show, by the mean over these; None where they show none.

    The torque is regressed on following error, its rate and integral, the sent acceleration (feed
    forward of inertia) and a constant. Each sample of a Galil's capture is 1 to 4 ms long: this
    gives the stand-in's stiffness within 20 %, and its damping within 25 %.
    """
    found = [fit for press in presses if (fit := _fit(press)) is not None]
    if not found:
        return None
    (k1, k2), (c1, c2) = np.mean(found, axis=0).T.tolist()
    return PositionLoops((k1, k2), (c1, c2))


def _fit(press: Recorded) -> list[tuple[float, float]] | None:
    """Return stiffness and damping of both joints."""
    joints = press.joints
    if joints is None or min(map(len, (joints.e1, joints.e2, joints.m1, joints.m2))) < 16:
        return None
    time, found = joints.t, []
    for q, e, torque in (joints.q1, joints.e1, joints.m1), (joints.q2, joints.e2, joints.m2):
        period = np.diff(time).mean()
        rate = np.diff(e, prepend=e[0]) / period
        acceleration = np.gradient(np.gradient(q + e, time), time)
        ones = np.ones_like(e)
        columns = np.stack([e, rate, np.cumsum(e) * period, acceleration, ones], 1)
        scale = np.abs(columns).max(axis=0)
        scale[scale == 0] = 1.0
        values, _, _, _ = np.linalg.lstsq(columns / scale, torque, rcond=None)
        left = np.std(torque - columns / scale @ values)
        stiffness, damping = (values / scale)[:2].tolist()
        # Feed-forward leaves a larger residual of the torque.
        if left >= 0.5 * np.std(torque) or not (stiffness > 0 and damping > 0):
            return None
        found.append((stiffness, damping))
    return found
