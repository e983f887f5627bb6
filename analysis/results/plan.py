"""The plan of one press: its checks and its motion."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.figures.palette import ARM, GRAIN, LASER, PHASES, PRESSED, SKY
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import expected_of
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.analysis.text import check_cells, counted, listed, relative_margin, table
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import Trajectory, draft_press

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from sautereau.analysis.results.expected import Expected

COLUMNS = ("name", "value", "limit", "unit", "at_least", "margin", "holds", "how_to_fix")
"""Columns of the table of checks."""


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """One planned press; `trajectory` has all its arrays."""

    rig: Rig
    trajectory: Trajectory
    expectation: Expectation | None
    """Force of the string on the finger; None if the model has no solution."""
    warnings: tuple[str, ...]
    return_force_min: float | None
    """N, least force between finger and key on the way back; not above 0 if they part, None if the
    key does not return."""

    def __repr__(self) -> str:
        feasible = "feasible" if self.feasible else "NOT feasible"
        return f"<Plan of rig {self.rig.name}: {self.trajectory.time[-1] * 1e3:.4g} ms, {feasible}>"

    @property
    def feasible(self) -> bool:
        """Whether every check holds."""
        return all(check.holds for check in self.trajectory.checks)

    @property
    def document(self) -> dict[str, Any]:
        """The plan as JSON; SI units."""
        draft = self.trajectory
        return {
            "cruise_speed": draft.cruise.speed,
            "cruise_error_max": draft.cruise.error,
            "loaded_speed_error": draft.loaded_speed_error,
            "return_force_min": self.return_force_min,
            "cruise_time": [draft.cruise.start, draft.cruise.end],
            "cruise_rise": list(draft.cruise.rise),
            "tilt_max": float(abs(draft.tilt).max()),
            "slide_max": float(abs(draft.slide).max()),
            "duration": float(draft.time[-1]),
            "segments": len(draft.segments),
            "feasible": self.feasible,
            "warnings": list(self.warnings),
            "checks": [asdict(c) | {"margin": c.margin, "holds": c.holds} for c in draft.checks],
        }

    def lines(self, all_checks: bool = False) -> list[str]:
        """Return the plan as text.

        Args:
            all_checks: List every check instead of the tightest and the failed ones.
        """
        draft, cruise = self.trajectory, self.trajectory.cruise
        tilt, slide = math.degrees(abs(draft.tilt).max()), abs(draft.slide).max() * 1e3
        start, end = cruise.start * 1e3, cruise.end * 1e3
        ordered = sorted(draft.checks, key=relative_margin)
        failed = sum(not check.holds for check in ordered)
        shown = ordered if all_checks else ordered[: max(5, failed)]  # The tightest checks
        more = len(ordered) - len(shown)
        held = "speed error unknown; give arm.servo_stiffness to predict it"
        if (error := draft.loaded_speed_error) is not None:
            limit = f"press.speed_tolerance {100 * self.rig.press.speed_tolerance:.3g} %"
            held = f"RMS speed error up to {error * 100:.2g} % expected, {limit}"
        return [
            f"rig {self.rig.name}: {draft.time[-1] * 1e3:.4g} ms in"
            f" {counted(len(draft.segments), 'segment')}",
            f"{'cruise' if draft.law.steady else 'gesture'}: jack speed {cruise.speed:.6g} m/s,"
            f" error by rounding at most {cruise.error * 100:.2g} %,"
            f" from {start:.4g} to {end:.4g} ms after the start of motion,"
            f" jack rise {cruise.rise[0] * 1e3:.4g} to {cruise.rise[1] * 1e3:.4g} mm",
            *([f"string held: {held}"] if self.expectation else []),
            f"finger: tilt at most {tilt:.3g} deg, slide at most {slide:.3g} mm",
            *table([("check", "value", "limit", "margin", ""), *map(check_cells, shown)]),
            *([f"{more} more checks hold by larger margins; -v lists them"] if more else []),
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    @property
    def checks(self) -> "pd.DataFrame":
        """Each check with value, limit and margin in its unit; SI."""
        rows = [[getattr(check, name) for name in COLUMNS] for check in self.trajectory.checks]
        return frame_of(rows, COLUMNS, "name")

    def expected(
        self,
        names: Sequence[str] | str,
        priors: Sequence[str] | str = (),
        *,
        presses: int = 3,
        speeds: Sequence[str] = (),
        force_noise: str = "5 mN",
        velocity_noise: str = "0.05 mm/s",
    ) -> "Expected":
        """Return the uncertainties that a fit to such presses would reach, and rank choices.

        Args:
            names: Parameters to fit, as for `Session.identify`: `"plectrum.overlap, key.inertia"`.
            priors: Prior knowledge of them, as for `Session.identify`.
            presses: Number of presses.
            speeds: Other speeds of the jack to compare, `"0.03 m/s"`; none: half and twice its
                speed.
            force_noise: Standard deviation of a sample of the force, white noise.
            velocity_noise: The same of the velocity.

        Raises:
            AnalysisError: A name, a prior, a number or a quantity is wrong.
            TrajectoryError: The planned press cannot be made.
            ModelError: The model has no solution for the rig.
        """
        from sautereau.analysis.results.expected import expected

        return expected(
            self.rig, listed(names), listed(priors), presses, speeds, force_noise, velocity_noise
        )

    def to_frame(self) -> "pd.DataFrame":
        """Return the checks."""
        return self.checks

    def plot(self) -> "Figure":
        """Return a figure of poses, path, jack, joints and used limits."""

        return shown(plan_figure(self.rig, self.trajectory, self.expectation))


def plan(rig: Rig, correction: Correction | None = None) -> Plan:
    """Plan the press of a rig with the force that the model expects.

    Args:
        correction: Learned addition to the jack's rise; None for none.

    Raises:
        TrajectoryError: No such motion exists: there is no cruise, or it is out of reach.
    """
    expected, doubts, said = expected_of(rig)
    draft = draft_press(rig, expected, correction)
    warnings = [*doubts, *said, *draft.warnings]
    least, name = _return_force(rig, draft), "jack.register_friction"
    friction = rig.assumed.get(name, (0.0, rig.jack.register_friction))[1]
    stiff = rig.jack.model_copy(update={"register_friction": friction})
    worst = _return_force(rig.model_copy(update={"jack": stiff}), draft)
    if least is not None and worst is not None and worst <= 0:
        warnings.append(
            f"weak return: the key presses on the returning finger with {least * 1e3:.2g} mN at"
            f" least, and leaves it by {-worst * 1e3:.2g} mN if {name} is {friction * 1e3:.3g} mN:"
            " the jack may hang; measure the friction, lower press.return_acceleration, or ease"
            " the jack"
        )
    return Plan(rig, draft, expected, tuple(warnings), least)


def _return_force(rig: Rig, draft: Trajectory) -> float | None:
    """Return the least force [N] between finger and key while the key returns."""
    back = draft.angle.velocity < 0
    if not back.any():
        return None
    angle = Motion(*(part[back] for part in draft.angle))
    return float(finger_force(rig, angle, np.zeros(int(back.sum()))).min())


FIRST, SECOND, KEY, FAILED = ARM, PRESSED, GRAIN, LASER
POSES = (("start", ARM), ("middle", SKY), ("end", PRESSED))  # Poses of the press and their colours


def plan_figure(rig: Rig, trajectory: Trajectory, expected: Expectation | None) -> "Figure":
    """Return a figure of poses and path to scale, jack and joints over time, and limits used.

    Args:
        expected: Predicted force on the finger, contact and release; None if unknown.
    """
    figure = drawing(14, 9)
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
    from sautereau.analysis.figures.artists import draw_pose

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
