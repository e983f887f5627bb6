"""The map: its accuracy, its derivatives, its pluck, what it refuses."""

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.batch import predict_many
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.fe import level as cache
from sautereau.analysis.model.plectrum.fe.build import Solver
from sautereau.analysis.model.plectrum.fe.level import FE
from sautereau.analysis.model.plectrum.fe.solve import Elastic
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.plectrum.tapered import samples
from sautereau.analysis.model.pluck.paths import Status
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.analysis.model.predict import predict
from sautereau.rig.instrument import Outline
from sautereau.rig.load import load_rig
from tests.outlines import outline_from

RIG = load_rig("paper")
PLECTRUM = RIG.plectrum
MAP_ERROR = 5e-4  # 1, of displacement, shortening and rotation


def outline(x, top, bottom):
    """mm."""
    edges = {"x": x, "top": top, "bottom": bottom}
    return Outline.model_validate({k: [f"{v} mm" for v in edge] for k, edge in edges.items()})


TAPERED = PLECTRUM.model_copy(
    update={"outline": outline_from(lambda x: 0.48e-3 * (1 - 0.5 * x / 4.5e-3), 4.5e-3)}
)
SCRAPED = PLECTRUM.model_copy(
    update={
        "friction": 0.1,
        "outline": outline(
            [0, 2, 2.6, 4.1, 4.5], [0.24, 0.24, 0.16, 0.15, 0.06], [-0.24, -0.24, -0.24, -0.2, -0.2]
        ),
    }
)
"""Its top falls by 11 degrees where the string slides off."""


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory):
    """Keep these tests' maps out of the user's cache."""
    path = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(cache, "cache_folder", lambda: path)
        yield path


@pytest.fixture(scope="module")
def uniform(folder):
    return FE(PLECTRUM)


def check_against_the_elements(plectrum, places):
    """Compare the map with solutions at places and loads that it was not fitted to."""
    found, solver = FE(plectrum), Solver(profile_of(plectrum), Elastic(0.35))
    random = np.random.default_rng(3)
    unit = plectrum.length
    for s in (unit - plectrum.overlap, *(unit * random.uniform(0.86, 1, places)), unit):
        loads = found.table.q_max * np.sort(random.uniform(0.05, 1, 3))
        x, z, turned = solver.laws(*np.array([[s / unit]]), loads, np.array([plectrum.friction]))
        x, z, turned = (x - 1)[0, :, 0] * s, z[0, :, 0] * s * loads, turned[0, :, 0] * loads
        force = loads * found.bending_stiffness / s**2
        still, bend = found.bend(s, 0 * force), found.bend(s, force)
        missed = (bend.x - still.x - x) / (np.abs(x) + 0.02 * np.abs(z).max())
        assert np.abs(missed).max() < MAP_ERROR
        np.testing.assert_allclose(bend.z - still.z, z, rtol=MAP_ERROR)
        np.testing.assert_allclose(bend.theta - still.theta, turned, rtol=MAP_ERROR)


def test_the_map_is_the_elements(uniform):
    check_against_the_elements(PLECTRUM, 2)


@pytest.mark.slow
@pytest.mark.parametrize("plectrum", [TAPERED, SCRAPED], ids=["tapered", "scraped"])
def test_the_map_of_a_carved_plectrum_is_the_elements(plectrum):
    check_against_the_elements(plectrum, 6)


def test_derivatives_are_those_of_the_map(uniform):
    s, force = np.array([4.0e-3, 4.3e-3, 4.49e-3]), np.array([1.3, 0.5, 0.1])
    bend = uniform.bend(s, force)
    for by, step in (("s", s * 1e-5), ("f", force * 1e-5)):
        shift = (step, 0) if by == "s" else (0, step)
        after, before = (uniform.bend(s + k * shift[0], force + k * shift[1]) for k in (1, -1))
        for name in ("x", "z", "theta"):
            measured = (getattr(after, name) - getattr(before, name)) / (2 * step)
            np.testing.assert_allclose(getattr(bend, f"{name}_{by}"), measured, rtol=1e-6)


def test_the_contact_moves_along_the_surface_that_the_angle_says(uniform):
    """No load does work on a string that slides on a smooth plectrum but by bending it."""
    bend = uniform.bend(np.linspace(3.9e-3, 4.5e-3, 7), 1e-9)
    np.testing.assert_allclose(np.arctan2(bend.z_s, bend.x_s), bend.theta, atol=1e-9)


