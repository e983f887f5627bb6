"""Whose plucks they are, in random presses of two strings on both simulators."""

import numpy as np
import pytest

from benchmarks.independent import press, random_two_strings
from benchmarks.simulated import judged_press
from benchmarks.spinet import SPINET
from sautereau.analysis.errors import ModelError
from sautereau.analysis.phases import find_phases
from sautereau.rig.errors import RigError
from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from tests.budget import amount, least
from tests.spinet import spinet_press

APART = 2e-3  # s, distance of contacts or releases from which plucks differ
OTHER_FORCE = 0.15  # Relative difference of forces from which they differ
FAR = 20e-3  # s, sum of the errors of contact and release beyond which a pluck is none of the true


def random_rig(random):
    """Return values of a spinet's rig with random gap, forces and speed, and those of the truth."""
    uniform = random.uniform
    speed = float(np.exp(uniform(np.log(0.02), np.log(0.15))))
    rig = {
        "press.jack_speed": f"{speed} m/s",
        "press.run_down_acceleration": "5 m/s^2",
        "press.run_down_jerk": "2000 m/s^3",
        "daq.channels.0.range": "10 V",
    }
    shared, truth = uniform(0.9, 1.1), {}
    for prefix in ("", "more_choirs.0."):
        clearance, overlap = uniform(1.5, 3.5), uniform(0.15, 0.4)
        own = random.normal(0, 0.05)
        rig[f"{prefix}jack.string_clearance"] = f"{clearance} mm"
        rig[f"{prefix}plectrum.overlap"] = f"{overlap} mm"
        rig[f"{prefix}plectrum.thickness"] = f"{uniform(0.4, 0.55)} mm"
        truth[f"{prefix}jack.string_clearance"] = f"{shared * clearance + own} mm"
        truth[f"{prefix}plectrum.overlap"] = f"{overlap * uniform(0.8, 1.25)} mm"
    return rig, truth


def of_the_stand_in(seed):
    """Return a random press of the stand-in, and string, contact and release of its plucks."""
    random = np.random.default_rng([43, seed])
    while True:
        rig, truth = random_rig(random)
        try:
            return spinet_press(seed, with_values(SPINET, rig), **truth)
        except (SceneError, ModelError, RigError):
            continue


def of_the_independent(seed):
    """Return a random press of the independent simulator, and its plucks likewise."""
    random = np.random.default_rng([43, seed])
    while True:
        try:
            made = press(random_two_strings(random), seed)
            plucks = [(p.choir + 1, p.contact, p.release) for p in made.truth.plucks]
            return judged_press(made), plucks
        except (ValueError, ArithmeticError, RigError):
            continue


def whose(held, truth):
    """Return the string of the true pluck that is nearest in contact and release; None if far."""
    errors = {
        string: abs(contact - held.contact) + abs(release - held.release)
        for string, contact, release in truth
    }
    nearest = min(errors, key=errors.__getitem__)
    return nearest if errors[nearest] < FAR else None


def differ(truth, plucks):
    """Return whether plucks differ so much that their strings should be known."""
    times = np.array([times for _, *times in truth])
    forces = [held.force_drop for held in plucks]
    apart = np.abs(np.diff(times, axis=0)).max(initial=0.0) > APART
    return apart or np.ptp(forces) > OTHER_FORCE * min(forces)


def studied(make, seeds):
    """Return the claims that are right, all claims, and the claims and plucks that differ."""
    right = claims = claimed = differing = 0
    for seed in seeds:
        found, truth = make(seed)
        plucks = find_phases(found).plucks
        stated = [held for held in plucks if held.string]
        right += sum(held.string == whose(held, truth) for held in stated)
        claims += len(stated)
        if len(truth) == 2 and len(plucks) == 2 and differ(truth, plucks):
            claimed, differing = claimed + len(stated), differing + 2
    return np.array([right, claims, claimed, differing])


@pytest.mark.slow
def test_a_few_presses_of_two_strings():
    right, claims, claimed, differing = studied(of_the_stand_in, range(6))
    assert right == claims
    assert claimed >= 0.8 * differing > 0


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_many_presses_of_two_strings():
    """99 % of the claims are right, and 90 % of the plucks that differ have one."""
    pytest.importorskip("numba")  # without it the independent simulator takes half a minute
    each = [studied(make, range(amount(24, 150))) for make in (of_the_stand_in, of_the_independent)]
    right, claims, claimed, differing = sum(each)
    assert right >= least(0.99, claims), each
    assert claimed >= least(0.90, differing), each
