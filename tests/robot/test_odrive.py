"""The driver of an ODrive: what it sends, what it refuses, and how it leaves the arm."""

import itertools
import threading
import time

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import MotionController, TorqueTable, motion_controller
from sautereau.robot.drivers.odrive.driver import OdriveController
from sautereau.robot.drivers.odrive.line import checksum, framed
from sautereau.robot.drivers.odrive.setpoints import INTERVAL, LEAD
from sautereau.robot.errors import (
    LineLost,
    MotionFault,
    NotReady,
    RobotError,
    SettingChanged,
    SettingNotTaken,
    UnsafeRequest,
)
from sautereau.sim_backend.devices.odrive.firmware import OdriveFirmware
from sautereau.trajectory.segments import Segments
from tests.emulated import EmulatedPort
from tests.robot.motions import NOT_OFF, OFF, fails, no_keep_alive, press, ready, stop_after

GRBL = "".join(map(framed, ("Grbl 1.1h", "x", "y"))).encode()


class Emulated(EmulatedPort):
    """The emulated controller; its answers can be replaced."""

    def __init__(self, rig):
        super().__init__((19_099, -19_099))
        self.said, self.replace = [], {}
        counts, ratios = rig.arm.counts_per_revolution, rig.arm.gear_ratios
        self.firmware = OdriveFirmware(
            self,
            per_turn=(counts / ratios[0], counts / ratios[1]),
            period=rig.controller.sample_period,
            stepped=True,
            torque_per_volt=(0.2, 0.2),
        )

    def torque_volts(self):
        return 0.5, -0.5

    def exchange(self, data):
        for line in data.decode().splitlines():
            text, star, sent = line.rpartition("*")
            if not star:
                assert not line
                self.incoming += self.firmware.receive(b"\n")
                continue
            assert sent == str(checksum(text)), line
            if text.startswith("u "):
                assert self.firmware.receive(f"{line}\n".encode()) == b""
                continue
            self.said.append(text)
            answer = self.firmware.receive(f"{line}\n".encode())
            if text in self.replace:
                changed = self.replace[text]
                if isinstance(changed, BaseException):
                    self.fault = changed
                    raise changed
                answer = changed if isinstance(changed, bytes) else framed(changed).encode()
            self.incoming += answer
            self.run()


@pytest.fixture
def rig(odrive_rig):
    return odrive_rig


@pytest.fixture
def port(rig):
    return Emulated(rig)


def controller_at(port, rig):
    """Return a controller whose watchdogs are not renewed."""
    return OdriveController(rig, open_port=port.open, keep_alive=no_keep_alive)


@pytest.fixture
def controller(rig, port):
    return controller_at(port, rig)


@pytest.fixture
def segments():
    return Segments(
        start=np.array([1000, -501000]),
        steps=np.array([[600, -300], [1800, -900], [600, -300]]),
        velocities=np.array([[60_000, -30_000], [60_000, -30_000], [0, 0]]),
        samples=np.array([20, 30, 20]),
    )


def test_the_registry_makes_the_controller_that_the_rig_names(rig):
    for named, said in ((rig, "answered 'i' with 'i'"), (load_rig(), "did not answer 'EO 0'")):
        at_nobody = {"controller.port": "loop://", "controller.timeout": "10 ms"}
        with pytest.raises(RobotError, match=said):
            motion_controller(with_values(named, at_nobody)).connect()


def test_a_press_through_the_seam(controller: MotionController, port, segments, rig):
    with controller, controller.powered():
        press(controller, segments)
        capture = controller.capture()
    assert port.firmware.motors_on == (False, False)
    assert port.closed
    lead = controller.capabilities.lead(rig.controller.sample_period)
    assert lead == pytest.approx(-capture.times[0])
    np.testing.assert_array_equal(capture.samples, np.arange(-LEAD * INTERVAL, 90, INTERVAL))
    np.testing.assert_array_equal(capture.counts[capture.samples <= 0], [segments.start] * 27)
    np.testing.assert_allclose(capture.counts[0], segments.start, atol=2)
    np.testing.assert_allclose(capture.counts[-1], segments.end, atol=10)
    assert np.abs(capture.following_errors).max() < 100
    np.testing.assert_allclose(capture.torques, [[0.1, -0.1]] * len(capture), atol=1e-6)
    assert capture.sample_period == rig.controller.sample_period


