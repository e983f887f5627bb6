"""Whatever goes wrong, the motors end up off, and the error says whether that is known."""

import pytest

from robot.errors import (
    CommandRefused,
    LineLost,
    MotionFault,
    NotReady,
    SettingNotTaken,
    SilentController,
)

OFF = "its motors are off: the controller confirms it"
NOT_OFF = "NOT confirmed off"


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit, GeneratorExit])
@pytest.mark.parametrize("through", ["bench", "terminal"])
def test_any_exception_leaves_the_motors_off(request, through, lines, kind):
    controller, _ = request.getfixturevalue(through)(lines.connect, lines.on, lines.off)
    with pytest.raises(kind) as caught, controller, controller.powered():
        raise kind
    assert OFF in caught.value.__notes__[0]


def test_an_interrupt_in_mid_motion_stops_it(bench, lines):
    script = [*lines.connect, *lines.on, *lines.home[:3]]
    controller, transcript = bench(script, [("MG _BGA,_BGB", KeyboardInterrupt())], lines.off)
    with pytest.raises(KeyboardInterrupt), controller, controller.powered():
        controller.home()
    assert transcript.closed


def test_a_second_interrupt_while_stopping_does_not_leave_the_motors_on(bench, lines):
    controller, _ = bench(
        lines.connect, lines.on, [("ST AB", KeyboardInterrupt())], lines.abort, lines.off
    )
    with pytest.raises(KeyboardInterrupt), controller, controller.powered():
        raise KeyboardInterrupt


def test_motors_that_stay_on_are_an_error(bench, lines):
    on = ("MG _MOA,_MOB,_BGA,_BGB", " 1.0000 0.0000 0.0000 0.0000\r\n:")
    controller, _ = bench(lines.connect, lines.on, [*lines.off[:-1], on])
    with controller, pytest.raises(MotionFault, match=r"_MOA.*\[1\.0, 0\.0") as caught:  # noqa: SIM117
        with controller.powered():
            pass
    assert NOT_OFF in str(caught.value)


def test_motors_that_stay_off_are_an_error(bench, lines):
    off = ("MG _MOA,_MOB", " 1.0000 0.0000\r\n:")
    controller, _ = bench(lines.connect, [lines.on[0], off], lines.off)
    with pytest.raises(SettingNotTaken, match="emergency stop"), controller:  # noqa: SIM117
        with controller.powered():
            pass


def test_a_refused_abort_is_said_again_in_case_half_a_line_spoilt_it(bench, lines):
    spoilt = [("AB", "?"), ("TC1", "1 Unrecognized command\r\n:")]
    controller, _ = bench(lines.connect, spoilt, lines.abort)
    with controller:
        controller.abort()


@pytest.mark.parametrize(
    ("codes", "reason"),
    [
        ("8.0000 4.0000", "joint 1 switched off by a following error over ER .*joint 2"),
        ("31.0000 2.0000", "joint 2 stopped by the forward limit"),
        ("7.0000 7.0000", "stopped by AB"),
        ("32.0000 31.0000", "empty FIFO"),
        ("77.0000 1.0000", r"unknown stop code \(stop code 77\)"),
    ],
)
def test_a_press_that_breaks_off_names_the_joint_and_the_reason(
    bench, lines, segments, codes, reason
):
    script = [*lines.press[: -len(lines.capture + lines.off) - 2]]
    controller, _ = bench(script, [("MG _SCA,_SCB", f" {codes}\r\n:")], lines.abort)
    with pytest.raises(MotionFault, match=reason) as caught:
        run_to_wait(controller, segments)
    assert OFF in str(caught.value)


def test_a_press_that_skipped_segments(bench, lines, segments):
    script = [*lines.press[: -len(lines.capture + lines.off) - 1]]
    controller, _ = bench(script, [("MG _BTA,_BTB", " 3.0000 2.0000\r\n:")], lines.abort)
    with pytest.raises(MotionFault, match="3 and 2 of its 3 segments"):
        run_to_wait(controller, segments)


