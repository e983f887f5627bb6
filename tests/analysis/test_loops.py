"""Stiffness and damping of position loops from recorded torques and following errors."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.press.loops import position_loops
from sautereau.commands.setup import setup
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Joints
from sautereau.rig.errors import UsageError
from sautereau.rig.load import load_rig
from sautereau.rig.text import commented_rig
from sautereau.robot.errors import RobotError
from tests.recordings import write_recording

TIME = np.arange(0, 0.5, 2e-3)
ERROR = 1e-3 * np.exp(-(((TIME - 0.2) / 0.02) ** 2)) + 2e-4 * np.sin(40 * TIME)
PATH = np.sin(6 * TIME)


def torque(stiffness, damping):
    """A PID on the following error, with feed-forward of an inertia and of a weight."""
    rate = np.diff(ERROR, prepend=ERROR[0]) / 2e-3
    acceleration = np.gradient(np.gradient(PATH + ERROR, TIME), TIME)
    integral = 100 * np.cumsum(ERROR) * 2e-3
    return stiffness * ERROR + damping * rate + integral + 2e-3 * acceleration + 0.3


@pytest.fixture
def recorded(tmp_path):
    found = read_recording(write_recording(tmp_path / "a.mcap", load_rig(), np.zeros((2, 64))))

    def of(**changes):
        both = {"e1": ERROR, "e2": ERROR, "m1": torque(27.0, 0.25), "m2": torque(10.0, 0.06)}
        return replace(found, joints=Joints(TIME, PATH, PATH, **(both | changes)))

    return of


def test_the_gains_of_a_loop_are_found(recorded):
    loops = position_loops([recorded()])
    assert loops.stiffness == pytest.approx((27.0, 10.0), rel=1e-6)
    assert loops.damping == pytest.approx((0.25, 0.06), rel=1e-6)
    stiffer = recorded(m1=torque(29.0, 0.25))
    assert position_loops([recorded(), stiffer]).stiffness[0] == pytest.approx(28.0)


def test_what_shows_no_loops_gives_none(recorded):
    """Torques of a feed-forward hide those of the loops; a rigid arm has no following error."""
    pushed = torque(27.0, 0.25) + np.where(TIME > 0.25, 0.2, 0.0) * np.sin(300 * TIME)
    nothing = np.zeros_like(TIME)
    assert position_loops([]) is None
    assert position_loops([recorded(m1=pushed)]) is None
    assert position_loops([recorded(e1=nothing, m1=nothing)]) is None
    assert position_loops([recorded(e1=np.empty(0))]) is None
    assert position_loops([replace(recorded(), joints=None)]) is None


def test_the_set_up_writes_them_into_the_rig(recorded, tmp_path, monkeypatch):
    path = tmp_path / "rig.toml"
    path.write_text(commented_rig(), encoding="utf-8")
    reader = "sautereau.robot.experiment.setup.loops.read_recording"
    monkeypatch.setattr(reader, lambda _: recorded())
    presses = [tmp_path / "press-0001.mcap"]
    assert setup(str(path), "loops", save=True, recording=presses) == 0
    arm = load_rig(path).arm
    assert arm.servo_stiffness == (27.0, 10.0)
    assert arm.servo_damping == (0.25, 0.06)
    with pytest.raises(UsageError, match="--recording"):
        setup(str(path), "loops")
    joints = replace(recorded(), joints=None)
    monkeypatch.setattr(reader, lambda _: joints)
    with pytest.raises(RobotError, match="do not show"):
        setup(str(path), "loops", recording=presses)
