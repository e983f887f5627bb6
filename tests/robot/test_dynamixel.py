"""The driver of bus servos: what it refuses, how it plays a motion, and how it leaves the arm."""

import shutil
import sys
from importlib import resources

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from sautereau.rig.edit import edit_rig
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.dynamixel.driver import DynamixelController
from sautereau.robot.drivers.dynamixel.line import GOAL_POSITION
from sautereau.robot.drivers.dynamixel.servos import INTERVAL, LEAD
from sautereau.robot.errors import (
    GarbledAnswer,
    LineLost,
    MotionFault,
    RobotError,
    SettingChanged,
    SettingNotTaken,
    SilentController,
    UnsafeRequest,
)
from sautereau.sim_backend.devices.dynamixel.firmware import Servos
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import Segments
from tests.emulated import EmulatedPort
from tests.robot.motions import NOT_OFF, OFF, fails, no_keep_alive, stop_after

pytest.importorskip("dynamixel_sdk")

SLOW = {
    "controller.kind": "dynamixel",
    "controller.baud_rate": 1_000_000,
    "controller.position_error_limit": 100,
    "arm.counts_per_revolution": 4096,
    "press.jack_speed": "0.02 m/s",
    "press.return_speed": "0.02 m/s",
    "press.speed_tolerance": 0.1,
}


class Emulated(EmulatedPort):
    """The emulated servos; what they answer can be spoilt."""

    def __init__(self, rig):
        super().__init__((5, -7))
        self.spoil = lambda answer: answer
        self.firmware = Servos(self, rig.controller.sample_period, stepped=True)

    def exchange(self, data):
        self.incoming += self.spoil(self.firmware.receive(data))
        self.run()


@pytest.fixture(scope="module")
def rig():
    return with_values(load_rig(), SLOW | {"controller.timeout": "50 ms"})


@pytest.fixture
def port(rig):
    return Emulated(rig)


@pytest.fixture
def controller(rig, port):
    return DynamixelController(rig, open_port=port.open, keep_alive=no_keep_alive)


def segments_from(start):
    return Segments(
        start=start,
        steps=np.array([[10, -4], [40, -16], [10, -4]]),
        velocities=np.array([[200, -80], [200, -80], [0, 0]]),
        samples=np.array([100, 200, 100]),
    )


def ready(controller):
    controller.home()
    controller.move_to(controller.positions() + 20, 500)
    controller.load(segments_from(controller.positions()))
    controller.arm()


def test_a_motion_through_the_seam(controller, port):
    with controller:
        assert controller.simulated
        assert "XM430-W350" in controller.identity
        with controller.powered():
            at = controller.positions().copy()
            np.testing.assert_array_equal(controller.home(), [0, -1024])
            np.testing.assert_array_equal(controller.positions(), at)  # nothing has moved
            ready(controller)
            start = controller.positions()
            controller.start()
            controller.wait()
            capture = controller.capture()
            controller.check_home()
            np.testing.assert_array_equal(controller.positions() - start, [60, -24])
    assert port.firmware.motors_on == (False, False)
    assert port.closed
    assert capture.torques is None
    assert capture.samples[0] == -LEAD * INTERVAL
    assert (np.diff(capture.samples) == INTERVAL).all()
    assert np.abs(capture.following_errors).max() < 10


def test_the_servos_hold_the_limits_of_the_arm(controller):
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest, match="outside arm limits"):
            controller.move_to(np.array([2000, -1024]), 500)
        with pytest.raises(SettingNotTaken, match=r"servo 1 .*Goal Position\(116\).*its limits"):
            controller.driver.line.write(GOAL_POSITION, (4000, 2048))


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("max_position_limit", 4095, r"Max Position Limit\(48\) of servo 2 is 4095, set to 2"),
        ("bus_watchdog", 0, r"Bus Watchdog\(98\) of servo 2 is 0, set to"),
    ],
)
def test_what_another_program_has_set_is_found_before_the_next_motion(
    controller, port, name, value, said
):
    with fails(controller, SettingChanged, said, OFF):
        controller.home()
        port.firmware.axes[1]._values[name] = value
        controller.move_to(controller.positions() + 20, 500)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"arm.counts_per_revolution": 8192}, r"is 8192 with gear ratios"),
        ({"controller.watchdog_period": "3 s"}, r"watchdog_period is 3 s, at most 2\.54 s"),
        ({"arm.home_angles": ["-60 deg", "-90 deg"], "arm.upper_limits": ["170 deg", "-10 deg"]},
         "within one turn"),
    ],
)  # fmt: skip
def test_a_rig_that_does_not_fit_is_refused(rig, port, values, said):
    for servo in port.firmware.axes:
        servo._values["model_information"] = 0  # as hardware
    controller = DynamixelController(with_values(rig, values), open_port=port.open)
    with pytest.raises(SettingNotTaken, match=said):
        controller.connect()
    assert port.closed


