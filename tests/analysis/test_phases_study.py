"""Phases of randomised presses of the stand-in, whose truth is known."""

import numpy as np
import pytest

from benchmarks.phases import study
from benchmarks.simulated import random_case, sensed, simulated_press
from sautereau.analysis.phases import find_phases
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow


def simulated(scene, speed=0.072, *, mute=False, seed=0, rate=51.2):
    rig = with_values(
        load_rig(), {"press.jack_speed": f"{speed} m/s", "daq.sample_rate": f"{rate} kHz"}
    )
    changes = {"sensors": load_scene("paper").sensors}
    if scene != "paper":  # which has the moment of release exactly
        changes["engine"] = "exact"
    if mute:
        changes |= {"plectrum": "none", "string": "none", "tongue": False}
    return simulated_press(rig, load_scene(scene).model_copy(update=changes), seed)


def assert_found(press, truth, limit=0.25e-3):
    plucks = find_phases(press).plucks
    assert len(plucks) == len(truth.releases)
    for held, contact, release in zip(plucks, truth.contacts, truth.releases, strict=True):
        assert held.contact == pytest.approx(contact, abs=limit)
        assert held.contact == pytest.approx(contact, abs=4 * held.contact_std)
        assert held.release == pytest.approx(release, abs=0.03e-3)


SCENES = ["ideal", "paper", "return", "two-choirs"]


@pytest.mark.parametrize(
    ("scene", "speed"),
    [
        *zip(SCENES, (0.02, 0.15, 0.15, 0.15), strict=True),
        *(
            slow(scene, speed)
            for scene, speed in zip(SCENES, (0.15, 0.02, 0.02, 0.02), strict=True)
        ),
    ],
)
def test_every_scene(scene, speed):
    assert_found(*simulated(scene, speed))


def test_a_contact_between_two_instants_of_the_first_grid():
    """Its well of chi2 is narrow, beside a wider one: the contact was 0.7 ms early."""
    assert_found(*simulated_press(*random_case(69), 69))


@pytest.mark.parametrize("scene", ["ideal", "paper", "return"])
def test_a_scene_without_a_string_has_no_pluck(scene):
    press, truth = simulated(scene, mute=True)
    assert not truth.contacts
    assert find_phases(press).plucks == ()


def test_a_push_of_constant_force_is_segmented_by_the_velocity_alone():
    """The finger's force shows neither contact nor release; the key's acceleration does."""
    scene = load_scene("pluck")
    push = scene.push.model_copy(update={"duration": 25e-3})
    scene = scene.model_copy(update={"push": push, "engine": "exact"})
    rig = with_values(load_rig(), {"daq.channels.0.range": "10 V"})  # it gets fast
    press, truth = simulated_press(rig, scene, 0)
    assert_found(press, truth, limit=0.05e-3)


@pytest.mark.parametrize("seeds", [range(8), slow(range(64))])
def test_the_force_drop_of_a_push_is_as_certain_as_the_inertia(seeds):
    """Under a constant force any factor of inertia, string and weight explains the motion."""
    away = []
    for seed in seeds:
        rig, other = random_case(seed)
        dry = ("key.pivot_coulomb_friction", "jack.register_friction")  # which it has not
        values = {key: value for key, value in other.truth.items() if key not in dry}
        scene = load_scene("pluck").model_copy(
            update={"truth": values, "sensors": other.sensors, "engine": "exact"}
        )
        push = {"force": f"{0.8 + 0.7 * seed / len(seeds)} N", "duration": "25 ms"}
        scene = scene.model_copy(update={"push": Push.model_validate(push)})
        seen = observe(rig, scene)
        press, truth = sensed(rig, scene, seen, seed)
        plucks = find_phases(press).plucks
        if len(plucks) != 1:  # hidden by noise, which a warning says
            continue
        drop = seen.motions.string_force[seen.motions.time <= truth.releases[0] + 1e-9].max()
        drop *= press.rig.key.jack_arm / press.rig.key.press_arm
        away.append((plucks[0].force_drop - drop) / plucks[0].force_drop_std)
    assert len(away) > 0.9 * len(seeds)
    assert np.abs(away).max() < 4.0
    assert np.mean(np.abs(away) < 1.96) > 0.85


