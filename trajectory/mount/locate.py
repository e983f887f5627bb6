"""Calibration of the robot's base from poses in which the fingertip touches known points.

The key is at rest, so its surface normal n is vertical, and a fingertip in contact with the
surface at a point P has its centre at P + r n. With the base B, u(t) = (cos t, sin t), the joints'
readings q1 and q2 and their offsets o1 and o2, each pose gives

    B + l1 u(q1 + o1) + l2 u(q1 + o1 + q2 + o2) = P + r n.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import link_vectors
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats

TOUCH = 0.1e-3
"""m, standard uncertainty of a touch in each direction, for a fingertip jogged by eye."""
UNKNOWNS = ("base_x", "base_z", "joint 1 offset", "joint 2 offset")
"""Names of the unknowns, in the order of `Located.std` and `Located.covariance`."""
CONDITION_LIMIT = 1e3
"""Dimensionless, condition number above which the poses do not determine an offset."""
LEAST_SPAN = 10.0  # Least span of the touched points, relative to the uncertainty of a touch
MOST_STEPS = 100  # Most Gauss-Newton steps


@dataclass(frozen=True)
class Located:
    """A base estimated from touches."""

    base_x: float
    """m, of joint 1 from the balance pin."""
    base_z: float
    """m, of joint 1 above the balance pin."""
    offsets: tuple[float, float]
    """rad, to add to the readings of joints 1 and 2; 0 if not estimated."""
    estimated: tuple[str, ...]
    """The k estimated `UNKNOWNS`."""
    std: Floats
    """Standard uncertainty of each of `estimated` [m, m, rad, rad]; shape (k,)."""
    covariance: Floats
    """Covariance of `estimated`; shape (k, k)."""
    residual: float
    """m, root mean square of the residual distances."""
    touch: float
    """m, standard uncertainty of a touch used for `std`: the larger of the stated and the observed
    one."""
    condition: float
    """Dimensionless, condition number of the equations, with offsets as lengths at full reach."""
    warnings: tuple[str, ...]


def locate_base(
    rig: Rig, joints: Floats, points: Floats, touch: float = TOUCH, offsets: int | None = None
) -> Located:
    """Estimate the position of the base and the offsets of the joints' zeros.

    Two touches determine the base and the zero of joint 1; three, that of joint 2 as well. An
    offset that the touches do not determine is set to 0, with a warning, unless requested.

    Args:
        rig: The bench; its own base is ignored.
        joints: rad, readings of both joints in each pose, shape (m, 2).
        points: m, touched points along the key from the pin, negative in front, shape (m,).
        touch: m, standard uncertainty of a touch in each direction.
        offsets: Number of joints whose zeros are estimated, from joint 1 on: 0, 1 or 2; None
            for as many as the touches determine.

    Raises:
        TrajectoryError: The touches are too few, too close together, not finite or not on the
            key, or they do not determine the requested offsets.
    """
    joints, points = np.asarray(joints, dtype=float), np.asarray(points, dtype=float)
    _check(rig, joints, points, touch, offsets)
    solution, residuals, scaled, lengths, warnings = _solve_determined(rig, joints, points, offsets)
    condition = float(np.linalg.cond(scaled))
    if condition > 50.0:
        warnings.append(
            f"the touches hardly determine the zero of joint {len(solution) - 2} (condition"
            f" number {condition:.2g}), which increases the uncertainty of the base: touch points"
            " further apart, or estimate fewer offsets if the homing is reliable"
        )
    freedom = residuals.size - len(solution)
    observed = float(np.sqrt((residuals**2).sum() / freedom)) if freedom else 0.0
    if observed > 3 * touch:
        warnings.append(
            f"the touches disagree by {observed * 1e3:.3g} mm, more than the stated"
            f" {touch * 1e3:.3g} mm: check the points, the readings, and that the key is at rest"
        )
    used = max(touch, observed)
    covariance = used**2 * np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths)
    found = np.zeros(4)
    found[: len(solution)] = solution
    return Located(
        base_x=float(found[0]),
        base_z=float(found[1]),
        offsets=(float(found[2]), float(found[3])),
        estimated=UNKNOWNS[: len(solution)],
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        residual=float(np.sqrt((residuals**2).sum() / len(points))),
        touch=used,
        condition=condition,
        warnings=tuple(warnings),
    )


def _solve_determined(
    rig: Rig, joints: Floats, points: Floats, offsets: int | None
) -> tuple[Floats, Floats, Floats, Floats, list[str]]:
    """Solve for as many offsets as the touches determine; warn of the others.

    Returns:
        The unknowns, the residuals and the Jacobian of `_solve`, divided by the displacement per
        unit of each unknown at the arm's full reach (1, or m); that displacement; and warnings.
    """
    warnings: list[str] = []
    reach = rig.arm.upper_length + rig.arm.lower_length
    zeros = min(2, len(points) - 1) if offsets is None else offsets
    while True:
        lengths = np.array([1.0, 1.0, *[reach] * zeros])
        solution, residuals, jacobian = _solve(rig, joints, points, lengths)
        scaled = jacobian / lengths
        condition = float(np.linalg.cond(scaled))
        if condition < CONDITION_LIMIT or zeros == 0:
            return solution, residuals, scaled, lengths, warnings
        fault = (
            f"the touches do not determine the zero of joint {zeros} (condition number"
            f" {condition:.2g}, at most {CONDITION_LIMIT:.2g}): touch points further apart,"
            " or with other bends of the elbow"
        )
        if offsets is not None:
            raise TrajectoryError(f"locate: {fault}, or estimate fewer offsets")
        warnings.append(f"{fault}; it is assumed exact")
        zeros -= 1


def _solve(
    rig: Rig, joints: Floats, points: Floats, lengths: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return the k unknowns by Gauss-Newton, the residuals and the Jacobian (2 m, k)."""
    arm, key = rig.arm, rig.key
    height = key.surface_height + arm.fingertip_radius
    centre = np.stack([points, np.full_like(points, height)], -1)
    unknown = np.zeros_like(lengths)
    zeros = len(lengths) - 2
    for step in range(MOST_STEPS):
        added = np.zeros(2)
        added[:zeros] = unknown[2:]
        turned = joints + added
        upper, upper_turned = link_vectors(arm.upper_length, turned[:, 0])
        lower, lower_turned = link_vectors(arm.lower_length, turned.sum(-1))
        if step == 0:
            unknown[:2] = (centre - upper - lower).mean(0)
        residuals = unknown[:2] + upper + lower - centre
        columns = [upper_turned + lower_turned, lower_turned][:zeros]
        base = np.broadcast_to(np.eye(2), (len(points), 2, 2))
        jacobian = np.concatenate([base, *(c[..., None] for c in columns)], -1)
        jacobian = jacobian.reshape(-1, 2 + zeros)
        change = np.linalg.lstsq(jacobian / lengths, -residuals.ravel(), rcond=1e-12)[0]
        if np.abs(change).max() < 1e-13:
            return unknown, residuals, jacobian
        # A joint's step of more than a radian would leave the range of the linear model.
        change *= min(1.0, lengths[-1] / max(np.abs(change[2:]).max(initial=0.0), 1e-300))
        unknown = unknown + change / lengths
    raise TrajectoryError(
        f"locate: the estimate does not converge in {MOST_STEPS} steps: the touches contradict the"
        " arm; check the points, the order of the joints and their units"
    )


