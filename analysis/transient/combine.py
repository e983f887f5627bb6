"""One oscillation of the bench from its modes in several phases and presses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from sautereau.analysis.transient.evidence import PHASES, Examined, ObservedMode
from sautereau.trajectory.motion import Floats

SAME = 0.04
"""Relative difference up to which frequencies belong to one oscillation. Finger contact and string
add stiffness in some phases."""
DEVIATIONS = 3.0
"""Standard uncertainties by which frequencies of one oscillation may differ in addition."""
VISIBLE = 2.0
"""An oscillation is absent from a stretch that does not show it if it would be this many times
larger than the smallest visible amplitude there."""
CONSISTENT = 0.01  # Smallest probability of the scatter of frequencies that agree


@dataclass(frozen=True)
class Oscillation:
    """Modes of the same frequency in several phases and presses."""

    observed: tuple[ObservedMode, ...]
    frequency: float
    """Hz, weighted mean."""
    frequency_std: float
    """Hz, standard uncertainty; it includes the scatter if that is larger than expected."""
    damping: float
    """Damping ratio, weighted mean."""
    damping_std: float
    """Standard uncertainty of the damping ratio."""
    consistent: bool
    """Whether the frequencies agree within their uncertainties."""
    seen: dict[str, float]
    """For each phase: fraction of the stretches that show it, among those that could show it."""
    presses: int
    """Number of presses that show it."""
    speeds: tuple[float, float]
    """m/s, jack speeds of the slowest and the fastest of these presses."""

    @property
    def clearest(self) -> ObservedMode:
        """The mode whose ratio of force to velocity has the smallest uncertainty."""
        return min(self.observed, key=lambda each: (bool(each.unseen), each.ratio_std))


def combine(examined: Sequence[Examined]) -> list[Oscillation]:
    """Return the oscillations of several presses on one bench, ordered by frequency."""
    modes = sorted(
        (each for press in examined for each in press.observed), key=lambda o: o.mode.frequency
    )
    groups: list[list[ObservedMode]] = []
    for each in modes:
        if groups and _same(groups[-1], each):
            groups[-1].append(each)
        else:
            groups.append([each])
    # An oscillation that only the rest shows is not transient.
    return [_oscillation(g, examined) for g in groups if any(o.phase != "rest" for o in g)]


def _same(group: list[ObservedMode], each: ObservedMode) -> bool:
    mean, std = _mean([(o.mode.frequency, o.mode.frequency_std) for o in group])[:2]
    doubt = DEVIATIONS * float(np.hypot(std, each.mode.frequency_std))
    return each.mode.frequency - mean < SAME * mean + min(doubt, SAME * mean)


def _mean(values: list[tuple[float, float]]) -> tuple[float, float, bool]:
    """Return weighted mean, standard uncertainty, and whether the scatter is as expected."""
    value, std = np.array(values).T
    weight = 1 / std**2
    mean = float(weight @ value / weight.sum())
    if len(value) == 1:
        return mean, float(std[0]), True
    scatter = float(weight @ (value - mean) ** 2)
    dof = len(value) - 1
    spread = float(np.sqrt(max(1.0, scatter / dof) / weight.sum()))
    return mean, spread, bool(chi2.sf(scatter, dof) > CONSISTENT)


def _oscillation(group: list[ObservedMode], examined: Sequence[Examined]) -> Oscillation:
    frequency, frequency_std, consistent = _mean(
        [(o.mode.frequency, o.mode.frequency_std) for o in group]
    )
    damping, damping_std, _ = _mean([(o.mode.damping, o.mode.damping_std) for o in group])
    typical = np.median([np.abs(o.mode.amplitude) for o in group], axis=0)
    shown = {(o.press, o.phase) for o in group}
    numbers = sorted({o.press for o in group})
    speeds = [examined[number].speed for number in numbers]
    return Oscillation(
        tuple(group),
        frequency,
        frequency_std,
        damping,
        damping_std,
        consistent,
        _seen(shown, typical, examined),
        len(numbers),
        (min(speeds), max(speeds)),
    )


def _seen(
    shown: set[tuple[int, str]], typical: Floats, examined: Sequence[Examined]
) -> dict[str, float]:
    found = {}
    for phase in PHASES:
        cases = []
        for number, press in enumerate(examined):
            stretches = [s for s in press.stretches if s.phase == phase]
            if (number, phase) in shown:
                cases.append(1.0)
            elif any(np.any(typical > VISIBLE * s.modes.smallest) for s in stretches):
                cases.append(0.0)
        if cases:
            found[phase] = float(np.mean(cases))
    return found
