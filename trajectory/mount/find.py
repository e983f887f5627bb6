"""Choice of the place to clamp the robot, for the least residual of its hold.

Two joints cannot follow the key completely: with the hold `point` the finger tilts, with `normal`
it slides. If link 2 stays normal to the key, its elbow moves on a circle about the balance pin, so
with a base on the line through elbow and pin at mid-stroke the residual is second order in the
key's angle. The largest residual is not a smooth function of the base, so its minimum is searched
for on grids: one over the region for each elbow branch, then shrinking windows around the lowest
points.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.mount.bases import (
    ELBOWS,
    LIMITS,
    BaseAssessment,
    Misplacement,
    assess_bases,
    key_angles,
    residual_and_sensitivity,
    unnoticed,
)

COARSE = 9  # Number of key angles for a search of the complete region
GRID = 41  # Number of bases along each side of the region
DERIVATIVE_STEP = 1e-6  # m, step of the residual's numerical derivative


@dataclass(frozen=True)
class Mount:
    """A place to clamp the robot, and its sensitivity to misplacement."""

    base_x: float
    """m, of joint 1 from the balance pin."""
    base_z: float
    """m, of joint 1 above the balance pin."""
    elbow: str
    """`up` or `down`."""
    hold: str
    """`point` or `normal`."""
    tilt_max: float
    """rad, largest tilt of the finger against the key's normal."""
    slide_max: float
    """m, largest slide of the contact along the key."""
    tilt_per_metre: float
    """rad/m, derivative of `tilt_max` in the worst direction; the plan is for the moved base."""
    slide_per_metre: float
    """Derivative of `slide_max` in the worst direction; the plan is for the moved base."""
    unnoticed_x: Misplacement
    """Errors by 1 mm along x that the plan does not include."""
    unnoticed_z: Misplacement
    """Errors by 1 mm along z that the plan does not include."""
    unnoticed_turn: Misplacement
    """Errors by 0.1 deg about joint 1 that the plan does not include."""


class MountMap(NamedTuple):
    """The residual over the region in which the robot can be clamped."""

    x: Floats
    """m, shape (n,)."""
    z: Floats
    """m, shape (n,)."""
    residual: Floats
    """Largest tilt [rad] or slide [m], for each of `ELBOWS`; shape (2, n, n) over (z, x).
    Finite everywhere, but meaningful only where `feasible`."""
    feasible: np.ndarray
    """Whether every limit holds, bool, shape (2, n, n)."""

    def best(self) -> tuple[Floats, np.ndarray]:
        """Return the residual of the better elbow, and whether either is feasible; (n, n)."""
        least = np.where(self.feasible, self.residual, np.inf).min(0)
        feasible = np.logical_or(*self.feasible)
        return np.where(feasible, least, self.residual.min(0)), feasible


def find_mount(rig: Rig) -> Mount:
    """Find the base in `arm.mount_x` by `arm.mount_z`, and the elbow branch, of least residual.

    The largest tilt (hold `point`) or slide (hold `normal`) over the press is minimised among the
    bases that satisfy the limits of reach, singularity, joints, elbow clearance and static torque.
    The speeds and accelerations of the joints are checked by `plan_press`.

    Args:
        rig: The bench; its own base and elbow are ignored.

    Raises:
        TrajectoryError: No base in the region is feasible; the message names the limit that
            excludes most. Or no such press exists.
    """
    grid = _grid(*_axes(rig, GRID))
    angles = key_angles(rig, COARSE)
    coarse = [assess_bases(rig, elbow, grid, angles) for elbow in ELBOWS]
    found = [
        (*_refine(rig, elbow, grid[start]), elbow)
        for elbow, assessment in tracked([*zip(ELBOWS, coarse, strict=True)])
        for start in tracked(_lowest(assessment.cost))
    ]
    base, assessment, elbow = min(found, key=lambda each: each[1].cost[0])
    if assessment.violation[0] > 0:
        raise TrajectoryError(_infeasible_message(rig, coarse, base, elbow, assessment))
    place = {"arm.base_x": float(base[0]), "arm.base_z": float(base[1]), "arm.elbow": elbow}
    return assess_mount(rig.replaced(place))


def assess_mount(rig: Rig) -> Mount:
    """Return the residual at the rig's own base and elbow, and its sensitivity to misplacement.

    Raises:
        TrajectoryError: The arm does not reach the key from there, or no such press exists.
    """
    arm, hold = rig.arm, rig.press.hold
    found, none = residual_and_sensitivity(rig), (0.0, 0.0)
    tilt, slide = (found, none) if hold == "point" else (none, found)
    x, z, turn = unnoticed(rig)
    return Mount(
        base_x=arm.base_x,
        base_z=arm.base_z,
        elbow=arm.elbow,
        hold=hold,
        tilt_max=tilt[0],
        slide_max=slide[0],
        tilt_per_metre=tilt[1],
        slide_per_metre=slide[1],
        unnoticed_x=x,
        unnoticed_z=z,
        unnoticed_turn=turn,
    )


