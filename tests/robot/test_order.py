"""Calls out of order, and requests that must not reach the controller."""

from dataclasses import replace

import numpy as np
import pytest

from robot.errors import NotReady, RobotError, SettingNotTaken, UnsafeRequest


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


def test_each_state_names_the_way_out(bench, lines, segments):
    controller, _ = bench(lines.press)

    def refused(call, *said):
        with pytest.raises(NotReady) as caught:
            call()
        assert all(word in str(caught.value) for word in said), caught.value

    def move():
        controller.move_to(segments.start, 100_000)

    with controller:
        refused(controller.connect, "already connected", "disconnect()")
        refused(controller.home, "motors are off", "powered()")
        with controller.powered():
            refused(lambda: controller.powered().__enter__(), "on already")
            refused(move, "unknown", "home()")
            controller.home()
            move()
            refused(controller.arm, "no motion is loaded", "load()")
            controller.load(segments)
            refused(controller.start, "no motion is armed", "arm()")
            controller.arm()
            refused(controller.wait, "no motion is running", "start()")
            controller.start()
            for call in (controller.capture, controller.home, move):
                refused(call, "a press is running", "wait() or stop()")
            refused(lambda: controller.load(segments), "a press is running")
            controller.wait()
            refused(controller.wait, "no motion is running")
            controller.capture()
        refused(controller.capture, "no motion is done", "wait()")


def test_an_arm_away_from_the_start_is_not_armed(bench, lines, segments):
    away = ("MG _TPA,_TPB", " 1051.0000 -501000.0000\r\n:")
    controller, _ = bench(lines.connect, lines.on, lines.home, lines.load, [away], lines.off)
    with controller, controller.powered():
        controller.home()
        controller.load(segments)
        with pytest.raises(NotReady, match=r"1051, -501000 counts .* 1000, -501000, within 50"):
            controller.arm()


def test_a_move_out_of_the_limits_lists_every_fault(bench, lines):
    controller, _ = bench(lines.connect, lines.on, lines.home, lines.off)
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest) as caught:
            controller.move_to([444445, -900000], 2e6)
    for said in (
        "joint 1 reaches 444445 counts (80 deg)",
        "joint 2 reaches -900000",
        "speed 2e+06",
    ):
        assert said in str(caught.value)


@pytest.mark.parametrize("speed", [0, -5, float("nan")])
def test_a_move_at_no_speed(bench, lines, speed):
    controller, _ = bench(lines.connect, lines.on, lines.home, lines.off)
    with controller, controller.powered():
        controller.home()
        with pytest.raises(UnsafeRequest, match="speed_limit"):
            controller.move_to([0, -500_000], speed)


def test_a_motion_that_must_not_be_played_lists_every_fault(bench, lines, segments):
    controller, _ = bench(lines.connect)
    bad = replace(
        segments,
        start=np.array([444440, -501000]),
        velocities=segments.velocities + 7,
        samples=np.array([10, 0, 10]),
    )
    with controller, pytest.raises(UnsafeRequest) as caught:
        controller.load(bad)
    for said in ("a segment of 0 samples", "ends at 7, 7 counts/s", "joint 1 reaches 444490"):
        assert said in str(caught.value)


@pytest.mark.parametrize("count", [0, 256])
def test_too_few_or_too_many_segments(bench, lines, segments, count):
    controller, _ = bench(lines.connect)
    motion = replace(
        segments,
        steps=np.zeros((count, 2), int),
        velocities=np.zeros((count, 2), int),
        samples=np.full(count, 4),
    )
    with controller, pytest.raises(UnsafeRequest, match=f"{count} segments, .* 1 to 255"):
        controller.load(motion)


def test_a_fifo_that_does_not_empty(bench, lines, segments):
    full = ("MG _PVA,_PVB", " 3.0000 255.0000\r\n:")
    clear = ("PVA=0,0,-1;PVB=0,0,-1", "::")
    controller, _ = bench(lines.connect, [full, clear, full])
    with controller, pytest.raises(SettingNotTaken, match="room for 3 segments"):
        controller.load(segments)


def test_a_fifo_that_took_less_than_was_sent(bench, lines, segments):
    short = ("MG _PVA,_PVB", " 252.0000 253.0000\r\n:")
    controller, _ = bench(lines.connect, lines.load[:-1], [short])
    with controller:
        with pytest.raises(SettingNotTaken, match=r"3 segments were sent .* took 3 and 2"):
            controller.load(segments)
        with pytest.raises(NotReady):
            controller.arm()


def test_firmware_without_pvt(bench, lines):
    refused = [("MG _PVA", "?"), ("TC1", "1 Unrecognized command\r\n:")]
    controller, transcript = bench(lines.connect[:2], refused)
    with pytest.raises(RobotError, match=r"has no PVT mode \(1 Unrecognized"):
        controller.connect()
    assert transcript.closed


def test_something_that_is_no_galil_controller(bench, lines):
    controller, _ = bench(lines.connect[:1], [("\x12\x16", "Grbl 1.1h\r\n:")])
    with pytest.raises(RobotError, match=r"this one says 'Grbl 1\.1h'"):
        controller.connect()


def test_settings_that_the_controller_does_not_take(bench, lines):
    other = ("MG _ERA,_ERB,_OEA,_OEB", " 20000.0000 16384.0000 1.0000 0.0000\r\n:")
    controller, _ = bench(lines.connect[:-1], [other])
    with pytest.raises(SettingNotTaken, match="_ERB is 16384 and should be 20000, _OEB is 0"):
        controller.connect()


def test_limits_that_the_controller_does_not_take(bench, lines):
    other = (lines.home[-1][0], " 444444.0000 -55556.0000 -444444.0000 0.0000\r\n:")
    controller, _ = bench(lines.connect, lines.on, lines.home[:-1], [other], lines.abort)
    with pytest.raises(SettingNotTaken, match="_BLB is 0 and should be -833333"):  # noqa: SIM117
        with controller, controller.powered():
            controller.home()


def test_the_rest_of_a_broken_line_is_forgiven(bench, lines):
    spoilt = [("EO 0", "EO 0\r\n?"), ("TC1", "TC1\r\n1 Unrecognized command\r\n:")]
    controller, _ = bench(spoilt, lines.connect)
    controller.connect()
