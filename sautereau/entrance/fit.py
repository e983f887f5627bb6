"""Values of a rig that were fitted to recordings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.analysis.identify import fit as fitting
from sautereau.analysis.identify.identified import Identified
from sautereau.analysis.identify.parameters import rig_values
from sautereau.analysis.summary.fit import fit_lines, fit_summary
from sautereau.analysis.summary.text import SOME_SIMULATED, counted
from sautereau.entrance.rig import Rig
from sautereau.entrance.shown import Shown, shown
from sautereau.rig import schema
from sautereau.rig.edit import edit_rig, edited_text
from sautereau.rig.load import parse_rig
from sautereau.rig.text import rig_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from sautereau.analysis.identify.profile import Profile


@dataclass(frozen=True, repr=False)
class Fit(Shown):
    """A fit; `found` has all its results."""

    nominal: schema.Rig
    """Rig of the recordings."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    mixed: tuple[str, ...]
    """Keys in which the presses differ although they were fitted together: the day, the scene."""
    made: fitting.Fit
    found: Identified

    def __repr__(self) -> str:
        values = ", ".join(f"{e.name} {e.value:.4g} {e.unit}" for e in self.found.estimates)
        presses = counted(len(self.found.presses), "press")
        return f"<Fit to {presses}: {values}; {self.found.quality.verdict}>"

    def __str__(self) -> str:
        return "\n".join(self.lines())

    @property
    def params(self) -> "pd.DataFrame":
        """Each parameter with value, uncertainty and 95 % interval, SI."""
        import pandas as pd

        columns = ["name", "unit", "value", "std", "low", "high", "rig_value"]
        columns += ["at_bound", "identifiable"]
        rows = [[getattr(e, name) for name in columns] for e in self.found.estimates]
        return pd.DataFrame(rows, columns=columns).set_index("name")

    @property
    def identifiable(self) -> dict[str, bool]:
        """Whether the recordings determine each parameter without its own prior."""
        return {e.name: e.identifiable for e in self.found.estimates}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about doubtful results."""
        more = []
        if self.mixed:
            more.append(f"fitted together, although the presses differ in {', '.join(self.mixed)}")
        if not self.simulated and self.found.contact_warning:
            more.append(self.found.contact_warning)
        return (*self.found.warnings, *more)

    def document(self, profiles: "Sequence[Profile]" = ()) -> dict[str, Any]:
        """Return the fit as JSON; SI units."""
        more = {"simulated": self.simulated, "warnings": list(self.warnings)}
        return fit_summary(self.found, profiles) | more

    def lines(self, profiles: "Sequence[Profile]" = (), *, every: bool = False) -> list[str]:
        """Return the fit as text, with the effects of every fixed number if requested."""
        found = replace(self.found, warnings=self.warnings)
        return [*([SOME_SIMULATED] * self.simulated), *fit_lines(found, profiles, every=every)]

    @property
    def values(self) -> dict[str, Any]:
        """Identifiable values by dotted key; empty unless the model is known to fit."""
        sure = [e for e in self.found.estimates if e.identifiable and self.found.quality.fits]
        return rig_values(self.nominal, {e.name: e.value for e in sure})

    @cached_property
    def rig(self) -> Rig:
        """The recordings' rig with `values`, which have this fit as their source."""
        nominal = rig_text(self.nominal)
        text = edited_text(nominal, "fit", Path(), self.values, self._source, every=True)
        return Rig(parse_rig(text))

    def write(self, path: Path) -> None:
        """Write `values` into a rig file and keep its other values; a new file is that of `rig`.

        Without `values` nothing is written.
        """
        if not self.values:
            return
        if path.exists():
            edit_rig(path, self.values, self._source, every=True).save()
        else:
            self.rig.save(path)

    @property
    def _source(self) -> str:
        first, more = self.found.presses[0], len(self.found.presses) - 1
        return (
            f"identified from {'SIMULATED ' * self.simulated}{first}"
            f"{f' and {more} more' * (more > 0)} on {date.today().isoformat()}"
        )

    def profile(self, name: str) -> "Profile":
        """Return the profile likelihood of one parameter."""
        from sautereau.analysis.identify.profile import profile

        return profile(self.made, self.found, name)

    def to_frame(self) -> "pd.DataFrame":
        """Return the parameters."""
        return self.params

    def plot(self) -> "Figure":
        """Return a figure of force, residuals and correlation."""
        from sautereau.analysis.figures.fit import fit_figure

        return shown(fit_figure(self.made, self.found, self.simulated))
