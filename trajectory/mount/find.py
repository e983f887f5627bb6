"""Where to clamp the robot, so that its hold leaves the least over.

With two joints a fingertip follows the key in one respect and departs in another: held on
its `point`, the finger tilts; held `normal`, it slides. If link 2 stays normal to the key
its elbow circles the balance pin, so with a base on the line through elbow and pin at
mid-stroke the departure is second order in the key's angle. The least of the largest
departures is not smooth in the base, so it is searched for on grids: one over the region
for either elbow, then windows that zoom in on its lowest places.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.mount.bases import ELBOWS, LIMITS, Stance, key_angles, stances
from sautereau.trajectory.mount.misplacement import Misplacement, residual_and_growth, unnoticed

FINGER_FORCE = 1.5
"""N, expected of the finger on the key: about three times what a pluck at 0.07 m/s takes."""
COARSE, FINE = 9, 65
"""Key angles at which the region, and the neighbourhood of a good base, are judged."""
GRID, WINDOW = 41, 9
"""Bases along each side of the region, and of a zoomed window."""
STARTS = 3
"""Places of the coarse grid, for each elbow, from which the search zooms."""
ACCURACY = 1e-8
"""m, half-width of the window at which zooming ends."""
LONGEST = 120
"""Windows in one zoom at most."""
NUDGE = 1e-6
"""m, step of the residual's derivative."""


@dataclass(frozen=True)
class Mount:
    """A place to clamp the robot, and what misplacing it costs."""

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
    """rad/m, growth of `tilt_max` in the worst direction where the plan knows the place."""
    slide_per_metre: float
    """1, growth of `slide_max` in the worst direction where the plan knows the place."""
    unnoticed_x: Misplacement
    """What 1 mm along x costs where the plan does not know it."""
    unnoticed_z: Misplacement
    """What 1 mm along z costs where the plan does not know it."""
    unnoticed_turn: Misplacement
    """What 0.1 deg about joint 1 costs where the plan does not know it."""


class MountMap(NamedTuple):
    """The residual over the region in which the robot can be clamped."""

    x: Floats
    """m, shape (n,)."""
    z: Floats
    """m, shape (n,)."""
    residual: Floats
    """Largest tilt [rad] or slide [m], for each of `elbows`; shape (2, n, n) over (z, x).
    Finite everywhere, and without meaning where not `feasible`."""
    feasible: np.ndarray
    """Whether every limit holds, bool, shape (2, n, n)."""
    elbows: tuple[str, str] = ELBOWS

    def best(self) -> tuple[Floats, np.ndarray]:
        """Return the residual of the better elbow and whether either is feasible; (n, n)."""
        least = np.where(self.feasible, self.residual, np.inf).min(0)
        feasible = np.logical_or(*self.feasible)
        return np.where(feasible, least, self.residual.min(0)), feasible


def find_mount(rig: Rig, finger_force: float = FINGER_FORCE) -> Mount:
    """Find the base in `arm.mount_x` by `arm.mount_z`, and the elbow, of least residual.

    The largest tilt (hold `point`) or slide (hold `normal`) over the press is made smallest
    among the bases that keep the reach, the margin from singularity, the joints' limits, the
    elbow above the neighbouring keys and the torques at rest within their limit. The speeds
    and accelerations of the joints are for `plan_press` to check.

    Args:
        rig: The bench; its own base and elbow are not looked at.
        finger_force: N, expected along the key's normal.

    Raises:
        TrajectoryError: No base in the region will do; says which limit excludes most. Or
            there is no such press.
    """
    _check_force(finger_force)
    grid = _grid(*_axes(rig, GRID))
    angles = key_angles(rig, COARSE)
    coarse = [stances(rig, elbow, grid, angles, finger_force) for elbow in ELBOWS]
    found = [
        (*_zoom(rig, elbow, grid[start], finger_force), elbow)
        for elbow, stance in zip(ELBOWS, coarse, strict=True)
        for start in _lowest(stance.merit)
    ]
    base, stance, elbow = min(found, key=lambda each: each[1].merit[0])
    if stance.miss[0] > 0:
        raise TrajectoryError(_nowhere(rig, coarse, base, elbow, stance))
    place = {"base_x": float(base[0]), "base_z": float(base[1]), "elbow": elbow}
    return assess_mount(rig.model_copy(update={"arm": rig.arm.model_copy(update=place)}))


def assess_mount(rig: Rig) -> Mount:
    """Return the residual at the rig's own base and elbow, and what misplacing it costs.

    Raises:
        TrajectoryError: The arm does not reach the key from there, or there is no press.
    """
    arm, hold = rig.arm, rig.press.hold
    residual, growth = residual_and_growth(rig)
    leans = hold == "point"
    x, z, turn = unnoticed(rig)
    return Mount(
        base_x=arm.base_x,
        base_z=arm.base_z,
        elbow=arm.elbow,
        hold=hold,
        tilt_max=residual if leans else 0.0,
        slide_max=0.0 if leans else residual,
        tilt_per_metre=growth if leans else 0.0,
        slide_per_metre=0.0 if leans else growth,
        unnoticed_x=x,
        unnoticed_z=z,
        unnoticed_turn=turn,
    )


