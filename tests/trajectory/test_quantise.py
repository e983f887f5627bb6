"""Quantisation to counts and samples, and its effect on the cruise."""

import numpy as np
import pytest

from sautereau.trajectory.press import draft_press, plan_press
from sautereau.trajectory.quantise import GRAIN, LONGEST_SEGMENT
from tests.budget import slow
from tests.trajectory.brute_force import true_cruise_error


def per_radian(rig):
    return rig.arm.counts_per_revolution / (2 * np.pi)


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
    assert np.abs(off).max() <= 1.0 + 1e-6
    assert not (segments.velocities % 2).any()
    assert plan.cruise.error <= 1e-3
    assert (segments.end == positions[-1]).all()
    assert (segments.velocities[-1] == 0).all()


def test_segments_are_integer_and_within_the_controllers_limits(planned):
    rig, plan = planned
    assert plan.segments.total_samples == plan.segments.samples.sum() == len(plan.time) - 1
    for segments in (plan.approach, plan.segments, plan.retreat):
        samples = segments.samples
        assert (samples % GRAIN == 0).all()
        assert (samples >= GRAIN).all()
        assert samples.max() <= LONGEST_SEGMENT
        assert len(segments) < rig.controller.segment_limit
        for counts in (segments.start, segments.steps, segments.velocities, samples):
            assert counts.dtype == np.int64
    assert plan.hover.dtype == plan.home.dtype == np.int64


QUICK = (0.005, 0.072, 0.7)
MIDDLE = (65_536, 500_000, 2**24)
# Jack speed [m/s], acceleration and jerk [m/s^2, m/s^3] that reach it within the rise.
SPEEDS = [
    (0.005, 12, 3000),
    (0.01, 12, 3000),
    (0.072, 12, 3000),
    (0.1, 12, 3000),
    (0.3, 60, 50_000),
    (0.7, 300, 500_000),
]


@pytest.mark.parametrize("hold", ["point", "normal"])
@pytest.mark.parametrize(
    ("speed", "acceleration", "jerk"),
    [
        pytest.param(*s, id=str(s[0]), marks=() if s[0] in QUICK else pytest.mark.slow)
        for s in SPEEDS
    ],
)
def test_at_two_million_counts_the_cruise_keeps_its_speed_to_a_thousandth(
    bench, hold, speed, acceleration, jerk
):
    rig = bench(
        press__hold=hold,
        press__jack_speed=f"{speed} m/s",
        press__run_up_acceleration=f"{acceleration} m/s^2",
        press__run_up_jerk=f"{jerk} m/s^3",
        press__run_down_acceleration=f"{max(1.5, acceleration if speed > 0.1 else 0)} m/s^2",
        press__run_down_jerk=f"{max(200, jerk if speed > 0.1 else 0)} m/s^3",
        arm__acceleration_limit="1e4 rad/s^2",
        arm__jerk_limit="1e8 rad/s^3",
        arm__speed_limit="100 rad/s",
        arm__torque_limit="100 N m",
    )
    draft = draft_press(rig)
    assert draft.cruise.error <= 1e-3
    assert draft.cruise.speed == pytest.approx(speed, rel=1e-3)
    found = true_cruise_error(rig, draft)
    assert draft.cruise.error == pytest.approx(found, rel=0.01, abs=1e-7)


@pytest.mark.parametrize("hold", ["point", "normal"])
@pytest.mark.parametrize("counts", [8192, *(slow(n) for n in MIDDLE), 2**31])
def test_other_encoders_are_reported_truthfully(bench, counts, hold):
    for speed in ("0.01 m/s", "0.072 m/s"):
        rig = bench(arm__counts_per_revolution=counts, press__hold=hold, press__jack_speed=speed)
        draft = draft_press(rig)
        found = true_cruise_error(rig, draft)
        assert draft.cruise.error == pytest.approx(found, rel=0.01, abs=1e-7)
        assert abs(draft.cruise.speed / rig.press.jack_speed - 1) <= draft.cruise.error


def test_the_cruise_consists_of_complete_segments(planned):
    rig, plan = planned
    start, end = plan.cruise.start, plan.cruise.end
    assert plan.law.cruise_start <= start < end <= plan.law.cruise_end
    knots = np.cumsum(plan.segments.samples) * rig.controller.sample_period
    for edge in (start, end):
        assert np.abs(knots - edge).min() < 1e-12
    assert end - start > 0.95 * (plan.law.cruise_end - plan.law.cruise_start)


def test_a_long_rest_is_cut_into_segments_that_a_controller_takes(bench):
    for hold in ("1.45 s", "2.5 s", "7 s", "60 s"):
        segments = draft_press(bench(press__bottom_hold=hold)).segments
        assert segments.samples.max() <= LONGEST_SEGMENT
        assert segments.samples.max() > LONGEST_SEGMENT / 2


@pytest.mark.parametrize("limit", ["0.1 rad/s^2", "1 rad/s^2", "200 rad/s^2"])
def test_the_coarsest_encoder_of_the_weakest_arm_has_no_longer_segments(bench, limit):
    """At 0.1 rad/s^2 the limit on rounding alone would require segments of 15 s."""
    rig = bench(
        arm__counts_per_revolution=16, arm__acceleration_limit=limit, press__bottom_hold="20 s"
    )
    draft = draft_press(rig)
    for segments in (draft.segments, draft.approach):
        assert GRAIN <= segments.samples.min() <= segments.samples.max() <= LONGEST_SEGMENT


def test_a_full_fifo_has_its_knots_further_apart(bench):
    needed = len(draft_press(bench(controller__segment_limit=1000)).segments)
    lengths = []
    for limit in (1000, needed + 1, needed, 64, 32):
        draft = draft_press(bench(controller__segment_limit=limit))
        assert len(draft.segments) < limit
        lengths.append(len(draft.segments))
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == lengths[1] > lengths[2]


def test_the_slowest_press_is_planned_in_bounded_memory(bench):
    """15 mm at 5 mm/s, and back at 0.1 mm/s: 150 s in few segments."""
    rig = bench(
        press__jack_speed="0.005 m/s",
        press__jack_rise="15 mm",
        press__return_speed="1e-4 m/s",
        key__dip="13 mm",
    )
    plan = plan_press(rig)
    assert plan.time[-1] > 150
    assert len(plan.segments) < rig.controller.segment_limit
    assert plan.cruise.error <= 1e-3
    assert plan.rise.position.max() == pytest.approx(0.015, rel=1e-9)


def test_the_finest_encoder_fits_into_the_fifo(bench):
    """Long segments are not needed for its cruise's speed, but for the FIFO."""
    for speed in ("0.005 m/s", "0.072 m/s"):
        plan = plan_press(bench(arm__counts_per_revolution=2**31, press__jack_speed=speed))
        assert len(plan.segments) < 255
        assert plan.cruise.error < 1e-4
