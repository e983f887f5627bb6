"""Identification: fits to presses of benches that differ from their rig in more than is freed.

Of each bench the plectrum, the key's inertia and friction and the clearance differ from the rig,
and so do the gains and delays of the sensors, by what the rig states; on half of them the plectrum
has friction of which the rig does not know. The string lies on the surface, in the rig as well.

The simulation has steps of 20 us: with the 100 us of the scene its force is 20 us late, which is
not an error of a bench.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.figures import BenchmarkFault, Figure, timed
from benchmarks.independent import ONE_FACTOR, Conditions, Pressed, press, random_conditions
from benchmarks.simulated import acquired, judged_press
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.identified import Identified, identify
from sautereau.analysis.identify.parameters import value_of
from sautereau.analysis.loading.press import Press, press_of
from sautereau.analysis.phases import Phases, find_phases
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import Scene, load_scene

RESULTS = ("plectrum.bending_stiffness", "plectrum.overlap", "key.inertia")
FREE = (*RESULTS, "key.pivot_coulomb_friction")
BENCHES, PRESSES = range(400, 500), 5
"""Random benches, none of which was seen in the development, and the number of presses of each."""
STEP = 20e-6  # s, step of the simulation
JUDGED_PRESSES = 3  # Presses of each bench of the independent simulator, which draws every factor
COMPLIANT = (
    *("all stiff", "key bends at 1200 Hz", "key bends at 350 Hz", "key heaves at 120 Hz"),
    *("jack on cloth of 400 kN/m", "jack on cloth of 60 kN/m", "soft pad"),
)
"""Conditions of the independent simulator with one soft part or none."""
TABLE = (
    *COMPLIANT[:3],
    *("key bends at 220 Hz", *COMPLIANT[3:], "transducer rings at 1 kHz", "plectrum friction 0.2"),
)
"""Conditions of the table that this module prints as a command."""
RANDOM = range(100, 110)  # Benches of the independent simulator with every factor drawn
LIMIT, COVERED = 0.05, 0.88
"""Dimensionless: largest error of a result that is reported as identifiable, by a model that fits;
and the least fraction of them that are within it and in their 95 % interval."""


@dataclass(frozen=True)
class Bench:
    """A bench, and what its experimenter knows of it."""

    nominal: Rig
    """The rig of the experimenter."""
    true: Rig
    """The same, with the true sensors."""
    scene: Scene
    """The true instrument."""


@dataclass(frozen=True)
class Outcomes:
    """Results of many benches; arrays of shape (benches, results)."""

    errors: np.ndarray
    """Dimensionless, fitted / true - 1."""
    covered: np.ndarray
    """Whether the 95 % interval contains the true value."""
    claimed: np.ndarray
    """Whether it is reported as identifiable, by a model that fits."""
    fits: np.ndarray
    """Whether the model is reported to fit; shape (benches,)."""
    seconds: float
    """Median time of a fit."""

    @property
    def right(self) -> np.ndarray:
        """Whether a result is within `LIMIT` and its interval."""
        return (np.abs(self.errors) < LIMIT) & self.covered


def bench(seed: int) -> Bench:
    """Return a random bench."""
    random = np.random.default_rng([8, 15, seed])
    uniform = random.uniform
    truth = {
        "plectrum.youngs_modulus": f"{uniform(1.8, 3.8)} GPa",
        "plectrum.overlap": f"{uniform(0.18, 0.36)} mm",
        "plectrum.friction": float(uniform(0.03, 0.25)) if uniform() < 0.5 else 0.0,
        "plectrum.contact": "surface",
        "key.inertia": f"{uniform(5.5e-4, 9.5e-4)} kg m^2",
        "key.pivot_coulomb_friction": f"{uniform(0.4, 2.5)} mN m",
        "jack.string_clearance": f"{uniform(1.7, 2.2)} mm",
    }
    nominal = measured(with_values(load_rig(), {"plectrum.contact": "surface"}))
    sensors: dict[str, str] = {}
    for number, channel in enumerate(nominal.daq.channels):
        at = f"daq.channels.{number}"
        scale = channel.scale * (1 + channel.gain_std * random.standard_normal())
        sensors[f"{at}.scale"] = f"{scale} {'m/s/V' if number == 0 else 'N/V'}"
        delay = channel.delay + channel.delay_std * random.standard_normal()
        sensors[f"{at}.delay"] = f"{max(0.0, delay)} s"
    scene = load_scene("paper").model_copy(update={"truth": truth, "step": STEP})
    return Bench(nominal, with_values(nominal, sensors), scene)


def measured(rig: Rig) -> Rig:
    """Return a rig whose experimenter has measured what is not fitted: without its ranges."""
    known = (*FREE, "jack.damper")
    kept = {name: ends for name, ends in rig.assumed.items() if name.startswith(known)}
    return rig.model_copy(update={"assumed": kept})


def presses_of(made: Bench, seeds: range) -> tuple[list[Press], list[Phases]]:
    """Return presses of one motion with different noise, and their phases."""
    seen = observe(made.true, made.scene)
    pressed = []
    for seed in seeds:
        recorded, _ = acquired(made.true, made.scene, seen, seed)
        rig = recorded.rig.model_copy(update={"daq": made.nominal.daq})
        pressed.append(press_of(replace(recorded, rig=rig)))
    return pressed, [find_phases(press) for press in pressed]


Case = tuple[list[Press], list[Phases], dict[str, float]]
"""Presses of a bench, their phases, and the true values of `RESULTS`."""


def simulated_cases(benches: range) -> Iterator[Case]:
    """Yield the benches of the stand-in."""
    for number in benches:
        made = bench(number)
        true = made.scene.true_rig(made.true)
        seeds = range(number * PRESSES, (number + 1) * PRESSES)
        yield *presses_of(made, seeds), {name: value_of(true, name) for name in RESULTS}


def random_bench(number: int) -> Conditions:
    """Return a bench of the independent simulator with every factor drawn."""
    return random_conditions(np.random.default_rng([15, number]))


def independent_cases(benches: Iterable[Conditions]) -> Iterator[Case]:
    """Yield benches of the independent simulator that pluck one string or more."""
    for conditions in benches:
        try:
            case = _independent(conditions)
        except (ValueError, ArithmeticError):
            continue
        if case is not None:
            yield case


def one_factor_case(name: str) -> Case:
    """Return the bench of the independent simulator with one factor of `ONE_FACTOR`."""
    if (case := _independent(ONE_FACTOR[name])) is None:
        raise BenchmarkFault(f"{name} does not pluck")
    return case


def _independent(c: Conditions) -> Case | None:
    """Return presses of a bench of the independent simulator; None if they do not pluck.

    Its inertia of the key is that seen by the transducer, with the mass in front of it.
    """
    made = [press(c, seed) for seed in range(1, JUDGED_PRESSES + 1)]
    if not made[0].truth.plucks:
        return None
    pressed = [judged_press(each, _stated(each)) for each in made]
    first = c.choirs[0]
    inertia = c.inertia + c.tip_mass * c.press_arm**2
    truth = (first.bending_stiffness, first.overlap, inertia)
    return pressed, [find_phases(p) for p in pressed], dict(zip(RESULTS, truth, strict=True))


def _stated(pressed: Pressed) -> dict[str, str | float]:
    """Return what the experimenter states of the string and the sensors, by the rig's keys."""
    stated = {
        key.replace(".delay", ".delay_std").replace(".scale", ".gain_std"): value
        for key, value in pressed.rig_uncertainties.items()
    }
    return {"plectrum.contact": "surface", **stated}


