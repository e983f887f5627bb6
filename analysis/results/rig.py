"""The rig: all numbers of the bench, and what follows from them alone."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.analysis.results.result import Shown, frame_of
from sautereau.rig import load, schema
from sautereau.rig.document import flat, named_values
from sautereau.rig.errors import RigError
from sautereau.rig.faults import unit_of

if TYPE_CHECKING:
    import pandas as pd

    from sautereau.analysis.results.plan import Plan
    from sautereau.analysis.results.prediction import Prediction
    from sautereau.analysis.results.sweep import Sweep


class Rig(Shown):
    """A bench. It cannot be changed; `with_values` returns another one.

    Args:
        source: Path of a rig file, name of a packaged one, or a rig.

    Raises:
        RigError: Lists every fault of the file.
    """

    def __init__(self, source: "str | Path | schema.Rig | Rig" = "paper"):
        self.path: Path | None = None
        """File of the rig; None for a packaged one or one from a recording."""
        self._changed = False
        if isinstance(source, Rig):
            self.path, self.values, self._changed = source.path, source.values, source._changed
        elif isinstance(source, schema.Rig):
            self.values: schema.Rig = source
            """Its values as SI numbers: `rig.values.plectrum.overlap`."""
        else:
            self.path = Path(source) if Path(source).is_file() else None
            self.values = load.load_rig(source)

    def __repr__(self) -> str:
        of = f" of {self.path}" if self.path else ""
        return f"<Rig {self.values.name}{of}{', with other values' * self._changed}>"

    @property
    def name(self) -> str:
        """Name of the bench."""
        return self.values.name

    def to_frame(self) -> "pd.DataFrame":
        """Return every value by its dotted key, with its unit and its source or assumed range."""
        values = flat(load.rig_document(self.values))
        units = {key: unit_of(schema.Rig, key.split("."), self.values) or "" for key in values}
        sources = dict(self.values.sources)
        for key, ends in self.values.assumed.items():
            low, high = (f"{end:.12g} {units.get(key, '')}".strip() for end in ends)
            sources.setdefault(key, f"assumed, {low} to {high}")
        rows = [(key, value, units[key], sources.get(key, "")) for key, value in values.items()]
        return frame_of(rows, ("key", "value", "unit", "source"), "key")

    def with_values(self, values: Mapping[str, Any] | None = None, /, **named: Any) -> "Rig":
        """Return the rig with other values.

        Args:
            values: Values by dotted key: texts with units, or numbers in SI units.
            named: Values by the last part of a key, if it is unique: `overlap="0.3 mm"`.

        Raises:
            RigError: A key is unknown or ambiguous, or the new rig is not valid.
        """
        changed = Rig(load.with_values(self.values, named_values(values, named)))
        changed.path, changed._changed = self.path, True
        return changed

    def plan(self) -> "Plan":
        """Return the plan of one press, whether or not it is feasible."""
        from sautereau.analysis.results.plan import plan

        return plan(self.values)

    def predict(
        self, values: Mapping[str, Any] | None = None, /, *, level: str = "auto", **named: Any
    ) -> "Prediction":
        """Return the press that the model predicts, with other values as in `with_values`.

        Raises:
            ModelError: The level has no solution for this rig.
        """
        from sautereau.analysis.model.predict import predict
        from sautereau.analysis.results.prediction import Prediction

        rig = self.with_values(values, **named).values
        return Prediction(rig, predict(rig, level))

    def sweep(self, values: Mapping[str, Any] | None = None, /, **named: Any) -> "Sweep":
        """Return the model's predictions over a grid of values.

        Args:
            values: Lists of texts with units or of SI numbers, by dotted key; `...` is the range
                assumed in the rig.
            named: The same by the last part of the key: `overlap=["0.2 mm", "0.3 mm"]`.

        Raises:
            ModelError: A value cannot be varied. A case out of range only has a status.
        """
        from sautereau.analysis.results.sweep import sweep

        return sweep(self.values, {**(values or {}), **named})

    def save(self, path: str | Path) -> Path:
        """Write the rig into a new file.

        Raises:
            RigError: The file exists, or cannot be written.
        """
        from sautereau.rig.disk import make_folder, write_durably
        from sautereau.rig.text import rig_text

        path = Path(path)
        try:
            make_folder(path.parent)
            write_durably(path, rig_text(self.values))
        except OSError as error:
            raise RigError(
                f"rig file {path}: cannot be written: {error.strerror}; give another path"
            ) from error
        return path
