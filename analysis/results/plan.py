"""The plan of one press: its checks and its motion."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import expected_of
from sautereau.analysis.results.result import Result, frame_of, shown
from sautereau.analysis.text import check_cells, counted, relative_margin, table
from sautereau.rig.schema import Rig
from sautereau.trajectory.checks import Check
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import Trajectory, draft_press

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from sautereau.analysis.results.expected import Expected

TIGHTEST = 5  # Checks in the text unless all are requested
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
            *_check_lines(draft.checks, all_checks),
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    @property
    def checks(self) -> "pd.DataFrame":
        """Each check with value, limit and margin in its unit; SI."""
        rows = [[getattr(check, name) for name in COLUMNS] for check in self.trajectory.checks]
        return frame_of(rows, COLUMNS, "name")

    def expected(
        self,
        names: Sequence[str],
        priors: Sequence[str] = (),
        *,
        presses: int = 3,
        speeds: Sequence[str] = (),
        force_noise: str = "5 mN",
        velocity_noise: str = "0.05 mm/s",
    ) -> "Expected":
        """Return the uncertainties that a fit to such presses would reach, and rank choices.

        Args:
            names: Parameters to fit, as for `Session.identify`: `["plectrum.overlap"]`.
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
            self.rig,
            names,
            priors,
            presses=presses,
            speeds=speeds,
            force_noise=force_noise,
            velocity_noise=velocity_noise,
        )

    def to_frame(self) -> "pd.DataFrame":
        """Return the checks."""
        return self.checks

    def plot(self) -> "Figure":
        """Return a figure of poses, path, jack, joints and used limits."""
        from sautereau.analysis.figures.plan import plan_figure

        return shown(plan_figure(self.rig, self.trajectory, self.expectation))


def plan(rig: Rig, correction: Correction | None = None) -> Plan:
    """Plan the press of a rig with the force that the model expects.

    Args:
        correction: Learned addition to the jack's rise; None for none.

    Raises:
        TrajectoryError: No such motion exists: there is no cruise, or it is out of reach.
    """
    expected, doubts = expected_of(rig)
    draft = draft_press(rig, expected, correction)
    warnings = [*doubts, *draft.warnings]
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


def _check_lines(checks: Sequence[Check], all_checks: bool) -> list[str]:
    """Return the checks as a table, the tightest first."""
    ordered = sorted(checks, key=relative_margin)
    failed = sum(not check.holds for check in checks)
    shown = ordered if all_checks else ordered[: max(TIGHTEST, failed)]
    lines = table([("check", "value", "limit", "margin", ""), *map(check_cells, shown)])
    if len(shown) < len(ordered):
        lines.append(
            f"{len(ordered) - len(shown)} more checks hold by larger margins; -v lists them"
        )
    return lines
