"""The picture of where to clamp the robot: what is on it, in which units and where."""

import numpy as np
import pytest

from sautereau.analysis.results.mount import mount_figure
from sautereau.rig.load import with_values
from sautereau.trajectory.mount.find import MountMap, find_mount, mount_map
from tests.plots import texts


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
