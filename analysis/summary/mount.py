"""Where the robot should be clamped, and where it is, as plain values and as lines."""

import math
from dataclasses import asdict
from typing import Any

from sautereau.rig.schema import Rig
from sautereau.trajectory.mount.find import Mount
from sautereau.trajectory.mount.locate import Located


def mount_summary(found: Mount) -> dict[str, Any]:
    """Return a mount as JSON would hold it; SI units."""
    return asdict(found)


def mount_lines(rig: Rig, found: Mount) -> list[str]:
    """Return a mount as text."""
    left = f"tilts by {math.degrees(found.tilt_max):.3g} deg"
    grows = f"{math.degrees(found.tilt_per_metre) * 1e-3:.3g} deg"
    if found.hold == "normal":
        left = f"slides by {found.slide_max * 1e3:.3g} mm"
        grows = f"{found.slide_per_metre:.3g} mm"
    away = math.hypot(rig.arm.base_x - found.base_x, rig.arm.base_z - found.base_z)
    lines = [
        f"rig {rig.name}: clamp the base at x = {found.base_x * 1e3:.2f} mm,"
        f" z = {found.base_z * 1e3:.2f} mm, elbow {found.elbow}"
        f" (the rig file's is {away * 1e3:.3g} mm away)",
        f"there the finger {left} at most; clamped 1 mm off, and planned so: {grows} more",
        "clamped elsewhere than planned, unnoticed:",
    ]
    for what, cost in (
        ("1 mm along x", found.unnoticed_x),
        ("1 mm along z", found.unnoticed_z),
        ("0.1 deg about joint 1", found.unnoticed_turn),
    ):
        lines.append(
            f"  {what + ':':22} jack {cost.height_error * 1e3:.3g} mm off, its speed"
            f" {cost.speed_error:.2%}; the finger tilts by"
            f" {math.degrees(cost.tilt_change):.3g} deg more or less"
        )
    return lines


def located_summary(found: Located) -> dict[str, Any]:
    """Return where touches have the base as JSON would hold it; SI units."""
    return {
        "base_x": found.base_x,
        "base_z": found.base_z,
        "offsets": list(found.offsets),
        "estimated": list(found.estimated),
        "std": found.std.tolist(),
        "covariance": found.covariance.tolist(),
        "residual": found.residual,
        "touch": found.touch,
        "condition": found.condition,
        "warnings": list(found.warnings),
    }


def located_lines(found: Located) -> list[str]:
    """Return where touches have the base as text."""
    lines = [
        "by its touches the base is here (standard uncertainties; the touches miss the key by"
        f" {found.residual * 1e3:.3g} mm rms):"
    ]
    values = (found.base_x, found.base_z, *found.offsets)
    for name, value, std in zip(found.estimated, values, found.std, strict=False):
        scale, unit = (1e3, "mm") if name.startswith("base") else (math.degrees(1), "deg")
        lines.append(f"  {name} = {value * scale:.4g} +- {std * scale:.2g} {unit}")
    return lines + [f"  warning: {warning}" for warning in found.warnings]
