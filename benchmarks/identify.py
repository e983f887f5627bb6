"""Identification: fits to presses of benches that differ from their rig by known amounts.

The simulation has steps of 20 us: with the 100 us of the scene its force is 20 us late, which is
not an error of a bench.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.figures import Figure, timed
from benchmarks.simulated import sensed
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.identify.parameters import value_of
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.session.compare import compare
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import Scene, load_scene

FREE = (
    "plectrum.bending_stiffness",
    "plectrum.overlap",
    "key.inertia",
    "key.pivot_coulomb_friction",
)
BENCHES, REPEATS, PRESSES = 20, 10, 5
"""Random benches, fits of each with different noise, presses of each fit."""
STEP = 20e-6
"""s, step of the simulation."""
LIMIT = 0.03
"""Dimensionless, of the error of a parameter, and of the force slope after the fit."""


@dataclass(frozen=True)
class Coverage:
    """Results of many fits; arrays of shape (fits, parameters)."""

    errors: np.ndarray
    """Dimensionless, fitted / true - 1."""
    covered: np.ndarray
    """Whether the 95 % interval contains the true value."""
    identifiable: np.ndarray
    """Whether the fit reports the parameter as identifiable."""
    slopes: np.ndarray
    """Dimensionless, slope error of the comparison before and after the fit, shape (fits, 2)."""
    seconds: float
    """Median time of a fit."""


def bench(seed: int) -> tuple[Rig, Scene]:
    """Return the nominal bench, and a scene with a different, random instrument."""
    uniform = np.random.default_rng([8, 2, seed]).uniform
    truth = {
        "plectrum.youngs_modulus": f"{uniform(1.8, 3.8)} GPa",
        "plectrum.overlap": f"{uniform(0.18, 0.36)} mm",
        "key.inertia": f"{uniform(5.5e-4, 9.5e-4)} kg m^2",
        "key.pivot_coulomb_friction": f"{uniform(0.4, 2.5)} mN m",
    }
    return load_rig(), load_scene("paper").model_copy(update={"truth": truth, "step": STEP})


def presses_of(rig: Rig, scene: Scene, seeds: range) -> tuple[list[Press], list[Phases]]:
    """Return presses of one motion with different noise, and their phases."""
    seen = observe(rig, scene)
    pressed = [sensed(rig, scene, seen, seed)[0] for seed in seeds]
    return pressed, [find_phases(press) for press in pressed]


def coverage(benches: int, repeats: int) -> Coverage:
    """Return the results of several fits of each of several benches."""
    rows, times = [], []
    for number in range(benches):
        rig, scene = bench(number)
        true = scene.true_rig(rig)
        truth = np.array([value_of(true, name) for name in FREE])
        pressed, phases = presses_of(rig, scene, range(repeats * PRESSES))
        before = predict(rig)
        for k in range(repeats):
            part = slice(k * PRESSES, (k + 1) * PRESSES)
            spent, found = timed(identify, pressed[part], phases[part], FREE, starts=1)
            times.append(spent)
            slopes = [
                compare(phases[part], prediction).slope_error.value
                for prediction in (before, predict(found.rig))
            ]
            value, low, high, identifiable = np.array(
                [(e.value, e.low, e.high, e.identifiable) for e in found.estimates], float
            ).T
            covered = (low <= truth) & (truth <= high)
            rows.append((value / truth - 1, covered, identifiable.astype(bool), slopes))
    errors, covered, identifiable, slopes = (np.array(column) for column in zip(*rows, strict=True))
    return Coverage(errors, covered, identifiable, slopes, float(np.median(times)))


def run() -> list[Figure]:
    """Return coverage and largest errors of 200 fits to 5 presses each, and the slope errors."""
    found = coverage(BENCHES, REPEATS)
    fits = len(found.errors)
    figures = []
    for k, name in enumerate(FREE):
        identifiable = found.identifiable[:, k]
        worst = float(np.abs(found.errors[identifiable, k]).max()) if identifiable.any() else 0.0
        fraction = float(found.covered[:, k].mean())
        assert fraction >= 0.90, (name, fraction)
        covered = f"{name}: 95 % intervals that contain the true value"
        largest = f"{name}: largest error of {identifiable.sum()} identifiable"
        figures += [
            Figure(covered, fraction, "1", "nominal", 0.95),
            Figure(largest, worst, "1", "limit", LIMIT),
        ]
    before, after = np.median(np.abs(found.slopes), axis=0)
    worst = float(np.abs(found.slopes[:, 1]).max())
    assert after < LIMIT
    return [
        *figures,
        Figure(f"slope error of compare, median of {fits}", float(after), "1", "before", before),
        Figure(f"slope error of compare, largest of {fits}", worst, "1", "before", before),
        Figure(f"a fit of {len(FREE)} to {PRESSES} presses", found.seconds, "s", "limit", 10.0),
    ]
