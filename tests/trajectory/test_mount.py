"""Choice of the base, against random search, the planner and finite displacements."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.trajectory.arm import fingertip_motion, follow_key
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import angle_of_rise, key_under_fingertip, rise_of_angle
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.mount.bases import ELBOWS, LIMITS, assess_bases, key_angles
from sautereau.trajectory.mount.find import assess_mount, find_mount, mount_map
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.timing import press_law
from tests.budget import examples, slow

PAPER = load_rig()


def with_arm(rig, **values):
    return rig.model_copy(update={"arm": rig.arm.model_copy(update=values)})


def clamped(rig, mount):
    return with_arm(rig, base_x=mount.base_x, base_z=mount.base_z, elbow=mount.elbow)


@pytest.fixture(scope="module")
def best(paper):
    """The best base of the paper's rig, which holds the point."""
    return find_mount(paper)


@pytest.fixture(scope="module", params=["point", "normal"])
def held(request, bench, best):
    """The paper's rig with either hold, and its best base."""
    rig = bench(press__hold=request.param)
    return rig, best if request.param == "point" else find_mount(rig)


def residual_of(mount):
    return mount.tilt_max if mount.hold == "point" else mount.slide_max


def test_the_papers_finger_tilts_by_less_than_a_tenth_of_a_degree(paper, best):
    mount = best
    assert np.degrees(mount.tilt_max) < 0.1
    assert mount.slide_max == mount.slide_per_metre == 0
    misplaced = with_arm(clamped(paper, mount), base_x=mount.base_x + 3e-3)
    assert np.degrees(assess_mount(misplaced).tilt_max) > 1


def test_the_plan_from_the_best_base_agrees(held, bench):
    rig, mount = held
    values = {"arm.base_x": mount.base_x, "arm.base_z": mount.base_z}
    plan = plan_press(
        bench(
            press__hold=rig.press.hold,
            arm__elbow=mount.elbow,
            **{key: f"{value!r} m" for key, value in values.items()},
        )
    )
    assert np.abs(plan.tilt).max() == pytest.approx(mount.tilt_max, rel=2e-4, abs=1e-12)
    assert np.abs(plan.slide).max() == pytest.approx(mount.slide_max, rel=2e-4, abs=1e-12)


@pytest.mark.parametrize(
    ("spread", "least"), [(1.0, 5_000), slow(1.0, 20_000), slow(5e-3, 20_000), slow(1e-5, 20_000)]
)
def test_no_random_base_is_better(held, spread, least):
    """In the complete region, and closely around the best base, for either elbow."""
    rig, mount = held
    random = np.random.default_rng(7)
    low, high = np.array([rig.arm.mount_x, rig.arm.mount_z]).T
    best = np.array([mount.base_x, mount.base_z])
    corner, end = np.maximum(best - spread, low), np.minimum(best + spread, high)
    feasible = 0
    for _ in range(200):
        bases = random.uniform(corner, end, (1000, 2))
        for elbow in ELBOWS:
            found = assess_bases(rig, elbow, bases, key_angles(rig, 33))
            allowed = found.violation <= 0
            feasible += allowed.sum()
            # 33 angles underestimate the largest residual by at most this fraction.
            assert (found.worst_residual[allowed] > residual_of(mount) * (1 - 3e-3)).all()
        if feasible > least:
            break
    assert feasible > least


