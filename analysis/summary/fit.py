"""What a fit has found, as plain values and as lines."""

from collections.abc import Sequence
from typing import Any

from sautereau.analysis.identify.identified import Estimate, Identified
from sautereau.analysis.identify.profile import Profile
from sautereau.analysis.identify.told import TOLD


def fit_summary(found: Identified, profiles: Sequence[Profile] = ()) -> dict[str, Any]:
    """Return a fit as JSON would hold it; SI units."""
    result: dict[str, Any] = {
        "parameters": {
            e.name: {
                "unit": e.unit,
                "value": e.value,
                "std": e.std,
                "ci95": None if e.low is None else [e.low, e.high],
                "start": e.start,
                "at_bound": e.at_bound,
                "identifiable": e.told,
            }
            for e in found.estimates
        },
        "correlation": {
            a.name: {b.name: float(found.correlation[i, j]) for j, b in enumerate(found.estimates)}
            for i, a in enumerate(found.estimates)
        },
        "identifiable": {
            "all": all(c.told for c in found.combinations),
            "told_below": TOLD,
            "combinations": [
                {"weights": dict(c.weights), "std": c.std, "told": c.told}
                for c in found.combinations
            ],
        },
        "presses": list(found.presses),
        "releases": found.releases,
        "level": found.level,
        "rms": found.rms,
        "rms_before": found.rms_before,
        "rise_error": found.rise_error,
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
    count = len(found.presses)
    lines = [
        f"rig {found.rig.name}, plectrum as {found.level}, fitted to {count}"
        f" press{'es' * (count > 1)} with {found.releases} releases:",
        f"the model missed {found.rms_before * 1e3:.3g} mN rms of the force and misses"
        f" {found.rms * 1e3:.3g} mN",
        *(_estimate_line(estimate) for estimate in found.estimates),
    ]
    for profile in profiles:
        ends = ["a bound" if end is None else f"{end:.5g}" for end in (profile.low, profile.high)]
        lines.append(f"  {profile.name}: 95 % by its profile from {ends[0]} to {ends[1]}")
    if all(c.told for c in found.combinations):
        lines.append("these data tell all of them apart")
    else:
        lines.append("these data do not tell all of them apart; changes over their scales:")
        lines += [
            f"  {'told' if c.told else 'not told'}"
            f" ({'not seen at all' if c.std is None else f'+- {c.std:.2g}'}): {c}"
            for c in found.combinations
        ]
    return lines + [f"warning: {warning}" for warning in found.warnings]


def _estimate_line(estimate: Estimate) -> str:
    unit = estimate.unit.replace("**", "^").replace("*", " ")
    spread = "nothing bounds it"
    if estimate.std is not None:
        spread = f"+- {estimate.std:.2g}"
    told = "" if estimate.told else "  NOT TOLD by these data"
    return (
        f"  {estimate.name:<28} {estimate.value:>11.5g} {spread} {unit}"
        f" (was {estimate.start:.5g}){told}"
    )
