"""The whole press as the model sees it."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from analysis.errors import ModelError
from analysis.model.predict import plectrum_map, predict, rig_pluck
from analysis.model.string import release_speed
from rig.load import with_values
from rig.schema import GRAVITY


@pytest.fixture(scope="module")
def prediction(paper):
    return predict(paper)


def test_the_papers_instants(prediction):
    assert prediction.contact == pytest.approx(27e-3, rel=1e-3)
    assert prediction.release == pytest.approx(47e-3, rel=1e-3)
    assert prediction.contact_duration == pytest.approx(20e-3, rel=5e-3)


def test_released_string(paper, prediction):
    """Vosc = c h / (2 L b (1 - b)) = f h / (b (1 - b)); 0.46 m/s belongs to 0.226 mm."""
    assert release_speed(paper.string, 0.226e-3) == pytest.approx(0.46, rel=5e-3)
    b = 108 / 460
    expected = 365 * prediction.release_lift / (b * (1 - b))
    assert prediction.v_osc == pytest.approx(expected, rel=1e-12)
    assert release_speed(paper.string, 0.0) == 0


def test_arrays_are_one_time_base(paper, prediction):
    arrays = [
        getattr(prediction, name)
        for name in ("time", "rise", "deflection", "string_force", "finger_force")
    ]
    for array in arrays:
        assert array.shape == prediction.time.shape
        assert np.isfinite(array).all()
    assert np.all(np.diff(prediction.time) > 0)
    np.testing.assert_allclose(
        prediction.rise, paper.press.jack_speed * prediction.time, rtol=1e-12
    )
    assert prediction.rise[-1] == paper.press.jack_rise


def test_the_string_pushes_only_while_it_is_held(prediction):
    held = (prediction.time >= prediction.contact) & (prediction.time <= prediction.release)
    np.testing.assert_array_equal(prediction.string_force[~held], 0)
    assert np.all(np.diff(prediction.string_force[held]) > 0)
    top = prediction.release_force * np.cos(prediction.release_angle)
    assert prediction.string_force.max() == pytest.approx(top, rel=1e-9)
    assert prediction.finger_force_peak == prediction.finger_force[held][-1]


def test_deflection_is_the_laser_spots_on_the_lever(paper, prediction):
    """At the jack's full rise of 10 mm the key has turned by 2.66 degrees."""
    key = paper.key
    angle = prediction.deflection[-1] / key.laser_arm
    c = key.jack_surface_height + 10e-3
    assert c * np.cos(angle) - key.jack_arm * np.sin(angle) == pytest.approx(
        key.jack_surface_height, rel=1e-12
    )
    assert prediction.deflection[-1] == pytest.approx(10e-3 * 82 / 215, rel=0.01)


def test_the_fingers_work_is_energy_and_heat(paper, prediction):
    """At constant speed of the jack, over the free phase, the held string, and to the end."""
    key, jack = paper.key, paper.jack
    angle = prediction.deflection / key.laser_arm
    slope = (key.jack_arm + key.jack_surface_height * np.sin(angle)) / np.cos(angle) ** 2
    spin = paper.press.jack_speed / slope
    for end in (prediction.contact, prediction.release, prediction.time[-1]):
        upto = prediction.time <= end
        a, w, rise = angle[upto], spin[upto], prediction.rise[upto]
        work = trapezoid(prediction.finger_force[upto] * key.press_arm, a)
        stored = (
            jack.mass * GRAVITY * rise[-1]
            - key.front_heaviness * a[-1]
            + key.inertia * (w[-1] ** 2 - w[0] ** 2) / 2
        )
        heat = (
            trapezoid(key.pivot_viscous_friction * w, a)
            + key.pivot_coulomb_friction * a[-1]
            + jack.register_friction * rise[-1]
        )
        string = trapezoid(prediction.string_force[upto], rise)
        assert work == pytest.approx(stored + heat + string, rel=1e-6)


def test_statics_before_contact(paper):
    """So slow that nothing but weight and dry friction is left."""
    slow = with_values(
        paper, {"press.jack_speed": "0.005 m/s", "key.pivot_viscous_friction": "0 N m s/rad"}
    )
    found = predict(slow).finger_force[0]
    key, jack = paper.key, paper.jack
    load = jack.mass * GRAVITY + jack.register_friction
    moment = load * key.jack_arm + key.pivot_coulomb_friction - key.front_heaviness
    assert found == pytest.approx(moment / key.press_arm, rel=1e-5)


def test_durations_go_with_the_speed_and_forces_hardly(paper, prediction):
    double = predict(with_values(paper, {"press.jack_speed": "0.144 m/s"}))
    assert double.contact_duration == pytest.approx(prediction.contact_duration / 2, rel=1e-9)
    assert double.contact == pytest.approx(prediction.contact / 2, rel=1e-9)
    assert double.release_force == prediction.release_force


def test_the_level_must_exist(paper):
    with pytest.raises(ModelError, match="level 'wood' is not known; take one of elastica"):
        plectrum_map(paper, "wood")


def test_a_press_that_ends_before_release_is_refused(paper):
    short = with_values(paper, {"press.jack_rise": "3 mm"})
    with pytest.raises(ModelError, match=r"jack_rise: 3 mm ends before .* released at 3\.38\d mm"):
        predict(short)


def test_the_pluck_is_the_rigs(paper, prediction):
    pluck = rig_pluck(paper)
    assert pluck.force[-1] == prediction.release_force
    assert pluck.release_height / paper.press.jack_speed == pytest.approx(
        prediction.contact_duration, rel=1e-12
    )


@pytest.mark.parametrize("speed", ["0.005 m/s", "1 m/s"])
@pytest.mark.parametrize("clearance", ["0.001 mm", "8 mm"])
def test_extremes_are_finite(paper, speed, clearance):
    rig = with_values(paper, {"press.jack_speed": speed, "jack.string_clearance": clearance})
    found = predict(rig)
    assert np.isfinite(found.finger_force).all()
    assert found.string_force.max() > 0.5
