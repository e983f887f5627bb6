"""What stands beside the plots: their captions, and the buttons that zoom."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from sautereau.analysis.report.contents import Contents


@dataclass(frozen=True)
class Zoom:
    """One button that shows another part of the plot over time."""

    text: str
    range: str = ""
    """ms, as JSON holds a pair; empty to show all, or to widen."""
    by: str = ""
    """1, factor of the part that is shown."""
    shift: str = "0"
    """1, by how much of the part its middle moves."""


def zooms(contents: Contents) -> list[Zoom]:
    """Return the buttons of the plot over time, the one that it opens with first."""
    held = [record.phases.plucks[0] for record in contents.presses if record.phases.plucks]
    bottom = max(record.phases.bottom for record in contents.presses)
    found = [Zoom("Going down", _ms(0.0, bottom))] if bottom > 0 else []
    if held:
        contact = min(pluck.contact for pluck in held), max(pluck.contact for pluck in held)
        release = min(pluck.release for pluck in held), max(pluck.release for pluck in held)
        margin = 0.2 * (release[1] - contact[0])
        found += [
            Zoom("String held", _ms(contact[0] - margin, release[1] + margin)),
            Zoom("Contact", _ms(contact[0] - 2e-3, contact[1] + 2e-3)),
            Zoom("Release", _ms(release[0] - 1e-3, release[1] + 1e-3)),
        ]
    return [
        *found,
        Zoom("Whole recording"),
        Zoom("Zoom in", by="0.5"),
        Zoom("Zoom out", by="2"),
        Zoom("Earlier", by="1", shift="-0.5"),
        Zoom("Later", by="1", shift="0.5"),
    ]


def _ms(start: float, stop: float) -> str:
    return json.dumps([start * 1e3, stop * 1e3])


def about_time(contents: Contents) -> str:
    """Return what the plot over time shows, for those who do not see it as well."""
    presses = contents.presses
    drawn = sum(bool(record.traces) for record in presses)
    held = [record.phases.plucks[0] for record in presses if record.phases.plucks]
    text = (
        f"Deflection under the laser, speed of the jack and force of the finger of {drawn} of"
        f" {len(presses)} presses over the time from the trigger."
    )
    if held:
        contact, release = _mean([p.contact for p in held]), _mean([p.release for p in held])
        text += (
            f" {len(held)} of the presses have a pluck: the string is met at {contact * 1e3:.3f} ms"
            f" (open circles) and let go at {release * 1e3:.3f} ms (crosses) on the mean."
        )
    if len(contents.conditions) == 1 and held:
        text += " The shading parts the three phases at these means."
    return (
        f"{text} Each trace has at most {contents.points + 2} of its samples: the least and the"
        f" largest of each even stretch, so that peaks stand but the samples between are not there."
        f" The features were found in all samples, {contents.rate:g} a second."
    )


def about_force(contents: Contents) -> str:
    """Return what the plot of force on deflection shows."""
    drawn = sum(record.held is not None for record in contents.presses)
    models = sum(condition.prediction is not None for condition in contents.conditions)
    return (
        f"Force of the finger on the deflection under the laser from contact on, of {drawn}"
        f" presses{', and what the model predicts (dashed)' if models else ''}; traces are thinned"
        " out as above."
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
