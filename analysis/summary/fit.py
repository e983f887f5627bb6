"""A fit as JSON and as text."""

from collections.abc import Sequence
from typing import Any

from sautereau.analysis.identify.identified import IDENTIFIABLE, Estimate, Identified
from sautereau.analysis.identify.profile import Profile
from sautereau.analysis.summary.text import counted
from sautereau.rig.quantities import QUANTITIES


def fit_summary(found: Identified, profiles: Sequence[Profile] = ()) -> dict[str, Any]:
    """Return a fit as JSON; SI units."""
    result: dict[str, Any] = {
        "parameters": {
            e.name: {
                "unit": e.unit,
                "value": e.value,
                "std": e.std,
                "ci95": None if e.low is None else [e.low, e.high],
                "start": e.start,
                "at_bound": e.at_bound,
                "identifiable": e.identifiable,
            }
            for e in found.estimates
        },
        "correlation": {
            a.name: {b.name: float(found.correlation[i, j]) for j, b in enumerate(found.estimates)}
            for i, a in enumerate(found.estimates)
        },
        "identifiable": {
            "all": all(c.identifiable for c in found.combinations),
            "identifiable_below": IDENTIFIABLE,
            "combinations": [
                {"weights": dict(c.weights), "std": c.std, "identifiable": c.identifiable}
                for c in found.combinations
            ],
        },
        "presses": list(found.presses),
        "releases": found.releases,
        "level": found.level,
        "residual": found.residual,
        "residual_before": found.residual_before,
        "rise_residual": found.rise_residual,
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


def fit_lines(found: Identified, profiles: Sequence[Profile] = ()) -> list[str]:
    """Return a fit as text."""
    lines = [
        f"rig {found.rig.name}, plectrum model {found.level}, fitted to"
        f" {counted(len(found.presses), 'press')} with {counted(found.releases, 'release')}",
        f"{QUANTITIES['residual'].label}: {found.residual_before * 1e3:.3g} mN before the fit,"
        f" {found.residual * 1e3:.3g} mN after",
        *(_estimate_line(estimate) for estimate in found.estimates),
    ]
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
    return lines + [f"warning: {warning}" for warning in found.warnings]


def _estimate_line(estimate: Estimate) -> str:
    unit = estimate.unit.replace("**", "^").replace("*", " ")
    spread = "undetermined" if estimate.std is None else f"+- {estimate.std:.2g}"
    remark = "" if estimate.identifiable else "  not identifiable from these recordings"
    return (
        f"  {estimate.name:<28} {estimate.value:>11.5g} {spread} {unit}"
        f" (rig: {estimate.start:.5g}){remark}"
    )
