"""A bent plectrum's complete mid-line against the elastica's own equation and against beams."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.shape import POINTS, mid_line, straight
from sautereau.rig.load import load_rig

PLECTRUM = load_rig().plectrum


def elastica(**changes):
    return Elastica(PLECTRUM.model_copy(update=changes))


def arc(line):
    return np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def test_without_a_force_it_is_straight():
    line = mid_line(elastica(), np.array([4.2e-3]), np.array([0.0]))[0]
    np.testing.assert_allclose(line[:, 1], 0, atol=1e-18)
    assert line[-1, 0] == pytest.approx(4.5e-3)
    np.testing.assert_array_equal(straight(PLECTRUM)[:, 1], 0)
    assert straight(PLECTRUM).shape == line.shape == (POINTS + 1, 2)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("force", [0.1, 0.5, 1.5])
def test_it_is_the_elastica(force, friction):
    """The equation is integrated from the clamp, with the end's angle and place given."""
    plectrum = elastica(friction=friction)
    s = 4.3e-3
    line = mid_line(plectrum, np.array([s]), np.array([force]))[0]
    end = plectrum.bend(s, force)
    # The load, normal to the surface at the string and along it towards the tip.
    angle = float(end.theta)
    load = force * np.array([np.sin(angle), -np.cos(angle)])
    load += friction * force * np.array([np.cos(angle), np.sin(angle)])
    place = np.array([float(end.x), float(end.z)])

    def right(_, state):
        x, z, theta = state
        lever = place - (x, z)
        moment = lever[0] * load[1] - lever[1] * load[0]
        return [np.cos(theta), np.sin(theta), moment / plectrum.bending_stiffness]

    at = np.linspace(0, s, POINTS)
    found = solve_ivp(right, (0, s), [0, 0, 0], t_eval=at, rtol=1e-11, atol=1e-16).y[:2].T
    np.testing.assert_allclose(line[:POINTS], found, atol=1e-10)


def test_a_light_load_bends_it_as_a_cantilever():
    force, s = 1e-3, 4.4e-3
    line = mid_line(elastica(), np.array([s]), np.array([force]))[0, :POINTS]
    x = line[:, 0]
    beam = -force * x**2 * (3 * s - x) / (6 * elastica().bending_stiffness)
    np.testing.assert_allclose(line[:, 1], beam, atol=1e-6 * abs(beam[-1]))


def test_its_length_stays_and_its_end_is_straight():
    plectrum = elastica()
    lines = mid_line(plectrum, np.array([4.0e-3, 4.5e-3]), np.array([0.8, 2.0]))
    for line, s in zip(lines, (4.0e-3, 4.5e-3), strict=True):
        assert arc(line)[-1] == pytest.approx(plectrum.length, rel=2e-3)  # chords are shorter
        assert arc(line)[-1] - arc(line)[-2] == pytest.approx(plectrum.length - s)
        np.testing.assert_allclose(line[0], 0, atol=1e-18)
