"""What every level of the plectrum owes: derivatives, shapes, limits, refusals."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend
from sautereau.analysis.model.plectrum.beam import Beam
from sautereau.analysis.model.plectrum.levels import LEVELS, plectrum_map
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.rig.load import load_rig

RIG = load_rig("paper")
PLECTRUM = RIG.plectrum
CLOSED = ("elastica", "rods", "beam", "two-beam")  # Levels that answer at once for any plectrum
MODULI = st.floats(6, 12).map(lambda e: 10**e)
THICKNESSES = st.floats(0.05e-3, 1e-3)
FRICTIONS = st.sampled_from([0.0, 0.1, 0.5])

every_level = pytest.mark.parametrize("level", CLOSED)


def other(**update):
    return PLECTRUM.model_copy(update=update)


@every_level
@given(place=st.floats(0.1, 1), share=st.floats(0.01, 0.9), friction=FRICTIONS)
def test_derivatives_are_those_of_the_map(level, place, share, friction):
    """Against sixth-order central differences."""
    s = place * PLECTRUM.length
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    at, step = np.arange(-3, 4), 1e-3
    # A section's end is a place where the second derivatives jump.
    tip = 0.7 * PLECTRUM.length if abs(place - 0.5) < 0.01 else 0.5 * PLECTRUM.length
    thinner = {"tip_thickness": 0.4e-3, "tip_length": tip} if level == "two-beam" else {}
    plectrum = plectrum_map(other(friction=friction, **thinner), level)
    force = share * float(plectrum.force_limit(s))
    bend = plectrum.bend(s, force)
    by_s = plectrum.bend(s * (1 + at * step), force)
    by_f = plectrum.bend(s, force * (1 + at * step))
    for name in ("x", "z", "theta"):
        scale = s if name != "theta" else 1.0
        found = getattr(bend, f"{name}_s") * s / scale, getattr(bend, f"{name}_f") * force / scale
        expected = [weights @ getattr(b, name) / step / scale for b in (by_s, by_f)]
        np.testing.assert_allclose(found, expected, atol=1e-9)


@every_level
@given(
    modulus=MODULI,
    thickness=THICKNESSES,
    tip=THICKNESSES,
    place=st.floats(0, 1),
    share=st.floats(0, 1),
    friction=FRICTIONS,
)
def test_up_to_its_limit_every_answer_is_finite(
    level, modulus, thickness, tip, place, share, friction
):
    values = {"youngs_modulus": modulus, "thickness": thickness, "friction": friction}
    thinner = {"tip_thickness": tip} if level == "two-beam" else {}
    plectrum = plectrum_map(other(**values, **thinner), level)
    s = place * PLECTRUM.length
    force = np.minimum(share * plectrum.force_limit(max(s, 1e-9)), 1e6)
    bend = plectrum.bend(s, force)
    assert np.isfinite(bend).all()
    assert -np.pi / 2 * (1 + 1e-9) <= bend.theta <= 0
    assert bend.z <= 0
    assert bend.x <= s * (1 + 1e-12)


@every_level
def test_no_load_and_no_lever_bend_nothing(level):
    plectrum = plectrum_map(PLECTRUM, level)
    free = plectrum.bend([1e-3, 4.5e-3], 0.0)
    np.testing.assert_allclose(free.x, [1e-3, 4.5e-3], rtol=1e-13)
    np.testing.assert_array_equal(free.z, 0)
    np.testing.assert_array_equal(free.theta, 0)
    at_clamp = plectrum.bend([[0.0], [1e-155], [1e-200]], [0.0, 1.0, 1e9])
    np.testing.assert_allclose(at_clamp[:3], 0, atol=1e-150)
    assert np.isinf(plectrum.force_limit(0.0))


@every_level
@pytest.mark.parametrize("factor", [1 + 1e-9, 1.1, 1e6, np.inf, np.nan, -1e-9])
def test_a_force_out_of_range_is_refused(level, factor):
    plectrum = plectrum_map(PLECTRUM, level)
    limit = plectrum.force_limit(4.5e-3)
    plectrum.bend(4.5e-3, limit)
    for force in (factor * limit, np.array([0.1, factor * limit])):
        with pytest.raises(ModelError, match=r"force .* at 4\.5 mm .* is not within 0 to .* N"):
            plectrum.bend(4.5e-3, force)


@every_level
@pytest.mark.parametrize("s", [-1e-6, 4.6e-3, np.nan, np.inf, [1e-3, 5e-3]])
def test_a_place_off_the_plectrum_is_refused(level, s):
    with pytest.raises(ModelError, match=r"position .* mm .* is not within 0 to 4\.5 mm"):
        plectrum_map(PLECTRUM, level).bend(s, 0.1)


@every_level
@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("friction", 0.6, r"plectrum\.friction: 0\.6 is not within 0 to 0\.5"),
        ("friction", -0.1, r"plectrum\.friction"),
        ("friction", np.nan, r"plectrum\.friction"),
        ("youngs_modulus", 0.0, "bending stiffness of 0 N m"),
        ("thickness", -1e-3, "bending stiffness"),
        ("length", np.nan, "length of nan mm"),
    ],
)
def test_what_a_fit_may_try_is_refused(level, field, value, said):
    """A copy of the plectrum is not validated by the rig."""
    with pytest.raises(ModelError, match=said):
        plectrum_map(other(**{field: value}), level)


@every_level
@given(
    modulus=MODULI,
    thickness=THICKNESSES,
    friction=FRICTIONS,
    stiffness=st.floats(1, 5).map(lambda e: 10**e),
    share=st.floats(-6, -0.001).map(lambda e: 10**e),
)
def test_it_is_plucked_or_refused(level, modulus, thickness, friction, stiffness, share):
    """The search for the release never asks beyond a level's range."""
    plectrum = plectrum_map(
        other(youngs_modulus=modulus, thickness=thickness, friction=friction), level
    )
    try:
        pluck = solve_pluck(plectrum, stiffness, share * plectrum.length)
    except ModelError as error:
        assert "on the plectrum:" not in str(error)  # noqa: PT017 - either way is right
        return
    assert np.isfinite([pluck.height, pluck.force, pluck.lift]).all()


def test_levels_have_names_and_no_others_do():
    assert set(CLOSED) <= set(LEVELS.names())
    for level in CLOSED:
        assert set(plectrum_map(PLECTRUM, level).bend(1e-3, 0.1)._fields) == set(Bend._fields)
    with pytest.raises(
        ModelError, match="plectrum level 'wood' is unknown; known: auto, elastica, fe"
    ):
        plectrum_map(PLECTRUM, "wood")


def test_a_level_is_imported_when_it_is_asked_for():
    code = (
        "import sys; import sautereau.analysis.model.plectrum.levels;"
        "levels = 'sautereau.analysis.model.plectrum.';"
        "print([m for m in sys.modules if m.startswith((levels, 'scipy'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['sautereau.analysis.model.plectrum.levels']"


@every_level
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_small_load_gives_the_beam(level, friction):
    """To second order in the load; rods to 1 / 2 N^2 of it, friction to first order."""
    s, force = np.array([0.5e-3, 2e-3, 4.5e-3]), 1e-6
    found = plectrum_map(other(friction=friction), level).bend(s, force)
    beam = Beam(PLECTRUM).bend(s, force)
    np.testing.assert_allclose(found.x, beam.x, rtol=1e-9)
    for name in ("z", "theta", "theta_s", "z_f", "theta_f"):
        loose = 1.3e-3 if level == "rods" else 1e-5
        np.testing.assert_allclose(getattr(found, name), getattr(beam, name), rtol=loose)
