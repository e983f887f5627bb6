"""The held string of the identification: its vibration and its friction."""

import numpy as np
import pytest

from benchmarks.independent import Choir as IndependentChoir
from benchmarks.independent.elastica import static_pluck
from sautereau.analysis.identify.elastic import HeldString
from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.rig.load import load_rig, with_values

RIG = with_values(load_rig(), {"plectrum.contact": "surface"})


def _force(rig, height, step, vibration):
    """Return the force of the string at heights of the jack at steps of time."""
    choir = choirs(rig)[0]
    held = HeldString(choir.string, choir_pluck(choir), vibration)
    return held.force(height, held.behind(height, step))


@pytest.mark.parametrize("speed", ["0.1 m/s", "0.2 m/s"])
def test_a_held_string_vibrates_as_a_string_that_is_integrated_in_time(speed):
    """The reference integrates 30 modes in two directions at the contact of the plectrum."""
    rig = with_values(RIG, {"press.jack_speed": speed})
    exact, step = modal_pluck(rig), 0.125e-3
    pull = exact.force * np.cos(exact.angle)
    time = np.arange(0, exact.release, step)
    force = _force(rig, rig.press.jack_speed * time, step, 1.0)
    static = _force(rig, rig.press.jack_speed * time, step, 0.0)
    true = np.interp(time, exact.time, pull)
    error, missing = (np.sqrt(np.mean((f - true) ** 2)) for f in (force, static))
    assert error < 0.2 * missing


def test_friction_by_coulombs_law_is_that_of_an_independent_solver():
    true = IndependentChoir(friction=0.2)
    values = {
        "plectrum.youngs_modulus": f"{true.modulus} Pa",
        "plectrum.overlap": f"{true.overlap} m",
        "plectrum.friction": true.friction,
        **{f"plectrum.{n}": f"{getattr(true, n)} m" for n in ("length", "width", "thickness")},
        "string.tension": f"{true.tension} N",
        "string.length": f"{true.string_length} m",
        "string.plucking_point": f"{true.plucking_point} m",
        "string.diameter": f"{true.diameter} m",
    }
    rig, expected = with_values(RIG, values), static_pluck(true)
    height = np.linspace(0.02, 0.99, 50) * expected.release_height
    load = np.interp(height, expected.height, expected.load)
    np.testing.assert_allclose(_force(rig, height, 1e-3, 0.0), load, rtol=1e-4)