SET = {
    "config.enable_watchdog": 1,
    "config.watchdog_timeout": 0.5,
    "controller.config.vel_limit": 0.954929659,
    "controller.config.input_filter_bandwidth": 64,
    "motor.config.torque_lim": 2,
    "min_endstop.config.debounce_ms": 2,
}
"""Properties of both axes before they have power."""
RESET = ("config.control_mode 3", "input_vel 0", "input_torque 0", "config.input_mode 5")
"""Settings of an axis's controller with which it holds its position when it is switched on."""


def test_the_motors_are_switched_on_last(controller, port):
    """Watchdogs and limits are set, errors cleared, and inputs of an earlier motion removed."""
    with controller, controller.powered():
        before = port.said[: port.said.index("w axis0.requested_state 8")]
        assert {f"w axis{axis}.controller.{to}" for axis in (0, 1) for to in RESET} < set(before)
        assert "sc" in before
        for axis in port.firmware.axes:
            assert {name: axis.settings[name] for name in SET} == pytest.approx(SET)


# What it is.


@pytest.mark.parametrize(
    ("sent", "answer", "said"),
    [
        ("i", GRBL, r"an ODrive 3.x gives its hardware version"),
        ("r axis1.motor.is_calibrated", "0", r"axis1\.motor\.is_calibrated is 0 and should be 1"),
        ("r axis0.encoder.config.cpr", "8192", r"axis0\.encoder.* is 8192 and .*2000000"),
        ("r axis1.controller.config.circular_setpoints", "1", "circular_setpoints is 1"),
        ("r axis1.motor.config.torque_lim", "inf", "torque_lim is inf and should be 2"),
        ("r axis0.config.enable_watchdog", "0", "enable_watchdog is 0 and should be 1"),
        ("r axis0.controller.config.vel_limit", "invalid property", "refused .*invalid property"),
        ("r axis0.controller.config.vel_limit", "nan", "1 numbers were expected"),
    ],
)  # fmt: skip
def test_a_controller_that_is_not_set_up_is_refused(controller, port, sent, answer, said):
    port.replace[sent] = answer
    with pytest.raises(RobotError, match=said):
        controller.connect()
    assert port.closed


def test_all_settings_that_are_not_taken_are_listed_at_once(controller, port):
    port.replace |= {
        "r axis0.motor.config.torque_lim": "inf",
        "r axis1.controller.config.vel_limit": "2.0",
    }
    with pytest.raises(SettingNotTaken, match=r"axis0\.motor.*inf.*axis1\.controller.* is 2 "):
        controller.connect()


@pytest.mark.parametrize(
    ("version", "why"),
    [
        ("0.5.1", "clear errors"),
        ("0.5.2", "several lines"),
        ("0.5.3", "state of an axis"),
        ("0.5.4", "homing"),
        ("0.5.5", "homing"),
        ("0.6.9", "knows the properties of 0.5.6 only"),
    ],
)
def test_another_firmware_is_refused_with_the_reason(controller, port, version, why):
    lines = ("Hardware version: 3.6-56V", f"Firmware version: {version}", "Serial number: 1")
    port.replace["i"] = "".join(map(framed, lines)).encode()
    with pytest.raises(RobotError, match=rf"{version}: .*{why}.*; install 0\.5\.6"):
        controller.connect()


def test_with_the_watchdog_disabled_the_motors_stay_off(controller, port):
    said = pytest.raises(SettingNotTaken, match=r"axis1\.config.enable_watchdog is 0")
    with controller:
        port.firmware.axes[1].settings["config.enable_watchdog"] = 0.0
        with said, controller.powered():
            pytest.fail("it has power")
        assert "w axis0.requested_state 8" not in port.said


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("controller.config.pos_gain", 1000, "pos_gain is 1000, set to 20"),
        ("controller.config.vel_limit", 50, "vel_limit is 50, set to 0.9549"),
        ("motor.config.torque_lim", 100, "torque_lim is 100, set to 2"),
        ("config.enable_watchdog", 0, "enable_watchdog is 0, set to 1"),
        ("controller.config.enable_overspeed_error", 0, "overspeed_error is 0, set to 1"),
    ],
)
def test_what_another_program_has_set_is_found_before_the_next_motion(
    controller, port, segments, name, value, said
):
    changed = port.firmware.axes[1].settings
    motions = {
        "home": controller.home,
        "move_to": lambda: controller.move_to(segments.start + 10, 100_000),
        "arm": controller.arm,
    }
    for move in motions.values():
        before = changed[name]
        with fails(controller, SettingChanged, rf"axis1\..*{said}", OFF):
            if move != controller.home:
                controller.home()
                controller.move_to(segments.start, 100_000)
                controller.load(segments)
            changed[name] = float(value)
            move()
        assert port.firmware.motors_on == (False, False)
        changed[name] = before