def test_the_force_drop_of_a_servo_is_certain_whatever_the_inertia():
    """The finger's force shows the fall, and what the inertia adds is known from the run-up."""
    press, _ = simulated("paper")
    (held,) = find_phases(press).plucks
    assert held.force_drop_std < 0.02 * held.force_drop


@pytest.mark.parametrize("seed", [33, 47, slow(69), slow(253)])
def test_a_string_that_is_touched_as_another_is_released(seed):
    """The way to the first contact, on which the key is free, shows how far the second lifts it."""
    (judged,) = study(range(seed, seed + 1))
    off, _, std, _ = judged.errors[1]
    assert abs(off) < min(3 * std, 0.8e-3)
    assert std < 1e-3


def test_a_return_passes_the_string_and_is_no_pluck():
    press, truth = simulated("return")
    phases = find_phases(press)
    assert len(truth.returns) == len(phases.plucks) == 1
    assert phases.returned > truth.returns[0]


def test_the_key_reaches_its_front_felt():
    press, _ = simulated_press(*random_case(5), 5)
    phases = find_phases(press)
    key = press.rig.key
    travel = press.data["angle"].to_numpy() * key.press_arm
    touched = press.data.index[np.argmax(travel > key.dip)]
    assert phases.bottomed == pytest.approx(touched, abs=0.5e-3)


def test_drop_outs_leave_the_phases():
    rig, scene = random_case(14)
    assert scene.faults is not None
    assert_found(*simulated_press(rig, scene, 14))


@pytest.mark.parametrize("rate", [1.0, 4.0, 200.0])
def test_sampling_rates(rate):
    press, truth = simulated("ideal", rate=rate)
    (held,) = find_phases(press).plucks
    limit = 1 / press.rate
    assert held.contact == pytest.approx(truth.contacts[0], abs=max(0.2e-3, limit))
    assert held.release == pytest.approx(truth.releases[0], abs=max(0.02e-3, limit))


def test_a_few_random_presses():
    found = study(range(6))
    assert all(one.right for one in found)
    contact, release, *_ = np.concatenate([one.errors for one in found]).T
    assert np.median(np.abs(contact)) < 0.1e-3
    assert np.median(np.abs(release)) < 0.02e-3


def test_a_rigid_key_is_kept_where_hardly_any_noise_makes_its_small_residuals_significant():
    """Two strings, of which the rig names one: as many as a compliant key may have."""
    press, truth = simulated_press(*random_case(284), 284)
    assert_found(press, truth)
    fit = find_phases(press).fit
    assert fit is not None
    assert fit.negligible
    assert fit.verdict == "fair"


@pytest.mark.parametrize("seed", [193, 736])
def test_an_interpolated_inertia_is_no_pluck(seed):
    """A push clipped in velocity until the recording ends, and drop-outs without a string."""
    press, truth = simulated_press(*random_case(seed), seed)
    assert not truth.contacts
    assert find_phases(press).plucks == ()


def test_what_an_interpolated_inertia_leaves_is_called_doubtful():
    """2 % of the rig's string is at the limit of the evidence: the shape's prior decides."""
    press, truth = simulated_press(*random_case(897), 897)
    assert not truth.contacts
    found = find_phases(press)
    assert all(held.doubtful and held.force_drop < 0.02 for held in found.plucks)
    assert bool(found.plucks) == any("may be no pluck" in text for text in found.warnings)


def test_the_same_press_with_other_noise_scatters_as_its_uncertainty():
    rig, scene = load_rig(), load_scene("paper")
    seen = observe(rig, scene)
    scores = []
    for seed in range(12):
        press, truth = sensed(rig, scene, seen, seed)
        (held,) = find_phases(press).plucks
        scores.append((held.contact - truth.contacts[0]) / held.contact_std)
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.6