def outcomes(cases: Iterator[Case]) -> Outcomes:
    """Return the results of benches; one that is refused has none, and does not fit."""
    rows, times = [], []
    nothing = ([np.nan] * len(RESULTS), *[[False] * len(RESULTS)] * 2, False)
    for pressed, phases, truth in cases:
        try:
            spent, found = timed(identify, pressed, phases, FREE, starts=1)
        except AnalysisError:
            rows.append(nothing)
            continue
        times.append(spent)
        rows.append(judged(found, truth))
    errors, covered, claimed, fits = (np.array(column) for column in zip(*rows, strict=True))
    return Outcomes(errors, covered, claimed, fits, float(np.median(times)))


def judged(
    found: Identified, truth: dict[str, float]
) -> tuple[list[float], list[bool], list[bool], bool]:
    """Return errors, coverage and claims of the results of one fit, and whether it fits."""
    fits = bool(found.quality.fits)  # None where the noise is unknown
    estimates = {e.name: e for e in found.estimates}
    errors, covered, claimed = [], [], []
    for name in RESULTS:
        estimate, value = estimates[name], truth[name]
        errors.append(estimate.value / value - 1)
        low, high = estimate.low, estimate.high
        covered.append(low is not None and high is not None and low <= value <= high)
        claimed.append(fits and estimate.identifiable)
    return errors, covered, claimed, fits


def run() -> list[Figure]:
    """Return how many results are claimed, and how many of the claimed ones are right."""
    found = outcomes(simulated_cases(BENCHES))
    figures = figures_of("stand-in", found)
    soft = (one_factor_case(name) for name in COMPLIANT)
    figures += figures_of("independent, one soft part", outcomes(soft))
    figures += figures_of(
        "independent, all random", outcomes(independent_cases(map(random_bench, RANDOM)))
    )
    spent = Figure(f"a fit of {len(FREE)} to {PRESSES} presses", found.seconds, "s", "limit", 10.0)
    return [*figures, spent]


def figures_of(what: str, found: Outcomes) -> list[Figure]:
    """Return the verdicts on the fits, and what is claimed and right of each result."""
    count = len(found.fits)
    fits = f"{what}: benches whose model fits, of {count}"
    figures = [Figure(fits, float(found.fits.mean()), "1", "all", 1.0)]
    for k, name in enumerate(RESULTS):
        claimed, at = found.claimed[:, k], f"{what}: {name}"
        part = float(claimed.mean())
        figures.append(Figure(f"{at}: reported as identifiable", part, "1", "all", 1.0))
        if claimed.any():
            right = float(found.right[claimed, k].mean())
            worst = float(np.abs(found.errors[claimed, k]).max())
            figures += [
                Figure(f"{at}: within 5 % and covered, of these", right, "1", "at least", COVERED),
                Figure(f"{at}: largest error of these", worst, "1", "limit", LIMIT),
            ]
    return figures


def one_factor_rows(names: Iterable[str] = TABLE) -> Iterator[str]:
    """Yield the rows of the table of docs/identification.md: verdict and errors of each bench."""
    for name in names:
        pressed, phases, truth = one_factor_case(name)
        found = identify(pressed, phases, FREE, starts=1)
        errors, covered, claimed, fits = judged(found, truth)
        modes = f"{len(found.modes)} mode{'s' * (len(found.modes) > 1)}" if found.modes else "rigid"
        cells = [f"fits, {modes}" if fits else "does not fit"]
        for error, held, sure in zip(errors, covered, claimed, strict=True):
            text = f"{100 * error:.1f} %{'' if held else ' outside'}"
            cells.append("-" if not fits else text if sure else f"({text})")
        yield f"| {name} | {' | '.join(cells)} |"


if __name__ == "__main__":
    for row in one_factor_rows():
        print(row, flush=True)
