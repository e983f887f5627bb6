"""The two small-rotation cantilevers against quadrature of their bending moments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.beam import Beam, TwoBeam
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.rig.load import load_rig

RIG = load_rig("paper")
PLECTRUM = RIG.plectrum
THINNED = PLECTRUM.model_copy(update={"tip_thickness": 0.3e-3, "tip_length": 1.8e-3})
JOINT = THINNED.length - THINNED.tip_length


def by_quadrature(plectrum, s, force, joint):
    """Return z, theta and the strain energy [J] from the moment F (s - x), piece by piece."""
    modulus, width = plectrum.youngs_modulus, plectrum.width
    node, weight = np.polynomial.legendre.leggauss(4)
    z = theta = energy = 0.0
    for start, end, thickness in (
        (0.0, min(s, joint), plectrum.thickness),
        (min(s, joint), s, plectrum.tip_thickness or plectrum.thickness),
    ):
        x = start + (end - start) * (node + 1) / 2
        dx = weight * (end - start) / 2
        curvature = -force * (s - x) / (modulus * width * thickness**3 / 12)
        theta += dx @ curvature
        z += dx @ (curvature * (s - x))
        energy -= dx @ (curvature * force * (s - x)) / 2
    return z, theta, energy


def test_textbook_values_of_the_paper():
    """Of a load at the tip, in mm."""
    bend = Beam(PLECTRUM).bend(PLECTRUM.length, [0.33, 0.5, 1.0])
    np.testing.assert_allclose(-bend.z * 1e3, [0.5001, 0.7577, 1.5154], rtol=2e-4)
    np.testing.assert_allclose(bend.x, PLECTRUM.length, rtol=1e-15)


@pytest.mark.parametrize("level", [Beam, TwoBeam])
@given(
    place=st.floats(0.01, 1),
    force=st.floats(0, 1),
    joint=st.floats(0.02, 0.98),
    tip=st.floats(0.3, 1),
)
def test_it_is_the_integral_of_its_moment(level, place, force, joint, tip):
    update = {"tip_thickness": tip * PLECTRUM.thickness, "tip_length": joint * PLECTRUM.length}
    plectrum = PLECTRUM.model_copy(update=update if level is TwoBeam else {})
    s = place * PLECTRUM.length
    force = force * float(level(plectrum).force_limit(s))
    bend = level(plectrum).bend(s, force)
    z, theta, _ = by_quadrature(plectrum, s, force, (1 - joint) * PLECTRUM.length)
    assert bend.z == pytest.approx(z, rel=1e-11)
    assert bend.theta == pytest.approx(theta, rel=1e-11)
    assert bend.x == s


def test_without_shortening_the_string_is_released_late():
    stiffness, overlap = RIG.string.static_stiffness, PLECTRUM.overlap
    late = solve_pluck(Beam(PLECTRUM), stiffness, overlap)
    exact = solve_pluck(Elastica(PLECTRUM), stiffness, overlap)
    assert late.release_height / exact.release_height == pytest.approx(1.22, abs=0.01)
    assert late.force[-1] / exact.force[-1] == pytest.approx(1.22, abs=0.01)


@pytest.mark.parametrize("level", [Beam, TwoBeam])
def test_friction_does_not_bend_it(level):
    rubbed = THINNED.model_copy(update={"friction": 0.4})
    np.testing.assert_array_equal(level(rubbed).bend(4e-3, 0.3), level(THINNED).bend(4e-3, 0.3))


@pytest.mark.parametrize("length", [4.6e-3, 0.0, -1e-3, float("nan")])
def test_a_tip_longer_than_the_plectrum_is_refused(length):
    longer = PLECTRUM.model_copy(update={"tip_length": length})
    with pytest.raises(ModelError, match=r"plectrum\.tip_length: .* mm is not within 0 to 4\.5 mm"):
        TwoBeam(longer)


@pytest.mark.parametrize("thickness", [0.0, -1e-4, float("nan"), float("inf")])
def test_a_tip_without_a_stiffness_is_refused(thickness):
    with pytest.raises(ModelError, match=r"plectrum\.tip_thickness: .* not finite and above 0"):
        TwoBeam(PLECTRUM.model_copy(update={"tip_thickness": thickness}))


@pytest.mark.parametrize("s", [2e-3, JOINT, 4.5e-3])
def test_the_loads_work_is_strain_energy(s):
    """The load stays upright: its work is half of force times deflection."""
    force = 0.7 * float(TwoBeam(THINNED).force_limit(s))
    energy = by_quadrature(THINNED, s, force, JOINT)[2]
    assert -force * TwoBeam(THINNED).bend(s, force).z / 2 == pytest.approx(energy, rel=1e-12)
    energy = by_quadrature(PLECTRUM, s, force / 9, JOINT)[2]
    assert -force / 9 * Beam(PLECTRUM).bend(s, force / 9).z / 2 == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize(
    "update",
    [
        {},
        {"tip_length": 1e-3},
        {"tip_length": PLECTRUM.length},
        {"tip_thickness": PLECTRUM.thickness, "tip_length": 3e-3},
    ],
)
def test_equal_sections_are_one_beam(update):
    s, share = np.linspace(0.1e-3, 4.5e-3, 23)[:, None], np.linspace(0, 1, 11)
    one, two = Beam(PLECTRUM), TwoBeam(PLECTRUM.model_copy(update=update))
    force = share * one.force_limit(s)
    np.testing.assert_allclose(two.force_limit(s), one.force_limit(s), rtol=1e-14)
    np.testing.assert_allclose(two.bend(s, force), one.bend(s, force), rtol=1e-14)
