"""A motion in integer counts, and its reversal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import Segments, segments_document


@st.composite
def rests_to_rest(draw):
    row = st.tuples(*[st.integers(-(2**30), 2**30)] * 4, st.integers(1, 512))
    rows = np.array(draw(st.lists(row, min_size=1, max_size=9)))
    rows[-1, 2:4] = 0
    return Segments(np.array([5, -7]), rows[:, :2], rows[:, 2:4], 2 * rows[:, 4])


@given(rests_to_rest())
def test_the_reversed_motion_is_the_motion_backwards(spline, segments):
    back = segments.reversed()
    assert (back.start == segments.end).all()
    assert (back.end == segments.start).all()
    assert back.total_samples == segments.total_samples
    assert len(back) == len(segments)
    there, again = spline(segments, 1e-3), spline(back, 1e-3)
    last = there.x[-1]
    t = np.linspace(0, last, 301)
    scale = np.abs(there(t)).max()
    assert np.abs(there(t) - again(last - t)).max() <= 1e-11 * scale
    scale = np.abs(there(t, 1)).max()
    assert np.abs(there(t, 1) + again(last - t, 1)).max() <= 1e-9 * scale


@given(rests_to_rest())
def test_reversing_twice_is_the_identity(segments):
    twice = segments.reversed().reversed()
    for name in ("start", "steps", "velocities", "samples"):
        assert (getattr(twice, name) == getattr(segments, name)).all()


def test_a_single_segment_is_reversed():
    one = Segments(np.array([1, 2]), np.array([[10, -4]]), np.array([[0, 0]]), np.array([6]))
    back = one.reversed()
    assert back.start.tolist() == [11, -2]
    assert back.steps.tolist() == [[-10, 4]]
    assert back.velocities.tolist() == [[0, 0]]


def test_the_document_says_the_same(paper):
    plan = plan_press(paper)
    document = segments_document(plan.segments, 1e-3, plan.home, plan.hover)
    assert document["sample_period"] == 1e-3
    assert document["home"] == [0, -500_000]
    assert document["hover"] == plan.approach.start.tolist()
    way = plan.segments.end - plan.segments.start
    assert np.sum(document["steps"], axis=0).tolist() == way.tolist()
    assert len(document["samples"]) == len(document["velocities"]) == len(plan.segments)
    assert document["start"] == pytest.approx(plan.segments.start)
