"""What the controller is sent, and what it makes of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from trajectory.cubic import controller_motion
from trajectory.press import draft_press, plan_press
from trajectory.quantise import GRAIN, LONGEST_SEGMENT
from trajectory.segments import Segments, segments_document


def per_radian(rig):
    return rig.arm.counts_per_revolution / (2 * np.pi)


def spline(segments, period):
    """The cubic through the knots, by an independent library; counts."""
    times = np.concatenate([[0], np.cumsum(segments.samples)]) * period
    positions = segments.start + np.vstack([[0, 0], np.cumsum(segments.steps, axis=0)])
    return CubicHermiteSpline(times, positions, np.vstack([[0, 0], segments.velocities]))


def cruise_error(rig, planned):
    """Brute force at 100 kHz: the jack's speed by differences of a bisected key angle."""
    arm, key = rig.arm, rig.key
    start, end = planned.cruise.start, planned.cruise.end
    t = np.linspace(start, end, int((end - start) * 1e5) + 1)
    first, second = spline(planned.segments, rig.controller.sample_period)(t).T / per_radian(rig)
    x = arm.base_x + arm.upper_length * np.cos(first) + arm.lower_length * np.cos(first + second)
    z = arm.base_z + arm.upper_length * np.sin(first) + arm.lower_length * np.sin(first + second)
    low, high = np.full_like(t, -0.3), np.full_like(t, 0.3)
    for _ in range(60):
        middle = (low + high) / 2
        above = -x * np.sin(middle) + z * np.cos(middle)
        turned_too_far = above > key.surface_height + arm.fingertip_radius
        low, high = np.where(turned_too_far, low, middle), np.where(turned_too_far, middle, high)
    b, hb = key.jack_arm, key.jack_surface_height
    rise = b * np.tan(low) + hb * (1 / np.cos(low) - 1)
    speed = np.gradient(rise, t)[1:-1]
    return np.abs(speed / rig.press.jack_speed - 1).max()


@pytest.fixture(scope="module", params=["point", "normal"])
def planned(request, bench):
    rig = bench(press__hold=request.param)
    return rig, plan_press(rig)


def test_knots_lie_within_half_a_count(planned):
    rig, plan = planned
    segments = plan.segments
    knots = np.concatenate([[0], np.cumsum(segments.samples)])
    positions = segments.start + np.vstack([[0, 0], np.cumsum(segments.steps, axis=0)])
    off = positions - plan.joints.position[knots] * per_radian(rig)
    assert np.abs(off).max() <= 0.5 + 1e-6
    off = segments.velocities - plan.joints.velocity[knots[1:]] * per_radian(rig)
    assert np.abs(off).max() <= 0.5 + 1e-6
    assert (segments.end == positions[-1]).all()
    assert (segments.velocities[-1] == 0).all()


def test_segments_are_whole_and_within_the_controllers_limits(planned):
    rig, plan = planned
    samples = plan.segments.samples
    assert (samples % GRAIN == 0).all()
    assert (samples >= GRAIN).all()
    assert samples.max() <= LONGEST_SEGMENT
    assert plan.segments.total_samples == samples.sum() == len(plan.time) - 1
    assert len(plan.segments) < rig.controller.segment_limit
    for counts in (plan.segments.steps, plan.segments.velocities, samples, plan.hover, plan.home):
        assert counts.dtype == np.int64


def test_the_controllers_motion_is_the_cubic_spline(planned):
    rig, plan = planned
    period = rig.controller.sample_period
    time, motion = controller_motion(plan.segments, 7, per_radian(rig), period)
    assert time[-1] == pytest.approx(plan.time[-1], rel=1e-14)
    curve = spline(plan.segments, period)
    inside = slice(None, -1)  # at the end the spline's second derivative is one-sided
    scale = per_radian(rig)
    assert motion.position == pytest.approx(curve(time) / scale, abs=1e-12)
    assert motion.velocity == pytest.approx(curve(time, 1) / scale, abs=1e-9)
    on_knot = np.isin(np.arange(len(time)) / 7, np.cumsum(plan.segments.samples))
    between = ~on_knot[inside]
    found, expected = motion.acceleration[inside][between], curve(time, 2)[inside][between] / scale
    assert found == pytest.approx(expected, abs=1e-6)


@given(
    st.lists(st.tuples(*[st.integers(-900, 900)] * 4, st.integers(1, 40)), min_size=1, max_size=9)
)
@settings(deadline=None, max_examples=50)
def test_any_segments_are_played_as_the_cubic_spline(rows):
    rows = np.array(rows)
    segments = Segments(np.array([5, -7]), rows[:, :2], rows[:, 2:4], GRAIN * rows[:, 4])
    time, motion = controller_motion(segments, 3, 1.0, 1e-3)
    curve = spline(segments, 1e-3)
    assert motion.position == pytest.approx(curve(time), abs=1e-8)
    assert motion.velocity == pytest.approx(curve(time, 1), abs=1e-5)
    assert motion.position[-1] == pytest.approx(segments.end, abs=1e-8)


def test_the_papers_cruise_error_is_true_and_below_a_thousandth(planned):
    rig, plan = planned
    assert plan.cruise.error <= 1e-3
    assert plan.cruise.error == pytest.approx(cruise_error(rig, plan), rel=0.02, abs=2e-6)
    assert plan.cruise.speed == pytest.approx(rig.press.jack_speed, rel=1e-4)


@pytest.mark.parametrize("counts", [8192, 65_536, 500_000, 2**24])
def test_other_encoders_are_reported_truthfully(bench, counts):
    rig = bench(arm__counts_per_revolution=counts)
    draft = draft_press(rig)
    assert draft.cruise.error == pytest.approx(cruise_error(rig, draft), rel=0.02, abs=2e-6)
    assert abs(draft.cruise.speed / rig.press.jack_speed - 1) <= draft.cruise.error


def test_a_coarse_encoder_is_worse_than_a_fine_one(bench):
    errors = [
        draft_press(bench(arm__counts_per_revolution=n)).cruise.error for n in (256, 8192, 2**24)
    ]
    assert errors[0] > 0.02 > errors[1] > 3e-3 > errors[2]


def test_the_cruise_is_a_window_of_whole_segments(planned):
    rig, plan = planned
    start, end = plan.cruise.start, plan.cruise.end
    assert plan.law.cruise_start <= start < end <= plan.law.cruise_end
    knots = np.cumsum(plan.segments.samples) * rig.controller.sample_period
    for edge in (start, end):
        assert np.abs(knots - edge).min() < 1e-12
    assert end - start > 0.95 * (plan.law.cruise_end - plan.law.cruise_start)


def test_a_long_rest_is_cut_into_segments_that_a_controller_takes(bench):
    for hold in ("1.45 s", "2.5 s", "7 s"):
        segments = draft_press(bench(press__bottom_hold=hold)).segments
        assert segments.samples.max() <= LONGEST_SEGMENT
        assert segments.samples.max() > LONGEST_SEGMENT / 2


def test_the_document_says_the_same(paper):
    plan = plan_press(paper)
    document = segments_document(plan.segments, 1e-3, plan.home, plan.hover)
    assert document["sample_period"] == 1e-3
    assert document["home"] == [0, -500_000]
    assert (
        np.sum(document["steps"], axis=0).tolist()
        == (plan.segments.end - plan.segments.start).tolist()
    )
    assert len(document["samples"]) == len(document["velocities"]) == len(plan.segments)
