"""The elastica of any outline against the uniform one, closed forms and its own derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sautereau.analysis.model.plectrum import tapered
from sautereau.analysis.model.plectrum.elastica import Elastica, uniform_table
from sautereau.analysis.model.plectrum.fe.level import FE
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.plectrum.tapered import laws, load_range, samples, tapered_table
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import OnePlectrum, plectra_of
from sautereau.analysis.model.pluck.paths import solve_paths
from sautereau.analysis.model.predict import predict
from sautereau.rig.instrument import Outline
from sautereau.rig.load import load_rig

PLECTRUM = load_rig("paper").plectrum
BAR = Profile(np.array([0.0, 1.0]), np.full(2, 0.05), np.full(2, -0.05))
TIP = np.ones(1)


def carved(x, top, bottom, **update):
    """Return a plectrum of an outline in mm."""
    edges = {"x": x, "top": top, "bottom": bottom}
    outline = Outline.model_validate({k: [f"{v} mm" for v in edge] for k, edge in edges.items()})
    return PLECTRUM.model_copy(update={"outline": outline, **update})


SCRAPED = carved(
    [0, 2, 2.6, 4.1, 4.5], [0.24, 0.24, 0.16, 0.15, 0.06], [-0.24, -0.24, -0.24, -0.2, -0.2]
)
"""Its top falls by 11 degrees where the string slides off."""


@pytest.mark.parametrize("drag", [-0.4, 0.0, 0.3])
def test_the_outline_of_a_uniform_bar_is_the_uniform_bar(drag):
    loads = np.array([0.1, 1.0, 3.4])
    found = tapered_table(BAR, 0.85).values(np.array([0.86, 0.97, 1.0]), loads, drag)
    exact = uniform_table().values(TIP, loads, drag)
    np.testing.assert_allclose(found, np.broadcast_to(exact, found.shape), rtol=2e-8)


def test_a_small_load_bends_as_a_beam_of_variable_stiffness():
    """A wedge t = 1 - a x has the deflection of the integral of (s - x)^2 / (1 - a x)^3."""
    wedge = Profile(BAR.x, np.array([0.05, 0.0]), np.array([-0.05, -0.05]))
    s, a = 0.95, 0.5
    x = np.linspace(0, s, 20001)
    bending = (s - x) / (1 - a * x) ** 3
    _, z, theta = laws(wedge, np.array([s]), np.array([1e-7]), np.zeros(1))[:, 0, 0, 0]
    # The mid-line and the load lean with the top: seen along the surface, to first order.
    lean = np.arctan(0.05)
    assert -theta == pytest.approx(np.trapezoid(bending, x) / s**2 / np.cos(lean), rel=3e-3)
    assert -z == pytest.approx(np.trapezoid(bending * (s - x), x) / s**3, rel=5e-3)


def test_the_error_falls_as_the_fourth_power_of_the_step(monkeypatch):
    def at(steps):
        monkeypatch.setattr(tapered, "STEPS", steps)
        return laws(BAR, TIP, np.array([3.0]), np.array([0.3]))[:, 0, 0, 0]

    coarse, fine, exact = at(16), at(32), uniform_table().values(TIP, np.array([3.0]), 0.3)[:, 0, 0]
    ratio = np.abs(coarse - exact) / np.abs(fine - exact)
    assert (ratio > 12).all()


def test_the_load_range_ends_at_nearly_a_right_angle():
    for profile in (BAR, Profile(BAR.x, np.array([0.05, 0.05]), np.array([-0.05, 0.03]))):
        load = load_range(profile)
        turned = load * laws(profile, TIP, np.array([load]), np.zeros(1))[2]
        assert turned == pytest.approx(-1.568, rel=1e-6)
    assert load_range(BAR) == pytest.approx(uniform_table().q_max, rel=1e-4)


@settings(max_examples=10, deadline=None)
@given(
    taper=st.floats(0.1, 1.5),
    fall=st.floats(-0.1, 0.1),
    share=st.floats(0.02, 0.95),
    drag=st.floats(-0.5, 0.5),
    place=st.floats(0.86, 1),
)
def test_any_taper_has_a_table_with_its_error(taper, fall, share, drag, place):
    top, bottom = np.array([0.05, 0.05 + fall]), np.array([-0.05, 0.05 + fall - 0.1 * taper])
    profile = Profile(BAR.x, top, bottom)
    found = samples(profile, 0.85, load_range(profile))
    assert found.error < 1e-5
    at = np.array([place]), np.array([share * found.q_max])
    exact = laws(profile, *at, np.array([drag]))[:, 0]
    np.testing.assert_allclose(found.table().values(*at, drag), exact, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("drag", [None, -0.3])
def test_derivatives_are_those_of_the_map(drag):
    elastica = Elastica(SCRAPED)
    s, force = np.array([4.0e-3, 4.3e-3, 4.45e-3]), np.array([0.3, 0.2, 0.1])
    bend = elastica.bend(s, force, drag)
    for by, step in (("s", s * 1e-5), ("f", force * 1e-5)):
        shift = (step, 0) if by == "s" else (0, step)
        after, before = (
            elastica.bend(s + k * shift[0], force + k * shift[1], drag) for k in (1, -1)
        )
        for name in ("x", "z", "theta"):
            measured = (getattr(after, name) - getattr(before, name)) / (2 * step)
            np.testing.assert_allclose(getattr(bend, f"{name}_{by}"), measured, rtol=2e-6)


def test_an_unloaded_carved_plectrum_is_its_own_top():
    """Away from a kink at once, and near one turned over the length of the patch."""
    s = np.array([3.9e-3, 4.1e-3, 4.4e-3])
    bend = Elastica(SCRAPED).bend(s, 0)
    np.testing.assert_allclose(bend.x, s)
    before, after = np.arctan([-0.01 / 1.5, -0.09 / 0.4])
    assert bend.theta[[0, 2]] == pytest.approx([before, after])
    assert np.tan(bend.theta[1]) == pytest.approx((np.tan(before) + np.tan(after)) / 2, abs=1e-6)
    assert bend.z[[0, 2]] == pytest.approx([-0.09e-3 + 0.2e-3 / 150, -0.09e-3 - 0.0675e-3])


def test_what_has_no_effect_is_said(monkeypatch):
    """A thickness beside an outline; an outline that a level takes as a slender bar, or ignores.

    The elements, which take seconds, are not solved for it.
    """
    monkeypatch.setattr(FE, "_table_of", None)
    thicker = load_rig().model_copy(
        update={"plectrum": SCRAPED.model_copy(update={"thickness": 1e-3})}
    )
    by_elastica, by_beam = predict(thicker, "elastica").warnings, predict(thicker, "beam").warnings
    assert "plectrum.thickness of 1 mm has no effect: plectrum.outline is 0.48 mm" in by_elastica[0]
    assert "elastica takes plectrum.outline as that of a slender bar" in by_elastica[1]
    assert ["beam ignores plectrum.outline" in text for text in by_beam] == [True]


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("contact", ["surface", "mid-line"])
def test_the_solver_of_tables_is_that_of_any_map(contact, friction):
    """The equations of the string's centre stand there in the load, here in position and force."""
    string = load_rig().string
    plectrum = SCRAPED.model_copy(update={"contact": contact, "friction": friction})
    centre = string_map(plectrum, string, "elastica")
    stiffness, overlap = np.array([string.static_stiffness]), np.array([plectrum.overlap])
    tabled, general = (
        solve_paths(Equilibria(plectra, stiffness, overlap), 33)
        for plectra in (plectra_of([centre], overlap), OnePlectrum(centre))
    )
    assert tabled.status == general.status
    for one, other in zip(tabled.curves, general.curves, strict=True):
        for name in ("height", "force", "position", "angle", "lift"):
            np.testing.assert_allclose(
                getattr(one, name), getattr(other, name), rtol=1e-7, atol=1e-10
            )