# What is refused; what every controller refuses is in test_order.py.


def test_without_a_streamed_motion_there_is_no_punctuality(controller):
    with controller, controller.powered(), pytest.raises(NotReady, match="no motion was streamed"):
        _ = controller.driver.punctuality


def test_torques_are_refused(controller, segments):
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest, match="adds no torques"):
            controller.load(segments, TorqueTable(np.array([0.0, 0.1]), np.zeros((2, 2))))


def test_a_line_that_is_too_slow_is_refused(rig, port, segments):
    slow = with_values(rig, {"controller.baud_rate": 115200})
    controller = controller_at(port, slow)
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest, match=r"baud_rate is 115200: set both ends to 921600"):
            controller.load(segments)


def test_a_motion_that_would_run_out_of_the_limits_if_the_host_died(controller):
    near = Segments(
        np.array([440_000, -501_000]),
        np.array([[2000, 0], [2000, 0]]),
        np.array([[120_000, 0], [0, 0]]),
        np.array([34, 34]),
    )
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest, match=r"joint 1 would run out to .* if the host died"):
            controller.load(near)


# How it ends.


@pytest.mark.parametrize(
    ("register", "value", "name"),
    [
        ("error", "2048", "joint 1 error: WATCHDOG_TIMER_EXPIRED"),
        ("error", "16384", "ESTOP_REQUESTED"),
        ("motor.error", "4096", "motor.error: CURRENT_LIMIT_VIOLATION"),
        ("encoder.error", "4", "encoder.error: NO_RESPONSE"),
        ("controller.error", "1", "controller.error: OVERSPEED"),
        ("controller.error", "16777217", "OVERSPEED, 0x1000000"),
        ("motor.error", "858993459", "motor.error: an error whose number begins with 858993459"),
    ],
)
def test_an_error_of_an_axis_is_reported_by_its_name(
    controller, port, segments, register, value, name
):
    with fails(controller, MotionFault, name, OFF):
        ready(controller, segments)
        controller.start()
        port.replace |= {f"r axis0.{register}": value, "r axis0.current_state": "1"}
        controller.wait()


def test_an_error_of_the_device_is_reported_with_those_of_its_motors(controller, port, segments):
    device, motor = "device error: DC_BUS_UNDER_VOLTAGE", "joint 2 motor.error: SYSTEM_LEVEL"
    with fails(controller, MotionFault, device, motor):
        ready(controller, segments)
        port.firmware.trip(0x2)
        controller.start()
        controller.wait()


def test_axes_that_are_off_without_an_error(controller, port, segments):
    with fails(controller, MotionFault, "states 1 and 1, not in closed loop"):
        ready(controller, segments)
        for axis in port.firmware.axes:
            axis.request(1)
        controller.start()
        controller.wait()


def test_a_joint_that_does_not_follow_is_switched_off_at_once(controller, port, segments):
    far = Segments(
        segments.start, segments.steps * 20, segments.velocities * 6, segments.samples * 4
    )
    with fails(controller, MotionFault, "counts from its plan, more than", OFF):
        ready(controller, far)
        port.follows = False
        controller.start()
        end = time.monotonic() + 60
        while port.firmware.motors_on != (False, False) and time.monotonic() < end:
            time.sleep(0.001)
        assert port.firmware.motors_on == (False, False)
        controller.wait()


