"""An ODrive on the stand-in, over real ports: presses, a pulled cable, a dead host."""

import subprocess
import time
from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.odrive.driver import OdriveController
from sautereau.robot.errors import LineLost, PortUnavailable, SilentController
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow
from tests.presses import QUICK, QUICK_TEXT, mute_scene, press_on

KIND = {"controller.kind": "odrive", "controller.baud_rate": 921600}
LEAD = 0.1015625  # s, of samples before the motion


@pytest.fixture(scope="module")
def rig():
    return with_values(load_rig(), KIND | QUICK)


@pytest.fixture(scope="module")
def pressed(rig, tmp_path_factory):
    """A press of seed 5, and its truth."""
    with StandIn(rig, load_scene("ideal"), 5) as stand_in:
        (path,) = press_on(stand_in, tmp_path_factory.mktemp("pressed"), 1, OdriveController)
        return path, stand_in.truth()[0]


@pytest.mark.slow
def test_a_press_has_the_phases_that_the_truth_has(pressed):
    path, truth = pressed
    recording = load_press(path)
    phases = find_phases(recording)
    held, start = phases.plucks[0], read_recording(path).motion
    assert recording.simulated
    assert held.contact == pytest.approx(truth.contacts[0] - LEAD, abs=0.1e-3)
    assert held.release == pytest.approx(truth.releases[0] - LEAD, abs=0.1e-3)
    assert recording.data.index[0] == pytest.approx(-LEAD - start.time)
    assert recording.motion == replace(start, time=0.0)
    assert "vibrometer" in start.text
    assert 0 < start.std < 50e-6
    assert abs(start.time) < 3 * start.std  # the stand-in's host is never late
    assert phases.free_speed == pytest.approx(0.072, rel=3e-3)
    assert phases.held_speed == pytest.approx(0.072, rel=3e-3)
    read = read_recording(path)
    assert "ODrive" in read.session.controller
    for name in ("q1", "q2"):
        planned = np.interp(read.joints.t, read.plan.t, getattr(read.plan, name))
        assert np.abs(getattr(read.joints, name) - planned).max() < 3e-4


@pytest.mark.slow
def test_the_command_line_presses_with_the_same_bytes_for_the_same_seed(
    pressed, tmp_path, monkeypatch
):
    text = QUICK_TEXT.replace("baud_rate = 115200", 'kind = "odrive"\nbaud_rate = 921600')
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    options = "--scene ideal --seed 5 --out out --json"
    assert app(["press", "rig.toml", *options.split()]) == 0
    (path,) = (tmp_path / "out").glob("press-*.mcap")
    one, other = read_recording(path), read_recording(pressed[0])
    assert "ODrive" in one.session.controller
    for name in ("velocity", "force"):
        assert one.volts[name].tobytes() == other.volts[name].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("port_closes", [False, slow(True)])
def test_a_cable_pulled_in_mid_motion(rig, tmp_path, port_closes):
    cable_out = {"press": 1, "at": "20 ms", "port_closes": port_closes}
    fast = with_values(rig, {"controller.timeout": "1 s", "daq.trigger_timeout": "0.5 s"})
    with StandIn(fast, mute_scene(faults={"cable_out": cable_out}), 0) as stand_in:
        controller = OdriveController(stand_in.rig)
        with pytest.raises(Exception, match="NOT confirmed off") as caught:
            press_on(stand_in, tmp_path, 1, lambda rig: controller)
        reported = [str(caught.value), *getattr(caught.value, "__notes__", ())]
        assert any("watchdogs switch them off" in text for text in reported)
        assert not list(tmp_path.glob("*.mcap"))
        with pytest.raises((LineLost, PortUnavailable, SilentController)):
            controller.connect()


HOST = """
import sys, time
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.odrive.driver import OdriveController

rig = with_values(load_rig(), {{"controller.kind": "odrive", "controller.baud_rate": 921600,
    "controller.watchdog_period": "0.2 s", "controller.port": {port!r}}})
with OdriveController(rig) as controller, controller.powered():
    print("on", flush=True)
    time.sleep(60)
"""


def until(reached, limit=60.0):
    """Wait until a condition is reached."""
    end = time.monotonic() + limit
    while not reached():
        assert time.monotonic() < end, "not reached within the limit"
        time.sleep(0.01)


def test_a_host_that_is_killed_leaves_the_motors_off(rig, command_server):
    """A real process, a real kill, and a watchdog in real time."""
    with StandIn(rig, mute_scene(), 0, paced=True) as stand_in:
        firmware = stand_in.bench.firmware
        words = ("-c", HOST.format(port=stand_in.serial_port))
        with command_server.start(*words, stdout=subprocess.PIPE) as host:
            try:
                assert host.stdout.readline() == "on\n"
                start = stand_in.bench.time
                until(lambda: stand_in.bench.time > start + 0.5)  # its watchdogs are renewed
                assert firmware.motors_on == (True, True)
            finally:
                host.kill()
        until(lambda: firmware.motors_on == (False, False))
        assert [axis.error for axis in firmware.axes] == [0x800, 0x800]