def test_other_models_are_refused(controller, port):
    port.firmware.axes[1]._values["model_number"] = 350
    with pytest.raises(RobotError, match="servo 2 is a model 350 with firmware 45; this driver"):
        controller.connect()


def test_without_the_vendors_package(controller, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", None)
    with pytest.raises(RobotError, match=r"pip install 'sautereau\[servos\]'"):
        controller.connect()


@pytest.mark.parametrize(
    ("spoil", "error"),
    [
        (lambda _: b"", SilentController),
        (lambda answer: answer[:-1] + bytes([answer[-1] ^ 1]), GarbledAnswer),
        (lambda answer: answer[:5], GarbledAnswer),
    ],
)
def test_answers_that_are_none(controller, port, spoil, error):
    port.spoil = spoil
    with pytest.raises(error):
        controller.connect()


def test_a_servo_that_switches_itself_off_ends_the_press(controller, port):
    with fails(controller, MotionFault, "servo 2: hardware error: overload", OFF):
        ready(controller)
        port.firmware.axes[1].shut_down(0x20)
        controller.start()
        controller.wait()
    assert port.firmware.motors_on == (False, False)


def test_a_watchdog_that_has_run_out_is_reported_and_cleared(controller, port):
    with controller:
        with pytest.raises(MotionFault, match="servo 1: its watchdog has run out"):  # noqa: PT012, SIM117
            with controller.powered():
                port.firmware.axes[0]._values["bus_watchdog"] = -1
                controller.home()
        with controller.powered():
            controller.home()


def test_a_line_that_breaks(controller, port):
    with fails(controller, LineLost, NOT_OFF, "they then hold their position"):
        port.fault = OSError("gone")
        controller.positions()


def test_stop_in_mid_motion(controller, port):
    with controller, controller.powered():
        ready(controller)
        start = controller.positions()
        where = stop_after(controller, LEAD + 20)
        assert start[0] < where[0] < start[0] + 60
        assert port.firmware.motors_on == (True, True)


def test_motors_that_stay_on_are_an_error(controller, monkeypatch):
    with pytest.raises(MotionFault, match=r"Torque Enable\(64\) is 1 and 1") as caught, controller:  # noqa: PT012, SIM117
        with controller.powered():
            monkeypatch.setattr(controller.driver.line, "say", lambda *_: None)
            controller.abort()
    assert NOT_OFF in str(caught.value)


@pytest.mark.slow
def test_the_command_line_presses_and_marks_the_resolution(tmp_path, monkeypatch):
    shutil.copy(str(resources.files("sautereau.rig") / "paper.toml"), tmp_path / "rig.toml")
    monkeypatch.chdir(tmp_path)
    edit_rig("rig.toml", SLOW).save()
    assert app(["press", "rig.toml", "--scene", "ideal", "--seed", "5", "--out", "out"]) == 0
    (path,) = (tmp_path / "out").glob("*.mcap")
    press = load_press(path)
    assert any("its encoders resolve 0.34 mm at the fingertip" in text for text in press.warnings)
    recorded = read_recording(path)
    assert 1e-4 < press.motion.std < 5e-3
    assert abs(recorded.motion.time) < 3 * press.motion.std
    np.testing.assert_allclose(recorded.arm.t, recorded.joints.t - recorded.motion.time)
    assert find_phases(press).free_speed == pytest.approx(0.02, rel=0.1)
    assert "Dynamixel" in recorded.session.controller


def test_the_plan_of_a_streamed_press_knows_no_limit_of_segments(rig):
    few = with_values(rig, {"controller.segment_limit": 8})
    assert len(plan_press(few).segments) > 8