def test_errors_of_a_misplaced_base_are_those_of_brute_force(held):
    """Fingertip from the joints, key by bisection, speeds by differences."""
    rig, mount = held
    rig = clamped(rig, mount)
    key, height = rig.key, rig.key.surface_height + rig.arm.fingertip_radius
    rise = np.linspace(0, rig.press.jack_rise, 401)
    joints = follow_key(rig, Motion(rise, rise * 0, rise * 0)).joints
    law = press_law(rig.press)
    ends = law.law.at(np.array([law.cruise_start, law.cruise_end])).position
    cruise = (rise >= ends[0]) & (rise <= ends[1])
    for field, x, z, turn in (
        ("unnoticed_x", 1e-3, 0, 0),
        ("unnoticed_z", 0, 1e-3, 0),
        ("unnoticed_turn", 0, 0, np.radians(0.1)),
    ):
        heights, speeds, leans = [], [], []
        for sign in (1, -1):
            moved = with_arm(
                rig, base_x=rig.arm.base_x + sign * x, base_z=rig.arm.base_z + sign * z
            )
            turned = joints.position + np.array([sign * turn, 0])
            tip = fingertip_motion(moved.arm, joints._replace(position=turned)).position
            low, high = np.full_like(rise, -0.2), np.full_like(rise, 0.2)
            for _ in range(60):
                middle = (low + high) / 2
                above = tip[:, 1] * np.cos(middle) - tip[:, 0] * np.sin(middle) - height
                low, high = np.where(above < 0, middle, low), np.where(above < 0, high, middle)
            still = Motion(tip, tip * 0, tip * 0)
            angle = key_under_fingertip(key, rig.arm.fingertip_radius, still).position
            assert angle == pytest.approx(low, abs=1e-9)
            jack = rise_of_angle(key, low)
            heights.append(np.abs(jack - rise).max())
            speeds.append(np.abs(np.gradient(jack, rise) - 1)[cruise].max())
            leans.append(np.abs(turned.sum(-1) - low - joints.position.sum(-1)
                                + angle_of_rise(key, rise)).max())  # fmt: skip
        errors = getattr(mount, field)
        assert errors.height_error == pytest.approx(max(heights), rel=1e-6)
        assert errors.speed_error == pytest.approx(max(speeds), rel=0.01)
        assert errors.tilt_change == pytest.approx(max(leans), rel=1e-6)


def test_a_feasible_area_smaller_than_the_grid_is_found(paper, best):
    angles = key_angles(paper, 2)
    rise = rise_of_angle(paper.key, angles)
    path = follow_key(clamped(paper, best), Motion(rise, rise * 0, rise * 0)).joints.position
    hover = 0.16  # rad, more than joint 1 needs to hover
    tight = with_arm(
        paper,
        lower_limits=(path[:, 0].min() - 2e-3, paper.arm.lower_limits[1]),
        upper_limits=(path[:, 0].max() + hover, path[:, 1].max() + 2e-3),
    )
    coarse = mount_map(tight, 41)
    assert coarse.feasible.mean() < 0.01
    assert find_mount(tight).tilt_max == pytest.approx(best.tilt_max, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "limit", "fix"),
    [
        ({"arm__mount_x": ["500 mm", "600 mm"]}, "reach", "widen arm.mount_x"),
        ({"arm__torque_limit": "1 mN m"}, "torque", "raise arm.torque_limit"),
        ({"key__neighbour_height": "0.5 m"}, "elbow clearance", "raise arm.mount_z"),
        ({"arm__lower_limits": ["-80 deg", "-12 deg"]}, "joint 2 limits", "widen arm.lower"),
    ],
)
def test_no_feasible_base_is_one_clear_message(bench, values, limit, fix):
    with pytest.raises(TrajectoryError, match=f"(?s)no base in.*{limit}.*{fix}") as caught:
        find_mount(bench(**values))
    assert "nan" not in str(caught.value)


def test_a_base_out_of_reach_is_not_assessed(paper):
    with pytest.raises(TrajectoryError, match="does not reach the key"):
        assess_mount(with_arm(paper, base_x=-0.5))


