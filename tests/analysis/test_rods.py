"""The chain of rods against a general solve of its joints, its limit and its closed forms."""

import numpy as np
import pytest
from scipy.optimize import root

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend
from sautereau.analysis.model.plectrum.beam import Beam
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.rods import Rods
from sautereau.rig.load import load_rig

PLECTRUM = load_rig("paper").plectrum
RUBBED = PLECTRUM.model_copy(update={"friction": 0.3})
EI = PLECTRUM.bending_stiffness
FIELDS = Bend._fields


def joints(s, force, friction, count):
    """Return the angles of all joints [rad], from the clamp, that balance the load's moments.

    In the clamp's frame, all joints at once, by a general solver: nothing of the march.
    """
    rod, springs = s / count, np.full(count, count * EI / s)
    springs[0] *= 2

    def unbalanced(bends):
        angle = np.cumsum(bends)
        x, z = (np.append(0, np.cumsum(rod * f(angle))) for f in (np.cos, np.sin))
        tip = angle[-1]
        push = force * np.array(
            [np.sin(tip) + friction * np.cos(tip), friction * np.sin(tip) - np.cos(tip)]
        )
        moment = (x[-1] - x[:-1]) * push[1] - (z[-1] - z[:-1]) * push[0]
        return bends - moment / springs

    bends = root(unbalanced, np.full(count, -0.1 / count), tol=1e-13).x
    assert np.abs(unbalanced(bends)).max() < 1e-11
    return bends, springs


@pytest.mark.parametrize("plectrum", [PLECTRUM, RUBBED], ids=["smooth", "rubbed"])
@pytest.mark.parametrize("count", [1, 2, 7, 20])
def test_every_joint_is_in_balance(plectrum, count):
    chain = Rods(plectrum, count)
    for s, share in ((4.5e-3, 0.2), (3e-3, 0.6), (1e-3, 0.9)):
        force = share * float(chain.force_limit(s))
        angle = np.cumsum(joints(s, force, plectrum.friction, count)[0])
        bend = chain.bend(s, force)
        assert bend.theta == pytest.approx(angle[-1], abs=1e-11)
        assert bend.x == pytest.approx(s * np.cos(angle).mean(), abs=1e-11 * s)
        assert bend.z == pytest.approx(s * np.sin(angle).mean(), abs=1e-11 * s)


@pytest.mark.parametrize("plectrum", [PLECTRUM, RUBBED], ids=["smooth", "rubbed"])
def test_it_converges_to_the_elastica_as_the_square_of_the_rods(plectrum):
    """Place, angle and all their derivatives: four times closer for twice the rods.

    Without friction the second-order error of the angle cancels: 16 times closer.
    """
    exact = Elastica(plectrum)
    s = plectrum.length
    force = np.array([0.2, 0.5, 0.8]) * float(exact.force_limit(s))
    errors = [
        np.abs(np.subtract(Rods(plectrum, count).bend(s, force), exact.bend(s, force)))
        for count in (20, 40, 80)
    ]
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    theory = [4 if name.startswith("theta") and not plectrum.friction else 2 for name in FIELDS]
    np.testing.assert_allclose(rates[0] - np.array(theory)[:, None], 0, atol=0.1)
    np.testing.assert_allclose(rates[1] - np.array(theory)[:, None], 0, atol=0.05)


def test_twenty_rods_are_as_good_as_they_say():
    chain, beam = Rods(PLECTRUM), Beam(PLECTRUM)
    assert chain.count == 20
    too_large = chain.bend(4.5e-3, 1e-3).z / beam.bend(4.5e-3, 1e-3).z - 1
    assert too_large == pytest.approx(0.125e-2, abs=0.001e-2)


@pytest.mark.parametrize("count", [0, -3, 2.5, float("nan"), 10_001])
def test_a_count_that_is_none_is_refused(count):
    with pytest.raises(ModelError, match=r"rods: .* is not a whole number of 1 to 10000"):
        Rods(PLECTRUM, count)


@pytest.mark.parametrize("count", [1, 3, 20, 200])
def test_a_small_load_bends_it_by_a_closed_form(count):
    """theta is that of the beam, z that of the beam times 1 + 1 / 2 N^2."""
    s, force = PLECTRUM.length, 1e-6
    bend, beam = Rods(PLECTRUM, count).bend(s, force), Beam(PLECTRUM).bend(s, force)
    assert bend.theta == pytest.approx(float(beam.theta), rel=1e-9)
    assert bend.z == pytest.approx(float(beam.z) * (1 + 0.5 / count**2), rel=1e-9)


@pytest.mark.parametrize("plectrum", [PLECTRUM, RUBBED], ids=["smooth", "rubbed"])
def test_the_loads_work_is_in_the_springs(plectrum):
    chain, s = Rods(plectrum, 6), 4e-3
    end = 0.9 * float(chain.force_limit(s))
    node, weight = np.polynomial.legendre.leggauss(40)
    force, weight = end * (node + 1) / 2, end * weight / 2
    b = chain.bend(s, force)
    across = np.sin(b.theta) * b.x_f - np.cos(b.theta) * b.z_f
    along = np.cos(b.theta) * b.x_f + np.sin(b.theta) * b.z_f
    work = weight @ (force * (across + plectrum.friction * along))
    bends, springs = joints(s, end, plectrum.friction, 6)
    assert work == pytest.approx(springs @ bends**2 / 2, rel=1e-10)
