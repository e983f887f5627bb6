"""A plan, and where the robot is to be clamped and is clamped, as JSON and as text."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from sautereau.analysis.summary.text import counted, table
from sautereau.rig.quantities import DISPLAYED
from sautereau.rig.schema import Rig
from sautereau.trajectory.checks import Check
from sautereau.trajectory.mount.find import Mount
from sautereau.trajectory.mount.locate import Located
from sautereau.trajectory.press import Trajectory

TIGHTEST = 5  # Checks in the text unless all are requested


def plan_summary(draft: Trajectory, warnings: Sequence[str]) -> dict[str, Any]:
    """Return a plan as JSON; SI units."""
    return {
        "cruise_speed": draft.cruise.speed,
        "cruise_error_max": draft.cruise.error,
        "cruise_time": [draft.cruise.start, draft.cruise.end],
        "cruise_rise": list(draft.cruise.rise),
        "tilt_max": float(abs(draft.tilt).max()),
        "slide_max": float(abs(draft.slide).max()),
        "duration": float(draft.time[-1]),
        "segments": len(draft.segments),
        "feasible": all(check.holds for check in draft.checks),
        "warnings": list(warnings),
        "checks": [asdict(c) | {"margin": c.margin, "holds": c.holds} for c in draft.checks],
    }


def plan_lines(
    rig: Rig, draft: Trajectory, warnings: Sequence[str], all_checks: bool = False
) -> list[str]:
    """Return a plan as text.

    Args:
        warnings: Warnings about the plan and about the prediction that it uses.
        all_checks: List every check instead of the tightest and the failed ones.
    """
    cruise = draft.cruise
    tilt, slide = math.degrees(abs(draft.tilt).max()), abs(draft.slide).max() * 1e3
    return [
        f"rig {rig.name}: {draft.time[-1] * 1e3:.4g} ms in"
        f" {counted(len(draft.segments), 'segment')}",
        f"{'cruise' if draft.law.steady else 'gesture'}: jack speed {cruise.speed:.6g} m/s, error"
        f" at most {cruise.error * 100:.2g} %, from {cruise.start * 1e3:.4g} to"
        f" {cruise.end * 1e3:.4g} ms after the start of motion,"
        f" jack rise {cruise.rise[0] * 1e3:.4g} to {cruise.rise[1] * 1e3:.4g} mm",
        f"finger: tilt at most {tilt:.3g} deg, slide at most {slide:.3g} mm",
        *_check_lines(draft.checks, all_checks),
        *(f"warning: {warning}" for warning in warnings),
    ]


def _check_lines(checks: Sequence[Check], all_checks: bool) -> list[str]:
    """Return the checks as a table, the tightest first."""
    ordered = sorted(checks, key=_relative_margin)
    failed = sum(not check.holds for check in checks)
    shown = ordered if all_checks else ordered[: max(TIGHTEST, failed)]
    lines = table([("check", "value", "limit", "margin", ""), *map(check_cells, shown)])
    if len(shown) < len(ordered):
        lines.append(
            f"{len(ordered) - len(shown)} more checks hold by larger margins; -v lists them"
        )
    return lines


def _relative_margin(check: Check) -> float:
    """Return the margin [1] over the limit; infinite where a limit of 0 is kept."""
    if math.isnan(check.margin):
        return -math.inf
    if check.limit == 0:
        return math.copysign(math.inf, check.margin) if check.margin else 0.0
    return check.margin / abs(check.limit)


def check_cells(check: Check) -> tuple[str, ...]:
    """Return name, value in the unit of its limit, limit, margin, and whether the check fails."""
    plain = "" if check.unit == "1" else check.unit.replace("*", " ")
    scale, unit = DISPLAYED.get(check.unit, (1.0, plain))

    relative = _relative_margin(check)
    margin = f"{100 * relative:.1f} %" if math.isfinite(relative) else "-"
    limit = f"{'>=' if check.at_least else '<='} {check.limit * scale:.4g} {unit}".rstrip()
    verdict = "" if check.holds else "FAILS"
    return check.name, f"{check.value * scale:.4g}", limit, margin, verdict


def mount_lines(rig: Rig, found: Mount) -> list[str]:
    """Return a mount as text."""
    error = f"tilt {math.degrees(found.tilt_max):.3g} deg"
    increase = f"{math.degrees(found.tilt_per_metre) * 1e-3:.3g} deg"
    if found.hold == "normal":
        error = f"slide {found.slide_max * 1e3:.3g} mm"
        increase = f"{found.slide_per_metre:.3g} mm"
    distance = math.hypot(rig.arm.base_x - found.base_x, rig.arm.base_z - found.base_z)
    rows = [("", "jack height (mm)", "jack speed (%)", "tilt (deg)")]
    for what, cost in (
        ("1 mm along x", found.unnoticed_x),
        ("1 mm along z", found.unnoticed_z),
        ("0.1 deg about joint 1", found.unnoticed_turn),
    ):
        height, speed = f"{cost.height_error * 1e3:.3g}", f"{100 * cost.speed_error:.2f}"
        rows.append((what, height, speed, f"{math.degrees(cost.tilt_change):.3g}"))
    return [
        f"rig {rig.name}: clamp the base at x = {found.base_x * 1e3:.2f} mm,"
        f" z = {found.base_z * 1e3:.2f} mm, elbow {found.elbow}"
        f" ({distance * 1e3:.3g} mm from the base in the rig file)",
        f"finger at this base: {error} at most; if you clamp it elsewhere and enter that place in"
        f" the rig file: {increase} more per mm of distance",
        "errors if the clamped base differs from the one in the rig file:",
        *table(rows, indent=2),
    ]


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