def _check(rig: Rig, joints: Floats, points: Floats, touch: float, offsets: int | None) -> None:
    """Refuse insufficient touches; the message lists all faults."""
    if points.ndim != 1 or joints.shape != (len(points), 2):
        raise TrajectoryError(
            f"locate: joints of shape {joints.shape} and points of shape {points.shape} do not fit;"
            " give (m, 2) and (m,)"
        )
    faults = []
    least = 2 if offsets in (None, 0) else offsets + 1
    if offsets not in (None, 0, 1, 2):
        faults.append(f"{offsets} offsets are requested; give 0, 1 or 2")
    if not (np.isfinite(touch) and touch > 0):
        faults.append(f"a touching uncertainty of {touch} m; give more than 0, such as 0.1 mm")
    if not (np.isfinite(joints).all() and np.isfinite(points).all()):
        faults.append("a reading or a point is not finite; remove that touch")
    if len(points) < least:
        faults.append(f"{len(points)} touches, and {least} are needed; touch more points")
    off = (points >= 0) | (points < -rig.key.front_arm)
    if off.any():
        faults.append(
            f"{points[off][0] * 1e3:.4g} mm from the pin is not on the key's front, from"
            f" {-rig.key.front_arm * 1e3:.4g} to 0 mm: points in front of the pin are negative"
        )
    if not faults and np.ptp(points) < LEAST_SPAN * touch:
        faults.append(
            f"the touched points span {np.ptp(points) * 1e3:.3g} mm, less than {LEAST_SPAN:g} times"
            f" the touching uncertainty of {touch * 1e3:.3g} mm; touch points further apart"
        )
    if faults:
        raise TrajectoryError("locate: " + "\n  ".join(faults))
