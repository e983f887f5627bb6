"""Fits to the presses of a session, as `sautereau identify --json` writes them."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import AliasChoices, Field, FiniteFloat

from sautereau.analysis.results.prediction import Written, read_part
from sautereau.analysis.text import counted, in_rig_units
from sautereau.rig.quantities import QUANTITIES

PATTERN = "fit*.json"  # Names of their files in the session's folder


VERDICTS = {
    True: "",
    False: "; the model does not fit",
    None: "; whether the model fits is unknown",
}  # Text about a fit by whether the model fits


class _Estimate(Written):
    unit: str
    value: FiniteFloat
    std: FiniteFloat | None
    std_noise: FiniteFloat | None = None
    std_inputs: FiniteFloat | None = None
    ci95: tuple[FiniteFloat, FiniteFloat] | None
    identifiable: bool


class _Identified(Written):
    parameters: dict[str, _Estimate]
    presses: tuple[str, ...]
    level: str
    residual: FiniteFloat = Field(validation_alias=AliasChoices("residual", "rms"))
    residual_before: FiniteFloat = Field(
        validation_alias=AliasChoices("residual_before", "rms_before")
    )
    fits: bool | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fit:
    """Parameters fitted to presses, as the page shows them."""

    name: str
    """Name of the file."""
    about: str
    rows: tuple[tuple[str, ...], ...]
    """Parameter, value, standard uncertainties from noise and inputs and in total, 95 % interval;
    the parts are `-` in files of earlier versions."""
    warnings: tuple[str, ...] = ()


def read_fit(path: Path) -> Fit:
    """Read a fit.

    Raises:
        AnalysisError: The file cannot be read, or was not written by `identify`.
    """
    how = f"write it with `sautereau identify ... --json > {path.name}`"
    found = read_part(path, _Identified, f"{how}, or give it a name other than {PATTERN}")
    return Fit(
        path.name,
        f"fitted to {counted(len(found.presses), 'press')}, plectrum model {found.level};"
        f" {QUANTITIES['residual'].label}: {found.residual_before * 1e3:.3g} mN before the fit,"
        f" {found.residual * 1e3:.3g} mN after{VERDICTS[found.fits]}",
        tuple(_row(name, estimate) for name, estimate in found.parameters.items()),
        found.warnings,
    )


def _row(name: str, found: _Estimate) -> tuple[str, ...]:
    stds = found.std_noise, found.std_inputs, found.std
    value, (*parts, total), unit = in_rig_units(found.value, found.std, found.unit, stds)
    ends = [in_rig_units(end, found.std, found.unit)[0] for end in found.ci95 or ()]
    note = "" if found.identifiable else ", not identifiable from these recordings"
    return (
        f"{name}{note}",
        f"{value} {unit}".strip(),
        *parts,
        "undetermined" if found.std is None else total,
        " to ".join(ends) or "none",
    )
