"""The exact engine against an independent solution of the documented equations."""

import numpy as np
import pytest

from sautereau.analysis.model.choirs import choir_pluck
from sautereau.rig.instrument import Choir
from sautereau.sim_backend.physics.observation import observe
from tests.budget import amount, slow
from tests.sim_backend import oracle
from tests.sim_backend.scenes import RIG, push_of, pushed

QUICK, MORE = (23, 43, 59), {41, 71, 93}
"""Seeds in which much happens: landings that accumulate, returns, a second contact, the felt."""
SOON_STUCK = (19, 117)  # Seeds of a string that soon sticks on the plectrum


def drawn_choir(rng):
    """Return a choir of random lever, jack, plectrum and string."""
    between = rng.uniform
    length = between(3e-3, 6e-3)
    tongue = RIG.jack.tongue.model_copy(update={"pivot": between(6e-3, 20e-3)})
    damper = RIG.jack.damper.model_copy(
        update={"lift": between(0.2e-3, 0.9e-3), "stiffness": between(0, 20)}
    )
    jack = {
        "mass": np.exp(between(np.log(4e-3), np.log(40e-3))),
        "register_friction": between(0, 60e-3),
        "string_clearance": between(1e-3, 4e-3),
        "tongue": tongue,
        "damper": damper,
    }
    plectrum = {
        "length": length,
        "width": between(0.5e-3, 2e-3),
        "thickness": between(0.3e-3, 0.6e-3),
        "overlap": length * between(0.02, 0.1),
        "contact": str(rng.choice(["surface", "mid-line"])),
        "friction": float(rng.choice([0.0, between(0, 0.3)])),
    }
    string = {"tension": between(30, 200), "plucking_point": between(0.05, 0.2)}
    return Choir.model_construct(
        jack_arm=between(0.15, 0.3),
        jack=RIG.jack.model_copy(update=jack),
        plectrum=RIG.plectrum.model_copy(update=plectrum),
        string=RIG.string.model_copy(update=string),
    )


def drawn(seed):
    """Return a random rig of one or two choirs and a random push."""
    rng = np.random.default_rng(seed)
    between = rng.uniform
    first, *more = [drawn_choir(rng) for _ in range(1 + seed % 2)]
    key = {
        "press_arm": between(0.1, 0.18),
        "jack_arm": first.jack_arm,
        "jack_surface_height": between(0, 20e-3),
        "inertia": np.exp(between(np.log(1e-5), np.log(1e-2))),
        "gravity_moment": between(-10e-3, 0.5 * first.jack.mass * 9.8 * first.jack_arm),
        "pivot_coulomb_friction": between(0, 5e-3),
        "pivot_viscous_friction": between(0, 2e-3),
        "dip": between(4e-3, 8e-3),
        "felt_stiffness": np.exp(between(np.log(2e3), np.log(1e5))),
        "felt_damping": between(0, 30),
    }
    tip = np.random.default_rng([seed, 3]).uniform(-0.3, 0.3)
    rig = RIG.model_copy(
        update={
            "key": RIG.key.model_copy(update=key),
            "jack": first.jack,
            "plectrum": first.plectrum,
            "string": first.string,
            "more_choirs": tuple(more),
            "arm": RIG.arm.model_copy(update={"fingertip_friction": tip}),
        }
    )
    on = [bool(value) for value in rng.integers(0, 2, 3)]
    force = np.exp(between(np.log(1.5), np.log(12)))
    scene = pushed(
        push=push_of(force, between(0.02, 0.05), between(0.05, 0.15)),
        step=1e-4,
        friction=on[0],
        felt=True,
        tongue=on[1],
        damper=on[2],
    )
    return rig, scene


def assert_same_events(found, true, within):
    """Assert that an engine's events are the oracle's, within a time [s]."""
    for name in ("contacts", "releases", "returns"):
        events, expected = getattr(found, name), getattr(true, name)
        assert [e.choir for e in events] == [choir for _, choir, _ in expected], name
        for event, (at, _, force) in zip(events, expected, strict=True):
            assert event.time == pytest.approx(at, abs=within, rel=0), name
            assert event.force == pytest.approx(force, rel=1e-9, abs=1e-12), name


def compare(seed):
    """Assert that the engine finds the events and the motion of the oracle."""
    rig, scene = drawn(seed)
    found = observe(rig, scene)
    time, end = found.motions.time, found.motions.time[-1]
    true = oracle.solve(rig, scene, end, time)
    assert_same_events(found.events, true, 2e-8)
    angle = np.array(true.motion)[:, 0]
    np.testing.assert_allclose(found.motions.angle[time < end], angle, atol=2e-7, rtol=0)


@pytest.mark.parametrize(
    ("force", "drop", "shortening"),
    [(0.33, 0.4979, 0.033), (0.5, 0.7501, 0.076), (1, 1.4565, 0.295)],
)
def test_the_oracles_elastica_is_that_of_table_1(force, drop, shortening):
    """mm, at the tip; beam theory gives 0.5001, 0.7577 and 1.5154 mm."""
    plectrum = RIG.plectrum
    q = plectrum.length**2 * force / plectrum.bending_stiffness
    x, z, *_ = oracle.StringCurve(plectrum, RIG.string).point(q, 0.0)
    length = plectrum.length * 1e3
    assert (-z * length, (1 - x) * length) == pytest.approx((drop, shortening), abs=6e-4)


@pytest.mark.parametrize(
    "seed", [*QUICK, *map(slow, sorted({*range(amount(24, 66)), *MORE, 117} - {*QUICK}))]
)
def test_random_presses_are_the_documented_equations(seed):
    compare(seed)


@pytest.mark.parametrize("seed", [SOON_STUCK[0], slow(SOON_STUCK[1])])
def test_a_string_that_soon_sticks_is_released_where_the_oracle_says(seed):
    """It slides inward only over the first 30 um of rise, and is then held."""
    rig, scene = drawn(seed)
    choir = Choir.model_construct(plectrum=rig.plectrum, string=rig.string)
    pluck, true = choir_pluck(choir, scene.plectrum), oracle.StringCurve(rig.plectrum, rig.string)
    assert len(true.pieces) == 3
    assert pluck.release_height == pytest.approx(true.release, rel=1e-9)
    assert pluck.vertical_force[-1] == pytest.approx(true.release_force, rel=1e-9)
