"""Recorded gestures, replayed."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from sautereau.rig.schema import Gesture
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.press import draft_press, plan_press
from sautereau.trajectory.timing import press_law
from tests.trajectory.brute_force import true_cruise_error

TIME = np.linspace(0, 0.3, 31)


def replaying(rig, time, rise, **press):
    """Return the rig with a gesture of times [s] and rises [m]."""
    gesture = Gesture(
        time=tuple(f"{float(t)!r} s" for t in time), rise=tuple(f"{float(r)!r} m" for r in rise)
    )
    changed = rig.press.model_copy(update={"gesture": gesture, **press})
    return rig.model_copy(update={"press": changed})


def stroke(time):
    """Return a press and its return, at rest at both ends."""
    return 0.009 * np.sin(np.pi * time / time[-1]) ** 2


def going_down(time):
    s = time / time[-1]
    return 0.009 * s**3 * (10 - 15 * s + 6 * s**2)


def test_the_replayed_rise_is_the_samples_and_the_spline_between_them(paper):
    rng = np.random.default_rng(3)
    time = np.append(0, np.sort(rng.uniform(0.005, 0.4, 40)))
    rise = np.append(0, rng.uniform(0, 0.01, 40))
    found = press_law(replaying(paper, time, rise).press)
    assert not found.steady
    assert found.start == found.cruise_start == paper.press.settle
    spline = CubicSpline(time, rise, bc_type="clamped")
    at = found.law.at(found.start + time)
    assert np.abs(at.position - rise).max() < 1e-15
    t = np.linspace(0, time[-1], 5001)
    at = found.law.at(found.start + t)
    assert np.abs(at.position - spline(t)).max() < 1e-14
    assert np.abs(at.velocity - spline(t, 1)).max() < 1e-11
    assert abs(at.velocity[0]) == 0
    assert abs(at.velocity[-1]) < 1e-9


@pytest.mark.parametrize("hold", ["point", "normal"])
@pytest.mark.parametrize("shape", [stroke, going_down])
def test_a_gesture_is_replayed_and_returned_to_rest(paper, shape, hold):
    rig = replaying(paper, TIME, shape(TIME), hold=hold, speed_tolerance=0.005)
    plan = plan_press(rig)
    assert (plan.segments.end == plan.segments.start).all()
    assert plan.rise.position.max() == pytest.approx(0.009, rel=1e-6)
    assert abs(plan.rise.position[-1]) < 1e-12
    assert plan.cruise.error == pytest.approx(true_cruise_error(rig, plan), rel=0.02)
    assert plan.cruise.end - plan.cruise.start > 0.29
    return_time = plan.law.law.duration - plan.law.return_start
    down = shape is going_down
    assert (return_time > 0.1) == down
    after = plan.law.law.at(np.linspace(plan.law.return_start, plan.law.law.duration, 99))
    assert np.abs(after.velocity).max() <= rig.press.return_speed * (1 + 1e-9)


@pytest.mark.parametrize("end", [-0.9e-6, 1e-9, 1e-200, 2e-6])
def test_a_press_ends_at_its_start_if_the_gesture_does_not(paper, end):
    rise = stroke(TIME)
    rise[0], rise[-1] = 0.9e-6, end
    plan = plan_press(replaying(paper, TIME, rise))
    assert (plan.segments.end == plan.segments.start).all()
    assert (plan.retreat.start == plan.segments.end).all()


def test_a_gesture_of_constant_speed_is_the_law(paper):
    """Between a law's own switching times the spline through it is the law itself."""
    law = press_law(paper.press)
    inside = law.law.times[(law.law.times > law.start) & (law.law.times < law.bottom)]
    time = np.concatenate([[law.start], inside, [law.bottom]])
    time = np.union1d(time, np.linspace(law.start, law.bottom, 50))
    time = time[np.append(True, np.diff(time) > 1e-9)]
    rig = replaying(paper, time - time[0], np.maximum(law.law.at(time).position, 0))
    played, planned = plan_press(rig), plan_press(paper)
    assert played.law.law.duration == pytest.approx(law.law.duration, rel=1e-12)
    n = min(len(played.time), len(planned.time))
    for name, scale in (("rise", 0.01), ("joints", 1.0)):
        for one, two, unit in zip(
            getattr(played, name), getattr(planned, name), (1, 10, 1e4), strict=True
        ):
            assert np.abs(one[:n] - two[:n]).max() < 1e-10 * scale * unit
    assert played.cruise.error < 5e-3


def test_too_violent_a_gesture_is_refused_with_all_that_fails(paper):
    with pytest.raises(TrajectoryError) as raised:
        plan_press(replaying(paper, TIME / 20, stroke(TIME)))
    text = str(raised.value)
    for n in (1, 2):
        for what in ("acceleration", "jerk"):
            line = next(x for x in text.split("\n") if f"joint {n} {what}: " in x)
            assert "fails by" in line
            assert "lower press.jack_speed" in line


def test_too_many_samples_for_the_fifo_are_replayed_with_knots_further_apart(bench):
    time = np.linspace(0, 2.0, 1001)
    rise = 0.009 * np.sin(np.pi * time) ** 2
    rig = replaying(bench(), time, rise)
    plan = plan_press(rig)
    assert len(plan.segments) < rig.controller.segment_limit
    assert plan.cruise.error < 3e-3
    wild = 0.004 + 0.004 * np.sin(400 * time) * (time > 0)
    wild[0] = 0
    failed = [c.name for c in draft_press(replaying(bench(), time, wild)).checks if not c.holds]
    assert "cruise speed error" in failed


def test_a_gesture_that_ends_before_the_controllers_first_segment(paper):
    with pytest.raises(TrajectoryError, match=r"press.gesture: .* no complete segment"):
        draft_press(replaying(paper, [0, 1e-4, 2e-4], [0, 1e-5, 0]))


def test_a_gesture_below_rest_is_warned_of(paper):
    time = np.array([0, 0.1, 0.2, 0.25, 0.3])
    plan = draft_press(replaying(paper, time, [0, 0, 0, 0.008, 0]))
    assert len(plan.warnings) == 1
    assert "the finger leaves the key; give more samples" in plan.warnings[0]
    assert plan_press(replaying(paper, TIME, stroke(TIME))).warnings == ()


@pytest.mark.parametrize("rise", [0.0, 1e-7, 1e-300])
def test_a_gesture_without_motion_is_refused(paper, rise):
    with pytest.raises(TrajectoryError, match=r"press.gesture: it moves the jack by less than"):
        draft_press(replaying(paper, [0, 0.1, 0.2], [rise, rise, rise]))
