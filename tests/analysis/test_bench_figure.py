"""The bench's picture: everything where the rig says it is."""

import numpy as np
import pytest
from matplotlib.patches import Circle

from sautereau.analysis.figures.bench import bench_figure
from sautereau.analysis.figures.parts import JACK, bench_parts, string_height
from sautereau.analysis.model.choirs import choirs
from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.key import angle_of_rise
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
