"""The picture of a plan."""

import numpy as np
import pytest

from sautereau.analysis.model.predict import expectation, predict
from sautereau.analysis.results.plan import plan, plan_figure
from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.press import draft_press
from tests.plots import texts


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
