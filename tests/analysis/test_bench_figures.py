"""The pictures of the bench, of a plan, and of the place to clamp the robot."""

import numpy as np
import pytest
from matplotlib.patches import Circle

from sautereau.analysis.figures.bench import bench_figure
from sautereau.analysis.figures.parts import JACK, bench_parts, string_height
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.predict import expectation, predict
from sautereau.analysis.results.mount import mount_figure
from sautereau.analysis.results.plan import plan, plan_figure
from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.key import angle_of_rise
from sautereau.trajectory.mount.find import MountMap, find_mount, mount_map
from sautereau.trajectory.press import draft_press
from tests.plots import texts

RIG = load_rig()
PLAN = draft_press(RIG)


def texts_of(rig, plan):
    return "\n".join(texts(bench_figure(rig, plan)))


def test_it_names_the_parts_and_gives_the_lengths():
    said = texts_of(RIG, PLAN)
    for word in ("nut", "bridge", "laser", "felt", "rail", "balance pin", "plectrum", "damper"):
        assert word in said
    assert "press arm 171 mm" in said
    assert "front arm 185 mm*" in said
    assert "plectrum's overlap 0.263 mm*" in said
    # Some of them have a source too, which gives the reason for the assumption.
    assert "* assumed in the rig file" in said.splitlines()


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_the_fingertip_touches_the_key(hold):
    rig = with_values(RIG, {"press.hold": hold})
    plan = draft_press(rig)
    side = bench_figure(rig, plan).axes[0]
    tips = [patch for patch in side.patches if isinstance(patch, Circle)]
    places = sorted(tip.get_center()[1] for tip in tips)
    expected = [plan.fingertip.position[:, 1].min() * 1e3, plan.fingertip.position[0, 1] * 1e3]
    np.testing.assert_allclose(places, expected, atol=1e-9)


def test_the_jack_stands_on_the_key_and_its_plectrum_meets_the_string():
    (choir,) = choirs(RIG)
    clearance = choir.jack.string_clearance
    angle = float(angle_of_rise(RIG.key, clearance))
    _, jack = bench_parts(RIG, np.array([angle]))
    foot = jack.at(0)[:, 1].min()
    assert foot == pytest.approx(RIG.key.jack_surface_height + clearance)
    assert foot + JACK == pytest.approx(string_height(RIG, choir))


@pytest.mark.parametrize("part", ["damper", "tongue"])
def test_a_jack_without_damper_or_tongue_is_drawn(part):
    said = texts_of(RIG.replaced({f"jack.{part}": None}), PLAN)
    assert ("damper" in said) is (part != "damper")


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_a_good_plan_says_that_every_check_holds(hold):
    rig = with_values(load_rig(), {"press.hold": hold})
    expected = expectation(predict(rig))
    draft = draft_press(rig, expected)
    figure = plan_figure(rig, draft, expected)
    assert "every check holds" in figure.get_suptitle()
    limits = [label.get_text() for label in figure.axes[4].get_yticklabels()]
    said = " ".join([*texts(figure), *limits])
    for word in ("balance pin", "jack", "contact", "release", "cruise", "joint 1 torque"):
        assert word in said


def test_a_finger_that_does_not_slide_is_not_drawn_sliding():
    """With `hold = "point"` the fingertip moves horizontally, with the key, and not along it."""
    for hold in ("point", "normal"):
        rig = with_values(load_rig(), {"press.hold": hold})
        draft = draft_press(rig)
        path = plan_figure(rig, draft, None).axes[1]
        along = [line for line in path.lines if "on the key" in str(line.get_label())]
        assert bool(along) == bool(draft.slide.any()) == (hold == "normal")
        for line in path.lines:
            assert "along the key" not in str(line.get_label())


def test_a_refused_plan_says_which_checks_fail():
    rig = with_values(load_rig(), {"key.dip": "7 mm", "arm.upper_limits": ["-30 deg", "-10 deg"]})
    figure = plan_figure(rig, draft_press(rig), None)
    assert "REFUSED" in figure.get_suptitle()
    assert "joint 1 upper limit" in " ".join(texts(figure))


def test_the_poses_are_drawn_where_the_fingertip_is(tmp_path):
    rig = load_rig()
    draft = draft_press(rig)
    scene = plan_figure(rig, draft, None).axes[0]
    start = next(line for line in scene.lines if line.get_label() == "start")
    tip = np.array([start.get_xdata()[-1], start.get_ydata()[-1]])
    np.testing.assert_allclose(tip, draft.fingertip.position[0] * 1e3, atol=1e-9)
    plan_figure(rig, draft, None).savefig(tmp_path / "plan.png")
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_a_plan_has_the_model_s_warnings():
    rig = with_values(load_rig(), {"string.frequency": "3.65 kHz"})
    assert any("kg/m^3" in warning for warning in plan(rig).warnings)
    assert not any("kg/m^3" in warning for warning in plan(load_rig()).warnings)


def drawn(axes, label):
    """Return the points [mm] of the line with a label, shape (n, 2)."""
    (line,) = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    return np.column_stack(line.get_data())


@pytest.fixture(scope="module")
def small_map(paper):
    return mount_map(paper, 31)


@pytest.fixture(scope="module")
def best(paper):
    return find_mount(paper)


@pytest.fixture(scope="module")
def figure(paper, small_map, best):
    return mount_figure(paper, small_map, best)


def test_the_arm_is_drawn_to_scale(figure, best):
    axes = figure.axes[0]
    assert axes.get_aspect() == 1
    for label in ("arm and key at rest", "arm and key at full rise"):
        base, elbow, tip = drawn(axes, label)
        assert base == pytest.approx([best.base_x * 1e3, best.base_z * 1e3])
        assert np.hypot(*(elbow - base)) == pytest.approx(120)
        assert np.hypot(*(tip - elbow)) == pytest.approx(100)
    assert drawn(axes, "arm and key at rest")[2] == pytest.approx([-171, 14])
    assert drawn(axes, "base in the rig")[0] == pytest.approx([-274.94, 174.12])
    assert drawn(axes, "best base")[0] == pytest.approx([best.base_x * 1e3, best.base_z * 1e3])


def test_units_are_degrees_or_millimetres(paper, figure):
    words = " | ".join(texts(figure))
    for expected in ("tilts by 0.0518 deg", "(deg)", "balance pin", "pressing point", "jack"):
        assert expected in words
    rig = with_values(paper, {"press.hold": "normal"})
    words = " | ".join(texts(mount_figure(rig, mount_map(rig, 31), find_mount(rig))))
    assert "slides by 0.0904 mm" in words
    assert "largest slide of the finger (mm)" in words


def test_what_is_excluded_is_hatched(paper, figure, small_map, best):
    def hatched(figure):
        return [c for c in figure.axes[0].collections if any(getattr(c, "hatches", [None]))]

    assert hatched(figure)
    free = MountMap(*small_map[:3], np.ones_like(small_map.feasible))
    assert not hatched(mount_figure(paper, free, best))
    nothing = MountMap(*small_map[:3], np.zeros_like(small_map.feasible))
    assert hatched(mount_figure(paper, nothing, best))


def test_a_region_over_the_key_leaves_no_room_for_the_neighbourhood(paper, figure, best):
    wide = paper.replaced({"arm.mount_x": (-0.4, 0.1)})
    assert "around the best base" not in texts(mount_figure(wide, mount_map(wide, 21), best))
    assert "around the best base" in texts(figure)
