"""Calls out of order, and requests that must not reach the controller."""

import math
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.safety import State
from sautereau.robot.errors import NotReady, RobotError, SettingNotTaken, UnsafeRequest
from tests.robot.test_states import ALLOWED


@contextmanager
def homed(controller):
    with controller, controller.powered():
        controller.home()
        yield


def test_nothing_works_unconnected(bench, segments):
    controller, _ = bench()
    calls = [
        lambda: controller.identity,
        lambda: controller.simulated,
        lambda: controller.powered().__enter__(),
        controller.home,
        lambda: controller.move_to(segments.start, 1e5),
        lambda: controller.load(segments),
        controller.arm,
        controller.start,
        controller.wait,
        controller.capture,
        controller.positions,
        controller.stop,
        controller.abort,
    ]
    for call in calls:
        with pytest.raises(NotReady, match=r"not connected; call connect\(\) first"):
            call()
    controller.disconnect()


def test_each_state_refuses_the_calls_that_it_does_not_allow(bench, lines, segments):
    controller, _ = bench(lines.press)
    names = ("home", "check_home", "arm", "start", "wait", "stop")
    calls = {name: getattr(controller, name) for name in names} | {
        "powered": lambda: controller.powered().__enter__(),
        "move_to": lambda: controller.move_to(segments.start, 100_000),
        "load": lambda: controller.load(segments),
    }

    def reaches(state):
        assert controller.state is state
        for name in calls.keys() - ALLOWED[state]:
            with pytest.raises(NotReady, match=f"{name}: the arm is {state}; "):
                calls[name]()

    with controller:
        with pytest.raises(NotReady, match=r"already connected.*disconnect\(\)"):
            controller.connect()
        with pytest.raises(NotReady, match=r"no motion is done.*wait\(\)"):
            controller.capture()
        reaches(State.OFF)
        with controller.powered():
            reaches(State.STOPPED)
            controller.home()
            reaches(State.HOMED)
            calls["move_to"]()
            calls["load"]()
            reaches(State.LOADED)
            controller.arm()
            reaches(State.ARMED)
            controller.start()
            reaches(State.MOVING)
            controller.wait()
            reaches(State.HOMED)
            controller.capture()
        reaches(State.OFF)


def test_an_arm_away_from_the_start_is_not_armed(bench, lines, segments):
    away = ("MG _TPA,_TPB", " 1051.0000 -501000.0000\r\n:")
    controller, _ = bench(lines.homed, lines.load, lines.ready, [away], lines.off)
    with homed(controller):
        controller.load(segments)
        said = r"joint 1 is 51 counts \(0\.00918 deg\) off .* 50 counts .*raise arm\.position_tol"
        with pytest.raises(NotReady, match=f"not where the motion starts: {said}"):
            controller.arm()


def test_the_position_tolerance_is_the_rigs_and_at_least_two_counts():
    arm = load_rig("paper").arm
    for angle, counts, permitted in (
        (arm.position_tolerance, 2_000_000, 50),  # the default of the packaged rig's encoders
        (math.radians(0.09), 2_000_000, 500),
        (math.radians(0.009), 4096, 2),
    ):
        own = {"position_tolerance": angle, "counts_per_revolution": counts}
        limits = Limits(arm.model_copy(update=own))
        start = np.array([1000, -1000])
        assert not limits.off_target(start + permitted, start)
        off = limits.off_target(start - np.array([0, permitted + 1]), start)
        assert off.startswith(f"joint 2 is {permitted + 1} counts")


def test_a_move_out_of_the_limits_lists_every_fault(bench, lines):
    controller, _ = bench(lines.homed, lines.off)
    said = r"joint 1 reaches 444445 counts \(80 deg\).*joint 2 reaches -900000.*speed 2e\+06"
    with homed(controller), pytest.raises(UnsafeRequest, match=said):
        controller.move_to([444445, -900000], 2e6)


@pytest.mark.parametrize("speed", [0, -5, float("nan")])
def test_a_move_at_no_speed(bench, lines, speed):
    controller, _ = bench(lines.homed, lines.off)
    with homed(controller), pytest.raises(UnsafeRequest, match="speed_limit"):
        controller.move_to([0, -500_000], speed)


def test_a_motion_that_must_not_be_played_lists_every_fault(bench, lines, segments):
    controller, _ = bench(lines.homed, lines.off)
    bad = replace(
        segments,
        start=np.array([444440, -501000]),
        velocities=segments.velocities + 7,
        samples=np.array([10, 0, 10]),
    )
    said = "a segment has 0 samples.*ends at 7, 7 counts/s.*joint 1 reaches 444490"
    with homed(controller), pytest.raises(UnsafeRequest, match=said):
        controller.load(bad)


