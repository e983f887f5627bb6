"""The model's prediction of a complete press."""

import re

import numpy as np
import pytest
from scipy.integrate import trapezoid

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.analysis.model.string.string import release_speed
from sautereau.rig.load import with_values
from tests.key_oracle import dissipated_power, energy, slope, static_moment
from tests.outlines import outline_from


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
    top = prediction.plectrum_force * np.cos(prediction.release_angle)
    assert prediction.string_force.max() == pytest.approx(top, rel=1e-9)
    assert prediction.peak_force == prediction.finger_force[held][-1]


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
    angle = prediction.deflection / paper.key.laser_arm
    omega = paper.press.jack_speed / slope(paper.key, angle)
    stored = energy(paper, angle, omega)
    for end in (prediction.contact, prediction.release, prediction.time[-1]):
        upto = prediction.time <= end
        a, w = angle[upto], omega[upto]
        work = trapezoid(prediction.finger_force[upto] * paper.key.press_arm, a)
        heat = trapezoid(dissipated_power(paper, a, w) / w, a)
        string = trapezoid(prediction.string_force[upto], prediction.rise[upto])
        gained = stored[upto][-1] - stored[0]
        assert work == pytest.approx(gained + heat + string, rel=1e-6)


def test_a_press_that_ends_before_release_is_refused(paper):
    short = with_values(paper, {"press.jack_rise": "3 mm"})
    with pytest.raises(ModelError, match=r"jack_rise: 3 mm ends before .* released at 3\.38\d mm"):
        predict(short)


def test_the_released_string_moves_as_it_did_just_before(paper, prediction):
    """Displacement and velocity against the pluck's own heights; twice the speed, twice both."""
    pluck, state = rig_pluck(paper), prediction.released_string
    assert (state.x, state.z) == (pluck.shift[-1], pluck.lift[-1])
    time = pluck.height / paper.press.jack_speed
    for velocity, place in ((state.velocity_x, pluck.shift), (state.velocity_z, pluck.lift)):
        before = (place[-1] - place[-2]) / (time[-1] - time[-2])
        assert velocity == pytest.approx(before, rel=5e-3)
    assert state.velocity_z < 0.5 * paper.press.jack_speed < prediction.v_osc
    double = predict(with_values(paper, {"press.jack_speed": "0.144 m/s"})).released_string
    assert double.velocity_z == pytest.approx(2 * state.velocity_z, rel=1e-12)


def test_friction_of_the_rig_is_in_the_prediction(paper, prediction):
    rough = predict(with_values(paper, {"plectrum.friction": 0.1}))
    normal = rough.plectrum_force / float(np.hypot(1, 0.1))  # What is left is the friction's
    assert normal / prediction.plectrum_force == pytest.approx(1.125, abs=2e-3)
    assert rough.pluck_duration / prediction.pluck_duration == pytest.approx(1.137, abs=2e-3)


@pytest.mark.parametrize("level", ["rods", "beam", "two-beam"])
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_every_level_is_predicted(paper, level, friction):
    """Rods as the elastica; the beam does not shorten, so it releases late."""
    rig = with_values(paper, {"plectrum.friction": friction})
    exact, found = predict(rig), predict(rig, level)
    late = found.pluck_duration / exact.pluck_duration
    assert late == pytest.approx(1, abs=2e-3) if level == "rods" else late > 1.1


@pytest.mark.parametrize("speed", ["0.005 m/s", "1 m/s"])
@pytest.mark.parametrize("clearance", ["0.001 mm", "8 mm"])
def test_extremes_are_finite(paper, speed, clearance):
    rig = with_values(paper, {"press.jack_speed": speed, "jack.string_clearance": clearance})
    found = predict(rig)
    assert np.isfinite(found.finger_force).all()
    assert found.string_force.max() > 0.5


def test_statics_before_contact(paper):
    """So slow that nothing but weight and dry friction is left."""
    slow = with_values(
        paper, {"press.jack_speed": "0.005 m/s", "key.pivot_viscous_friction": "0 N m s/rad"}
    )
    found = predict(slow).finger_force[0]
    expected = static_moment(paper, friction=1) / paper.key.press_arm
    assert found == pytest.approx(expected, rel=1e-5)


def test_a_press_that_ends_on_the_front_felt_is_named(paper, prediction):
    """The jack is where the key's depth is the dip: (c + rise) cos a - b sin a = c."""
    assert not prediction.warnings
    key, dip = paper.key, 7e-3
    angle = dip / key.press_arm
    c = key.jack_surface_height
    rise = (c + key.jack_arm * np.sin(angle)) / np.cos(angle) - c
    found = predict(paper.replaced({"key.dip": dip}))
    (warning,) = found.warnings
    assert f"from {rise * 1e3:.4g} mm" in warning
    assert found.peak_force > prediction.peak_force


def test_a_string_of_no_material_is_named(paper):
    """Of steel it has 7850 kg/m^3; ten times the tension would need ten times as much."""
    assert paper.string.density == pytest.approx(7850, rel=0.005)
    (warning,) = predict(paper.replaced({"string.tension": 669.5})).warnings
    assert warning.startswith("string 1: tension")
    assert "7.9e+04 kg/m^3" in warning


@pytest.mark.parametrize("speed", [0.072, 0.15, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("frequency", [365, 110])
def test_a_string_that_its_inertia_holds_back_is_named(paper, speed, frequency):
    """The string of modes gives the errors, which are within the warning's, or small without it.

    The slower string is as much longer, of the same tension and wire.
    """
    values = {"string.frequency": f"{frequency} Hz", "string.length": f"{167.9 / frequency} m"}
    rig = with_values(paper, values | {"press.jack_speed": f"{speed} m/s"})
    static, moving = predict(rig), modal_pluck(rig)
    duration = abs(moving.release / (static.release - static.contact) - 1)
    lift = abs(moving.displacement[-1, 1] / static.release_lift - 1)
    limits = 0.03, 0.06
    if warnings := static.warnings:
        limits = [float(x) / 100 for x in re.findall(r"([0-9.]+) %", warnings[0])]
    assert bool(warnings) == (speed >= 0.3)
    assert (duration <= limits[0], lift <= limits[1]) == (True, True)


@pytest.mark.parametrize("slope", [-0.15e-3, 0.15e-3])
def test_an_outline_that_is_thicker_at_its_tip_is_named(paper, slope):
    length = paper.plectrum.length
    outline = outline_from(lambda x: 0.45e-3 + slope * (x / length - 0.5), length)
    carved = paper.model_copy(
        update={"plectrum": paper.plectrum.model_copy(update={"outline": outline})}
    )
    warnings = [text for text in predict(carved).warnings if "exchanged" in text]
    assert len(warnings) == (slope > 0)
