"""Counts, segments and their reversal; their cubics against scipy's and dense sampling."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import (
    Cubics,
    Segments,
    evaluate,
    extremes,
    motion_at,
    segment_cubics,
    segments_document,
    to_angles,
    to_counts,
)
from tests.trajectory.brute_force import spline

PERIOD = 1e-3
REST = Segments(np.zeros(2, int), np.zeros((1, 2), int), np.zeros((1, 2), int), np.array([2]))


@st.composite
def rests_to_rest(draw):
    row = st.tuples(*[st.integers(-(2**30), 2**30)] * 4, st.integers(1, 512))
    rows = np.array(draw(st.lists(row, min_size=1, max_size=9)))
    rows[-1, 2:4] = 0
    return Segments(np.array([5, -7]), rows[:, :2], rows[:, 2:4], 2 * rows[:, 4])


@given(rests_to_rest())
def test_the_reversed_motion_is_the_motion_backwards(segments):
    back = segments.reversed()
    assert back.total_samples == segments.total_samples
    assert len(back) == len(segments)
    assert (back.start == segments.end).all()
    assert (back.end == segments.start).all()
    twice = back.reversed()
    for name in ("start", "steps", "velocities", "samples"):
        assert (getattr(twice, name) == getattr(segments, name)).all()
    there, again = spline(segments, 1e-3), spline(back, 1e-3)
    last = there.x[-1]
    t = np.linspace(0, last, 301)
    scale = np.abs(there(t)).max()
    assert np.abs(there(t) - again(last - t)).max() <= 1e-11 * scale
    scale = max(1.0, np.abs(there(t, 1)).max())  # count/s; segments may be at rest
    assert np.abs(there(t, 1) + again(last - t, 1)).max() <= 1e-9 * scale


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


def test_a_quarter_turn():
    assert to_counts([np.pi / 2, -np.pi / 2], 2_000_000).tolist() == [500_000, -500_000]
    assert to_angles([500_000, -250_000], 2_000_000) == pytest.approx([np.pi / 2, -np.pi / 4])


def test_shapes_and_types_are_kept():
    assert to_counts(np.zeros((3, 2)), 4096).shape == (3, 2)
    assert to_counts(0.1, 4096).dtype == np.int64
    assert to_angles(np.zeros((3, 2), dtype=int), 4096).dtype == np.float64


@given(st.integers(-(2**40), 2**40), st.integers(16, 2**31))
def test_counts_are_recovered_from_angles(counts, turn):
    assert to_counts(to_angles(counts, turn), turn) == counts


@given(st.floats(-10, 10), st.integers(16, 2**31))
def test_an_angle_is_wrong_by_at_most_half_a_count(angle, turn):
    step = 2 * np.pi / turn
    assert abs(to_angles(to_counts(angle, turn), turn) - angle) <= step / 2 + 1e-14


@st.composite
def segments_of(draw, size=900):
    """Segments of random and of degenerate cubics: rests, lines, parabolas, S-curves."""
    rows, before = [], np.zeros(2, dtype=int)
    for _ in range(draw(st.integers(1, 7))):
        samples = 2 * draw(st.integers(1, 40))
        kind = draw(st.sampled_from(["any", "rest", "line", "parabola", "bump"]))
        step = np.array(draw(st.tuples(*[st.integers(-size, size)] * 2)))
        after = np.array(draw(st.tuples(*[st.integers(-size, size)] * 2)))
        if kind == "rest":
            step = after = np.zeros(2, dtype=int)
        elif kind == "line":
            after, step = before, before * samples // 1000
        elif kind == "parabola":
            step = (before + after) * samples // 2000
        elif kind == "bump":
            after, step = -before, np.zeros(2, dtype=int)
        rows.append([*step, *after, samples])
        before = after
    rows = np.array(rows)
    return Segments(np.array([5, -7]), rows[:, :2], rows[:, 2:4], rows[:, 4])


@given(segments_of())
def test_any_segments_are_played_as_the_cubic_spline(segments):
    ticks = np.arange(segments.total_samples * 3 + 1) / 3
    motion = motion_at(segments, segment_cubics(segments, 1.0, PERIOD), ticks)
    time = ticks * PERIOD
    curve = spline(segments, PERIOD)
    assert motion.position == pytest.approx(curve(time), abs=1e-8)
    assert motion.velocity == pytest.approx(curve(time, 1), abs=1e-5)
    assert motion.position[-1] == pytest.approx(segments.end, abs=1e-8)


@given(segments_of())
@example(REST)
def test_extremes_are_those_of_dense_sampling(segments):
    found = extremes(segment_cubics(segments, 1.0, PERIOD))
    curve = spline(segments, PERIOD)
    t = np.union1d(np.linspace(0, curve.x[-1], 20_001), curve.x)
    step = t[1] - t[0]
    jerk = np.abs(6 * curve.c[0]).max(axis=0)
    acceleration = 2 * np.abs(
        np.stack([curve.c[1], curve.c[1] + 3 * curve.c[0] * np.diff(curve.x)[:, None]])
    )
    acceleration = acceleration.max(axis=(0, 1))
    place, speed = curve(t), np.abs(curve(t, 1)).max(axis=0)
    # Between points a distance h apart a function turns by h^2/8 of its second derivative.
    miss, slack = step**2 / 8 * acceleration + 1e-9, 1e-9 * np.abs(place).max() + 1e-9
    assert (found.low <= place.min(axis=0) + slack).all()
    assert (found.low >= place.min(axis=0) - miss - slack).all()
    assert (found.high >= place.max(axis=0) - slack).all()
    assert (found.high <= place.max(axis=0) + miss + slack).all()
    assert (found.speed >= speed * (1 - 1e-9) - 1e-6).all()
    assert (found.speed <= speed * (1 + 1e-9) + step**2 / 8 * jerk + 1e-6).all()
    assert found.acceleration == pytest.approx(acceleration, rel=1e-9, abs=1e-3)
    assert found.jerk == pytest.approx(jerk, rel=1e-9, abs=1.0)


@pytest.mark.parametrize(
    ("terms", "low", "high", "speed"),
    [
        ((0, 0, 0, 0), 0.0, 0.0, 0.0),
        ((1, 2, 0, 0), 1.0, 3.0, 2.0),
        ((0, 1, -1, 0), 0.0, 0.25, 1.0),
        ((0, 0, 0, 1), 0.0, 1.0, 3.0),
        ((0, 1, -3, 2), -np.sqrt(3) / 18, np.sqrt(3) / 18, 1.0),
        ((0, 0.75, -1.5, 1), 0.0, 0.25, 0.75),
        ((0, 1, -1, 1e-17), 0.0, 0.25, 1.0),
    ],
    ids=["rest", "line", "parabola", "cubic", "s-curve", "saddle", "nearly parabola"],
)
def test_extremes_of_degenerate_cubics(terms, low, high, speed):
    p0, p1, p2, p3 = (np.full((1, 2), float(term)) for term in terms)
    cubics = Cubics(p0, p1, p2, p3, np.ones((1, 1)))
    found = extremes(cubics)
    assert found.low == pytest.approx([low, low], abs=1e-15)
    assert found.high == pytest.approx([high, high], abs=1e-15)
    assert found.speed == pytest.approx([speed, speed], abs=1e-15)
    middle = evaluate(cubics, np.array([[0.5]]))
    assert middle.position[0, 0] == pytest.approx(sum(t / 2**i for i, t in enumerate(terms)))


def test_the_controllers_motion_of_a_press_is_the_cubic_spline(bench):
    for hold in ("point", "normal"):
        rig = bench(press__hold=hold)
        plan = plan_press(rig)
        scale, period = rig.arm.counts_per_revolution / (2 * np.pi), rig.controller.sample_period
        ticks = np.arange(plan.segments.total_samples * 7 + 1) / 7
        time = ticks * period
        motion = motion_at(plan.segments, segment_cubics(plan.segments, scale, period), ticks)
        assert time[-1] == pytest.approx(plan.time[-1], rel=1e-14)
        curve = spline(plan.segments, period)
        assert motion.position == pytest.approx(curve(time) / scale, abs=1e-12)
        assert motion.velocity == pytest.approx(curve(time, 1) / scale, abs=1e-9)
        on_knot = np.isin(np.arange(len(time)) / 7, np.cumsum(plan.segments.samples))
        # At the end the spline's second derivative is one-sided.
        between = ~on_knot[:-1]
        found = motion.acceleration[:-1][between]
        assert found == pytest.approx(curve(time, 2)[:-1][between] / scale, abs=1e-6)
