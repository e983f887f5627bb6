"""A whole press: what holds of it, what is refused, and that nothing else comes out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from rig.errors import SautereauError
from rig.load import load_rig, with_values
from trajectory.checks import at_least, at_most
from trajectory.errors import TrajectoryError
from trajectory.press import draft_press, plan_press

PAPER = load_rig()


def flat(trajectory):
    """Every array of a trajectory, by name."""
    for name in ("rise", "angle", "fingertip", "joints"):
        for part, array in zip("pva", getattr(trajectory, name), strict=True):
            yield f"{name}.{part}", array
    for name in ("time", "tilt", "slide", "hover", "home"):
        yield name, getattr(trajectory, name)


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_the_papers_press_can_be_made(bench, hold):
    rig = bench(press__hold=hold)
    planned = plan_press(rig)
    assert all(check.holds and check.margin >= 0 for check in planned.checks)
    assert planned.rise.position.max() == pytest.approx(0.01, rel=1e-9)
    n = len(planned.time)
    for name, array in flat(planned):
        assert np.isfinite(array).all(), name
        assert len(array) == n or name in ("hover", "home")
    assert planned.time[1] == rig.controller.sample_period
    if hold == "point":
        assert (planned.slide == 0).all()
        assert 0 < np.abs(planned.tilt).max() < np.radians(2)
    else:
        assert np.abs(planned.tilt).max() < 1e-12
        assert 0 < np.abs(planned.slide).max() < 1e-3


def test_the_same_rig_gives_the_same_plan(paper):
    one, two = plan_press(paper), plan_press(paper)
    assert (one.segments.steps == two.segments.steps).all()
    assert one.cruise.error == two.cruise.error


def test_the_finger_hovers_above_the_pressing_point(paper):
    turn = 2 * np.pi / paper.arm.counts_per_revolution
    first, second = plan_press(paper).hover * turn
    arm = paper.arm
    x = arm.base_x + arm.upper_length * np.cos(first) + arm.lower_length * np.cos(first + second)
    z = arm.base_z + arm.upper_length * np.sin(first) + arm.lower_length * np.sin(first + second)
    assert x == pytest.approx(-0.171, abs=1e-6)
    assert z == pytest.approx(0.010 + 0.004 + 0.010, abs=1e-6)


def test_the_finger_hovers_in_the_turn_it_presses_in():
    """With the base behind the key, joint 1 crosses half a turn between hover and key."""
    rig = with_values(
        PAPER,
        {
            "arm.base_x": "20 mm",
            "arm.base_z": "76 mm",
            "arm.lower_limits": ["90 deg", "-170 deg"],
            "arm.upper_limits": ["270 deg", "170 deg"],
        },
    )
    for elbow in ("up", "down"):
        draft = draft_press(with_values(rig, {"arm.elbow": elbow}))
        moved = (draft.hover - draft.segments.start) / rig.arm.counts_per_revolution
        assert np.abs(moved).max() < 0.1


BREAKS = [
    ("singularity", {"arm.elbow": "down", "press.hold": "normal"}, "change arm.elbow"),
    ("dip", {"key.dip": "7 mm"}, "lower press.jack_rise"),
    ("contact on the key", {"press.hold": "normal", "arm.base_x": "-300 mm"}, 'hold = "point"'),
    (
        "cruise speed error",
        {"arm.counts_per_revolution": 1024},
        "raise arm.counts_per_revolution or press.speed_tolerance",
    ),
    ("segments", {"controller.segment_limit": 100}, "raise press.jack_speed"),
    ("joint 1 lower limit", {"arm.lower_limits": ["-34 deg", "-150 deg"]}, "move arm.base_x"),
    ("joint 2 lower limit", {"arm.lower_limits": ["-80 deg", "-59 deg"]}, "move arm.base_x"),
    ("joint 1 upper limit", {"arm.upper_limits": ["-32 deg", "-10 deg"]}, "move arm.base_x"),
    ("joint 2 upper limit", {"arm.upper_limits": ["80 deg", "-55 deg"]}, "move arm.base_x"),
    ("joint 1 speed", {"arm.speed_limit": "0.5 rad/s"}, "lower press.jack_speed"),
    ("joint 2 speed", {"arm.speed_limit": "0.9 rad/s"}, "lower press.jack_speed"),
    ("joint 1 acceleration", {"arm.acceleration_limit": "90 rad/s^2"}, "run_up_acceleration"),
    ("joint 2 acceleration", {"arm.acceleration_limit": "130 rad/s^2"}, "run_up_acceleration"),
]


@pytest.mark.parametrize(("name", "values", "remedy"), BREAKS, ids=[b[0] for b in BREAKS])
def test_each_check_can_fail(name, values, remedy):
    rig = with_values(PAPER, values)
    draft = draft_press(rig)
    failed = {check.name: check for check in draft.checks if not check.holds}
    assert name in failed
    assert failed[name].margin < 0
    with pytest.raises(TrajectoryError, match="the press cannot be made:") as raised:
        plan_press(rig)
    line = next(x for x in str(raised.value).split("\n") if x.startswith(f"  {name}: "))
    assert "fails by" in line
    assert remedy in line


def test_every_failed_check_is_listed_with_its_remedy():
    rig = with_values(
        PAPER,
        {"key.dip": "7 mm", "arm.speed_limit": "0.5 rad/s", "controller.segment_limit": 100},
    )
    with pytest.raises(SautereauError) as raised:
        plan_press(rig)
    lines = str(raised.value).split("\n")[1:]
    names = [line.strip().partition(":")[0] for line in lines]
    assert names == ["dip", "segments", "joint 1 speed", "joint 2 speed"]
    assert all("fails by" in line and "; " in line for line in lines)


def test_the_hover_is_checked_against_the_limits():
    """Joint 1 stands at -24.75 deg there, above every angle of the press."""
    rig = with_values(PAPER, {"arm.upper_limits": ["-28 deg", "-10 deg"]})
    failed = [check.name for check in draft_press(rig).checks if not check.holds]
    assert failed == ["joint 1 upper limit"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"arm.base_x": "-600 mm"}, r"reach: the fingertip's path goes .* mm beyond the outer"),
        ({"arm.base_x": "-175 mm", "arm.base_z": "20 mm"}, "inside the inner reach"),
        ({"press.hover": "400 mm"}, r"reach: the point press.hover above the key goes"),
        ({"press.hold": "normal", "arm.base_z": "300 mm"}, r"move arm.base_z"),
        ({"press.jack_speed": "1 m/s"}, r"leaves no cruise; lower jack_speed"),
        ({"controller.sample_period": "60 ms"}, r"holds no whole segment of the controller"),
        ({"controller.sample_period": "1 ns"}, r"segment_limit.*raise press.return_speed"),
        ({"press.return_speed": "1e-4 m/s", "controller.segment_limit": 8}, "press: lasts"),
    ],
    ids=["far", "near", "hover", "normal", "fast", "coarse", "fine", "slow"],
)
def test_no_such_motion_is_one_clear_message(values, message):
    with pytest.raises(TrajectoryError, match=message) as raised:
        draft_press(with_values(PAPER, values))
    assert "\n" not in str(raised.value)


def test_a_check_says_its_side_value_limit_and_margin():
    assert str(at_most("speed", 7.0, 6.0, "rad/s", "")) == (
        "speed: 7 rad/s, at most 6 rad/s: fails by 1 rad/s"
    )
    assert str(at_least("segments", 10, 8, "1", "")) == "segments: 10, at least 8: holds by 2"
    assert at_most("", 1.0, 1.0, "m", "").holds
    assert not at_most("", np.nan, 1.0, "m", "").holds
    assert not at_least("", np.inf, 1.0, "m", "").holds


@st.composite
def rigs(draw):
    """Rigs around the paper's, most of which can be reached, of both holds and elbows."""
    upper, lower = draw(st.floats(0.06, 0.25)), draw(st.floats(0.06, 0.25))
    bend, lean = draw(st.floats(0.05, 2.9)), draw(st.floats(-0.5, 3.6))
    press_arm = draw(st.floats(0.05, 0.185))
    hold = draw(st.sampled_from(["point", "normal"]))
    if hold == "normal":
        x = draw(st.floats(-1.05, 1.05)) * upper
        z = lower + draw(st.floats(-0.5, 0.5)) * upper
    else:
        distance = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(bend))
        x, z = distance * np.cos(lean), distance * np.sin(lean)
    return with_values(
        PAPER,
        {
            "key.press_arm": f"{press_arm} m",
            "key.jack_arm": f"{draw(st.floats(0.1, 0.4))} m",
            "key.dip": "15 mm",
            "press.jack_speed": f"{max(0.005, 10 ** draw(st.floats(-2.3, 0)))} m/s",
            "press.jack_rise": f"{draw(st.floats(1, 15))} mm",
            "press.run_up_acceleration": f"{draw(st.floats(2, 500))} m/s^2",
            "press.run_up_jerk": f"{draw(st.floats(1e3, 1e6))} m/s^3",
            "press.run_down_acceleration": f"{draw(st.floats(2, 500))} m/s^2",
            "press.run_down_jerk": f"{draw(st.floats(1e3, 1e6))} m/s^3",
            "press.hold": hold,
            "press.bottom_hold": f"{draw(st.floats(0, 0.2))} s",
            "arm.upper_length": f"{upper} m",
            "arm.lower_length": f"{lower} m",
            "arm.base_x": f"{x - press_arm} m",
            "arm.base_z": f"{z + 0.014} m",
            "arm.elbow": draw(st.sampled_from(["up", "down"])),
            "arm.lower_limits": ["-200 deg", "-175 deg"],
            "arm.upper_limits": ["200 deg", "175 deg"],
            "arm.speed_limit": "30 rad/s",
            "arm.acceleration_limit": "1e4 rad/s^2",
            "arm.counts_per_revolution": draw(st.sampled_from([2_000_000, 16, 8192, 2**24, 2**31])),
            "controller.segment_limit": 2000,
        },
    )