def delay(controller, jumps):
    """Let the host's clock jump (s) in some of its sleeps, counted from 1."""
    polling, sleeps = controller.driver.polling, itertools.count(1)
    wait, now = polling.sleep, [0.0]

    def sleep(seconds):
        seconds += jumps.get(next(sleeps), 0.0)
        now[0] += seconds
        wait(seconds)

    polling.clock, polling.sleep = lambda: now[0], sleep


@pytest.mark.parametrize(
    ("late", "gap", "skipped"), [({5: 0.002}, 0.00590625, 0), ({5: 0.007}, 0.01090625, 1)]
)
def test_a_late_host_catches_up_and_reports_it(controller, segments, late, gap, skipped):
    with controller, controller.powered():
        ready(controller, segments)
        delay(controller, late)
        controller.start()
        controller.wait()
        found = controller.driver.punctuality
        assert found.largest_gap == pytest.approx(gap, abs=1e-9)
        assert found.skipped == skipped
        assert found.jitter > 0
        assert len(controller.capture()) == 23 + LEAD - skipped


def test_a_press_with_a_large_gap_is_refused(controller, segments):
    with fails(controller, MotionFault, r"gap of 23\.9 ms .* 11\.7 ms are allowed", OFF):
        ready(controller, segments)
        delay(controller, {5: 0.020})
        controller.start()
        controller.wait()


def test_a_slow_adapter_is_named_where_setpoints_are_skipped(controller, segments):
    with fails(controller, MotionFault, r"sending one takes 16 ms, .* latency timer", OFF):
        ready(controller, segments)
        now, send = [0.0], controller.driver.send
        controller.driver.polling.clock = lambda: now[0]

        def slow(rows, index):
            now[0] += 0.016
            return send(rows, index)

        controller.driver.send = slow
        controller.start()
        controller.wait()


def test_stop_in_mid_motion_decelerates_and_returns_the_positions(controller, port, segments):
    with controller, controller.powered():
        ready(controller, segments)
        where = stop_after(controller, LEAD + 10)
        assert segments.start[0] < where[0] < segments.end[0] + 1000
        assert port.firmware.motors_on == (True, True)
        np.testing.assert_array_equal(controller.positions(), where)
    assert port.firmware.motors_on == (False, False)


def test_an_abort_requested_by_another_thread_ends_the_stream(controller, port, segments):
    with fails(controller, MotionFault, "aborted by the operator", OFF):
        ready(controller, segments)
        request = threading.Thread(target=controller.request_abort)
        request.start()
        request.join()
        controller.start()
        controller.wait()
    assert port.firmware.motors_on == (False, False)


def test_a_line_that_breaks_in_mid_motion(controller, port, segments):
    with fails(controller, LineLost, "check the cable", NOT_OFF, "watchdogs"):
        ready(controller, segments)
        port.replace["f 1"] = OSError("gone")
        controller.start()
        controller.wait()


def test_motors_that_stay_on_are_an_error(controller, port):
    with pytest.raises(MotionFault, match="states 8 and 1") as caught, controller:  # noqa: PT012, SIM117
        with controller.powered():
            port.replace["r axis0.current_state"] = "8"
            controller.abort()
    assert NOT_OFF in str(caught.value)


def test_home_finds_the_switches_from_either_side(rig):
    for above in (19_099, -19_099, 0):
        port = Emulated(rig)
        port.counts = [above, -above]
        controller = controller_at(port, rig)
        with controller, controller.powered():
            np.testing.assert_array_equal(controller.home(), [0, -500_000])
            np.testing.assert_allclose(port.counts, 0, atol=rig.controller.home_tolerance)


@pytest.mark.parametrize(
    ("home", "homed", "said"),
    [
        (10_000_000, "1", r"home switch of joint 2 is still closed after 0\.5 rad"),
        (0, "0", "joint 2 stopped before its home switch"),
    ],
)
def test_a_switch_that_never_opens_or_is_not_found(controller, port, home, homed, said):
    port.home = (0, home)
    port.replace["r axis1.is_homed"] = homed
    with pytest.raises(MotionFault, match=said), controller, controller.powered():
        controller.home()


def test_a_moved_home_switch_is_found(controller, port):
    with controller, controller.powered():
        controller.home()
        controller.check_home()
        port.home = (0, 500)
        with pytest.raises(MotionFault, match="home switch of joint 2 is not within 100") as caught:
            controller.check_home()
    assert OFF in str(caught.value)
