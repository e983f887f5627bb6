"""The place to clamp the robot, and the place where touches found it clamped."""

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.figures.palette import PRESSED, PURPLE
from sautereau.analysis.results.result import Result, drawing, frame_of, plain, shown
from sautereau.analysis.text import table
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import follow_key
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.mount.bases import key_angles
from sautereau.trajectory.mount.find import Mount, MountMap, mount_map
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
        located = {"located": plain(self.located)} if self.located else {}
        return located | plain(self.found)

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


REST, PRESENT = "#12263a", PURPLE
EXCLUDED, HATCH = "#e9e9e9", "#a8a8a8"


def mount_figure(rig: Rig, area: MountMap, mount: Mount) -> "Figure":
    """Return a figure of the residual over the region, with key and arm in the same axes.

    The arm is drawn at the best base, with the key at rest and at full rise. Places that a
    limit excludes are hatched. If the region leaves room above the key, the neighbourhood of
    the best base is enlarged there.
    """
    from matplotlib.patches import Patch, Rectangle

    figure = drawing(12, 6.6)
    axes = figure.add_subplot()
    levels = _levels(area, mount)
    filled = _draw_residual(axes, area, mount, levels)
    corner = (area.x[0] * 1e3, area.z[0] * 1e3)
    size = (np.ptp(area.x) * 1e3, np.ptp(area.z) * 1e3)
    axes.add_patch(Rectangle(corner, *size, fill=False, ec="black", lw=1, zorder=2))
    _draw_bench(axes, rig, mount)
    _draw_bases(axes, rig, mount)
    axes.set_aspect("equal")
    axes.relim()
    axes.autoscale_view()
    axes.set_ylim(bottom=min(axes.get_ylim()[0], -40))  # mm, with room for labels
    axes.set(xlabel="x from the balance pin (mm)", ylabel="z above the balance pin (mm)")
    tilts = mount.hold == "point"
    what = "largest tilt of the finger (deg)" if tilts else "largest slide of the finger (mm)"
    bar = figure.colorbar(filled, ax=axes, label=what, pad=0.01, aspect=30)
    decades = 10.0 ** np.arange(np.ceil(np.log10(levels[0]) - 1e-9), np.log10(levels[-1]) + 1e-9)
    bar.set_ticks(decades, labels=[f"{tick:g}" for tick in decades])
    bar.ax.minorticks_off()
    if area.x[-1] < 0:
        _draw_inset(axes, rig, mount, levels)
    error = f"tilts by {np.degrees(mount.tilt_max):.3g} deg"
    if not tilts:
        error = f"slides by {mount.slide_max * 1e3:.3g} mm"
    figure.suptitle(
        f'Rig {rig.name}, hold "{mount.hold}", elbow {mount.elbow}: from the best base the finger'
        f" {error} over a rise of {rig.press.jack_rise * 1e3:.4g} mm"
    )
    excluded = Patch(fc=EXCLUDED, ec=HATCH, hatch="////", label="excluded by a limit")
    handles = [*axes.get_legend_handles_labels()[0], excluded]
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
    return figure


def _unit(mount: Mount) -> float:
    """Return degrees per radian or millimetres per metre, the unit of the residual of this hold."""
    return float(np.degrees(1)) if mount.hold == "point" else 1e3


def _levels(area: MountMap, mount: Mount) -> Floats:
    """Return contour levels, four per decade, from the best base's residual to the largest."""
    residual, feasible = area.best()
    least = max(mount.tilt_max, mount.slide_max) * _unit(mount)
    most = residual[feasible].max(initial=0.0) * _unit(mount)
    first = np.floor(4 * np.log10(max(least, 1e-6)))
    last = max(np.ceil(4 * np.log10(max(most, 1e-6))), first + 4)
    return 10 ** (np.arange(first, last + 1) / 4)