@pytest.mark.parametrize(
    ("count", "said"), [(0, "it has no segment"), (256, "256 segments, .* takes 255 at most")]
)
def test_too_few_or_too_many_segments(bench, lines, segments, count, said):
    controller, _ = bench(lines.homed, lines.off)
    motion = replace(
        segments,
        steps=np.zeros((count, 2), int),
        velocities=np.zeros((count, 2), int),
        samples=np.full(count, 4),
    )
    with homed(controller), pytest.raises(UnsafeRequest, match=said):
        controller.load(motion)


def test_a_fifo_that_does_not_empty(bench, lines, segments):
    full = ("MG _PVA,_PVB", " 3.0000 255.0000\r\n:")
    clear = ("PVA=0,0,-1;PVB=0,0,-1", "::")
    script = [lines.homed, [full, clear, full], lines.off]
    controller, _ = bench(*script)
    with homed(controller), pytest.raises(SettingNotTaken, match="room for 3 segments"):
        controller.load(segments)


def test_a_fifo_that_took_less_than_was_sent(bench, lines, segments):
    short = ("MG _PVA,_PVB", " 252.0000 253.0000\r\n:")
    script = [lines.homed, lines.fifo[:-1], [short], lines.off]
    controller, _ = bench(*script)
    with homed(controller):
        with pytest.raises(SettingNotTaken, match=r"3 segments were sent .* took 3 and 2"):
            controller.load(segments)
        with pytest.raises(NotReady):
            controller.arm()


def test_something_that_is_no_galil_controller(bench, lines):
    revision = [("\x12\x16", "Grbl 1.1h\r\n:")]
    controller, _ = bench(lines.connect[:1], revision, lines.fresh, revision)
    with pytest.raises(RobotError, match=r"this one answers 'Grbl 1\.1h'"):
        controller.connect()


def test_a_controller_without_echo(bench, lines):
    asked, fresh = [("MG _EO", b" 1.0000\r\n:")], [("", b":"), ("MG 4711", b" 4711.0000\r\n:")]
    controller, transcript = bench(lines.connect[:3], asked, fresh, asked)
    with pytest.raises(SettingNotTaken, match="does not echo what it receives"):
        controller.connect()
    assert transcript.closed


SETTINGS = {
    "MG _TM,_OEA,_OEB": (" 1024.0000 3.0000 0.0000", "_TM is 1024 and .* 1000, _OEB is 0"),
    "MG _ERA,_ERB": (" 20000.0000 16384.0000", "_ERB is 16384 and should be 20000"),
    "MG _OFA,_OFB,_TKA,_TKB": (" 0.0000 1.0000 0.0000 0.0000", "_OFB is 1 and should be 0"),
    "MG _TLA,_TLB": (" 9.9979 0.0000", "reads back 9.9979 and 0 V; check its amplifiers"),
    "MG _CN0,_CN1,_CN3,_CN4,_LDA,_LDB": (
        " -1.0000 1.0000 0.0000 1.0000 0.0000 0.0000",
        "_CN1 is 1 and",
    ),
    "MG _FLA,_FLB,_BLA,_BLB": (
        " 444444.0000 -55556.0000 -444444.0000 0.0000",
        "_BLB is 0 and should be -833333",
    ),
}


@pytest.mark.parametrize("query", SETTINGS)
def test_settings_that_the_controller_does_not_take_keep_the_power_off(bench, lines, query):
    answer, said = SETTINGS[query]
    at = [sent for sent, _ in lines.connect].index(query)
    controller, _ = bench(lines.connect[:at], [(query, f"{answer}\r\n:")])
    with pytest.raises(SettingNotTaken, match=said):
        controller.connect()


def test_limits_that_are_not_restored_after_homing(bench, lines):
    other = (lines.software[-1][0], " 444444.0000 -55556.0000 -444444.0000 0.0000\r\n:")
    at = len(lines.home) - 1 - lines.home[::-1].index(lines.software[-1])
    controller, _ = bench(lines.connect, lines.on, lines.home[:at], [other], lines.abort)
    with pytest.raises(SettingNotTaken, match="_BLB is 0 and should be -833333"):  # noqa: SIM117
        with controller, controller.powered():
            controller.home()


def test_a_rig_that_the_controller_would_not_enforce(rig, lines, transcript_of):
    at = {"controller.position_error_limit": 400_000, "controller.sample_period": "1.2 ms"}
    transcript = transcript_of(lines.connect[: lines.connect.index(("TM 1000", ":"))])
    controller = GalilController(with_values(rig, at), open_port=transcript.open)
    with pytest.raises(RobotError, match=r"sample_period is 1200 us.*; .*is 400000 counts"):
        controller.connect()
    transcript.check()


def test_the_rest_of_a_broken_off_line_is_ignored(bench, lines):
    spoilt = [("EO 0", "EO 0\r\n?"), ("TC1", "TC1\r\n1 Unrecognized command\r\n:")]
    controller, _ = bench(spoilt, lines.connect)
    controller.connect()
