"""The plot of a plan, to be looked at before the press is run."""

import numpy as np
from matplotlib.figure import Figure

from sautereau.analysis.figures.artists import draw_pose
from sautereau.analysis.figures.palette import ARM, GRAIN, LASER, PHASES, PRESSED, SKY
from sautereau.analysis.text import check_cells
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.press import Trajectory

FIRST, SECOND, KEY, FAILED = ARM, PRESSED, GRAIN, LASER
POSES = (("start", ARM), ("middle", SKY), ("end", PRESSED))  # Poses of the press and their colours


def plan_figure(rig: Rig, trajectory: Trajectory, expected: Expectation | None) -> Figure:
    """Return a figure of poses and path to scale, jack and joints over time, and limits used.

    Args:
        expected: Predicted force on the finger, contact and release; None if unknown.
    """
    figure = Figure(figsize=(14, 9), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.35, 1))
    scene, zoom = figure.add_subplot(grid[:2, 0]), figure.add_subplot(grid[2, 0])
    jack = figure.add_subplot(grid[0, 1])
    speeds = figure.add_subplot(grid[1, 1], sharex=jack)
    limits = figure.add_subplot(grid[2, 1])
    _poses(scene, rig, trajectory)
    _path(zoom, trajectory)
    _jack(jack, trajectory, expected)
    _speeds(speeds, rig, trajectory)
    _limits(limits, trajectory)
    held = all(check.holds for check in trajectory.checks)
    verdict = "every check holds" if held else "REFUSED: a check fails"
    figure.suptitle(f'Plan of a press, rig {rig.name}, hold = "{rig.press.hold}": {verdict}')
    return figure


def _moments(trajectory: Trajectory) -> list[int]:
    """Return the samples at the start, middle and end of the jack's rise."""
    bottom = int(np.searchsorted(trajectory.time, trajectory.law.bottom))
    bottom = min(bottom, len(trajectory.time) - 1)
    half = trajectory.rise.position[bottom] / 2
    middle = int(np.argmax(trajectory.rise.position >= half))
    return [0, middle, bottom]


def _poses(axes, rig: Rig, trajectory: Trajectory) -> None:
    """Draw key, jack and arm at the start, the middle and the end of the press."""
    arm, key = rig.arm, rig.key
    for k, (name, colour) in zip(_moments(trajectory), POSES, strict=True):
        place = float(trajectory.angle.position[k]), trajectory.joints.position[k]
        draw_pose(axes, rig, *place, colour, ghost=name != "start", label=name)
    axes.relim()
    axes.plot(0, 0, "^", color=KEY, ms=12, zorder=4)
    axes.annotate("balance pin", (0, 0), (0, -20), textcoords="offset points", ha="center")
    axes.annotate("jack", (key.jack_arm * 1e3, 100), (8, 0), textcoords="offset points")
    base = (arm.base_x * 1e3, arm.base_z * 1e3)
    axes.annotate("base", base, (0, 10), textcoords="offset points", ha="center")
    axes.axhline(key.neighbour_height * 1e3, color=KEY, ls=":", lw=1)
    axes.text(
        0.01, key.neighbour_height * 1e3, "neighbouring keys", color=KEY, va="bottom", ha="left",
        transform=axes.get_yaxis_transform(), fontsize=8,
    )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.set(xlabel="x from the balance pin (mm)", ylabel="z (mm)")
    axes.legend(loc="lower right", title="pose")


def _path(axes, trajectory: Trajectory) -> None:
    """Draw the path of the fingertip's centre, its slide on the key, and the tilt along it."""
    bottom = _moments(trajectory)[2]
    tip = (trajectory.fingertip.position[: bottom + 1] - trajectory.fingertip.position[0]) * 1e3
    axes.plot(-tip[:, 1], tip[:, 0], color=FIRST, label="horizontal position (mm)")
    axes.plot(
        -tip[:, 1], np.degrees(trajectory.tilt[: bottom + 1]), color=SECOND, label="tilt (deg)"
    )
    if trajectory.slide.any():
        slide = trajectory.slide[: bottom + 1] * 1e3
        axes.plot(-tip[:, 1], slide, color=KEY, label="slide on the key (mm)")
    axes.set(xlabel="depth of the fingertip (mm)", ylabel="fingertip: path (mm), tilt (deg)")
    axes.grid(alpha=0.3)
    axes.legend(loc="best", fontsize=8)


def _jack(axes, trajectory: Trajectory, expected: Expectation | None) -> None:
    time = trajectory.time * 1e3
    axes.plot(time, trajectory.rise.position * 1e3, color=FIRST)
    cruise = trajectory.cruise
    axes.axvspan(cruise.start * 1e3, cruise.end * 1e3, color=PHASES["string released"][0], zorder=0)
    name = "cruise" if trajectory.law.steady else "gesture"
    axes.text(
        (cruise.start + cruise.end) * 500, 0.97, f"{name}\n{cruise.speed:.5g} m/s",
        transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=8,
    )  # fmt: skip
    if expected is not None:
        for height, what in ((expected.contact, "contact"), (expected.release, "release")):
            axes.axhline(height * 1e3, color=SECOND, ls="--", lw=0.8)
            label = QUANTITIES[what].label
            axes.text(time[-1], height * 1e3, f"{label} ", color=SECOND, ha="right", va="bottom")
    axes.set_ylabel("jack rise (mm)")
    axes.grid(alpha=0.3)


def _speeds(axes, rig: Rig, trajectory: Trajectory) -> None:
    time = trajectory.time * 1e3
    for j, colour in enumerate((FIRST, SECOND)):
        axes.plot(time, trajectory.joints.velocity[:, j], color=colour, label=f"joint {j + 1}")
    limit, top = rig.arm.speed_limit, np.abs(trajectory.joints.velocity).max()
    axes.set_ylim(-1.25 * top, 1.25 * top)
    if limit <= 1.25 * top:
        for side in (-limit, limit):
            axes.axhline(side, color=FAILED, ls="--")
    axes.set_ylabel(f"joint speed (rad/s)\nlimit {limit:.4g} rad/s")
    axes.set_xlabel("time after the start of motion (ms)")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", fontsize=8)


def _limits(axes, trajectory: Trajectory) -> None:
    """Draw the used percentage of each limit, the largest on top."""
    # A joint's position has no natural zero, so a percentage of its limit means nothing.
    bars = [c for c in trajectory.checks if not c.at_least and "upper limit" not in c.name]
    bars.sort(key=lambda check: check.value / check.limit)
    used = np.array([check.value / check.limit for check in bars]) * 100
    colours = [FIRST if check.holds else FAILED for check in bars]
    axes.barh([check.name for check in bars], np.minimum(used, 130), color=colours)
    for y, (percent, check) in enumerate(zip(used, bars, strict=True)):
        text = " {1} {2}".format(*check_cells(check))
        inside = bool(percent > 60)
        axes.text(
            min(percent, 130), y, text + " " * inside, va="center", fontsize=7,
            ha="right" if inside else "left", color="white" if inside else "black",
        )  # fmt: skip
    axes.axvline(100, color=FAILED, lw=1)
    axes.set(xlim=(0, 130), xlabel="fraction of the limit (%)")
    axes.tick_params(labelsize=7)
    failed = [c.name for c in trajectory.checks if c not in bars and not c.holds]
    text = "reach, branch, clearance and range: within their limits"
    if failed:
        text = f"FAILED: {', '.join(failed)}"
    axes.set_title(text, fontsize=8, color=FAILED if failed else "black", loc="right")
