"""The drawing of the bench to scale, with its dimensions, and of a jack's head enlarged."""

from operator import attrgetter

import numpy as np
from matplotlib.figure import Figure

from sautereau.analysis.figures import parts
from sautereau.analysis.figures.artists import Artists, draw_head, draw_pose
from sautereau.analysis.figures.palette import ARM, FELT, GRAIN, LASER, METAL, PRESSED, literal
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.press.replay import ChoirMotion, at_rest
from sautereau.rig.disk import table_beside
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import base
from sautereau.trajectory.press import Trajectory

DIMENSION = "#444444"
LENGTHS = dict(table_beside(__file__))  # Lengths without an arrow in the drawing, and their texts


def bench_figure(rig: Rig, trajectory: Trajectory) -> Figure:
    """Draw the bench to scale at rest and at full rise, with its dimensions, and a jack's head."""
    figure = Figure(figsize=(14, 9), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.5), height_ratios=(1.3, 1))
    side = figure.add_subplot(grid[0, :])
    head, words = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    Artists(side, parts.fixed_parts(rig))
    rise = trajectory.rise.position
    for sample, ghost in ((int(np.argmax(rise)), True), (0, False)):
        place = float(trajectory.angle.position[sample]), trajectory.joints.position[sample]
        draw_pose(side, rig, *place, PRESSED if ghost else ARM, ghost=ghost)
    _draw_labels(side, rig)
    _dimensions(side, rig)
    side.set_aspect("equal")
    side.relim()
    side.margins(0.03, 0.08)
    side.autoscale_view()
    side.set(xlabel="x from the balance pin (mm)", ylabel="z (mm)")
    choir = choirs(rig)[0]
    motion = at_rest(choir, np.array([-choir.jack.string_clearance]))
    draw_head(head, motion)
    _label_head(head, motion)
    head.set_title("jack's head at rest, seen along the string", fontsize=10)
    _legend(words, rig)
    figure.suptitle(
        f'Rig {rig.name}, hold "{rig.press.hold}": the bench to scale, at rest and (dashed) at a'
        f" jack rise of {rise.max() * 1e3:.4g} mm"
    )
    literal(figure)
    return figure


def _draw_labels(axes, rig: Rig) -> None:
    key, arm = rig.key, rig.arm
    foot = np.array([key.jack_arm, key.jack_surface_height]) * 1e3
    height = parts.string_height(rig, choirs(rig)[0]) * 1e3
    plucked = rig.string.plucking_point * 1e3
    ends = foot[0] - plucked, foot[0] - plucked + rig.string.length * 1e3
    axes.plot(
        [-key.laser_arm * 1e3] * 2, [key.surface_height * 1e3, 120], color=LASER, lw=1, ls="-."
    )
    low = key.neighbour_height * 1e3
    axes.plot([-key.front_arm * 1e3, 0], [low, low], color=GRAIN, ls=":", lw=1)
    felt = (-parts.UNDER - key.dip) * 1e3 - 2
    named = (
        ("laser", (-key.laser_arm * 1e3, 120), (0, 3), "center", LASER),
        ("base", tuple(base(arm) * 1e3), (0, 12), "center", ARM),
        ("neighbouring keys", (0, low), (3, 0), "left", GRAIN),
        ("jack", (foot[0] - 4, (foot[1] + height) / 2), (-8, -14), "right", "black"),
        ("nut", (ends[0], height - 9), (0, -11), "center", "black"),
        ("bridge", (ends[1], height - 9), (0, -11), "center", "black"),
        ("string", ((foot[0] + ends[1]) / 2, height), (0, -13), "center", "black"),
        ("rail", (foot[0] - 6, -parts.UNDER * 1e3 - 4), (0, -11), "right", FELT),
        ("felt", (-key.press_arm * 1e3 - 12, felt), (-4, -4), "right", FELT),
        ("balance pin", (0, -parts.UNDER * 1e3 - 8), (0, -11), "center", "black"),
    )
    for text, place, offset, side, colour in named:
        axes.annotate(
            text, place, offset, textcoords="offset points", ha=side, color=colour, fontsize=9
        )


def _dimensions(axes, rig: Rig) -> None:
    """Draw the lengths along the key below it, from the balance pin."""
    key = rig.key
    rows = (
        ("key.laser_arm", -key.laser_arm, -42.0),
        ("key.press_arm", -key.press_arm, -57.0),
        ("key.front_arm", -key.front_arm, -72.0),
        ("key.jack_arm", key.jack_arm, -42.0),
    )
    axes.plot([0, 0], [-36, -76], color=DIMENSION, lw=0.6)
    for name, value, z in rows:
        axes.plot([value * 1e3] * 2, [-14, z - 4], color=DIMENSION, lw=0.6, ls=":")
        axes.annotate(
            "", (value * 1e3, z), (0, z), arrowprops={"arrowstyle": "<->", "color": DIMENSION}
        )
        text = _length_text(rig, name, name.split(".")[1].replace("_", " "))
        axes.text(
            value * 500, z, text, ha="center", va="center", fontsize=8,
            bbox={"fc": "white", "ec": "none", "pad": 1},
        )  # fmt: skip


def _label_head(axes, motion: ChoirMotion) -> None:
    """Label the parts of a jack's head at rest."""
    choir, clamp = motion.choir, parts.clamp_place(motion.choir) * 1e3
    clearance, radius = choir.jack.string_clearance * 1e3, choir.string.diameter * 500
    low = -clearance - radius - choir.plectrum.clamp_thickness * 500
    axes.annotate(
        "", (0.9, 0), (0.9, -clearance), arrowprops={"arrowstyle": "<->", "color": DIMENSION}
    )
    for z in (-clearance, 0):
        axes.plot([0.1, 1.2], [z, z], color=DIMENSION, lw=0.6, ls=":")
    middle, style = {"ha": "center", "fontsize": 8}, {"fontsize": 8, "va": "center"}
    axes.text(1.0, -clearance / 2, "clearance", **style)
    axes.text(clamp / 2, low - 0.35, "plectrum", va="top", **middle)
    axes.annotate("wire", (-radius, 0), (-30, -12), textcoords="offset points", fontsize=8)
    if choir.jack.damper:
        top = radius + (parts.FELT_HEIGHT - choir.jack.damper.lift) * 1e3 + 0.4
        axes.text(clamp / 2, top, "damper", va="bottom", **middle)
    axes.text(clamp - parts.AXLE * 500, low - 0.1, "tongue", rotation=90, va="bottom", **middle)


def _legend(axes, rig: Rig) -> None:
    """Write the lengths that have no arrow."""
    rows = [_length_text(rig, name, text) for name, text in LENGTHS.items()]
    if rig.more_choirs:
        rows.append(f"{len(rig.more_choirs)} more string{'s' * (len(rig.more_choirs) > 1)}")
    axes.axis("off")
    half = (len(rows) + 1) // 2
    for column, part in enumerate((rows[:half], rows[half:])):
        axes.text(
            0.03 + 0.5 * column, 0.95, "\n".join(part), va="top", linespacing=1.7, fontsize=10
        )
    if any("*" in row for row in rows):
        axes.text(0.03, 0.02, "* assumed in the rig file", fontsize=9, color=METAL)


def _length_text(rig: Rig, name: str, text: str) -> str:
    mark = "*" if name in rig.assumed else ""
    return f"{text} {attrgetter(name)(rig) * 1e3:.5g} mm{mark}"