def _draw_residual(axes, area: MountMap, mount: Mount, levels: Floats):
    from matplotlib.colors import LogNorm

    residual, feasible = area.best()
    x, z = area.x * 1e3, area.z * 1e3
    filled = axes.contourf(
        x, z, np.clip(residual * _unit(mount), levels[0], levels[-1]), levels=levels,
        norm=LogNorm(levels[0], levels[-1]), cmap="viridis", zorder=1,
    )  # fmt: skip
    if not feasible.all():
        hidden = axes.contourf(
            x, z, np.where(feasible, 0.0, 1.0), levels=[0.5, 1.5], colors=[EXCLUDED],
            hatches=["////"], zorder=1.5,
        )  # fmt: skip
        hidden.set_edgecolor(HATCH)
        hidden.set_linewidth(0)
    return filled


def _draw_bases(axes, rig: Rig, mount: Mount) -> None:
    axes.plot(
        mount.base_x * 1e3, mount.base_z * 1e3, "*", ms=17, mfc="#ffd400", mec="black", mew=0.8,
        ls="", label=f"best base: x = {mount.base_x * 1e3:.2f}, z = {mount.base_z * 1e3:.2f} mm",
        zorder=7,
    )  # fmt: skip
    axes.plot(
        rig.arm.base_x * 1e3, rig.arm.base_z * 1e3, "D", ms=13, mfc="none", mec=PRESENT, mew=2,
        ls="", label="base in the rig file", zorder=8,
    )  # fmt: skip


def _draw_inset(axes, rig: Rig, mount: Mount, levels: Floats) -> None:
    """Draw 10 mm around the best base into the free corner above the key."""
    low, high = np.array([rig.arm.mount_x, rig.arm.mount_z]).T
    best = np.array([mount.base_x, mount.base_z])
    corner, end = np.maximum(best - 10e-3, low), np.minimum(best + 10e-3, high)
    x, z = zip(corner, end, strict=True)
    near = rig.replaced({"arm.mount_x": x, "arm.mount_z": z})
    inset = axes.inset_axes((0.5, 0.34, 0.42, 0.56))
    _draw_residual(inset, mount_map(near, 121), mount, levels)
    _draw_bases(inset, rig, mount)
    inset.set(xlim=np.multiply(x, 1e3), ylim=np.multiply(z, 1e3))
    inset.set_aspect("equal")
    inset.yaxis.tick_right()
    inset.set_title("around the best base", fontsize="medium")
    axes.indicate_inset_zoom(inset, edgecolor="black")


def _draw_bench(axes, rig: Rig, mount: Mount) -> None:
    from sautereau.analysis.figures.artists import draw_pose

    key = rig.key
    rest, pressed = key_angles(rig, 2)
    base = {f"arm.{name}": getattr(mount, name) for name in ("base_x", "base_z", "elbow")}
    best = rig.replaced(base)
    for angle, colour, name in ((rest, REST, "at rest"), (pressed, PRESSED, "at full rise")):
        ghost = name != "at rest"
        rise = np.array([rise_of_angle(key, angle)])
        still = Motion(rise, np.zeros(1), np.zeros(1))
        joints, named = follow_key(best, still).joints.position[0], f"arm and key {name}"
        draw_pose(axes, best, float(angle), joints, colour, ghost=ghost, label=named)
    axes.plot(0, 0, "^", ms=9, color="black", zorder=4)
    axes.annotate(
        "balance pin", (0, 0), (0, -14), textcoords="offset points", ha="center", va="top"
    )
    touched = np.array([-key.press_arm, key.surface_height]) * 1e3
    axes.annotate(
        "pressing point", touched, (40, -40), textcoords="offset points", va="center",
        arrowprops={"arrowstyle": "->", "color": "#555555"},
    )  # fmt: skip
    jack = np.array([key.jack_arm, key.jack_surface_height]) * 1e3
    axes.annotate(
        "jack", jack, (14, 34), textcoords="offset points", ha="left",
        arrowprops={"arrowstyle": "->", "color": "#555555"},
    )  # fmt: skip
