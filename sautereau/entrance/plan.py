"""The plan of one press: its checks and its motion."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sautereau.analysis.model.predict import expected_of
from sautereau.entrance.shown import Shown, shown
from sautereau.rig.schema import Rig
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.press import Trajectory, draft_press

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """One planned press; `trajectory` has all its arrays."""

    rig: Rig
    trajectory: Trajectory
    expected: Expectation | None
    """Force of the string on the finger; None if the model has no solution."""
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        feasible = "feasible" if self.feasible else "NOT feasible"
        return f"<Plan of rig {self.rig.name}: {self.trajectory.time[-1] * 1e3:.4g} ms, {feasible}>"

    @property
    def feasible(self) -> bool:
        """Whether every check holds."""
        return all(check.holds for check in self.trajectory.checks)

    @property
    def checks(self) -> "pd.DataFrame":
        """Each check with value, limit and margin in its unit; SI."""
        import pandas as pd

        names = ("name", "value", "limit", "unit", "at_least", "margin", "holds", "how_to_fix")
        rows = [[getattr(check, name) for name in names] for check in self.trajectory.checks]
        return pd.DataFrame(rows, columns=list(names)).set_index("name")

    def to_frame(self) -> "pd.DataFrame":
        """Return the checks."""
        return self.checks

    def plot(self) -> "Figure":
        """Return a figure of poses, path, jack, joints and used limits."""
        from sautereau.analysis.figures.plan import plan_figure

        return shown(plan_figure(self.rig, self.trajectory, self.expected))


def plan(rig: Rig) -> Plan:
    """Plan the press of a rig with the force that the model expects.

    Raises:
        TrajectoryError: No such motion exists: there is no cruise, or it is out of reach.
    """
    expected, doubts = expected_of(rig)
    draft = draft_press(rig, expected)
    return Plan(rig, draft, expected, (*doubts, *draft.warnings))
