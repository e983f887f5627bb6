"""Comparison with presses that differ from the prediction by known amounts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.simulated import simulated_press
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.predict import JackSpeed, predict
from sautereau.analysis.phases import HeldString, Phases, find_phases
from sautereau.analysis.press.features import COMPARED
from sautereau.analysis.press.string_start import OF_START
from sautereau.analysis.session.analysed import jack_speeds
from sautereau.analysis.session.compare import (
    Mean,
    compare,
    held_steps,
    mean_of,
    pluck_features,
    predicted_features,
    predicted_means,
)
from sautereau.analysis.session.pooled import pooled_features
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.scene import load_scene
from tests.analysis.test_choirs import choir
from tests.budget import slow


def test_a_jack_that_slows_down_has_the_times_of_its_speed(paper):
    """v^2 = v0^2 - 2 g r, so t = (v0 - v) / g."""
    rise = np.linspace(0, 10e-3, 5000)
    slowed = np.sqrt(0.1**2 - 2 * 0.3 * rise)
    law = JackSpeed(rise, slowed, np.full_like(rise, -0.3))
    found, constant = predict(paper, speed=law), predict(paper)
    assert found.time == pytest.approx((0.1 - law.at(found.rise)[0]) / 0.3, rel=1e-6, abs=1e-9)
    assert found.release_lift == constant.release_lift
    fixed = predict(paper, speed=JackSpeed.constant(paper.press.jack_speed))
    assert fixed.pluck_duration == pytest.approx(constant.pluck_duration, rel=1e-12)


@pytest.mark.parametrize("speed", [0.03, 0.15])
def test_a_compliant_arm_is_no_model_error(speed):
    """The arm slows down while the string is held, and the key's inertia pushes in its place."""
    values = {"press.jack_speed": f"{speed} m/s", "daq.channels.0.range": "10 V"}
    values |= {"press.run_down_acceleration": "5 m/s^2", "press.run_down_jerk": "2000 m/s^3"}
    rig, scene = with_values(load_rig(), values), load_scene("paper")
    press, _ = simulated_press(rig, scene.model_copy(update={"step": 50e-6}), 1)
    phases = find_phases(press)
    found = compare([phases], [predict(press.rig, speed=jack_speeds(press, phases)[0])])
    assert abs(found.duration_error.value) < 3e-3
    assert abs(found.slope_error.value) < 0.015
    before = compare([phases], [predict(press.rig)])
    assert abs(before.duration_error.value) > 0.03
    assert jack_speeds(press, MUTE) == ()


def test_every_pluck_is_predicted_for_the_speed_until_its_own_release(paper):
    """Here the jack rises at 0.06 m/s until the first release, and at 0.1 m/s from then on."""
    rig = paper.model_copy(update={"more_choirs": (choir(paper, stagger=0.9e-3),)})
    first, second = predict(rig).choirs
    rises = [paper.press.jack_speed * t for t in (first.contact, first.release)]
    rises += [paper.press.jack_speed * t for t in (second.contact, second.release)]

    def instant(rise):
        return min(rise, rises[1]) / 0.06 + max(0.0, rise - rises[1]) / 0.1

    time = np.arange(0.0, 0.15, 2e-5)
    rise = np.minimum(0.06 * time, rises[1]) + 0.1 * np.maximum(0, time - instant(rises[1]))
    samples = {"jack_rise": rise}
    press = Press(Path("a"), rig, True, time, samples, 5e4)
    held = [
        HeldString(instant(rises[k]), instant(rises[k + 1]), 1e-5, 1e-5, 0.1, 0.9, 0.8, 1e3)
        for k in (0, 2)
    ]
    phases = Phases(0.0, 0.15, tuple(held), 0.06, 0.06, 0.1, ())
    each = [predict(rig, speed=speed) for speed in jack_speeds(press, phases)]
    rows = [{"pluck_duration": 0.0, "pluck_duration_2": 0.0, "string": 1, "string_2": 2}]
    found = predicted_means(rows, rig, [each])
    assert found["pluck_duration"] == pytest.approx(held[0].pluck_duration, rel=1e-3)
    assert found["pluck_duration_2"] == pytest.approx(held[1].pluck_duration, rel=2e-3)
    stopped = replace(press, samples={"jack_rise": np.minimum(rise, rises[1])})
    assert len(jack_speeds(stopped, phases)) == 1


def test_the_acceleration_changes_at_the_contact_of_another_string(paper):
    """The jack slows down by 2 m/s^2 from the second contact on."""
    time = np.arange(0.0, 0.1, 2e-5)
    rise = 0.07 * time - np.maximum(0.0, time - 0.05) ** 2
    press = Press(Path("a"), paper, True, time, {"jack_rise": rise}, 5e4)
    held = [HeldString(0.03, 0.06, 1e-5, 1e-5, 0.1, 0.9, 0.8, 1e3)]
    held += [HeldString(0.05, 0.08, 1e-5, 1e-5, 0.1, 0.9, 0.8, 1e3)]
    speed, _ = jack_speeds(press, Phases(0.0, 0.15, tuple(held), 0.07, 0.07, 0.07, ()))
    assert speed.at(np.interp([0.0301, 0.0599], time, rise))[1] == pytest.approx([0, -2], abs=0.01)


