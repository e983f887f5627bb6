"""Landings and modes of the exact engine, against momentum and Gauss's principle."""

import math

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.exact.inclusion import resolve, select
from sautereau.sim_backend.physics.exact_world import new_press
from sautereau.sim_backend.physics.structures import JACK, KEY, opened
from tests import key_oracle
from tests.sim_backend.scenes import RIG, pushed


def bench(*jacks, dry=0.0, friction=0.0):
    """Return a press with jacks of mass, arm, lift and stiffness of the damper each."""
    key, found = np.zeros(1, KEY), np.zeros(len(jacks), JACK)
    key["inertia"], key["gravity_moment"], key["viscous"], key["dry"] = 7e-4, 4e-3, 1e-4, dry
    key["dip"], key["height"], key["press_arm"] = math.inf, 0.01, 0.171
    key["gravity"] = GRAVITY
    found["friction"], found["clearance"], found["range"] = friction, 1.0, (-math.inf, 1.0)
    for name, values in zip(
        ("mass", "arm", "lift", "damper"), zip(*jacks, strict=True), strict=True
    ):
        found[name] = values
    return opened(new_press(RIG, pushed(), (0.0, 0.0), key, found, np.zeros((1, 5))))


def surfaces(press, angle):
    """Return rise and slope under each jack."""
    keys = [RIG.key.model_copy(update={"jack_arm": jack.arm}) for jack in press.jacks]
    return [(key_oracle.rise(key, angle), key_oracle.slope(key, angle)) for key in keys]


def test_a_landing_conserves_momentum():
    """A jack lands on a key that carries another jack, which then leaves the key."""
    press = bench((6e-3, 0.215, -math.inf, 0.0), (4e-3, 0.225, -math.inf, 0.0))
    a, w = 0.02, 1.0
    (y1, s1), (y2, s2) = surfaces(press, a)
    press.x[:], press.v[:] = (a, y1, y2), (w, -0.3, s2 * w)
    resolve(press, 0.0)
    expected = (7e-4 * w - 6e-3 * s1 * 0.3) / (7e-4 + 6e-3 * s1**2)
    np.testing.assert_allclose(press.v, [expected, s1 * expected, s2 * w], rtol=1e-12)
    # A key that rises against two resting jacks carries both.
    press.x[:], press.v[:] = (a, y1, y2), (w, 0.0, 0.0)
    resolve(press, 0.0)
    expected = 7e-4 * w / (7e-4 + 6e-3 * s1**2 + 4e-3 * s2**2)
    np.testing.assert_allclose(press.v, [expected, s1 * expected, s2 * expected], rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 1e4])
def test_a_plastic_landing_has_no_rebound_at_any_mass(ratio):
    """m b^2 / I = ratio: a fallen jack stays on its key at rest on the rail."""
    mass = ratio * 7e-4 / 0.215**2
    press = bench((mass, 0.215, -math.inf, 0.0))
    press.x[:], press.v[:] = 0.0, (0.0, -0.4)
    resolve(press, 0.0)
    assert (press.v == 0).all()


@pytest.mark.parametrize("seed", range(40))
def test_a_mode_is_the_one_of_least_constraint(seed):
    """Gauss's principle by its dual, a bounded least-squares problem, from rest."""
    random = np.random.default_rng(seed)
    masses, dampers = random.uniform(2e-3, 9e-3, 2), random.uniform(0, 60, 2)
    dry, friction = random.uniform(0, 3e-3), random.uniform(0, 0.06)
    press = bench(
        (masses[0], 0.215, 0.02, dampers[0]), (masses[1], 0.225, 0.02, dampers[1]),
        dry=dry, friction=friction,
    )  # fmt: skip
    a = 0.0 if seed % 3 == 0 else 0.03
    press.finger.moment = random.uniform(-0.03, 0.05)
    feet = surfaces(press, a)
    press.x[:] = a, feet[0][0], feet[1][0]
    select(press)
    mass = np.diag([7e-4, *masses])
    forces = [press.finger.moment + 4e-3]
    forces += [dampers[k] * (0.02 - feet[k][0]) - masses[k] * GRAVITY for k in (0, 1)]
    rows = np.array([
        [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [-feet[0][1], 1, 0], [-feet[1][1], 0, 1]
    ])  # fmt: skip
    low = np.array([-dry, -friction, -friction, 0, 0, 0])
    high = np.array([dry, friction, friction, np.inf, np.inf, np.inf])
    if a > 0:  # off the rail
        rows, low, high = (np.delete(array, 3, axis=0) for array in (rows, low, high))
    root = np.diag(np.diag(mass) ** -0.5)
    dual = lsq_linear(root @ rows.T, -root @ forces, (low, high), method="bvls", tol=1e-15)
    expected = (forces + rows.T @ dual.x) / np.diag(mass)
    np.testing.assert_allclose(press.a, expected, rtol=1e-6, atol=1e-6)
