"""The plot of a pluck by every plectrum model, after the paper's figure 4."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sautereau.analysis.errors import ModelError
from sautereau.analysis.figures.palette import DASHES, GRID
from sautereau.analysis.figures.palette import LEVELS as COLOURS
from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.model.plectrum.levels import LEVELS, dropped
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.schema import Rig

WIDTHS = (7.5, 4.5, 2.6, 1.2, 0.8, 0.5)  # Points, decreasing, so that covered curves remain visible
LEGEND = "pluck duration, plectrum force at release"  # Meaning of the numbers in the legend


def pluck_figure(rig: Rig, levels: Sequence[str]) -> Figure:
    """Return a figure of the plectrum's angle, the string's path and the force on the clamp.

    A last panel has the differences of the force from that of the first level.

    Args:
        levels: Plectrum models by name; one without a pluck for this rig is listed
            in the legend as out of range.

    Raises:
        ModelError: A level is not known, or none has a pluck.
    """
    for level in levels:
        LEVELS.get(level)
    plucks: dict[str, Pluck] = {}
    faults: dict[str, str] = {}
    for level in levels:
        try:
            plucks[level] = rig_pluck(rig, level)
        except ModelError as error:
            faults[level] = f"{level}: {error}"
    if not plucks:
        raise ModelError("\n".join(["no level has a pluck for this rig", *faults.values()]))
    figure = Figure(figsize=(11, 9), layout="constrained")
    (angle, path), (force, differences) = figure.subplots(2, 2)
    reference = next(iter(plucks))
    stiffness = rig.string.static_stiffness
    for i, level in enumerate(dict.fromkeys(levels)):
        colour, width = COLOURS[i % len(COLOURS)], WIDTHS[min(i, len(WIDTHS) - 1)]
        if level not in plucks:
            angle.plot([], [], color=colour, lw=width, label=f"{level}: out of range")
            continue
        pluck = plucks[level]
        height, lift, shift = pluck.height * 1e3, pluck.lift, pluck.shift
        curves = (
            (angle, height, np.degrees(pluck.angle), "-"),
            (path, shift * 1e3, lift * 1e3, "-"),
            (force, height, stiffness * np.hypot(lift, shift), "-"),
            (force, height, stiffness * shift, (0, (9 / width, 4 / width))),
        )
        for axes, x, y, dashes in curves:
            axes.plot(x, y, color=colour, lw=width, ls=dashes)
            axes.plot(x[-1], y[-1], "o", color=colour, ms=4 + width, mfc="white", zorder=3)
        if level != reference:
            first = plucks[reference]
            both = height[height <= first.height[-1] * 1e3]
            other = np.interp(both, first.height * 1e3, np.hypot(first.lift, first.shift))
            change = stiffness * (np.hypot(lift, shift)[: len(both)] - other)
            style = {"color": colour, "lw": 1.8, "ls": DASHES[i % len(DASHES)], "label": level}
            differences.plot(both, change * 1e3, **style)
        duration = pluck.release_height / rig.press.jack_speed
        lost = dropped(rig.plectrum, level)
        without = f", without {' and '.join(lost)}" * bool(lost)
        label = f"{level}: {duration * 1e3:.4g} ms, {pluck.string_force[-1]:.4g} N{without}"
        angle.plot([], [], color=colour, lw=width, label=label)
    _dress(rig, angle, path, force)
    differences.axhline(0, color=COLOURS[0], lw=3)
    differences.set_ylabel(f"force minus that of {reference} (mN)")
    differences.set_xlabel("jack height above first contact (mm)")
    if len(plucks) > 1:
        differences.legend(loc="best", framealpha=0.8, edgecolor="none")
    differences.grid(color=GRID, lw=0.7)
    entries, columns = angle.get_legend_handles_labels(), min(3, len(levels))
    figure.legend(*entries, loc="outside lower center", ncols=columns, frameon=False, title=LEGEND)
    plectrum = rig.plectrum
    which = f", {string_names(rig)[0]} of {1 + len(rig.more_choirs)}" if rig.more_choirs else ""
    title = (
        f"Pluck of rig {rig.name}{which}: overlap {plectrum.overlap * 1e3:.4g} mm, string of"
        f" {stiffness:.4g} N/m, jack at {rig.press.jack_speed:.4g} m/s; circles: release"
    )
    lines = [line for fault in faults.values() for line in textwrap.wrap(fault, 190)]
    figure.suptitle("\n".join([title, *lines]), fontsize=10 if lines else 12)
    return figure


def _dress(rig: Rig, angle, path, force) -> None:
    """Label the axes, with a second axis of time."""
    speed = rig.press.jack_speed
    angle.set_ylabel("plectrum angle under the string (deg)")
    path.set_xlabel("string displacement x, outwards (mm)")
    path.set_ylabel("string displacement z, upwards (mm)")
    force.set_ylabel("force on the clamp (N)")
    force.plot([], [], color="#777777", label="its norm, as in the paper")
    force.plot([], [], color="#777777", ls=(0, (6, 2.7)), label="its part along the plectrum")
    force.legend(loc="best", framealpha=0.8, edgecolor="none")
    for axes in (angle, force):
        axes.set_xlabel("jack height above first contact (mm)")
        above = axes.secondary_xaxis("top", (lambda mm: mm / speed, lambda ms: ms * speed))
        above.set_xlabel("time after contact (ms)")
        axes.set_xlim(left=0)
    angle.set_ylim(bottom=0)
    path.set_ylim(bottom=0)
    for axes in (angle, path, force):
        axes.grid(color=GRID, lw=0.7)
        axes.set_axisbelow(True)
        axes.spines["right"].set_visible(False)
    path.spines["top"].set_visible(False)
