"""Many presses simulated together, against presses simulated separately."""

import numpy as np
import pytest

from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.presses.sweep import Ending, sweep
from sautereau.sim_backend.physics.presses.world import ExactWorld
from tests.sim_backend.scenes import RETURNING, RIG, choir, pressed, pushed

UNITS = {
    "push.force": "N",
    "push.duration": "s",
    "key.inertia": "kg m^2",
    "key.press_arm": "m",
    "key.pivot_coulomb_friction": "N m",
    "key.felt_stiffness": "N/m",
    "jack.mass": "kg",
    "jack.string_clearance": "m",
    "jack.tongue.pivot": "m",
    "jack.damper.stiffness": "N/m",
    "plectrum.overlap": "m",
    "plectrum.thickness": "m",
    "string.tension": "N",
}


def scene(**changes):
    return pushed(duration=0.03, rest=0.02, **RETURNING, **changes)


def one(scene, values, rig=RIG):
    """Return contact and release of each choir in a world with one press."""
    texts = {name: f"{value!r} {UNITS[name]}" for name, value in values.items()}
    changed = {n.split(".")[1]: values[n] for n in values if n.startswith("push.")}
    if changed:
        scene = scene.model_copy(update={"push": scene.push.model_copy(update=changed)})
    rig = with_values(rig, {n: text for n, text in texts.items() if not n.startswith("push.")})
    drive = drive_of(RIG, scene)
    world = ExactWorld(rig, scene, drive.start)
    for i in range(drive.samples):
        world.advance(drive.reference(i), True)
    found = []
    for events in (world.events.contacts, world.events.releases):
        firsts = np.full(1 + len(rig.more_choirs), np.inf)
        for event in reversed(events):
            firsts[event.choir] = event.time
        found.append(firsts)
    return found


def spread(names, presses, seed=5):
    ranges = {
        "push.force": (0.1, 3.0),
        "push.duration": (0.01, 0.04),
        "key.inertia": (5e-4, 1e-3),
        "key.press_arm": (0.16, 0.18),
        "key.pivot_coulomb_friction": (0.0, 3e-3),
        "key.felt_stiffness": (5e3, 1e5),
        "jack.mass": (4e-3, 12e-3),
        "jack.string_clearance": (1e-3, 3e-3),
        "jack.tongue.pivot": (6e-3, 20e-3),
        "jack.damper.stiffness": (0.0, 40.0),
        "plectrum.overlap": (0.1e-3, 0.5e-3),
        "plectrum.thickness": (0.3e-3, 0.6e-3),
        "string.tension": (40.0, 90.0),
    }
    random = np.random.default_rng(seed)
    return {name: random.uniform(*ranges[name], presses) for name in names}


def rows(values):
    count = len(next(iter(values.values())))
    return [{name: float(v[i]) for name, v in values.items()} for i in range(count)]


KEYS = [name for name in UNITS if name.split(".")[0] in ("push", "key", "jack")]
PLUCKS = ["plectrum.overlap", "plectrum.thickness", "string.tension"]


def test_a_press_of_a_sweep_agrees_with_a_separate_world():
    values = spread(KEYS, 12)
    found = sweep(RIG, scene(), values)
    assert found.contact.shape == (1, 12)
    assert 3 < found.plucked.sum() < 12
    single = [one(scene(), row) for row in rows(values)]
    np.testing.assert_allclose(found.contact[0], [c[0] for c, _ in single], rtol=1e-12)
    np.testing.assert_allclose(found.release[0], [r[0] for _, r in single], rtol=1e-12)


def test_results_do_not_depend_on_batch_and_threads():
    values = spread(KEYS, 150)
    many = sweep(RIG, scene(), values, threads=2)
    again = sweep(RIG, scene(), values, threads=1)
    alone = sweep(RIG, scene(), {name: v[70] for name, v in values.items()})
    for name in ("contact", "release", "release_force", "release_speed", "status"):
        np.testing.assert_array_equal(getattr(many, name), getattr(again, name))
        np.testing.assert_array_equal(getattr(many, name)[..., 70], getattr(alone, name))
        assert not np.isnan(getattr(many, name)).any()


def test_varied_plectra_agree_with_separate_worlds():
    values = spread([*PLUCKS, "push.force"], 10)
    values["push.force"] += 0.5
    found = sweep(RIG, scene(), values)
    single = [one(scene(), row) for row in rows(values)]
    np.testing.assert_allclose(found.contact[0], [c[0] for c, _ in single], rtol=1e-12)
    np.testing.assert_allclose(found.release[0], [r[0] for _, r in single], atol=1e-10)
    alone = [sweep(RIG, scene(), row).release[0] for row in rows(values)]
    np.testing.assert_allclose(found.release[0], alone, rtol=1e-12)