@pytest.mark.slow
def test_an_unloaded_carved_plectrum_is_its_own_top():
    """Away from a kink at once, and near one turned over the length of the patch."""
    found, s = FE(SCRAPED), np.array([3.9e-3, 4.1e-3, 4.4e-3])
    bend = found.bend(s, 0)
    np.testing.assert_allclose(bend.x, s)
    before, after = np.arctan([-0.01 / 1.5, -0.09 / 0.4])
    assert bend.theta[0] == pytest.approx(before)
    assert bend.theta[2] == pytest.approx(after)
    assert np.tan(bend.theta[1]) == pytest.approx((np.tan(before) + np.tan(after)) / 2, abs=1e-6)
    assert bend.z[[0, 2]] == pytest.approx([-0.09e-3 + 0.2e-3 / 150, -0.09e-3 - 0.0675e-3])
    turned = np.arctan2(bend.z_s, bend.x_s)
    np.testing.assert_allclose(turned[[0, 2]], bend.theta[[0, 2]], atol=1e-12)
    assert turned[1] == pytest.approx(bend.theta[1], abs=1e-6)  # of the table


def test_the_pluck_is_the_elastica_s_but_for_shear(uniform):
    stiffness = RIG.string.static_stiffness
    found = solve_pluck(uniform, stiffness, PLECTRUM.overlap)
    exact = solve_pluck(Elastica(PLECTRUM), stiffness, PLECTRUM.overlap)
    assert found.force[-1] == pytest.approx(exact.force[-1], rel=6e-3)
    assert found.height[-1] == pytest.approx(exact.height[-1], rel=3e-3)
    assert found.angle[-1] == pytest.approx(exact.angle[-1], abs=2e-3)


@pytest.mark.parametrize(
    ("s", "force", "message"),
    [
        (1e-3, 0.1, r"1 mm from the clamp is not within 3.825 to 4.5 mm"),
        (5e-3, 0.1, "5 mm from the clamp"),
        (4.4e-3, 3.0, r"3 N at 4.4 mm from the clamp is not within 0 to 2.0.* N"),
        (4.4e-3, -0.1, "-0.1 N at"),
        ([4.4e-3, np.nan], 0.1, "nan mm from the clamp"),
    ],
)
def test_what_is_outside_the_map_is_refused(uniform, s, force, message):
    with pytest.raises(ModelError, match=message):
        uniform.bend(s, force)


def test_an_outline_of_another_length_is_refused():
    carved = outline([0, 4.2], [0.2, 0.2], [-0.2, -0.2])
    with pytest.raises(ModelError, match=r"ends at x = 4.2 mm and plectrum.length is 4.5 mm"):
        FE(PLECTRUM.model_copy(update={"outline": carved}))


def test_an_overlap_down_to_the_root_is_refused():
    with pytest.raises(ModelError, match=r"4 mm is more than 70 % of the plectrum's 4.5 mm"):
        FE(PLECTRUM.model_copy(update={"overlap": 4e-3}))


def test_a_batch_of_carved_plectra_is_predicted_as_each_of_them(uniform, monkeypatch):
    """With a map that is at hand; a case that has no pluck says why."""
    made = samples(profile_of(PLECTRUM), 0.85, 2.0)
    monkeypatch.setattr("sautereau.analysis.model.plectrum.fe.build.build", lambda *_: (made, None))
    stepped = RIG.plectrum.model_copy(update={"tip_thickness": 0.4e-3, "contact": "surface"})
    rig = RIG.model_copy(update={"plectrum": stepped})
    overlaps = {"plectrum.overlap": [0.2e-3, 0.3e-3, 4.0e-3], "press.jack_speed": 0.1}
    found = predict_many(rig, overlaps)
    for k, overlap in enumerate(overlaps["plectrum.overlap"][:2]):
        one = predict(rig.replaced({"plectrum.overlap": overlap, "press.jack_speed": 0.1}))
        assert one.level == "fe"
        for name in ("pluck_duration", "plectrum_force", "release_lift", "release_angle", "v_osc"):
            assert getattr(found, name)[k] == pytest.approx(getattr(one, name), rel=1e-6)
        assert found.peak_force[k] == pytest.approx(one.peak_force, rel=1e-4)
    short = predict_many(rig, {"press.jack_rise": 2e-3})
    assert (found.status[2], short.status) == (Status.NOT_CONVERGED, Status.PRESS_TOO_SHORT)
    assert np.isnan(found.v_osc[2])