def test_the_string_slows_the_jack_after_the_contact_only(paper):
    """From the contact on by 1 m/s^2; the force at it is that of a constant speed."""
    rig = paper
    contact = rig.jack.string_clearance / 0.07
    time = np.arange(0.0, 0.1, 2e-5)
    rise = 0.07 * time - np.maximum(0.0, time - contact) ** 2 / 2
    press = Press(Path("a"), rig, True, time, {"jack_rise": rise}, 5e4)
    held = HeldString(contact, contact + 0.025, 1e-5, 1e-5, 0.1, 0.9, 0.8, 1e3)
    (speed,) = jack_speeds(press, Phases(0.0, 0.15, (held,), 0.07, 0.07, 0.07, ()))
    forces = []
    for law in (speed, JackSpeed.constant(0.07)):
        found = predict(rig, speed=law)
        forces.append(pluck_features(rig, found, found.choirs[0])["contact_force"])
    assert forces[0] == pytest.approx(forces[1], rel=5e-3)
    at = np.interp([contact - 1e-4, contact + 0.01], time, rise)
    assert speed.at(at)[1] == pytest.approx([0, -1], abs=0.01)


def phases_of(prediction, *, slope=0.0, rise=0.0, duration=0.0):
    """Return the phases of a measurement for given model errors."""
    predicted_slope, predicted_rise = predicted_features(prediction)
    magnitude = predicted_rise / (1 + rise)
    held = HeldString(
        contact=0.04,
        release=0.04 + prediction.pluck_duration / (1 + duration),
        contact_std=1e-5,
        release_std=1e-5,
        contact_force=0.3,
        release_force=0.3 + magnitude,
        force_drop=magnitude,
        force_slope=predicted_slope / (1 + slope),
        string=1,
        force_rise=magnitude,
    )
    return Phases(0.01, 0.2, (held,), 0.072, 0.07, 0.072, ())


MUTE = Phases(0.01, 0.2, (), 0.072, None, None, ())


def test_known_model_errors_of_one_press(prediction):
    found = compare([phases_of(prediction, slope=0.1, rise=-0.2, duration=0.05)], [prediction])
    assert found.presses == 1
    assert found.slope_error.value == pytest.approx(0.1, rel=1e-12)
    assert found.magnitude_error.value == pytest.approx(-0.2, rel=1e-12)
    assert found.duration_error.value == pytest.approx(0.05, rel=1e-12)
    for departure in (found.slope_error, found.magnitude_error, found.duration_error):
        assert departure.low is None
        assert departure.high is None


def test_mean_and_interval_of_three(prediction):
    """Student's t of 2 degrees of freedom is 4.302653 at 97.5 %."""
    found = compare([phases_of(prediction, rise=r) for r in (0.1, 0.2, 0.3)], [prediction] * 3)
    half = 4.302653 * 0.1 / np.sqrt(3)
    assert found.magnitude_error.value == pytest.approx(0.2, rel=1e-12)
    assert found.magnitude_error.low == pytest.approx(0.2 - half, rel=1e-6)
    assert found.magnitude_error.high == pytest.approx(0.2 + half, rel=1e-6)


def test_errors_that_all_presses_share_widen_the_intervals(prediction):
    """Equal presses: only gains, and the instants' 10 us each, are uncertain."""
    equal = [phases_of(prediction, slope=0.1, rise=0.2, duration=0.05)] * 4
    gains = {"force_slope": 0.02, "release_force": 0.01, "held_speed": 0.005}
    found = compare(equal, [prediction] * 4, gains)
    instants = np.hypot(1e-5, 1e-5) / equal[0].plucks[0].pluck_duration
    for error, std in (
        (found.slope_error, 0.02),
        (found.magnitude_error, 0.01),
        (found.duration_error, np.hypot(0.005, instants)),
    ):
        half = 1.96 * std * (1 + error.value)
        assert (error.low, error.high) == pytest.approx((error.value - half, error.value + half))


def test_presses_without_a_pluck_do_not_count(prediction):
    found = compare([MUTE, phases_of(prediction, slope=0.1), MUTE], [prediction] * 3)
    assert found.presses == 1
    assert found.slope_error.value == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("known", [(2,), (2, 1), (None, 2)])
