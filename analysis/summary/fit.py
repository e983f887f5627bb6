"""A fit as JSON and as text."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from sautereau.analysis.identify.combinations import IDENTIFIABLE
from sautereau.analysis.identify.fixed import Sensitivity, Suggestion
from sautereau.analysis.identify.identified import Estimate, FittedMode, Identified
from sautereau.analysis.identify.parameter_names import CONTACT
from sautereau.analysis.identify.profile import Profile
from sautereau.analysis.identify.quality import Quality
from sautereau.analysis.summary.text import counted, part_of, table
from sautereau.rig.quantities import QUANTITIES

TOGETHER = 2  # Number of results in one table of effects, which then fits into 80 columns


def fit_summary(found: Identified, profiles: Sequence[Profile] = ()) -> dict[str, Any]:
    """Return a fit as JSON; SI units."""
    names = [e.name for e in found.estimates]
    result: dict[str, Any] = {
        "parameters": {
            e.name: _without(e, "name", "low", "high")
            | {"ci95": None if e.low is None else [e.low, e.high]}
            for e in found.estimates
        },
        "correlation": {
            name: dict(zip(names, row, strict=True))
            for name, row in zip(names, found.correlation.tolist(), strict=True)
        },
        "identifiable": {
            "all": all(c.identifiable for c in found.combinations),
            "identifiable_below": IDENTIFIABLE,
            "combinations": [asdict(c) for c in found.combinations],
        },
        "modes": [asdict(mode) for mode in found.modes],
        "fits": found.quality.fits,
        "quality": _without(found.quality, "repetition", "quiet", "repeats"),
        "suggested": [asdict(s) for s in found.suggested],
        "sensitivity": {s.name: _without(s, "name") for s in found.sensitivity},
        "presses": list(found.presses),
        **part_of(found, "releases", "level", "residual", "residual_before", "rise_residual"),
        "force_offsets": list(found.force_offsets),
        "warnings": list(found.warnings),
    }
    if profiles:
        result["profiles"] = {
            p.name: {
                "values": p.values.tolist(),
                "rises": p.rises.tolist(),
                "ci95": [p.low, p.high],
            }
            for p in profiles
        }
    return result


def _without(part: Estimate | Quality | Sensitivity, *names: str) -> dict[str, Any]:
    """Return the fields of a part of the result, except some."""
    return {name: value for name, value in asdict(part).items() if name not in names}


def fit_lines(
    found: Identified, profiles: Sequence[Profile] = (), *, every: bool = False
) -> list[str]:
    """Return a fit as text.

    Args:
        every: Whether to add the table of the fixed numbers' effects.
    """
    lines = [
        f"rig {found.rig.name}, plectrum model {found.level}, fitted to"
        f" {counted(len(found.presses), 'press')} with {counted(found.releases, 'release')}",
        f"{QUANTITIES['residual'].label}: {found.residual_before * 1e3:.3g} mN before the fit,"
        f" {found.residual * 1e3:.3g} mN after",
        *map(_mode_line, found.modes),
        _quality_line(found.quality),
        *(f"  {reason}" for reason in found.quality.reasons),
        *(_suggestion_line(suggestion) for suggestion in found.suggested),
        *table(map(_estimate_cells, found.estimates), left=(0, 2, 3, 4), indent=2, gap=1),
        *(line for estimate in found.estimates for line in _needed_lines(estimate)),
    ]
    if not found.quality.fits:
        lines.append("no 95 % intervals: the uncertainties are those of a model that fits")
    for profile in profiles:
        ends = ["a bound" if end is None else f"{end:.5g}" for end in (profile.low, profile.high)]
        lines.append(f"  {profile.name}: 95 % by profile likelihood, {ends[0]} to {ends[1]}")
    if all(c.identifiable for c in found.combinations):
        lines.append("all parameters are identifiable from these recordings")
    else:
        lines.append(
            "not all parameters are identifiable from these recordings; standard uncertainty of"
            " the combinations of their relative changes:"
        )
        lines += [
            f"  {'undetermined' if c.std is None else f'{c.std:.2g}'},"
            f" {'identifiable' if c.identifiable else 'not identifiable'}: {c}"
            for c in found.combinations
        ]
    if every:
        lines += _table(found)
    return lines + [f"warning: {warning}" for warning in found.warnings]


def _mode_line(mode: FittedMode) -> str:
    spread = "" if mode.frequency_std is None else f" +- {mode.frequency_std:.2g}"
    return f"compliant key: mode at {mode.frequency:.4g}{spread} Hz, damping {mode.damping:.2g}"


def _quality_line(good: Quality) -> str:
    parts = [f"{good.free_residual * 1e3:.3g} mN without a string"]
    if good.held_residual is not None:
        parts.append(f"{good.held_residual * 1e3:.3g} mN while it is held")
    if good.noise is not None:
        parts.append(f"{good.noise * 1e3:.3g} mN of noise at rest")
    return f"{good.verdict}{': ' if good.noise is not None else '; '}residual {', '.join(parts)}"


def _suggestion_line(suggestion: Suggestion) -> str:
    gain = f"weighted sum of squares {suggestion.reduction:.0f} less"
    if suggestion.name == CONTACT:
        return f'  suggested: set {CONTACT} = "surface" in the rig ({gain})'
    value = _quantity(suggestion.value, suggestion.unit)
    return f"  suggested: free {suggestion.name}, about {value} ({gain})"


def _quantity(value: float, unit: str) -> str:
    return f"{value:.4g} {_unit(unit)}".strip()


def _table(found: Identified) -> list[str]:
    """Return the effects of fixed numbers and calibrations, a line each."""
    lines = [
        "change in % of each result by a change of a number that is not a result"
        " (* its standard uncertainty):"
    ]
    for first in range(0, len(found.estimates), TOGETHER):
        names = [e.name for e in found.estimates[first : first + TOGETHER]]
        rows = [("number", "change", *(name.rpartition(".")[2] for name in names))]
        for s in found.sensitivity:
            change = _quantity(s.change, s.unit) + "*" * s.stated
            rows.append((s.name, change, *(f"{100 * s.effects[name]:+.2f}" for name in names)))
        lines += table(rows, indent=2, gap=1)
    return lines


def _estimate_cells(estimate: Estimate) -> tuple[str, ...]:
    """Return name, value, standard uncertainty, unit and the rig's own value."""
    spread = "undetermined" if estimate.std is None else f"+- {estimate.std:.2g}"
    rig = f"(rig: {estimate.rig_value:.5g})"
    return estimate.name, f"{estimate.value:.5g}", spread, _unit(estimate.unit), rig


def _needed_lines(estimate: Estimate) -> list[str]:
    """Return what would make a parameter identifiable; nothing if it is."""
    if estimate.identifiable:
        return []

    def spread(std: float) -> str:
        return f"+- {std:.2g} {_unit(estimate.unit)}".strip()

    prior = ""
    if estimate.std is not None and estimate.std < estimate.needed:
        unaided = "undetermined" if estimate.unaided is None else spread(estimate.unaided)
        prior = f", and without its own prior it is {unaided}"
    helps = [f"at best {spread(m.std)} if you {m.what}" for m in estimate.measurements]
    return [
        f"{estimate.name} is not identifiable from these recordings:"
        f" {spread(estimate.needed)} is needed{prior}",
        *(f"  {each}" for each in helps or ["no single measurement would change this"]),
    ]


def _unit(unit: str) -> str:
    return unit.replace("**", "^").replace("*", " ")
