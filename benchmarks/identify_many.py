"""Identification on 200 benches with every factor drawn, and on 60 with one soft part.

The benches are those of the independent simulator. The run takes an hour of processor time
and is only made if it is named. On one of five random benches the string lies on the mid-line of
the plectrum, although the rig states the surface: that is unlike any instrument, and these benches
are counted separately.
"""

from dataclasses import replace
from itertools import compress
from operator import not_

import numpy as np

from benchmarks.figures import Figure
from benchmarks.identify import figures_of, independent_cases, outcomes, random_bench
from benchmarks.independent import FORCE, VELOCITY, Choir, Conditions

RANDOM = range(120, 370)  # Benches with every factor drawn; about 200 of them pluck
SOFT = range(120, 180)  # Benches with one soft part or none


def run() -> list[Figure]:
    """Return how many results are claimed, and how many of the claimed ones are right."""
    drawn = [random_bench(number) for number in RANDOM]
    on_surface = [all(choir.on_surface for choir in c.choirs) for c in drawn]
    benches = {
        "one soft part": map(soft_bench, SOFT),
        "all random, string on the surface": compress(drawn, on_surface),
        "all random, string on the mid-line": compress(drawn, map(not_, on_surface)),
    }
    return [
        figure
        for what, own in benches.items()
        for figure in figures_of(what, outcomes(independent_cases(own)))
    ]


def soft_bench(number: int) -> Conditions:
    """Return a bench with one soft part or none, whose rig is off as that of `random_bench`.

    Args:
        number: Seed.
    """
    rng = np.random.default_rng([16, number])

    def among(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    friction = among(0, 0.3) if rng.random() < 0.5 else 0.0
    choir = replace(
        Choir(),
        modulus=among(2.2e9, 3.6e9),
        overlap=among(0.12e-3, 0.4e-3),
        thickness=among(0.36e-3, 0.55e-3),
        friction=friction,
        rig_friction=friction if rng.random() < 0.5 else 0.0,
        modulus_factor=log(0.8, 1.25),
        overlap_factor=log(0.8, 1.25),
        clearance_factor=among(0.9, 1.1),
    )
    speed = log(0.03, 0.2)
    stiff = Conditions(
        choirs=(choir,),
        speed=speed,
        run_up=max(12e-3, speed / 8),
        inertia=among(5e-4, 10e-4),
        inertia_factor=among(0.8, 1.2),
        friction_factor=among(0.5, 2.0),
        gravity_factor=among(0.7, 1.3),
        velocity=replace(
            VELOCITY,
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay_error=20e-6 * float(rng.standard_normal()),
            scale=0.025 if speed < 0.15 else 0.125,
        ),
        force=replace(
            FORCE,
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay_error=3e-6 * float(rng.standard_normal()),
        ),
    )
    match int(rng.integers(5)):
        case 0:
            return stiff
        case 1:
            bending = log(200, 1500)
            return replace(stiff, bending_frequency=bending, bending_damping=log(0.005, 0.05))
        case 2:
            return replace(stiff, heave_frequency=log(100, 400), heave_damping=among(0.03, 0.3))
        case 3:
            return replace(stiff, choirs=(replace(choir, cloth_stiffness=log(1.5e4, 1e6)),))
        case _:
            exponent = float(rng.choice([1.0, 1.25, 1.5]))
            return replace(stiff, pad_stiffness=log(2e4, 3e5), pad_exponent=exponent)
