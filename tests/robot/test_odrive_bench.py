"""An ODrive on the stand-in, over real ports: whole presses, a pulled cable, a dead host."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib import resources

import numpy as np
import pytest

from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.load import load_press
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, rig_document, with_values
from sautereau.robot.drivers.odrive.driver import OdriveController
from sautereau.robot.errors import LineLost, PortUnavailable, SilentController
from sautereau.robot.experiment.session import run_session
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

KIND = {"controller.kind": "odrive", "controller.baud_rate": 921600}
MUTE = {"plectrum": "none", "string": "none", "step": 1e-3}


@pytest.fixture(scope="module")
def rig():
    return with_values(load_rig(), KIND)


def mute(**faults):
    tables = Faults.model_validate(faults) if faults else None
    return load_scene("ideal").model_copy(update=MUTE | {"faults": tables})


def press(rig, scene, out, seed=0):
    with StandIn(rig, scene, seed) as stand_in:
        controller = OdriveController(stand_in.rig)
        paths = run_session(stand_in.rig, plan_press(stand_in.rig), controller, out, 1)
        return paths[0], stand_in.truth()[0]


def test_a_press_has_the_phases_that_the_truth_has(rig, tmp_path):
    path, truth = press(rig, load_scene("ideal"), tmp_path)
    recording = load_press(path)
    phases = find_phases(recording)
    held = phases.plucks[0]
    assert recording.simulated
    assert held.contact == pytest.approx(truth.contacts[0], abs=0.1e-3)
    assert held.release == pytest.approx(truth.releases[0], abs=0.1e-3)
    assert phases.free_speed == pytest.approx(0.072, rel=3e-3)
    assert phases.held_speed == pytest.approx(0.072, rel=3e-3)
    read = read_recording(path)
    assert "ODrive" in read.session.controller
    for name in ("q1", "q2"):
        planned = np.interp(read.joints.t, read.plan.t, getattr(read.plan, name))
        assert np.abs(getattr(read.joints, name) - planned).max() < 3e-4


def test_the_same_seed_gives_the_same_bytes(rig, tmp_path):
    scene = load_scene("ideal").model_copy(update=MUTE)
    volts = [
        read_recording(press(rig, scene, tmp_path / str(run), seed=5)[0]).volts for run in (0, 1)
    ]
    for name in ("velocity", "force"):
        assert volts[0][name].tobytes() == volts[1][name].tobytes()


@pytest.mark.parametrize("port_closes", [False, True])
def test_a_cable_pulled_in_mid_motion(rig, tmp_path, port_closes):
    scene = mute(cable_out={"press": 1, "at": "20 ms", "port_closes": port_closes})
    fast = with_values(rig, {"controller.timeout": "1 s", "daq.trigger_timeout": "0.5 s"})
    with StandIn(fast, scene, 0) as stand_in:
        controller = OdriveController(stand_in.rig)
        with pytest.raises(Exception, match="NOT confirmed off") as caught:
            run_session(stand_in.rig, plan_press(stand_in.rig), controller, tmp_path, 1)
        told = [str(caught.value), *getattr(caught.value, "__notes__", ())]
        assert any("watchdogs switch them off" in text for text in told)
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


def until(met, patience=20.0):
    """Wait until something is met, which it is sooner or later."""
    end = time.monotonic() + patience
    while not met():
        assert time.monotonic() < end, "it never came to that"
        time.sleep(0.01)


def test_a_host_that_is_killed_leaves_the_motors_off(rig):
    """A real process, a real kill, and a watchdog on the wall's clock."""
    with StandIn(rig, mute(), 0, paced=True) as stand_in:
        firmware = stand_in.bench.firmware
        command = [sys.executable, "-c", HOST.format(port=stand_in.serial_port)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as host:
            try:
                assert host.stdout.readline() == "on\n"
                start = stand_in.bench.time
                until(lambda: stand_in.bench.time > start + 0.5)  # it lives on its signs of life
                assert firmware.motors_on == (True, True)
            finally:
                os.kill(host.pid, signal.SIGKILL)
        until(lambda: firmware.motors_on == (False, False))
        assert [axis.error for axis in firmware.axes] == [0x800, 0x800]


def test_the_command_line_presses_and_says_so(rig, tmp_path):
    text = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")
    text = text.replace("baud_rate = 115200", 'kind = "odrive"\nbaud_rate = 921600')
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    assert rig_document(load_rig(str(tmp_path / "rig.toml")))["controller"]["kind"] == "odrive"
    options = "--scene ideal --seed 3 --out out --json"
    ran = subprocess.run(
        [sys.executable, "-m", "sautereau", "press", "rig.toml", *options.split()],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONWARNINGS": "error"},
        timeout=60,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)
    (path,) = (tmp_path / "out").glob("*.mcap")
    assert "ODrive" in read_recording(path).session.controller
