"""Quantisation to counts and samples, and its effect on the cruise."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from sautereau.trajectory.learning import corrected, residual
from sautereau.trajectory.press import draft_press, plan_press, sent_motion
from sautereau.trajectory.quantise import GRAIN, LONGEST_SEGMENT, _least, quantise
from sautereau.trajectory.timing import press_law
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


@pytest.mark.parametrize("hold", ["point", slow("normal")])
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


def held_string(rig, depth):
    """A correction as learning makes it: against a fall of the speed that ends at a release."""
    law, period = press_law(rig.press), rig.controller.sample_period
    time = np.arange(0, law.law.duration, 1e-4)
    held = (time > law.cruise_start + 0.03) & (time < law.cruise_start + 0.05)
    sent = law.law.at(time).velocity
    speed = sent - depth * rig.press.jack_speed * held
    return corrected(law, [residual(law, time, sent, speed, period)], period)


@pytest.mark.slow
@given(counts=strategies.integers(4000, 2_000_000), depth=strategies.floats(0.05, 0.3))
@settings(max_examples=60)
def test_a_correction_is_rounded_as_little_as_the_encoder_permits(bench, counts, depth):
    rig = bench(arm__counts_per_revolution=counts)
    correction = held_string(rig, depth)
    plan = draft_press(rig, None, correction)
    fixed = quantise(rig, plan.law.law, plan.joints)
    assert len(plan.segments) < rig.controller.segment_limit
    assert (plan.segments.samples % GRAIN == 0).all()
    assert plan.segments.end.tolist() == fixed.end.tolist()
    # Rounding at two knots, a time T apart, gives an RMS error of up to sqrt(6/5) counts / T. With
    # knots chosen by it, it is less than half of that at T = 20 ms, a string's time.
    count = 2 * np.pi / counts * rig.arm.upper_length * rig.key.jack_arm / rig.key.press_arm
    rounded = np.sqrt(6 / 5) * count / rig.press.jack_speed / 20e-3
    assert plan.cruise.rms_error < max(rig.press.speed_tolerance, rounded / 2)
    as_fixed = replace(plan, segments=fixed)
    assert plan.cruise.rms_error == pytest.approx(rms_error(rig, plan), rel=0.02, abs=1e-5)
    assert plan.cruise.rms_error <= rms_error(rig, as_fixed) * 1.02 + 1e-5
    if rms_error(rig, as_fixed, np.inf) <= rig.press.speed_tolerance:
        assert plan.segments.ends.tolist() == fixed.ends.tolist()  # fine encoders: as without


def rms_error(rig, plan, order=2):
    """Return the RMS or, of order infinity, the largest error of a plan's speed in its cruise."""
    time = np.arange(plan.cruise.start, plan.cruise.end, 1e-5)
    sent = sent_motion(rig, plan.segments, time / rig.controller.sample_period).velocity
    planned = plan.law.law.at(time).velocity
    error = np.abs(sent - planned) / planned.max()
    return error.max() if order == np.inf else np.sqrt(np.mean(error**2))


@given(errors=strategies.lists(strategies.floats(0, 9), min_size=28, max_size=28))
def test_the_sequence_of_segments_with_the_least_error_is_found(errors):
    """Seven grains: all 64 sequences are tried."""
    table = np.full((7, 7), np.inf)
    table[
        [k for k in range(7) for _ in range(7 - k)], [i for k in range(7) for i in range(7 - k)]
    ] = errors
    least = np.inf
    for chosen in product([False, True], repeat=6):
        ends = [0, *np.flatnonzero(chosen) + 1, 7]
        least = min(least, sum(table[b - a - 1, a] for a, b in pairwise(ends)))
    total, ends = _least(table)
    assert total == pytest.approx(least)
    assert sum(table[b - a - 1, a] for a, b in pairwise(ends.tolist())) == pytest.approx(least)
