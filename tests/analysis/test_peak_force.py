"""The largest force of a press: releases are included, spikes are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import sici

from benchmarks.simulated import random_case, sensed
from sautereau.analysis.phases import find_phases
from sautereau.daq.signals.calibration import undelayed, white_noise
from sautereau.sim_backend.physics.observation import observe
from tests.budget import amount, slow


@pytest.mark.parametrize(
    "seed", [2, 14, 84, *map(slow, sorted({*range(amount(12, 60))} - {2, 14}))]
)
def test_it_is_between_the_forces_of_the_releases_and_the_largest_of_the_finger(seed):
    """In spite of what the correction of a fractional delay adds beside a fall."""
    rig, scene = random_case(seed)
    seen = observe(rig, scene)
    press, _ = sensed(rig, scene, seen, seed)
    found = find_phases(press)
    assert found.peak_force >= max((held.release_force for held in found.plucks), default=0.0)
    noise = white_noise(press.samples["force"])
    # A blow is an impulse that the bench states as a rectangle of one step. The card's low-pass
    # makes of a rectangle of height 1 at most 2 Si(pi) / pi (Wilbraham).
    largest = (seen.motions.finger_force + 2 / np.pi * sici(np.pi)[0] * seen.motions.blow).max()
    # Of 1e5 samples, the largest is 4.3 standard deviations high.
    assert found.peak_force <= 1.01 * largest + 5 * noise


@pytest.mark.parametrize("lag", [0.0, 0.25, 0.5])
@pytest.mark.parametrize(
    ("shape", "counts"),
    [
        ((1,), False), ((1, 1), False), ((0.5, 1), False),
        ((0.5, 0.8, 1, 0.8, 0.5), True), ((0.2, 0.6, 0.9, 1, 0.9, 0.6, 0.2), True),
    ],
)  # fmt: skip
def test_a_peak_counts_and_a_spike_does_not(make_press, shape, counts, lag):
    press = make_press(force_noise=5e-3, velocity_noise=5e-5)
    release = find_phases(press).plucks[0].release_force
    force = press.samples["force"].copy()
    force[5500 : 5500 + len(shape)] += 2 * np.array(shape)
    late = undelayed(force, lag)
    force[: len(late)] = late
    found = find_phases(replace(press, samples={**press.samples, "force": force}))
    highest = press.samples["force"][5500:5510].mean() + 2
    assert found.peak_force == pytest.approx(highest if counts else release, rel=0.06)


def test_forces_of_one_sign_and_short_presses(make_press):
    press = make_press()
    for force in (np.zeros_like(press.time), -press.samples["force"]):
        assert (
            find_phases(replace(press, samples={**press.samples, "force": force})).peak_force == 0
        )