def mount_map(rig: Rig, n: int = 201, finger_force: float = FINGER_FORCE) -> MountMap:
    """Return the residual of n by n bases over the region, for either elbow.

    Args:
        rig: The bench; its own base and elbow are not looked at.
        n: Bases along each side of the region, at least 2.
        finger_force: N, expected along the key's normal.

    Raises:
        TrajectoryError: n is less than 2, or the force is not finite.
    """
    _check_force(finger_force)
    if n < 2:
        raise TrajectoryError(f"mount map: {n} bases along a side are too few; give 2 or more")
    x, z = _axes(rig, n)
    angles = key_angles(rig, COARSE)
    # Row by row, so that memory does not grow with n squared.
    rows = [
        [stances(rig, elbow, _grid(x, z[i : i + 1]), angles, finger_force) for i in range(n)]
        for elbow in ELBOWS
    ]
    residual = np.array([[row.worst for row in elbow] for elbow in rows])
    feasible = np.array([[row.miss <= 0 for row in elbow] for elbow in rows])
    return MountMap(x, z, residual, feasible)


def _zoom(rig: Rig, elbow: str, base: Floats, finger_force: float) -> tuple[Floats, Stance]:
    """Follow the merit [1] down from a base, in windows that halve around the best place.

    The residual is a cone, drawn out along a valley: each window is drawn out likewise, by
    the singular values of the residual's derivative, and as wide as the residual lets it be.
    """
    angles = key_angles(rig, FINE)
    low, high = np.array([rig.arm.mount_x, rig.arm.mount_z]).T
    steps = np.linspace(-1, 1, WINDOW)
    window = _grid(steps, steps)
    edge = np.abs(window).max(-1) == 1
    here = stances(rig, elbow, base[None], angles, finger_force)
    size = 2.0
    for _ in range(LONGEST):
        if here.miss[0] > 0:
            spread = np.diag(high - low) / GRID
        else:
            nudged = base + NUDGE * np.eye(2)
            slope = stances(rig, elbow, nudged, angles).residual - here.residual
            _, values, turned = np.linalg.svd(slope.T / NUDGE, full_matrices=False)
            reach = here.worst[0] * np.sqrt(len(angles)) / np.maximum(values, 1e-12)
            spread = np.minimum(reach, np.hypot(*(high - low)))[:, None] * turned
        if size * np.abs(spread).max() < ACCURACY:
            break
        bases = np.clip(base + size * window @ spread, low, high)
        tried = stances(rig, elbow, bases, angles, finger_force)
        best = int(tried.merit.argmin())
        met = here.miss[0] > 0 >= tried.miss[best]
        if tried.merit[best] < here.merit[0]:
            base, here = bases[best], tried.only(best)
            size = 2.0 if met else size * (1.0 if edge[best] else 0.5)
        else:
            size *= 0.5
    return base, here


def _lowest(merit: Floats) -> list[int]:
    """Return the lowest of the square grid's local minima, best first."""
    square = np.pad(merit.reshape(GRID, GRID), 1, constant_values=np.inf)
    shifts = [(i, j) for i in (0, 1, 2) for j in (0, 1, 2)]
    around = np.min([square[i : i + GRID, j : j + GRID] for i, j in shifts], axis=0)
    lowest = np.flatnonzero(merit <= around.ravel())
    return [int(i) for i in lowest[np.argsort(merit[lowest])][:STARTS]]


def _nowhere(rig: Rig, coarse: list[Stance], base: Floats, elbow: str, nearest: Stance) -> str:
    """Say which limit excludes most of the region, and what the nearest miss lacks."""
    arm = rig.arm
    excluded = np.mean([stance.margins < 0 for stance in coarse], axis=(0, 2))
    names = list(LIMITS)
    most, last = int(excluded.argmax()), int(nearest.margins[:, 0].argmin())
    x, z = (np.array(side) * 1e3 for side in (arm.mount_x, arm.mount_z))
    text = (
        f"mount: nowhere in arm.mount_x ({x[0]:.4g} to {x[1]:.4g} mm) and arm.mount_z"
        f" ({z[0]:.4g} to {z[1]:.4g} mm) can the robot press this key; {names[most]} excludes"
        f" most, {excluded[most]:.0%} of the places: {LIMITS[names[most]]}"
    )
    if last != most:
        text += (
            f"; the place that comes nearest (x = {base[0] * 1e3:.4g}, z = {base[1] * 1e3:.4g} mm,"
            f" elbow {elbow}) fails by {names[last]}: {LIMITS[names[last]]}"
        )
    return text


def _axes(rig: Rig, n: int) -> tuple[Floats, Floats]:
    return np.linspace(*rig.arm.mount_x, n), np.linspace(*rig.arm.mount_z, n)


def _grid(x: Floats, z: Floats) -> Floats:
    """Return every pair (x, z), x running fastest; shape (n, 2)."""
    return np.stack(np.meshgrid(x, z), -1).reshape(-1, 2)


def _check_force(force: float) -> None:
    if not np.isfinite(force):
        raise TrajectoryError(f"finger_force: {force} N is not finite; give one, such as 1.5 N")
