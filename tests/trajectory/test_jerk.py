"""Motions of constant jerk: continuous, within their limits, and as fast as possible."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.trajectory.timing import (
    chained,
    falling,
    jerk_law,
    length,
    ramp,
    rest_to_rest,
    reversed_law,
)


def powers(low, high):
    return st.floats(low, high).map(lambda power: 10.0**power)


@given(powers(-3, 0), powers(-3, 4), powers(-1, 8))
def test_a_ramp_reaches_its_speed_within_its_limits(speed, acceleration, jerk):
    phases = ramp(speed, acceleration, jerk)
    law = jerk_law(phases)
    assert law.states[-1, 1] == pytest.approx(speed, rel=1e-9)
    assert abs(law.states[-1, 2]) <= 1e-9 * acceleration
    assert np.abs(law.states[:, 2]).max() <= acceleration * (1 + 1e-9)
    assert np.abs(law.jerks).max() <= jerk
    # Its mean speed is half the final one, and reversing it ends at rest.
    assert law.states[-1, 0] == pytest.approx(speed * length(phases) / 2, rel=1e-9)
    undone = jerk_law([*phases, *falling(phases)])
    assert abs(undone.states[-1, 1]) <= 1e-9 * speed


@given(powers(-9, -1), powers(-4, 0), powers(-3, 4), powers(-1, 8))
def test_a_stroke_covers_its_distance_from_rest_to_rest(distance, speed, acceleration, jerk):
    law = jerk_law(rest_to_rest(distance, speed, acceleration, jerk))
    assert law.states[-1, 0] == pytest.approx(distance, rel=1e-9)
    assert abs(law.states[-1, 1]) <= 1e-9 * speed
    motion = law.at(np.union1d(np.linspace(0, law.duration, 501), law.times))
    assert motion.velocity.max() <= speed * (1 + 1e-9)
    assert np.abs(motion.acceleration).max() <= acceleration * (1 + 1e-9)
    assert np.abs(law.jerks).max() <= jerk
    assert np.diff(motion.position).min() >= -1e-12 * distance
    # Some limit is reached, otherwise it would not be the fastest.
    reached = motion.velocity.max() / speed, np.abs(law.jerks).max() / jerk
    assert max(reached) > 1 - 1e-9


@pytest.mark.parametrize("distance", [5e-324, 1e-200, 1e-30])
def test_the_least_of_distances_is_covered(distance):
    law = jerk_law(rest_to_rest(distance, 0.05, 0.6, 200.0))
    assert np.isfinite(law.states).all()
    assert np.isfinite(law.times).all()


def test_chained_laws_are_continuous():
    rise = jerk_law(rest_to_rest(0.01, 0.05, 0.6, 200.0))
    rest = jerk_law([(0.1, 0.0)])
    total = chained([rest, rise, rest, reversed_law(rise)])
    assert total.duration == pytest.approx(0.2 + 2 * rise.duration, rel=1e-15)
    at = total.at(np.array([0.05, 0.1 + rise.duration, 0.2 + rise.duration, total.duration]))
    assert at.position == pytest.approx([0.0, 0.01, 0.01, 0.0], abs=1e-15)
    t = np.linspace(0, rise.duration, 101)
    down = total.at(0.2 + rise.duration + t)
    up = rise.at(t)
    assert down.position == pytest.approx(0.01 - up.position, abs=1e-15)
    assert down.velocity == pytest.approx(-up.velocity, abs=1e-13)
    assert len(total.jerks) == len(total.times) - 1 == len(total.states) - 1


def test_outside_the_law_everything_is_at_rest():
    law = jerk_law(rest_to_rest(0.01, 0.05, 0.6, 200.0))
    before, after = law.at(np.array([-1.0])), law.at(np.array([law.duration + 1]))
    assert before.position[0] == before.velocity[0] == 0.0
    assert after.position[0] == pytest.approx(0.01, rel=1e-12)
    assert abs(after.velocity[0]) < 1e-15
