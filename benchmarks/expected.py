"""Expected uncertainties: those before any press over those of fits to recorded presses.

The benches are those of the independent simulator. Their instruments are drawn from what the rig
states. On a key that bends, the fits count the change of the values by whitening as an uncertainty
too; no plan knows it, and it is omitted here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.figures import Figure
from benchmarks.identify import FREE
from benchmarks.independent import Conditions
from benchmarks.uncertain import NOMINAL, RANGES, conditions, recorded, true
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.compliant import fit_presses
from sautereau.analysis.identify.fit import informative
from sautereau.analysis.identify.forecast import Planned, WhiteNoise, forecast, together
from sautereau.analysis.identify.information import Information
from sautereau.analysis.identify.parameters import MODE as MODE_NAME
from sautereau.analysis.identify.quality import quality
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.instrument import KeyMode

BENCHES = range(32)  # Instruments; each is pressed at all speeds
STATED = {"inertia": 7e-4, "coulomb": 1e-3}  # What the rig says of the fitted numbers
KNOWN = RANGES | {
    "plectrum.overlap": (0.2e-3, 0.32e-3),
    "plectrum.youngs_modulus": (2.3e9, 3.5e9),
    "key.inertia": (5.5e-4, 9e-4),
    "key.pivot_coulomb_friction": (0.4e-3, 1.6e-3),
}
FRICTION_STD = 0.1  # Of the plectrum, as `identify` assumes
NOISE = WhiteNoise(5e-3, 0.05e-3)  # Of the simulator's sensors
SPEED, SLOW, FAST = 0.072, 0.036, 0.12  # m/s
CHOICES = {
    "2 presses": {SPEED: 2},
    "2 slow presses": {SLOW: 2},
    "2 fast presses": {FAST: 2},
    "a press and a slow one": {SPEED: 1, SLOW: 1},
    "4 presses": {SPEED: 4},
}
"""Numbers of presses by their speed [m/s]."""
BENDS = 350.0  # Hz, of the free key; pressed it rings at 180 to 190 Hz
MODE = KeyMode.model_construct(frequency=185.0, frequency_std=5.0, damping=0.02, damping_std=0.01)
"""Of the pressed key, as its rig states it."""
LIMIT, EACH = 0.10, 0.25
"""Dimensionless: largest error of the mean ratio of a parameter, and of the ratio of a choice."""


@dataclass(frozen=True)
class Outcome:
    """Standard uncertainties of one fit, SI; shape (parameters,)."""

    total: np.ndarray
    noise: np.ndarray


def instrument(number: int, bends: bool) -> Conditions:
    """Return a bench whose numbers are drawn from what the rig states of them."""
    rng = np.random.default_rng([45, 3, number])
    drawn = true(rng, KNOWN)
    friction = min(abs(FRICTION_STD * float(rng.standard_normal())), 0.5)
    base = replace(
        NOMINAL,
        inertia=drawn["key.inertia"],
        pivot_coulomb=drawn["key.pivot_coulomb_friction"],
        return_speed=0.04,
        choirs=(replace(NOMINAL.choirs[0], friction=friction),),
    )
    made = conditions(rng, drawn, base)
    return replace(made, bending_frequency=BENDS) if bends else made


def pressed(
    made: Conditions, speed: float, count: int, bends: bool
) -> tuple[list[Press], list[Phases]]:
    """Return presses of a bench at one speed, with the rig of its experimenter."""
    presses, phases = recorded(replace(made, speed=speed), range(1, 1 + count), KNOWN, **STATED)
    if bends:
        key = presses[0].rig.key.model_copy(update={"modes": (MODE,)})
        presses = [replace(p, rig=p.rig.model_copy(update={"key": key})) for p in presses]
    return presses, phases


def realised(presses: list[Press], phases: list[Phases], bends: bool) -> Outcome | None:
    """Return the uncertainties of a fit, without the change of the values by whitening.

    It is None if the fit has modes that the key has not, or lacks those that it has.
    """
    rig = presses[0].rig
    fitted = fit_presses(
        [replace(p, rig=rig) for p in presses], phases, FREE, None, "auto", 1, False
    )
    found = fitted.problem
    data = found.white(found.differences(fitted.values / found.scales))
    rows = informative(fitted, data) / np.sqrt(quality(fitted).repetition)
    names, scales = [p.name for p in found.free], found.scales
    if bends != any(name.startswith(MODE_NAME) for name in names):
        return None
    known = Information(names, rows, found.prior_jacobian, np.zeros(len(names)))
    own = [names.index(name) for name in FREE]
    return Outcome(known.stds[own] * scales[own], known.noise_stds[own] * scales[own])


def planned(presses: list[Press]) -> dict[str, Outcome]:
    """Return the uncertainties that are expected of each choice for a rig."""
    rig, speeds = presses[0].rig, (SPEED, SLOW, FAST)
    rows: dict[str, list[np.ndarray]] = {name: [] for name in CHOICES}
    for problem, data in forecast(rig, FREE, [Planned(v) for v in speeds], noise=NOISE):
        own = [[p.name for p in problem.free].index(name) for name in FREE]
        for name, counts in CHOICES.items():
            known = together(problem, data, [counts.get(v, 0) for v in speeds])
            stds = np.stack([known.stds[own], known.noise_stds[own]])
            rows[name].append(stds * problem.scales[own])
    return {name: Outcome(*np.mean(own, axis=0)) for name, own in rows.items()}


def outcomes(benches: range, bends: bool) -> Iterator[tuple[str, Outcome, Outcome]]:
    """Yield each choice with its expected and its realised uncertainties, for each bench."""
    plans: dict[str, Outcome] = {}
    for number in benches:
        made = instrument(number, bends)
        every = {v: pressed(made, v, max(c.get(v, 0) for c in CHOICES.values()), bends)
                 for v in (SPEED, SLOW, FAST)}  # fmt: skip
        plans = plans or planned(every[SPEED][0])
        for name, counts in CHOICES.items():
            presses = [p for v, n in counts.items() for p in every[v][0][:n]]
            phases = [p for v, n in counts.items() for p in every[v][1][:n]]
            try:
                found = realised(presses, phases, bends)
            except AnalysisError:
                continue
            if found is not None:
                yield name, plans[name], found


def run() -> list[Figure]:
    """Return the ratios of expected and realised uncertainties, for each choice and on average."""
    figures = []
    for what, bends in (("rigid key", False), (f"key bends at {BENDS:g} Hz", True)):
        ratios: dict[str, list[np.ndarray]] = {name: [] for name in CHOICES}
        for name, plan, fit in outcomes(BENCHES, bends):
            ratios[name].append(np.stack([plan.total, fit.total]))
        figures += figures_of(what, ratios)
    return figures


def figures_of(what: str, stds: dict[str, list[np.ndarray]]) -> list[Figure]:
    """Return the figures of one kind of key; a parameter that is never determined has none."""
    means = {name: np.array(own).mean(axis=0) for name, own in stds.items()}
    figures = []
    for k, name in enumerate(FREE):
        ratios = {choice: own[0, k] / own[1, k] for choice, own in means.items()}
        if not np.isfinite(list(ratios.values())).all():
            continue
        at = f"{what}: {name}, expected over realised uncertainty less 1"
        for choice, ratio in ratios.items():
            figures.append(Figure(f"{at}: {choice}", ratio - 1, "1", "limit", EACH))
        mean = float(np.mean(list(ratios.values())))
        figures.append(Figure(f"{at}: mean", mean - 1, "1", "limit", LIMIT))
    return figures
