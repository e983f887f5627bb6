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
from sautereau.analysis.summary.text import counted, part_of
from sautereau.rig.quantities import QUANTITIES


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
        "quality": _without(found.quality, "repetition", "quiet"),
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
        *(line for estimate in found.estimates for line in _estimate_lines(estimate)),
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
            f"  {'undetermined' if c.std is None else f'{c.std:.2g}':<12}"
            f" {'identifiable' if c.identifiable else 'not identifiable':<16} {c}"
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
    verdict = "the model fits" if good.fits else "THE MODEL DOES NOT FIT"
    return f"{verdict}: residual {', '.join(parts)}"


def _suggestion_line(suggestion: Suggestion) -> str:
    gain = f"weighted sum of squares {suggestion.reduction:.0f} less"
    if suggestion.name == CONTACT:
        return f'  suggested: set {CONTACT} = "surface" in the rig ({gain})'
    value = _quantity(suggestion.value, suggestion.unit)
    return f"  suggested: free {suggestion.name}, about {value} ({gain})"


def _quantity(value: float, unit: str) -> str:
    return f"{value:.4g} {unit.replace('**', '^').replace('*', ' ')}".strip()


def _table(found: Identified) -> list[str]:
    """Return the effects of fixed numbers and calibrations, a line each."""
    names = [e.name.rpartition(".")[2] for e in found.estimates]
    widths = [max(len(name), 9) for name in names]
    heads = "  ".join(f"{name:>{width}}" for name, width in zip(names, widths, strict=True))
    lines = [
        "change of each result by a change of a number that is not a result (* stated in the rig):",
        f"  {'number':<28} {'change':>18}  {heads}",
    ]
    for s in found.sensitivity:
        change = _quantity(s.change, s.unit) + "*" * s.stated
        effects = [f"{100 * s.effects[e.name]:+.2f} %" for e in found.estimates]
        row = "  ".join(f"{e:>{width}}" for e, width in zip(effects, widths, strict=True))
        lines.append(f"  {s.name:<28} {change:>18}  {row}")
    return lines


def _estimate_lines(estimate: Estimate) -> list[str]:
    """Return the value, and what would make it identifiable."""
    unit = estimate.unit.replace("**", "^").replace("*", " ")
    spread = "undetermined" if estimate.std is None else f"+- {estimate.std:.2g}"
    line = (
        f"  {estimate.name:<28} {estimate.value:>11.5g} {spread} {unit} (rig: {estimate.start:.5g})"
    )
    if estimate.identifiable:
        return [line]
    helps = [f"at best +- {m.std:.2g} {unit} if you {m.what}" for m in estimate.measurements]
    return [
        f"{line}  not identifiable from these recordings: needs +- {estimate.needed:.2g} {unit}",
        *(f"      {each}" for each in helps or ["no single measurement would change this"]),
    ]
