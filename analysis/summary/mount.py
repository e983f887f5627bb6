"""The robot's mounting as JSON and as text: where to clamp it, and where it is clamped."""

import math
from dataclasses import asdict
from typing import Any

from sautereau.rig.schema import Rig
from sautereau.trajectory.mount.find import Mount
from sautereau.trajectory.mount.locate import Located


def mount_summary(found: Mount) -> dict[str, Any]:
    """Return a mount as JSON; SI units."""
    return asdict(found)


def mount_lines(rig: Rig, found: Mount) -> list[str]:
    """Return a mount as text."""
    error, increase = (
        f"tilt {math.degrees(found.tilt_max):.3g} deg",
        f"{math.degrees(found.tilt_per_metre) * 1e-3:.3g} deg",
    )
    if found.hold == "normal":
        error = f"slide {found.slide_max * 1e3:.3g} mm"
        increase = f"{found.slide_per_metre:.3g} mm"
    distance = math.hypot(rig.arm.base_x - found.base_x, rig.arm.base_z - found.base_z)
    lines = [
        f"rig {rig.name}: clamp the base at x = {found.base_x * 1e3:.2f} mm,"
        f" z = {found.base_z * 1e3:.2f} mm, elbow {found.elbow}"
        f" ({distance * 1e3:.3g} mm from the base in the rig file)",
        f"finger at this base: {error} at most, {increase} more for each mm of distance from it"
        " that the rig file states",
        "errors for a base that differs from the rig file's:",
    ]
    for what, cost in (
        ("1 mm along x", found.unnoticed_x),
        ("1 mm along z", found.unnoticed_z),
        ("0.1 deg about joint 1", found.unnoticed_turn),
    ):
        lines.append(
            f"  {what + ':':22} jack height {cost.height_error * 1e3:.3g} mm, jack speed"
            f" {cost.speed_error:.2%}, tilt {math.degrees(cost.tilt_change):.3g} deg"
        )
    return lines


def located_summary(found: Located) -> dict[str, Any]:
    """Return the base that touches give as JSON; SI units."""
    return asdict(found) | {"std": found.std.tolist(), "covariance": found.covariance.tolist()}


def located_lines(found: Located) -> list[str]:
    """Return the base that touches give as text."""
    lines = [
        "base from the touches, with standard uncertainties"
        f" (RMS residual {found.residual * 1e3:.3g} mm):"
    ]
    values = (found.base_x, found.base_z, *found.offsets)
    for name, value, std in zip(found.estimated, values, found.std, strict=False):
        scale, unit = (1e3, "mm") if name.startswith("base") else (math.degrees(1), "deg")
        lines.append(f"  {name} = {value * scale:.4g} +- {std * scale:.2g} {unit}")
    return lines + [f"  warning: {warning}" for warning in found.warnings]