def test_a_pluck_is_compared_with_its_own_string(paper, known):
    """Whatever the order of the releases: here the second plectrum is higher."""
    lower = choir(paper, stagger=-0.8e-3, overlap=0.2e-3)
    found = predict(paper.model_copy(update={"more_choirs": (lower,)}))
    plucks = []
    for k, string in enumerate(known):
        own = found.choirs[(string or 1) - 1]
        slope, rise = predicted_features(found, own)
        times = (0.04 + 0.1 * k, 0.04 + 0.1 * k + own.pluck_duration)
        held = HeldString(*times, 1e-5, 1e-5, 0.3, 0.3 + rise, rise, slope, string=string)
        plucks.append(replace(held, force_rise=rise))
    compared = compare([Phases(0.01, 0.2, tuple(plucks), 0.072, 0.07, 0.072, ())], [found])
    assert compared.string == min(filter(None, known))
    for error in (compared.slope_error, compared.magnitude_error, compared.duration_error):
        assert error.value == pytest.approx(0.0, abs=1e-12)
    deflection, force = found.from_contact(0.0, compared.string)
    own = found.choirs[compared.string - 1]
    assert deflection[0] == pytest.approx(0.0, abs=5e-6)
    assert force[-1] == pytest.approx(found.finger_force[held_steps(own)][-1], rel=0.01)


def test_plucks_of_unknown_strings_are_not_compared(prediction):
    known = phases_of(prediction)
    unknown = replace(known, plucks=(replace(known.plucks[0], string=None),))
    with pytest.raises(AnalysisError, match="whose string is known"):
        compare([unknown], [prediction])


@pytest.mark.parametrize("phases", [[], [MUTE], [MUTE, MUTE]])
def test_without_a_pluck_there_is_nothing_to_compare(prediction, phases):
    with pytest.raises(AnalysisError, match=f"none of the {len(phases)} presses has a pluck"):
        compare(phases, [prediction] * len(phases))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "kind", "repeats", "within"),
    [(2, "student", 2000, 0.015), (20, "bootstrap", 400, 0.045), slow(5, "student", 2000, 0.015)],
)
def test_the_interval_covers_the_mean_in_95_of_100(n, kind, repeats, within):
    """Resampling of 20 covers 93 of 100 and no less, where the values are normal."""
    random = np.random.default_rng(n)
    draws = random.normal(0.1, 0.03, (repeats, n))
    found = [mean_of(list(row)) for row in draws]
    assert {d.interval for d in found} == {kind}
    assert np.mean([d.low <= 0.1 <= d.high for d in found]) == pytest.approx(0.95, abs=within)


@pytest.mark.parametrize("n", [2, 20])
def test_equal_presses_have_an_interval_of_zero_width(n):
    found = mean_of([0.25] * n)
    assert (found.low, found.high) == pytest.approx((0.25, 0.25), abs=1e-15)


def pooled(rows, rig, predictions):
    """Return the features that are compared, by name."""
    found = pooled_features(rows, predicted_means(rows, rig, [[p] for p in predictions]), {})
    return {feature.name: feature for feature in found if feature.predicted is not None}


def features_of(predicted, share=0.0):
    """Return the features of a press for a given relative model error of each."""
    values = {name: value / (1 + share) for name, value in predicted.items()}
    return {"plucks": 1, "string": 1} | values


def test_every_feature_is_compared_with_the_models(paper, prediction):
    predicted = pluck_features(paper, prediction, prediction.choirs[0])
    rows = [features_of(predicted, share) for share in (-0.1, 0.0, 0.1)]
    found = pooled(rows, paper, [prediction] * len(rows))
    assert set(found) == {*COMPARED, *OF_START}
    for name, feature in found.items():
        assert feature.predicted == pytest.approx(predicted[name], rel=1e-12)
        assert feature.presses == 3
        assert feature.measured.low < feature.measured.value < feature.measured.high
    assert found["pluck_duration"].predicted == pytest.approx(prediction.pluck_duration)
    assert found["contact_rise"].predicted == pytest.approx(paper.jack.string_clearance, rel=1e-6)
    assert found["force_drop"].predicted > 0
    assert found["force_slope"].unit == "N/m"


def test_one_press_has_features_without_intervals(paper, prediction):
    row = features_of(pluck_features(paper, prediction, prediction.choirs[0]))
    for feature in pooled([row], paper, [prediction]).values():
        assert feature.measured == Mean(feature.measured.value, None, None, "none")
        assert feature.measured.value == pytest.approx(feature.predicted)


def test_features_without_a_pluck_are_not_compared(paper, prediction):
    assert pooled([{"plucks": 0} | dict.fromkeys(COMPARED)], paper, [prediction]) == {}


def test_the_held_work_of_a_prediction_is_its_own(paper, prediction):
    """The finger's work while the string is held is the string's and what friction and
    weight take on the way."""
    held = pluck_features(paper, prediction, prediction.choirs[0])["held_work"]
    bare = paper.replaced(
        {
            "key.gravity_moment": 0.0,
            "key.pivot_coulomb_friction": 0.0,
            "key.pivot_viscous_friction": 0.0,
            "key.inertia": 1e-9,
            "jack.mass": 1e-9,
            "jack.register_friction": 0.0,
        }
    )
    alone = predict(bare)
    assert pluck_features(bare, alone, alone.choirs[0])["held_work"] == pytest.approx(
        alone.work, rel=1e-3
    )
    assert held > alone.work
