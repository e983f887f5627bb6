"""The bench's picture: everything where the rig says it is."""

import numpy as np
import pytest
from matplotlib.patches import Circle

from sautereau.analysis.figures.bench import bench_figure
from sautereau.analysis.figures.side import BenchPose, jack_foot, string_height
from sautereau.analysis.model.choirs import choirs
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
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
    assert "* assumed in the rig file" in said


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
    foot = jack_foot(RIG, choir, angle)
    assert foot[1] == pytest.approx(RIG.key.jack_surface_height + clearance)
    assert foot[1] + 80e-3 == pytest.approx(string_height(RIG, choir))


def test_every_choir_has_a_jack():
    from matplotlib.figure import Figure

    rig = load_scene("two-choirs").true_rig(RIG)
    axes = Figure().add_subplot()
    pose = BenchPose(axes, rig)
    pose.put(0.04, None)
    jacks = [patch.get_xy() for patch in pose.artists[1:3]]
    for jack, choir in zip(jacks, choirs(rig), strict=True):
        assert jack[:, 0].mean() == pytest.approx(choir.jack_arm * 1e3, abs=1.0)
        lever = rig.key.model_copy(update={"jack_arm": choir.jack_arm})
        rise = float(rise_of_angle(lever, 0.04))
        low = (rig.key.jack_surface_height + rise) * 1e3
        assert jack[:, 1].min() == pytest.approx(low)
    assert not pose.artists[-1].get_visible()  # no arm
    assert "1 more choir" in texts_of(rig, draft_press(rig))


@pytest.mark.parametrize("change", [{"damper": None}, {"tongue": None}])
def test_a_jack_without_damper_or_tongue_is_drawn(change):
    jack = RIG.jack.model_copy(update=change)
    said = texts_of(RIG.model_copy(update={"jack": jack}), PLAN)
    assert ("damper" in said) is (jack.damper is not None)
