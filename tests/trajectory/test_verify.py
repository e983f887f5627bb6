"""Every check, against brute force at 100 kHz on the quantised segments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Gesture
from sautereau.trajectory.checks import at_least, at_most
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.press import draft_press, plan_press
from tests.budget import amount, examples
from tests.trajectory.brute_force import brute

PAPER = load_rig()


@given(
    st.lists(st.tuples(st.integers(0, 1000), st.floats(-9, 9)), min_size=1, max_size=12),
    st.lists(st.tuples(st.floats(-5, 1005), st.floats(0, 500)), min_size=1, max_size=6),
)
def test_the_range_is_that_of_a_dense_sampling(points, windows):
    rise, first = np.unique([p[0] for p in points], return_index=True)
    force = np.array([points[i][1] for i in first])
    curve = Expectation(rise.astype(float), force, 0.0, 0.0)
    low = np.array([w[0] for w in windows])
    high = low + np.array([w[1] for w in windows])
    least, most = curve.range_between(low, high)
    for a, b, down, up in zip(low, high, least, most, strict=True):
        inside = curve.rise[(curve.rise >= a) & (curve.rise <= b)]
        sampled = curve.force_at(np.concatenate([[a, b], inside, np.linspace(a, b, 50)]))
        assert np.isclose(sampled.min(), down, rtol=1e-12, atol=1e-12)
        assert np.isclose(sampled.max(), up, rtol=1e-12, atol=1e-12)


def test_a_check_prints_value_limit_and_margin():
    assert str(at_most("speed", 7.0, 6.0, "rad/s", "")) == (
        "speed: 7 rad/s, at most 6 rad/s: fails by 1 rad/s"
    )
    assert str(at_least("segments", 10, 8, "1", "")) == "segments: 10, at least 8: holds by 2"


def test_a_check_holds_at_the_limit_and_fails_for_nan():
    assert at_most("", 1.0, 1.0, "m", "").holds
    assert at_least("", 1.0, 1.0, "m", "").holds
    for value in (np.nan, np.inf, -np.inf):
        assert not at_most("", value, 1.0, "m", "").holds
        assert not at_least("", value, 1.0, "m", "").holds
    assert at_most("", 3.0, 1.0, "m", "").margin == -2.0


def powers(low, high):
    return st.floats(low, high).map(lambda power: 10.0**power)


@st.composite
def gestures(draw, rise):
    n = draw(st.integers(3, 30))
    time = np.linspace(0, draw(st.floats(0.05, 1.0)), n)
    s = time / time[-1]
    shapes = [
        np.sin(np.pi * s) ** 2,
        s**3 * (10 - 15 * s + 6 * s**2),
        np.array([0, *draw(st.lists(st.floats(0, 1), min_size=n - 1, max_size=n - 1))]),
    ]
    shape = np.clip(draw(st.sampled_from(shapes)), 0, 1)
    return Gesture(
        time=tuple(f"{float(t)!r} s" for t in time),
        rise=tuple(f"{float(r) * rise!r} m" for r in shape),
    )


@st.composite
def rigs(draw):
    """Rigs of many kinds: both holds and elbows, equal and 10:1 links, straight and folded."""
    upper = draw(st.floats(0.06, 0.25))
    lower = upper * draw(st.sampled_from([1.0, 10.0, 0.1, 1.3, 0.6]))
    press_arm = draw(st.floats(0.05, 0.185))
    hold, elbow = draw(st.sampled_from(["point", "normal"])), draw(st.sampled_from(["up", "down"]))
    if hold == "normal":
        above = draw(st.floats(-0.8, 0.8)) * upper
        side, slide = draw(st.sampled_from([-1, 1])), draw(st.floats(-0.03, 0.03))
        x, z = side * np.sqrt(upper**2 - above**2) + slide, lower + above
        elbow = draw(st.sampled_from([elbow, "up" if x < 0 else "down"]))
    else:
        bend = draw(st.floats(0.05, 0.3) | st.floats(0.3, 2.8) | st.floats(2.8, 3.1))
        lean = draw(st.floats(-0.2, 3.3))
        away = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(bend))
        x, z = away * np.cos(lean), away * np.sin(lean)
    rise, speed = draw(st.floats(1e-3, 15e-3)), max(0.005, draw(powers(-2.3, 0)))
    # Most ramps take between a tenth and a half of the rise.
    hard, soft = (min(5e3, draw(powers(0, 1)) * speed**2 / rise) for _ in range(2))
    jerks = [min(1e8, draw(powers(0, 2)) * max(1, 8 * a**2 / speed)) for a in (hard, soft)]
    return with_values(
        PAPER,
        {
            "key.press_arm": f"{press_arm} m",
            # A rise of 15 mm turns a jack arm of 26 mm by 30 degrees.
            "key.jack_arm": f"{draw(st.floats(0.026, 0.06) | st.floats(0.06, 0.4))} m",
            "key.gravity_moment": "0 N m",
            "key.dip": f"{draw(st.floats(0.02, 0.1))} m",
            "key.neighbour_height": f"{draw(st.floats(-0.5, -0.1) | st.floats(-0.5, 0.03))} m",
            "press.jack_speed": f"{speed} m/s",
            "press.jack_rise": f"{rise} m",
            "press.run_up_acceleration": f"{2 * hard} m/s^2",
            "press.run_up_jerk": f"{jerks[0]} m/s^3",
            "press.run_down_acceleration": f"{2 * soft} m/s^2",
            "press.run_down_jerk": f"{jerks[1]} m/s^3",
            "press.return_speed": f"{draw(st.floats(0.05, 1))} m/s",
            "press.return_acceleration": f"{draw(powers(0, 3))} m/s^2",
            "press.approach_speed": f"{draw(st.floats(0.05, 1))} m/s",
            "press.hover": f"{draw(st.floats(1e-3, 0.03))} m",
            "press.hold": hold,
            "press.bottom_hold": f"{draw(st.floats(0, 0.1))} s",
            "press.settle": f"{draw(st.floats(0, 0.05))} s",
            "press.speed_tolerance": 0.1,
            "arm.upper_length": f"{upper} m",
            "arm.lower_length": f"{lower} m",
            "arm.base_x": f"{x - press_arm} m",
            "arm.base_z": f"{z + 0.014} m",
            "arm.elbow": elbow,
            "arm.lower_limits": ["-200 deg", "-179 deg"],
            "arm.upper_limits": ["280 deg", "179 deg"],
            "arm.speed_limit": f"{draw(powers(1, 3))} rad/s",
            "arm.acceleration_limit": f"{draw(powers(3, 6))} rad/s^2",
            "arm.jerk_limit": f"{draw(powers(6, 10))} rad/s^3",
            "arm.torque_limit": f"{draw(powers(1, 4))} N m",
            "arm.tilt_limit": draw(st.sampled_from(["180 deg", "45 deg"])),
            "arm.counts_per_revolution": draw(
                st.sampled_from([2_000_000, 8192, 100_000, 2**24, 2**31, 16])
            ),
            "controller.segment_limit": draw(st.sampled_from([255, 2000, 64, 8])),
        },
    )


@st.composite
def presses(draw):
    """A rig, some with a gesture, and the expected force, or None."""
    rig = draw(rigs())
    if draw(st.integers(0, 3)) == 0:
        gesture = draw(gestures(rig.press.jack_rise))
        rig = rig.replaced({"press.gesture": gesture})
    if draw(st.booleans()):
        return rig, None
    rises = np.unique(draw(st.lists(st.integers(0, 1000), min_size=1, max_size=20)))
    force = draw(st.lists(st.floats(0, 20), min_size=len(rises), max_size=len(rises)))
    rises = rises / 1000 * rig.press.jack_rise
    return rig, Expectation(rises, np.array(force), rises[0], rises[-1])


def arrays(plan):
    for name in ("rise", "angle", "fingertip", "joints"):
        yield from getattr(plan, name)
    yield from (plan.time, plan.torques, plan.tilt, plan.slide)


def check_by_force(rig, expected):
    """Plan, and check every value of an accepted plan by brute force."""
    try:
        plan = plan_press(rig, expected)
    except TrajectoryError as error:
        message, plan = str(error), None
    if plan is None:
        assert "nan" not in message
        return
    assert all(np.isfinite(array).all() for array in arrays(plan))
    assert (plan.approach.end == plan.segments.start).all()
    assert (plan.segments.end == plan.segments.start).all()
    assert (plan.retreat.end == plan.hover).all()
    found = brute(rig, plan, expected)
    for check in plan.checks:
        value, scale = found[check.name], max(abs(found[check.name]), abs(check.value))
        if check.name == "cruise speed error":
            assert check.value == pytest.approx(value, rel=0.05, abs=1e-6)
            continue
        beyond = check.value - value if check.at_least else value - check.value
        # Half a count above a key at rest its normal is taken as vertical.
        slack = (1e-6 if "torque" in check.name else 1e-8) * scale + 1e-9
        assert beyond <= slack, check
        margin = value - check.limit if check.at_least else check.limit - value
        assert margin >= -slack, check


@pytest.mark.slow
@pytest.mark.timeout(1800)
@given(presses())
@examples(25, amount(100, 2000))
def test_a_plan_holds_by_brute_force_or_is_refused(press):
    check_by_force(*press)


@pytest.mark.parametrize("hold", ["point", "normal"])
@pytest.mark.parametrize("pushed", [False, True])
def test_the_papers_checks_are_exact_within_a_small_bound(bench, hold, pushed):
    rig = bench(press__hold=hold, arm__torque_limit="10 N m")
    rise = np.linspace(0, 0.01, 400)
    spike = 0.6 + 50.0 * np.exp(-(((rise - 0.0041234) / 2e-5) ** 2))
    expected = Expectation(rise, spike, 0.002, 0.0035) if pushed else None
    plan = plan_press(rig, expected)
    found = brute(rig, plan, expected)
    for check in plan.checks:
        assert check.value == pytest.approx(found[check.name], rel=0.05, abs=1e-5), check
        beyond = found[check.name] - check.value
        assert (-beyond if check.at_least else beyond) <= 1e-2 * check.value * (
            check.name == "cruise speed error"
        ) + 1e-8 * abs(check.value), check


def test_stops_decelerate_each_joint_independently(bench):
    """With a low deceleration the finger moves on; the check reports the actual depth."""
    rig = bench(arm__acceleration_limit="3 rad/s^2")
    values = {check.name: check for check in draft_press(rig).checks}
    found = brute(rig, draft_press(rig))
    deep = values["depth of the key after a stop"]
    assert not deep.holds
    assert deep.value == pytest.approx(found[deep.name], rel=0.06)
    assert deep.value >= found[deep.name] > values["depth of the key"].value * 1.3
    spare = values["joint margin after a stop"]
    assert spare.value <= found[spare.name] + 1e-9
    assert spare.value == pytest.approx(found[spare.name], abs=1e-2)


def test_torques_balance_the_expected_force_by_virtual_work(paper):
    """The additional power of the joints is that of the force on the fingertip, which moves key
    and jack too, and cannot pull them."""
    rise = np.array([0.0, 0.002, 0.004, 0.01])
    expected = Expectation(rise, np.array([0.6, 0.6, 3.0, 0.6]), 0.002, 0.004)
    bare, pushed = plan_press(paper), plan_press(paper, expected)
    work = ((pushed.torques - bare.torques) * bare.joints.velocity).sum(-1)
    angle = bare.angle.position
    normal = np.stack([-np.sin(angle), np.cos(angle)], -1)
    inertia = paper.key.inertia + paper.jack.mass * paper.key.jack_arm**2
    inertial = inertia * bare.angle.acceleration / paper.key.press_arm
    force = np.maximum(np.interp(bare.rise.position, rise, expected.force) + inertial, 0.0)
    against = -force * (normal * bare.fingertip.velocity).sum(-1)
    assert np.abs(against).max() > 0.1
    assert np.abs(work - against).max() < 1e-12


def test_a_heavy_key_needs_the_torques_that_accelerate_it(bench):
    """Of a key of 0.07 kg m^2 the run-up needs 2.6 N m of joint 1, ten times those of the arm."""
    rig = bench(key__inertia="0.07 kg m^2")
    expected = Expectation(np.array([0.0, 0.01]), np.array([0.1, 0.1]), 0.002, 0.004)
    plan = draft_press(rig, expected)
    checks, found = {check.name: check for check in plan.checks}, brute(rig, plan, expected)
    for name in ("joint 1 torque", "joint 2 torque"):
        assert found[name] <= checks[name].value + 1e-9 <= 1.1 * found[name]
    assert not checks["joint 1 torque"].holds
    assert np.abs(plan.torques[:, 0]).max() == pytest.approx(found["joint 1 torque"], rel=0.1)


def test_the_force_is_not_expected_above_the_key(bench):
    """A force at rest acts in the press only, not in approach and retreat."""
    rig = bench()
    expected = Expectation(np.array([0.0]), np.array([30.0]), 0.0, 0.0)
    draft = draft_press(rig, expected)
    found = brute(rig, draft, expected)
    for check in draft.checks:
        if "torque" in check.name:
            assert check.value == pytest.approx(found[check.name], rel=0.03)