def mount_map(rig: Rig, n: int = 201) -> MountMap:
    """Return the residual of n by n bases over the region, for either elbow.

    Args:
        rig: The bench; its own base and elbow are ignored.
        n: Bases along each side of the region, at least 2.

    Raises:
        TrajectoryError: n is less than 2.
    """
    if n < 2:
        raise TrajectoryError(f"mount map: {n} bases along a side are too few; give 2 or more")
    x, z = _axes(rig, n)
    angles = key_angles(rig, COARSE)
    # Row by row, so that memory does not grow with n squared.
    rows = [
        [assess_bases(rig, elbow, _grid(x, z[i : i + 1]), angles) for i in tracked(range(n))]
        for elbow in tracked(ELBOWS)
    ]
    residual = np.array([[row.worst_residual for row in elbow] for elbow in rows])
    feasible = np.array([[row.violation <= 0 for row in elbow] for elbow in rows])
    return MountMap(x, z, residual, feasible)


def _refine(rig: Rig, elbow: str, base: Floats) -> tuple[Floats, BaseAssessment]:
    """Minimise the cost from a base on, in windows that halve around the best point.

    The residual is a cone elongated along a valley. Each window is elongated in the same way, by
    the singular values of the residual's derivative, and its width is limited by the residual.
    """
    angles = key_angles(rig, 65)
    low, high = np.array([rig.arm.mount_x, rig.arm.mount_z]).T
    steps = np.linspace(-1, 1, 9)
    window = _grid(steps, steps)
    edge = np.abs(window).max(-1) == 1
    here = assess_bases(rig, elbow, base[None], angles)
    size = 2.0
    for _ in range(120):
        if here.violation[0] > 0:
            spread = np.diag(high - low) / GRID
        else:
            shifted = base + DERIVATIVE_STEP * np.eye(2)
            slope = assess_bases(rig, elbow, shifted, angles).residual - here.residual
            _, values, turned = np.linalg.svd(slope.T / DERIVATIVE_STEP, full_matrices=False)
            reach = here.worst_residual[0] * np.sqrt(len(angles)) / np.maximum(values, 1e-12)
            spread = np.minimum(reach, np.hypot(*(high - low)))[:, None] * turned
        if size * np.abs(spread).max() < 1e-8:  # m
            break
        bases = np.clip(base + size * window @ spread, low, high)
        candidates = assess_bases(rig, elbow, bases, angles)
        best = int(candidates.cost.argmin())
        newly_feasible = here.violation[0] > 0 >= candidates.violation[best]
        if candidates.cost[best] < here.cost[0]:
            base = bases[best]
            here = BaseAssessment(candidates.residual[[best]], candidates.margins[:, [best]])
            size = 2.0 if newly_feasible else size * (1.0 if edge[best] else 0.5)
        else:
            size *= 0.5
    return base, here


def _lowest(cost: Floats) -> list[int]:
    """Return the lowest local minima of the square grid, best first."""
    square = np.pad(cost.reshape(GRID, GRID), 1, constant_values=np.inf)
    shifts = [(i, j) for i in (0, 1, 2) for j in (0, 1, 2)]
    around = np.min([square[i : i + GRID, j : j + GRID] for i, j in shifts], axis=0)
    lowest = np.flatnonzero(cost <= around.ravel())
    return [int(i) for i in lowest[np.argsort(cost[lowest])][:3]]


def _infeasible_message(
    rig: Rig, coarse: list[BaseAssessment], base: Floats, elbow: str, nearest: BaseAssessment
) -> str:
    """Return a message with the limit that excludes most, and that of the least infeasible base."""
    arm = rig.arm
    excluded = np.mean([assessment.margins < 0 for assessment in coarse], axis=(0, 2))
    names = list(LIMITS)
    most, last = int(excluded.argmax()), int(nearest.margins[:, 0].argmin())
    x, z = (np.array(side) * 1e3 for side in (arm.mount_x, arm.mount_z))
    text = (
        f"mount: no base in arm.mount_x ({x[0]:.4g} to {x[1]:.4g} mm) and arm.mount_z"
        f" ({z[0]:.4g} to {z[1]:.4g} mm) is feasible; {names[most]} excludes"
        f" most, {100 * excluded[most]:.0f} % of the bases: {LIMITS[names[most]]}"
    )
    if last != most:
        text += (
            f"; the base closest to feasible (x = {base[0] * 1e3:.4g}, z = {base[1] * 1e3:.4g} mm,"
            f" elbow {elbow}) violates {names[last]}: {LIMITS[names[last]]}"
        )
    return text


def _axes(rig: Rig, n: int) -> tuple[Floats, Floats]:
    return np.linspace(*rig.arm.mount_x, n), np.linspace(*rig.arm.mount_z, n)


def _grid(x: Floats, z: Floats) -> Floats:
    """Return every pair (x, z), x running fastest; shape (n, 2)."""
    return np.stack(np.meshgrid(x, z), -1).reshape(-1, 2)
