"""The table of a haptic key, against predictions of presses and closed forms."""

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results.force_map import force_map, inertia_at_finger
from sautereau.commands.output import FileOutput
from sautereau.commands.plan import predict as command
from sautereau.rig.instrument import Damper, Tongue
from sautereau.rig.load import load_rig
from sautereau.rig.units import GRAVITY

RIG = load_rig()
RIG = RIG.model_copy(update={"jack": RIG.jack.model_copy(update={"damper": None})})


def test_pressed_slowly_it_is_the_prediction_without_inertia():
    """Of a press at 5 mm/s, whose inertia is 1e-5 of the force, at every travel."""
    slow = RIG.model_copy(update={"press": RIG.press.model_copy(update={"jack_speed": 5e-3})})
    found = force_map(slow, speeds=(5e-3 * RIG.key.press_arm / RIG.key.jack_arm,))
    press = predict(slow)
    travel = press.deflection * slow.key.press_arm / slow.key.laser_arm
    between = np.abs(travel[press.string_force > 0][-1] - found.travel) > 2e-5  # but at the jump
    expected = np.interp(found.travel, travel, press.finger_force)
    np.testing.assert_allclose(found.pressed[0, between], expected[between], rtol=1e-3)


def test_the_branches_differ_by_friction_and_tongue():
    """Where no string is held: 2 (tau + mu r') / a_p, and the tongue's force times r' / a_p."""
    tongue = Tongue.model_construct(pivot=12e-3, bristle_moment=1e-4, bristle_stiffness=0.0)
    jack = RIG.jack.model_copy(update={"tongue": tongue})
    rig = RIG.model_copy(update={"jack": jack})
    found = force_map(rig, speeds=(0.0,))
    key, level = rig.key, found.travel / rig.key.press_arm
    slope = key.jack_arm * (1 + np.tan(level) ** 2) + key.jack_surface_height * np.tan(
        level
    ) / np.cos(level)
    dry = 2 * (key.pivot_coulomb_friction + slope * jack.register_friction) / key.press_arm
    lever = rig.plectrum.length - rig.plectrum.overlap
    rise = key.jack_arm * np.tan(level) + key.jack_surface_height * (1 / np.cos(level) - 1)
    below = jack.string_clearance - rise
    passing = (below >= 0) & (below <= lever * rig.plectrum.overlap / tongue.pivot)
    assert passing.sum() > 5
    pushed = tongue.bristle_moment / lever * slope / key.press_arm * passing
    free = rise < jack.string_clearance
    differences = (found.pressed - found.returning)[0]
    np.testing.assert_allclose(differences[free], (dry + pushed)[free], rtol=1e-6)


def test_a_damper_carries_the_jack_at_rest_and_speed_adds_viscous_friction():
    damper = Damper.model_construct(lift=0.4e-3, stiffness=15.0, decay=40.0)
    with_felt = RIG.model_copy(update={"jack": RIG.jack.model_copy(update={"damper": damper})})
    bare, felted = force_map(RIG), force_map(with_felt)
    carried = min(damper.stiffness * damper.lift, RIG.jack.mass * GRAVITY)
    less = carried * RIG.key.jack_arm / RIG.key.press_arm
    assert bare.pressed[0, 0] - felted.pressed[0, 0] == pytest.approx(less, rel=1e-6)
    assert felted.pressed[0, -1] == bare.pressed[0, -1]
    viscous = RIG.key.pivot_viscous_friction * bare.speed[-1] / RIG.key.press_arm**2
    assert bare.pressed[-1, 0] - bare.pressed[0, 0] >= viscous * (1 - 1e-6)


def test_files_have_every_value_with_its_unit(tmp_path, capsys):
    for ending in ("csv", "h5"):
        path = tmp_path / f"map.{ending}"
        plot = tmp_path / f"{ending}.png"
        assert command("paper", force_map=path, plot=plot, output=FileOutput()) == 0
        assert plot.exists()
    assert "inertia" in capsys.readouterr().out
    found = force_map(load_rig())
    with h5py.File(tmp_path / "map.h5") as file:
        np.testing.assert_array_equal(file["returning"], found.returning)
        assert file["travel"].attrs["unit"] == "m"
        assert file.attrs["inertia_at_finger"] == inertia_at_finger(RIG)
    with (tmp_path / "map.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["speed [m/s]", "travel [m]", "pressed [N]", "returning [N]"]
    values = np.array(rows, float)
    assert len(values) == found.pressed.size
    np.testing.assert_allclose(values[:, 2], found.pressed.ravel(), rtol=1e-6, atol=1e-9)


def test_speeds_that_do_not_increase_are_refused():
    with pytest.raises(AnalysisError, match="increase from 0"):
        force_map(RIG, speeds=(0.1, 0.05))
    assert command("paper", fit=Path("x.json"), force_map=Path("y.csv"), output=FileOutput()) == 2