def test_the_map_holds_the_best_base(held):
    rig, mount = held
    area = mount_map(rig, 61)
    assert area.residual.shape == area.feasible.shape == (2, 61, 61)
    assert np.isfinite(area.residual).all()
    least, feasible = area.best()
    assert least[feasible].min() >= residual_of(mount) * (1 - 1e-2)
    row, column = np.unravel_index(np.where(feasible, least, np.inf).argmin(), least.shape)
    place = np.array([[area.x[column], area.z[row]]])
    there = assess_bases(rig, mount.elbow, place, key_angles(rig, 65))
    assert least[row, column] == pytest.approx(there.worst_residual[0], rel=0.05)


@st.composite
def rigs(draw):
    """Arms, limits and regions of many kinds, most of them feasible."""
    x, z = draw(st.floats(-0.4, -0.05)), draw(st.floats(0.0, 0.25))
    low = draw(st.floats(-4.0, -1.0)), draw(st.floats(-3.1, -1.0))
    arm = {
        "upper_length": draw(st.floats(0.06, 0.25)),
        "lower_length": draw(st.floats(0.06, 0.25)),
        "mount_x": (x, x + draw(st.floats(1e-4, 0.3))),
        "mount_z": (z, z + draw(st.floats(1e-4, 0.3))),
        "lower_limits": low,
        "upper_limits": tuple(each + draw(st.floats(1.0, 6.0)) for each in low),
        "torque_limit": draw(st.sampled_from([0.5, 2.0])),
    }
    press = {
        "hold": draw(st.sampled_from(["point", "normal"])),
        "jack_rise": draw(st.sampled_from([6e-3, 10e-3, 15e-3])),
    }
    changed = with_arm(PAPER, **arm)
    return changed.model_copy(update={"press": PAPER.press.model_copy(update=press)})


@given(rigs())
@examples(3, 60)
def test_any_rig_has_a_mount_or_a_message(rig):
    try:
        mount = find_mount(rig)
    except TrajectoryError as error:
        mount, message = None, str(error)
    if mount is None:
        assert any(limit in message for limit in LIMITS)
        return
    assert "nan" not in repr(mount)
    assert "inf" not in repr(mount)
    x, z = rig.arm.mount_x, rig.arm.mount_z
    assert x[0] <= mount.base_x <= x[1]
    assert z[0] <= mount.base_z <= z[1]
    bases = np.random.default_rng(1).uniform((x[0], z[0]), (x[1], z[1]), (2000, 2))
    for elbow in ELBOWS:
        found = assess_bases(rig, elbow, bases, key_angles(rig, 65))
        allowed = found.worst_residual[found.violation <= 0]
        assert allowed.min(initial=np.inf) >= residual_of(mount) * (1 - 1e-3)


def test_the_many_bases_agree_with_the_planner(held):
    rig, mount = held
    angles = key_angles(rig, 9)
    random = np.random.default_rng(3)
    bases = np.array([mount.base_x, mount.base_z]) + random.uniform(-5e-3, 5e-3, (20, 2))
    found = assess_bases(rig, mount.elbow, bases, angles)
    rise = rise_of_angle(rig.key, angles)
    still = np.zeros_like(rise)
    for index, (x, z) in enumerate(bases):
        moved = with_arm(rig, base_x=x, base_z=z, elbow=mount.elbow)
        path = follow_key(moved, Motion(rise, still, still))
        lean = path.joints.position.sum(-1) - (angles - np.pi / 2)
        expected = lean if rig.press.hold == "point" else path.slide
        assert found.residual[index] == pytest.approx(expected, abs=1e-12)


def test_the_sensitivity_is_that_of_displaced_bases(held):
    rig, mount = held
    around = np.linspace(0, 2 * np.pi, 31)
    bases = np.stack([np.cos(around), np.sin(around)], -1) * 1e-3 + [mount.base_x, mount.base_z]
    displaced = assess_bases(rig, mount.elbow, bases, key_angles(rig, 257)).worst_residual
    sensitivity = mount.tilt_per_metre + mount.slide_per_metre
    increase = (displaced.max() - residual_of(mount)) / 1e-3
    assert increase == pytest.approx(sensitivity, rel=6e-3)