def check_by_force(rig, planned):
    """Recompute from the segments alone what the checks promise."""
    arm, key, period = rig.arm, rig.key, rig.controller.sample_period
    count = 2 * np.pi / arm.counts_per_revolution
    segments = planned.segments
    times = np.concatenate([[0], np.cumsum(segments.samples)]) * period
    positions = segments.start + np.vstack([[0, 0], np.cumsum(segments.steps, axis=0)])
    curve = CubicHermiteSpline(times, positions, np.vstack([[0, 0], segments.velocities]))
    t = np.linspace(0, times[-1], 20_001)
    joints = curve(t) * count
    first, second = joints.T
    slack = 2 * count + 1e-4
    for j in (0, 1):
        assert joints[:, j].min() >= arm.lower_limits[j] - slack
        assert joints[:, j].max() <= arm.upper_limits[j] + slack
    speed_of_rounding = 3 * count / (segments.samples.min() * period)
    assert np.abs(curve(t, 1) * count).max() <= arm.speed_limit * 1.05 + speed_of_rounding
    bend = second * (-1 if arm.elbow == "up" else 1)
    assert bend.min() >= np.radians(5) - slack
    assert bend.max() <= np.radians(175) + slack
    x = arm.base_x + arm.upper_length * np.cos(first) + arm.lower_length * np.cos(first + second)
    z = arm.base_z + arm.upper_length * np.sin(first) + arm.lower_length * np.sin(first + second)
    # The sphere stays where it touches the key, whose surface ends at the front edge.
    along = np.sqrt(x**2 + z**2 - (key.surface_height + arm.fingertip_radius) ** 2)
    reach = 2 * count * (arm.upper_length + arm.lower_length) + 1e-5
    assert along.min() > 0
    assert along.max() <= key.front_arm + reach


@given(rigs())
@settings(deadline=None, max_examples=150)
def test_any_rig_gives_a_finite_plan_that_holds_or_a_trajectory_error(rig):
    try:
        planned = plan_press(rig)
    except TrajectoryError as error:
        message = str(error)
    else:
        message = ""
        for name, array in flat(planned):
            assert np.isfinite(array).all(), name
        check_by_force(rig, planned)
    assert "nan" not in message
