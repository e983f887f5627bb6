"""Folds of the pluck, and early release there."""

import math

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import OnePlectrum
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.rig.load import load_rig
from tests.budget import slow

RIG = load_rig("paper")
PLECTRUM, STIFFNESS = RIG.plectrum, RIG.string.static_stiffness


@pytest.fixture(scope="module")
def pluck():
    return solve_pluck(Elastica(PLECTRUM), STIFFNESS, PLECTRUM.overlap)


def with_(**fields):
    return PLECTRUM.model_copy(update=fields)


def brute_release(elastica, stiffness, rest, start, force):
    """Follow the curve along which the string is in equilibrium along the plectrum, densely.

    Lengths are of overlaps and forces of `force`. All cases at once; arrays of shape (n,).
    Returns height and force where the height first stops rising or the tip is reached.
    """
    overlap = elastica.length - rest
    mu = elastica.friction

    def residual(u):
        s, f = rest + overlap * u[0], force * u[1]
        bend = elastica.bend(s, f)
        turn = f * (np.cos(bend.theta) - mu * np.sin(bend.theta)) / stiffness
        side = (np.sin(bend.theta) + mu * np.cos(bend.theta)) / stiffness
        value = (bend.x - rest + f * side) / overlap
        slope = np.stack([bend.x_s + turn * bend.theta_s, (bend.x_f + side + turn * bend.theta_f)])
        slope = slope * np.stack([np.ones_like(rest), force / overlap])
        lift = f * (np.cos(bend.theta) - mu * np.sin(bend.theta)) / stiffness
        return value, slope, lift - bend.z

    # At contact the force grows and the place hardly, and at a slip the place.
    u = np.stack([np.zeros_like(rest), start / force])
    way = np.stack([np.full_like(rest, mu > 0), np.full_like(rest, mu == 0)])
    heights, places, forces = [], [], []
    for _ in range(700):
        _, slope, height = residual(u)
        heights.append(height)
        places.append(u[0])
        forces.append(u[1])
        tangent = np.stack([-slope[1], slope[0]])
        tangent = tangent / np.hypot(*tangent)
        tangent = tangent * np.where((tangent * way).sum(0) < 0, -1, 1)
        way = tangent
        guess = u + tangent / 300
        for _ in range(2):
            value, slope, _ = residual(guess)
            norm = slope[0] ** 2 + slope[1] ** 2
            guess = guess - slope * value / norm
        # A case that has ended stays where it is.
        ended = (len(heights) > 1) & (
            (heights[-1] <= heights[max(len(heights) - 2, 0)]) | (u[0] > 1)
        )
        u = np.where(ended, u, guess)
    return np.array(heights), np.array(places), np.array(forces)


@pytest.mark.parametrize("friction", [*(slow(mu) for mu in (0.0, 0.1)), 0.4])
def test_no_wrong_branch_is_taken(friction):
    """Random cases, folds among them, against a dense continuation that knows no load s^2 F."""
    random = np.random.default_rng(3)
    elastica = Elastica(with_(friction=friction))
    cases = []
    while len(cases) < 40:
        overlap, stiffness = random.uniform(0.05e-3, 3.5e-3), 10 ** random.uniform(1.5, 4)
        try:
            cases.append((overlap, stiffness, solve_pluck(elastica, stiffness, overlap)))
        except ModelError:
            continue
    plucks = [pluck for _, _, pluck in cases]
    assert 3 < sum(pluck.released_at_fold for pluck in plucks) < 37
    # Where sliding starts, which may be at the fold.
    starts = [
        len(pluck.force) - 1 if friction and len(pluck.stretches) == 1 else pluck.stretches[-1]
        for pluck in plucks
    ]
    usable = [i for i, pluck in enumerate(plucks) if np.isclose(pluck.drag[-1], friction)]
    assert len(usable) > 30
    overlap, stiffness = (np.array([cases[i][k] for i in usable]) for k in (0, 1))
    start = np.array([plucks[i].force[starts[i]] for i in usable])
    top = np.array([plucks[i].force.max() for i in usable])
    heights, places, forces = brute_release(
        elastica, stiffness, elastica.length - overlap, start, top
    )
    for column, i in enumerate(usable):
        h, u, f = heights[:, column], places[:, column], forces[:, column] * top[column]
        past = np.flatnonzero((np.diff(h) <= 0) | (u[1:] > 1))
        end = past[0]
        if plucks[i].released_at_fold:
            assert plucks[i].release_height == pytest.approx(h[end], rel=1e-4)
        else:
            at_tip = np.interp(1.0, u[: end + 2], h[: end + 2])
            assert plucks[i].release_height == pytest.approx(at_tip, rel=1e-4)
        slid = slice(starts[i], None)
        between = np.interp(plucks[i].height[slid], h[: end + 1], f[: end + 1])
        error = np.abs(between - plucks[i].force[slid])[:-5]
        assert np.all(error <= 2e-3 * top[column])


def test_at_a_fold_the_string_is_released_before_the_tip():
    """At the fold the height is stationary: neighbours in the load are no higher."""
    pluck = solve_pluck(Elastica(PLECTRUM), 300.0, 3.5e-3)
    assert pluck.released_at_fold
    assert pluck.position[-1] < PLECTRUM.length
    steps = np.diff(pluck.height)
    assert np.all(steps > 0)
    assert steps[-1] < 0.02 * steps[0]
    assert pluck.release_slopes == (math.inf, math.inf)
    elastica = Elastica(PLECTRUM)
    load = pluck.force[-1] * pluck.position[-1] ** 2 * np.array([0.999, 1, 1.001])
    equilibria = Equilibria(OnePlectrum(elastica), np.array([300.0]), np.array([3.5e-3]))
    assert np.argmax(equilibria.slide(load[None]).height) == 1


def test_a_string_that_would_be_held_again_is_refused():
    soft = with_(youngs_modulus=8.2e9, thickness=0.105e-3, friction=0.05)
    with pytest.raises(ModelError, match=r"jumps along the plectrum at a jack height of .* mm"):
        solve_pluck(Elastica(soft), 573.8, 4.204e-3)
