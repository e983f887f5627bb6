"""The plot of where to clamp the robot, to scale with the key and the arm."""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from sautereau.analysis.figures.artists import draw_pose
from sautereau.analysis.figures.palette import PRESSED, PURPLE
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import follow_key
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.mount.bases import key_angles
from sautereau.trajectory.mount.find import Mount, MountMap, mount_map

REST, PRESENT = "#12263a", PURPLE
EXCLUDED, HATCH = "#e9e9e9", "#a8a8a8"
NEAR = 10e-3  # m, from the best base to the sides of the enlarged region
LOWEST = -40e-3  # m, lower edge of the plot, which leaves room for labels


def mount_figure(rig: Rig, area: MountMap, mount: Mount) -> Figure:
    """Return a figure of the residual over the region, with key and arm in the same axes.

    The arm is drawn at the best base, with the key at rest and at full rise. Places that a
    limit excludes are hatched. If the region leaves room above the key, the neighbourhood of
    the best base is enlarged there.
    """
    figure = Figure(figsize=(12, 6.6), layout="constrained")
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
    axes.set_ylim(bottom=min(axes.get_ylim()[0], LOWEST * 1e3))
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
    """Draw the neighbourhood of the best base into the free corner above the key."""
    low, high = np.array([rig.arm.mount_x, rig.arm.mount_z]).T
    best = np.array([mount.base_x, mount.base_z])
    corner, end = np.maximum(best - NEAR, low), np.minimum(best + NEAR, high)
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