def test_a_press_that_never_ends_is_aborted(bench, lines, segments):
    script = [*lines.press[: -len(lines.wait + lines.capture + lines.off)]]
    stuck = [(lines.wait[0][0], " 1.0000 1.0000 1.0000 2.0000\r\n:")]
    controller, transcript = bench(script, stuck * 1200)
    with pytest.raises(MotionFault, match="not ended after 10 s") as caught:
        run_to_wait(controller, segments, before_wait=lambda: limit(transcript, lines))
    assert OFF in str(caught.value)


def limit(transcript, lines):
    """Let the clock, not the script, end the polling."""
    write = transcript.write

    def follow(data):
        if data == b"AB\r":
            transcript.expected = list(lines.abort)
        return write(data)

    transcript.write = follow


def run_to_wait(controller, segments, before_wait=lambda: None):
    with controller, controller.powered():
        controller.home()
        controller.move_to(segments.start, 100_000)
        controller.load(segments)
        controller.arm()
        controller.start()
        before_wait()
        controller.wait()


def test_a_silent_controller_in_mid_motion(terminal, lines, segments):
    script = [*lines.press[: -len(lines.wait + lines.capture + lines.off)]]
    silent = [(sent, "") for sent, _ in [lines.wait[0], *lines.abort]]
    again = [(sent, "") for sent, _ in [lines.off[0], *lines.abort]]
    controller, _ = terminal(script, silent, again)
    with pytest.raises(SilentController, match=r"MG _BTA.*within 0\.2 s") as caught:
        run_to_wait(controller, segments)
    assert NOT_OFF in str(caught.value)
    assert "emergency stop" in str(caught.value)


def test_a_controller_that_only_hears(terminal, lines, segments):
    """Silent to the poll, then it answers again: the abort is confirmed."""
    script = [*lines.press[: -len(lines.wait + lines.capture + lines.off)]]
    controller, _ = terminal(script, [(lines.wait[0][0], "")], lines.abort)
    with pytest.raises(SilentController) as caught:
        run_to_wait(controller, segments)
    assert OFF in str(caught.value)


def test_a_cable_pulled_in_mid_motion(terminal, lines, segments):
    script = [*lines.press[: -len(lines.wait + lines.capture + lines.off)]]
    controller, _ = terminal(script, [(lines.wait[0][0], None)])
    with pytest.raises(LineLost, match="check the cable") as caught:
        run_to_wait(controller, segments)
    assert NOT_OFF in str(caught.value)


def home_and_move(controller):
    with controller, controller.powered():
        controller.home()
        controller.move_to([1000, -501000], 100_000)


def test_a_refused_move_is_aborted(bench, lines):
    refused = [
        *lines.move[:2],
        ("PA 1000,-501000;BG AB", ":?"),
        ("TC1", "22 Begin not possible due to limit switch\r\n:"),
    ]
    controller, _ = bench(lines.connect, lines.on, lines.home, refused, lines.abort)
    with pytest.raises(CommandRefused, match=r"refused 'BG AB': 22 .*limit stands in") as caught:
        home_and_move(controller)
    assert caught.value.code == 22
    assert OFF in str(caught.value)


def test_an_arm_that_does_not_arrive(bench, lines):
    controller, transcript = bench(lines.connect, lines.on, lines.home, lines.move[:-2])
    transcript.expected += [("MG _TPA,_TPB", " 900.0000 -501000.0000\r\n:")] * 200
    limit(transcript, lines)
    with pytest.raises(MotionFault, match=r"900, -501000 .*to 1000, -501000"):
        home_and_move(controller)


def test_disconnect_inside_powered_switches_off(bench, lines):
    controller, _ = bench(lines.connect, lines.on, lines.off)
    with controller, controller.powered():
        controller.disconnect()


def test_disconnect_does_not_hide_an_earlier_error(bench, lines):
    lost = [("ST AB", OSError("gone")), ("AB", OSError("gone"))]
    controller, _ = bench(lines.connect, lines.on, lost)
    controller.connect()
    with pytest.raises(ZeroDivisionError) as caught:  # noqa: PT012
        power = controller.powered()
        power.__enter__()
        try:
            raise ZeroDivisionError
        finally:
            controller.disconnect()
    assert "gone" in caught.value.__notes__[0]
    with pytest.raises(NotReady):
        controller.positions()
