"""Laws of motion: continuous, within their limits, as fast as possible, exact in the cruise."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.timing import (
    approach_law,
    chained,
    falling,
    jerk_law,
    length,
    press_law,
    ramp,
    rest_to_rest,
    reversed_law,
)
from tests.trajectory.brute_force import close, derivatives

PAPER = load_rig().press
TWO = load_rig("tests/data/spinet.toml")


def powers(low, high):
    return st.floats(low, high).map(lambda power: 10.0**power)


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


@st.composite
def presses(draw):
    return PAPER.model_copy(
        update={
            "jack_speed": max(0.005, 10 ** draw(st.floats(-2.3, 0))),
            "jack_rise": draw(st.floats(1e-3, 15e-3)),
            "run_up_acceleration": draw(st.floats(0.5, 500)),
            "run_up_jerk": draw(st.floats(100, 1e6)),
            "run_down_acceleration": draw(st.floats(0.5, 500)),
            "run_down_jerk": draw(st.floats(100, 1e6)),
            "return_acceleration": draw(st.floats(0.05, 50)),
            "return_speed": draw(st.floats(0.005, 1.0)),
            "bottom_hold": draw(st.floats(0, 0.1)),
            "settle": draw(st.floats(0, 0.1)),
        }
    )


def check_law(press):
    found = press_law(press)
    law, times = found.law, found.law.times
    assert (np.diff(times) >= -1e-15).all()
    # Rise, speed and acceleration are continuous between phases.
    start = law.states[:-1]
    span = np.diff(times)
    rise, speed, acceleration = start.T
    ends = np.stack(
        [
            rise + speed * span + acceleration * span**2 / 2 + law.jerks * span**3 / 6,
            speed + acceleration * span + law.jerks * span**2 / 2,
            acceleration + law.jerks * span,
        ],
        -1,
    )
    # A rounding error of the time, times the jerk, is one of the acceleration.
    scale = [press.jack_rise, 1.0, np.abs(law.jerks).max() * law.duration]
    assert (np.abs(ends - law.states[1:]) / scale).max() < 1e-12
    # From rest to rest, through the full rise.
    assert (np.abs(law.states[[0, -1]]) / scale).max() < 1e-11
    bottom = law.at(np.array([found.bottom, (found.bottom + found.return_start) / 2]))
    assert bottom.position == pytest.approx(press.jack_rise, rel=1e-11)
    assert np.abs(bottom.velocity).max() < 1e-12
    # First the finger rests on the key.
    assert found.start == press.settle
    resting = law.at(np.linspace(0, press.settle, 20))
    assert all((values == 0).all() for values in resting)
    # No limit is exceeded, and the cruise is exact.
    t = np.union1d(np.linspace(0, law.duration, 4001), times)
    motion = law.at(t)
    slack = 1 + 1e-9
    assert motion.position.min() > -1e-12
    assert motion.position.max() < press.jack_rise * slack
    parts = [
        (t <= found.cruise_start, press.run_up_acceleration, press.jack_speed),
        ((t >= found.cruise_end) & (t <= found.bottom), press.run_down_acceleration, 1.0),
        (t > found.return_start, press.return_acceleration, press.return_speed),
    ]
    for inside, acceleration, speed in parts:
        assert np.abs(motion.acceleration[inside]).max(initial=0) <= acceleration * slack + 1e-9
        assert np.abs(motion.velocity[inside]).max(initial=0) <= speed * slack
    assert motion.velocity[t <= found.bottom].min() > -1e-11
    assert motion.velocity[t >= found.return_start].max() < 1e-11
    assert np.abs(law.jerks[times[1:] <= found.cruise_start]).max() <= press.run_up_jerk
    assert np.abs(law.jerks[times[:-1] >= found.cruise_end]).max() <= press.run_down_jerk
    cruise = law.at(np.linspace(found.cruise_start, found.cruise_end, 50)[1:-1])
    assert cruise.velocity == pytest.approx(press.jack_speed, rel=1e-12)
    assert np.abs(cruise.acceleration).max() < 1e-9 * press.run_up_acceleration
    return found


@given(st.floats(0.005, 0.3), st.floats(0.3e-3, 3e-3), st.floats(0.3e-3, 3e-3))
def test_a_run_up_that_is_not_given_ends_2_ms_before_the_first_contact(speed, first, second):
    changed = {
        "jack.string_clearance": f"{first} m", "press.jack_speed": f"{speed} m/s",
        "press.run_up_acceleration": None, "press.run_up_jerk": None,
        "more_choirs.0.jack.string_clearance": f"{second} m",
    }  # fmt: skip
    rig = with_values(TWO, changed)
    contact = min(first, second)
    acceleration, jerk = rig.press.run_up
    law = jerk_law(ramp(speed, acceleration, jerk))
    rise, reached, _ = law.states[-1]
    assert reached == pytest.approx(speed)
    assert rise == pytest.approx(max(contact - 2e-3 * speed, contact / 2))
    # The least peak of the jerk that changes the speed by v in T is 4 v / T^2.
    assert jerk == pytest.approx(4 * speed / law.duration**2)
    given = rig.press.model_copy(update={"run_up_acceleration": 12.0, "run_up_jerk": 3000.0})
    assert given.run_up == (12.0, 3000.0)


@given(presses())
def test_any_press_keeps_its_limits_or_is_refused(press):
    try:
        press_law(press)
    except TrajectoryError:
        assume(False)
    check_law(press)


def test_the_papers_press():
    found = check_law(PAPER)
    assert found.start == PAPER.settle == 0.02
    assert found.cruise_start == pytest.approx(0.02 + 0.072 / 12 + 12 / 3000)
    assert found.steady
    assert len(found.law.jerks) == 1 + 3 + 1 + 3 + 1 + 3 + 1 + 3


@pytest.mark.parametrize(
    ("change", "phases"),
    [
        ({"run_up_acceleration": 1000.0}, 1 + 2 + 1 + 3 + 1 + 7),
        ({"run_down_acceleration": 1000.0}, 1 + 3 + 1 + 2 + 1 + 7),
        ({"return_acceleration": 100.0}, 1 + 3 + 1 + 3 + 1 + 5),
    ],
    ids=["run-up", "run-down", "return"],
)
def test_a_ramp_that_never_reaches_its_acceleration_is_triangular(change, phases):
    found = check_law(PAPER.model_copy(update=change))
    assert len(found.law.jerks) == phases


@pytest.mark.parametrize("acceleration", [0.6, 100.0], ids=["trapezoidal", "triangular"])
def test_a_way_back_too_short_for_its_speed(acceleration):
    change = {"return_speed": 1.0, "return_acceleration": acceleration}
    found = check_law(PAPER.model_copy(update=change))
    t = np.linspace(found.return_start, found.law.duration, 10_001)
    assert np.abs(found.law.at(t).velocity).max() < 0.5
    cruise = np.diff(found.law.times)[-4 if acceleration < 1 else -3]
    assert cruise == pytest.approx(0.0, abs=1e-12)


def test_no_room_for_a_cruise_is_refused_with_fixes():
    with pytest.raises(TrajectoryError) as raised:
        press_law(PAPER.model_copy(update={"jack_speed": 0.5}))
    text = str(raised.value)
    assert text.startswith("press.jack_speed: at 0.5 m/s the run-up takes 11.4 mm")
    assert "of the rise of 10 mm" in text
    fixes = ("lower jack_speed", "run_up_acceleration", "run_up_jerk", "run_down_acceleration")
    assert all(fix in text for fix in fixes)


def test_the_way_down_covers_the_hover_within_its_limits():
    for change in ({}, {"hover": 1e-4}, {"hover": 0.3, "approach_speed": 1e-3}):
        press = PAPER.model_copy(update=change)
        law = approach_law(press)
        motion = law.at(np.linspace(0, law.duration, 2001))
        assert motion.position[-1] == pytest.approx(press.hover, rel=1e-9)
        assert abs(motion.velocity[-1]) < 1e-12
        assert motion.velocity.max() <= press.approach_speed * (1 + 1e-9)
        assert np.abs(motion.acceleration).max() <= press.return_acceleration * (1 + 1e-9)
        assert np.abs(law.jerks).max() <= press.run_down_jerk


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


def test_acceleration_and_speed_are_derivatives():
    law = press_law(PAPER).law
    step = 1e-5
    edges = law.times[:, None]
    t = np.linspace(0, law.duration, 997)[1:-1]
    t = t[np.abs(t - edges).min(0) > 5 * step]
    first, _ = derivatives(lambda t: law.at(t).position, t, step)
    close(law.at(t).velocity, first, 1e-9)
    second, _ = derivatives(lambda t: law.at(t).velocity, t, step)
    close(law.at(t).acceleration, second, 1e-9)


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
