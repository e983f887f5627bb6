"""A plan, as plain values and as lines."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from sautereau.rig.schema import Rig
from sautereau.trajectory.press import Trajectory


def plan_summary(draft: Trajectory, warnings: Sequence[str]) -> dict[str, Any]:
    """Return a plan as JSON would hold it; SI units."""
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


def plan_lines(rig: Rig, draft: Trajectory, warnings: Sequence[str]) -> list[str]:
    """Return a plan as text."""
    cruise = draft.cruise
    tilt, slide = math.degrees(abs(draft.tilt).max()), abs(draft.slide).max() * 1e3
    return [
        f"rig {rig.name}: {draft.time[-1] * 1e3:.4g} ms in {len(draft.segments)} segments",
        f"the jack {'cruises' if draft.law.steady else 'goes'} at {cruise.speed:.6g} m/s from"
        f" {cruise.start * 1e3:.4g} to {cruise.end * 1e3:.4g} ms and from"
        f" {cruise.rise[0] * 1e3:.4g} to {cruise.rise[1] * 1e3:.4g} mm; its speed is wrong by at"
        f" most {cruise.error * 100:.2g} %",
        f"the finger tilts by {tilt:.3g} deg and slides by {slide:.3g} mm",
        *(f"  {check}" for check in draft.checks),
        *(f"warning: {warning}" for warning in warnings),
    ]