def test_any_level_and_friction_may_differ():
    beam = scene(plectrum="beam")
    values = spread(["plectrum.overlap"], 3)
    found = sweep(RIG, beam, values)
    single = [one(beam, row)[1][0] for row in rows(values)]
    np.testing.assert_allclose(found.release[0], single, rtol=1e-12)
    found = sweep(RIG, scene(), {"plectrum.friction": [0.2, 0.0, 0.1]})
    single = [
        sweep(with_values(RIG, {"plectrum.friction": mu}), scene(), {}).release[0]
        for mu in (0.2, 0.0, 0.1)
    ]
    np.testing.assert_allclose(found.release[0], single, atol=1e-10)
    assert found.release_force[0, 0] > found.release_force[0, 1]


def test_derived_quantities_may_be_given():
    plain = sweep(RIG, scene(), {"plectrum.overlap": [0.2e-3]})
    derived = sweep(
        RIG,
        scene(),
        {
            "plectrum.overlap": [0.2e-3],
            "plectrum.bending_stiffness": RIG.plectrum.bending_stiffness,
            "string.static_stiffness": RIG.string.static_stiffness,
        },
    )
    np.testing.assert_allclose(plain.release, derived.release, rtol=1e-13)


def force_of(law, height):
    """Evaluate a law in its cells."""
    cells = law.cells
    first, _, last = law.first[0]
    cell = first + np.searchsorted(cells[first:last, 0], height, side="right") - 1
    u = height - cells[cell, 0]
    c = cells[cell].T
    return c[1] + u * (c[2] + u * (c[3] + u * c[4]))


def test_shapes_broadcast_and_choirs_come_first():
    rig = RIG.model_copy(
        update={"more_choirs": (choir(0.205, 2.6e-3, mass=RIG.jack.mass, overlap=0.2e-3),)}
    )
    force, clearance = np.array([[1.5], [2.0], [2.5]]), np.array([2.2e-3, 2.8e-3])
    found = sweep(
        rig, scene(), {"push.force": force, "more_choirs.0.jack.string_clearance": clearance}
    )
    assert found.contact.shape == (2, 3, 2)
    assert found.status.shape == (3, 2)
    assert found.plucked.all()
    assert (np.diff(found.release[1], axis=1) > 0).all()
    assert (np.diff(found.release, axis=1) < 0).all()
    assert sweep(rig, scene(), {}).contact.shape == (2,)
    assert sweep(rig, scene(), {"push.force": []}).contact.shape == (2, 0)


def test_ideal_presses():
    ideal = pressed(**RETURNING)
    values = {"jack.string_clearance": np.array([1.5e-3, 1.944e-3, 2.4e-3])}
    found = sweep(RIG, ideal, values)
    single = [one(ideal, row) for row in rows(values)]
    np.testing.assert_allclose(found.contact[0], [c[0] for c, _ in single], rtol=1e-12)
    np.testing.assert_allclose(found.release[0], [r[0] for _, r in single], rtol=1e-12)
    np.testing.assert_allclose(found.release_speed, RIG.press.jack_speed, rtol=5e-3)


def test_presses_without_a_pluck_are_reported_without_nan():
    found = sweep(
        RIG,
        scene(),
        {
            "push.force": [1.2, 0.0, 0.12, 1.2, np.nan, 1.2, 1.2],
            "key.inertia": [7e-4, 7e-4, 7e-4, -1.0, 7e-4, np.inf, 7e-4],
            "plectrum.overlap": [0.2e-3, 0.2e-3, 0.2e-3, 0.2e-3, 0.2e-3, 0.2e-3, 4.4999e-3],
        },
    )
    ends = [Ending.PLAYED] * 3 + [Ending.OUT_OF_RANGE] * 3 + [Ending.NO_PLUCK]
    assert found.status.tolist() == ends
    assert found.plucked[0].tolist() == [True] + [False] * 6
    assert np.isinf(found.release[0, 1:]).all()
    assert np.isinf(found.release_speed[0, 1:]).all()
    none = sweep(RIG, scene(), {"plectrum.overlap": [-1e-3, np.nan]})
    assert (none.status == Ending.OUT_OF_RANGE).all()
    wild = sweep(RIG, scene(felt=False), {"push.force": 90.0, "push.duration": 1.0})
    assert wild.status == Ending.TURNED_OVER
    assert wild.plucked.all()  # before


def test_values_that_cannot_vary_are_refused():
    with pytest.raises(SceneError, match=r"arm\.base_x cannot be varied.*key\.inertia"):
        sweep(RIG, scene(), {"arm.base_x": [0.1]})
    with pytest.raises(SceneError, match="felt_stiffness"):
        sweep(RIG, scene(felt=False), {"key.felt_stiffness": [1e3]})
    with pytest.raises(SceneError, match="do not fit"):
        sweep(RIG, scene(), {"push.force": [1.0, 2.0], "key.inertia": [1e-3] * 3})
    with pytest.raises(SceneError, match="rigid"):
        sweep(RIG, scene().model_copy(update={"string": "modal"}), {})
