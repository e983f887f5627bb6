"""The place to clamp the robot, and the place where touches found it clamped."""

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.results.result import Result, frame_of, shown
from sautereau.analysis.text import table
from sautereau.rig.schema import Rig
from sautereau.trajectory.mount.find import Mount, mount_map
from sautereau.trajectory.mount.locate import Located

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Clamping(Result):
    """Where the robot is to be clamped, and where it is."""

    rig: Rig
    found: Mount
    located: Located | None = None
    """The base that touches give; None without touches."""

    def __repr__(self) -> str:
        base = f"{self.found.base_x * 1e3:.2f} mm, {self.found.base_z * 1e3:.2f} mm"
        return f"<Clamping for rig {self.rig.name}: base at {base}>"

    @property
    def document(self) -> dict[str, Any]:
        """Both places as JSON; SI units."""
        if self.located is None:
            return asdict(self.found)
        arrays = {name: getattr(self.located, name).tolist() for name in ("std", "covariance")}
        return {"located": asdict(self.located) | arrays} | asdict(self.found)

    def lines(self) -> list[str]:
        """Return both places as text."""
        found = self.found
        error = f"tilt {math.degrees(found.tilt_max):.3g} deg"
        increase = f"{math.degrees(found.tilt_per_metre) * 1e-3:.3g} deg"
        if found.hold == "normal":
            error = f"slide {found.slide_max * 1e3:.3g} mm"
            increase = f"{found.slide_per_metre:.3g} mm"
        distance = math.hypot(
            self.rig.arm.base_x - found.base_x, self.rig.arm.base_z - found.base_z
        )
        rows = [("", "jack height (mm)", "jack speed (%)", "tilt (deg)")]
        for what, cost in (
            ("1 mm along x", found.unnoticed_x),
            ("1 mm along z", found.unnoticed_z),
            ("0.1 deg about joint 1", found.unnoticed_turn),
        ):
            height, speed = f"{cost.height_error * 1e3:.3g}", f"{100 * cost.speed_error:.2f}"
            rows.append((what, height, speed, f"{math.degrees(cost.tilt_change):.3g}"))
        return [
            *(_located_lines(self.located) if self.located else ()),
            f"rig {self.rig.name}: clamp the base at x = {found.base_x * 1e3:.2f} mm,"
            f" z = {found.base_z * 1e3:.2f} mm, elbow {found.elbow}"
            f" ({distance * 1e3:.3g} mm from the base in the rig file)",
            f"finger at this base: {error} at most; if you clamp it elsewhere and enter that place"
            f" in the rig file: {increase} more per mm of distance",
            "errors if the clamped base differs from the one in the rig file:",
            *table(rows, indent=2),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return the errors of the press if the clamped base differs from that of the rig file."""
        costs = {name: asdict(getattr(self.found, name)) for name in _MISPLACED}
        rows = [(name, *cost.values()) for name, cost in costs.items()]
        return frame_of(rows, ("misplacement", *costs["unnoticed_x"]), "misplacement")

    def plot(self) -> "Figure":
        """Return a map of the finger's tilt or slide over the places of the base."""
        from sautereau.analysis.figures.mount import mount_figure

        return shown(mount_figure(self.rig, mount_map(self.rig), self.found))


_MISPLACED = ("unnoticed_x", "unnoticed_z", "unnoticed_turn")


def _located_lines(found: Located) -> list[str]:
    lines = [
        "base from the touches, with standard uncertainties"
        f" (RMS residual {found.residual * 1e3:.3g} mm):"
    ]
    values = (found.base_x, found.base_z, *found.offsets)
    for name, value, std in zip(found.estimated, values, found.std, strict=False):
        scale, unit = (1e3, "mm") if name.startswith("base") else (math.degrees(1), "deg")
        lines.append(f"  {name} = {value * scale:.4g} +- {std * scale:.2g} {unit}")
    return lines + [f"  warning: {warning}" for warning in found.warnings]
