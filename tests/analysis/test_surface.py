"""The string on the plectrum's surface, against the elastica's equation solved from the clamp."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from sautereau.analysis.model.batch import predict_many
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from tests.outlines import outline_from


def paper(**plectrum) -> Rig:
    """Return the paper's rig with the string on the surface."""
    rig = load_rig()
    update = {"contact": "surface", **plectrum}
    return rig.model_copy(update={"plectrum": rig.plectrum.model_copy(update=update)})


def shot(rig: Rig, position: float) -> tuple[float, float]:
    """Return force [N] and jack height [m] with a sliding string at a position [m].

    From the clamp, EI theta'' = -(cos theta f_z - sin theta f_x) under the string's force f at the
    position, where the curvature is zero; a spring holds the centre of the string, which is half
    the thickness and half the wire above the mid-line.
    """
    plectrum, stiffness = rig.plectrum, rig.string.static_stiffness
    offset = (plectrum.thickness + rig.string.diameter) / 2
    rest = plectrum.length - plectrum.overlap

    def load(force, theta):
        sine, cosine = np.sin(theta), np.cos(theta)
        normal, along = np.array([sine, -cosine]), np.array([cosine, sine])
        return force * (normal + plectrum.friction * along)

    def bent(curvature, force, theta):
        x, z = load(force, theta) / plectrum.bending_stiffness
        return solve_ivp(
            lambda _, y: [y[1], np.sin(y[0]) * x - np.cos(y[0]) * z, np.cos(y[0]), np.sin(y[0])],
            (0, position), [0, -curvature, 0, 0], "DOP853", rtol=1e-11, atol=1e-14,
        ).y[:, -1]  # fmt: skip

    def faults(unknown):
        curvature, force, theta = unknown * scales
        end = bent(-curvature, force, theta)
        push = -load(force, theta)
        x = end[2] - offset * np.sin(end[0])
        return [end[0] - theta, end[1] / 100, (x - rest - push[0] / stiffness) * 1e4]

    scales = np.array([-100.0, 0.5, -0.25])
    found, _, status, why = fsolve(faults, np.ones(3), full_output=True, xtol=1e-12)
    assert status == 1, why
    curvature, force, theta = found * scales
    end = bent(-curvature, force, theta)
    drop = end[3] + offset * (np.cos(theta) - 1)
    return force, -load(force, theta)[1] / stiffness - drop


@pytest.mark.parametrize("friction", [0.0, 0.15])
def test_force_and_height_are_those_of_the_equation_solved_from_the_clamp(friction):
    rig = paper(friction=friction)
    pluck = rig_pluck(rig)
    for position in (4.35e-3, 4.5e-3):
        force, height = shot(rig, position)
        sliding = slice(pluck.stretches[-1] + 60 * (friction == 0), None)
        at = np.interp(position, pluck.position[sliding], pluck.height[sliding])
        assert at == pytest.approx(height, rel=2e-5)
        assert np.interp(at, pluck.height, pluck.force) == pytest.approx(force, rel=2e-5)
    assert pluck.release_height == pytest.approx(height, rel=1e-8)


def test_the_surface_changes_force_and_duration_by_a_fifth():
    line, surface = rig_pluck(load_rig()), rig_pluck(paper())
    assert surface.force[-1] / line.force[-1] == pytest.approx(1.22, abs=0.01)
    assert surface.release_height / line.release_height == pytest.approx(24.5 / 20, abs=0.005)


@pytest.mark.parametrize(("level", "error"), [("rods", 1e-3), ("fe", 6e-3)])
def test_every_level_has_the_surface(level, error):
    exact, found = rig_pluck(paper()), rig_pluck(paper(), level)
    assert found.release_height == pytest.approx(exact.release_height, rel=error)
    assert found.force[-1] == pytest.approx(exact.force[-1], rel=error)


@pytest.mark.parametrize("friction", [0.05, 0.12, 0.3])
def test_friction_holds_the_string_between_sliding_back_and_out(friction):
    pluck = rig_pluck(paper(friction=friction))
    moved = np.diff(pluck.position[: pluck.stretches[-1]])
    # Towards the clamp only with all friction against it, and towards the tip not at all.
    assert moved.max() <= 1e-12
    sliding = moved < -1e-9
    assert np.all(pluck.drag[1 : pluck.stretches[-1]][sliding] < -0.99 * friction)
    assert sliding.any() == (friction < 0.13)
    assert np.abs(pluck.drag).max() <= friction
    assert np.all(np.diff(pluck.height) > 0)


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.48])
def test_the_force_on_the_plectrum_is_that_of_the_displaced_string(friction):
    rig = paper(friction=friction)
    found = predict(rig)
    string = found.released_string
    force = rig.string.static_stiffness * np.hypot(string.x, string.z)
    assert found.plectrum_force == pytest.approx(force, rel=1e-9)


def test_a_batch_and_a_slow_moving_string_agree():
    rig, values = paper(friction=0.1), {"plectrum.thickness": [0.4e-3, 0.48e-3]}
    found, one = predict_many(rig, values), predict(rig)
    assert found.pluck_duration[1] == pytest.approx(one.pluck_duration, rel=1e-6)
    assert found.plectrum_force[1] == pytest.approx(one.plectrum_force, rel=1e-6)
    slow = paper()
    slow = slow.replaced({"press.jack_speed": 0.02})
    moving = modal_pluck(slow, modes=10)
    assert moving.release == pytest.approx(rig_pluck(slow).release_height / 0.02, rel=3e-3)


def test_a_sloping_top_starts_at_its_own_height():
    rig = paper()
    length = rig.plectrum.length
    outline = outline_from(lambda x: 0.48e-3 - 0.2e-3 * x / length, length)
    for contact in ("surface", "mid-line"):
        carved = paper(outline=outline, contact=contact)
        steps = np.diff(rig_pluck(carved, "fe").height)
        assert steps[0] == pytest.approx(steps[1], rel=0.05)
        rest = string_map(carved.plectrum, carved.string, "fe")
        at = rest.bend(rest.first, 0.0)
        assert (at.x, at.z) == pytest.approx((length - carved.plectrum.overlap, 0), abs=1e-15)


def test_the_stand_in_plucks_on_the_surface():
    from sautereau.sim_backend.physics.observation import observe
    from sautereau.sim_backend.scene import load_scene

    scene, held = load_scene("ideal").model_copy(update={"engine": "exact"}), []
    for contact in ("mid-line", "surface"):
        truth = {"plectrum.contact": contact}
        events = observe(load_rig(), scene.model_copy(update={"truth": truth})).events
        held.append(events.releases[0].time - events.contacts[0].time)
    assert held[1] / held[0] == pytest.approx(24.465 / 19.987, rel=1e-3)
