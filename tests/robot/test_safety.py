"""After every fault the motors are off, and the error reports whether that is confirmed."""

import threading
from types import SimpleNamespace

import pytest

from sautereau.robot.errors import (
    CommandRefused,
    LineLost,
    MotionFault,
    NotReady,
    RobotError,
    SettingNotTaken,
    SilentController,
)
from sautereau.robot.experiment.monitor import Control, Fault
from tests.robot.motions import NOT_OFF, OFF, fails, press


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit, GeneratorExit])
@pytest.mark.parametrize("through", ["bench", "terminal"])
def test_any_exception_leaves_the_motors_off(request, through, lines, kind):
    controller, _ = request.getfixturevalue(through)(lines.connect, lines.on, lines.off)
    with pytest.raises(kind) as caught, controller, controller.powered():
        raise kind
    assert OFF in caught.value.__notes__[0]


def test_an_interrupt_in_mid_motion_stops_it(bench, lines):
    script = [*lines.connect, *lines.on, *lines.home[: 11 + len(lines.ready)]]
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
    on = (lines.abort[-1][0], " 4711.0000 1.0000 0.0000 0.0000 0.0000 0.0000 0.0000\r\n:")
    abort = [*lines.abort[:-1], on]
    tried_again = [(sent, "") for sent, _ in lines.abort[:-1]]
    controller, _ = bench(lines.connect, lines.on, lines.stop, abort, abort, tried_again)
    with controller, pytest.raises(MotionFault, match=r"_MOA.*\[1\.0, 0\.0") as caught:  # noqa: SIM117
        with controller.powered():
            pass
    assert NOT_OFF in str(caught.value)


def test_a_refused_abort_is_sent_again_after_a_broken_off_line(bench, lines):
    on = (lines.abort[-1][0], " 4711.0000 0.0000 0.0000 1.0000 0.0000 0.0000 0.0000\r\n:")
    spoilt = [("AB", b"xxAB\r?"), *lines.abort[1:-1], on]
    controller, _ = bench(lines.connect, spoilt, lines.abort)
    with controller:
        controller.abort()


@pytest.mark.parametrize("noise", [b"", b"\x00\xff", b"4711.0000 1.0000\r\n:?::"])
def test_an_abort_ignores_answers_before_its_own_question(bench, lines, noise):
    script = [(sent, noise) for sent, _ in lines.abort[:-1]]
    again = [lines.abort[-1]] if b"\xff" in noise else []
    controller, _ = bench(lines.connect, script, [lines.abort[-1]], again)
    with controller:
        controller.abort()


def ends_with(lines, codes, poll=None):
    """Return the lines of a press whose last poll has an answer, and then its codes."""
    polls = lines.wait[:-2] if poll is None else [(lines.wait[0][0], f" {poll}\r\n:")]
    return [*polls, (lines.wait[3][0], f" {codes} 0.0000\r\n:")]


def counts(lines, old, new):
    """Return the lines of a press that ends with other counts."""
    sent, answer = lines.wait[-1]
    return [*lines.wait[:-1], (sent, answer.replace(old, new))]


EXPIRED = "0.0000 0.0000 7.0000 7.0000 -1.0000 -1.0000"
LIMITED = "0.0000 1.0000 2.0000 0.0000 1.0000 1.0000"


@pytest.mark.parametrize(
    ("ending", "what", "reason"),
    [
        (
            ends_with,
            ["8.0000 4.0000 1.0000 9.0000"],
            "joint 1 .* following error over ER .*joint 2",
        ),
        (ends_with, ["31.0000 2.0000 1.0000 9.0000"], "joint 2 stopped by the forward limit"),
        (ends_with, ["7.0000 7.0000 1.0000 9.0000"], "stopped by AB"),
        (ends_with, ["32.0000 31.0000 1.0000 9.0000"], "empty FIFO"),
        (ends_with, ["77.0000 1.0000 1.0000 9.0000"], r"unknown stop code \(stop code 77\)"),
        (ends_with, ["2.0000 0.0000 1.0000 9.0000", LIMITED], "joint 1 stopped by the forward"),
        # The watchdog's thread has ended, or is about to end, or was ended by something else.
        (ends_with, ["7.0000 7.0000 -1.0000 0.0000", EXPIRED], "watchdog has switched"),
        (ends_with, ["7.0000 7.0000 43.0000 0.0000", EXPIRED], "watchdog has switched"),
        (ends_with, ["7.0000 7.0000 -1.0000 9.0000", EXPIRED], "ended with 9 of 10 counts"),
        (counts, ["3.0000 3.", "3.0000 2."], "3 and 2 of its 3 segments"),
        (counts, ["1050.", "1049."], "ended at 1049 and -501025 counts"),
    ],
)
def test_a_press_that_breaks_off_names_the_joint_and_the_reason(
    bench, lines, segments, ending, what, reason
):
    controller, _ = bench(lines.started, ending(lines, *what), lines.abort)
    with fails(controller, MotionFault, reason, OFF):
        press(controller, segments)


@pytest.mark.parametrize(
    ("number", "answer", "said"),
    [
        (0, "0.0000 1.0000 1.0000 1.0000 1.0000", "abort input is active; release"),
        (0, "1.0000 1.0000 0.0000 1.0000 0.0000", "forward limit of joint 2, reverse limit of joi"),
        (4, "9.0000 -1.0000", "watchdog does not run"),
        (4, "10.0000 -1.0000", "watchdog does not run"),
        (-1, "1.0000 0.0000", "emergency stop"),
    ],
)
def test_what_keeps_the_power_off(bench, lines, number, answer, said):
    asked = [*lines.on[:number], (lines.on[number][0], f" {answer}\r\n:")]
    controller, _ = bench(lines.connect, asked, lines.off)
    with controller, pytest.raises(SettingNotTaken, match=said), controller.powered():
        pass


def test_a_watchdog_that_does_not_count_keeps_the_power_off(bench, lines):
    stuck = [lines.on[4]] * 600
    controller, transcript = bench(lines.connect, lines.on[:4], stuck)
    limit(transcript, [*lines.stop, *lines.abort])
    with pytest.raises(MotionFault, match="first count has not"), controller, controller.powered():
        pass


def test_a_press_that_never_ends_is_aborted(bench, lines, segments):
    stuck = [(lines.wait[0][0], " 1.0000 1.0000 0.0000 0.0000 1.0000 2.0000\r\n:")]
    controller, transcript = bench(lines.started, stuck * 1200)
    with fails(controller, MotionFault, "not ended after 10 s", OFF):
        press(controller, segments, before_wait=lambda: limit(transcript, lines.abort))


def limit(transcript, ending):
    """Let the clock, not the script, end the polling, with the first line of an ending."""
    write, stuck = transcript.write, transcript.expected[-1]

    def follow(data):
        if data == f"{ending[0][0]}\r".encode() and transcript.expected[0] == stuck:
            transcript.expected = list(ending)
        return write(data)

    transcript.write = follow


def test_an_abort_requested_by_another_thread_ends_a_press_at_once(terminal, lines, segments):
    """The next question is not asked any more: the motors go off, and that is read back."""
    controller, _ = terminal(lines.started, lines.wait[:1], lines.abort)
    request = threading.Thread(target=controller.request_abort)
    with fails(controller, MotionFault, "aborted by the operator", OFF):
        press(controller, segments, before_wait=lambda: (request.start(), request.join()))


def test_an_abort_requested_before_the_motors_are_on_ends_nothing(terminal, lines, segments):
    controller, _ = terminal(lines.started, lines.wait, lines.off)
    controller.request_abort()
    with controller, controller.powered():
        press(controller, segments)


def test_the_operator_aborts_the_motions_of_one_session():
    control, requested = Control(), []
    controller = SimpleNamespace(request_abort=lambda: requested.append("abort"))
    with control.over(controller):
        control.abort()
    assert requested == ["abort"]
    control.watched(lambda seen: None)(Fault("aborted"))
    control.wait()  # the next session runs
    control.abort()
    with pytest.raises(RobotError, match="aborted by the operator"):
        control.wait()
    assert requested == ["abort"]


def test_a_silent_controller_in_mid_motion(terminal, lines, segments):
    asked = [lines.wait[0], *lines.fresh, *lines.abort, *lines.abort[:-1]]
    silent = [(sent, "") for sent, _ in asked]
    controller, _ = terminal(lines.started, silent)
    with fails(
        controller, SilentController, r"MG _BGA.*within 0\.125 s", NOT_OFF, "emergency stop"
    ):
        press(controller, segments)


def test_a_controller_that_answers_again_confirms_the_abort(terminal, lines, segments):
    """It is silent to the poll, then answers again."""
    silent = [(sent, "") for sent, _ in [lines.wait[0], *lines.fresh]]
    controller, _ = terminal(lines.started, silent, lines.abort)
    with fails(controller, SilentController, OFF):
        press(controller, segments)


def test_a_cable_pulled_in_mid_motion(terminal, lines, segments):
    controller, _ = terminal(lines.started, [(lines.wait[0][0], None)])
    with fails(controller, LineLost, "check the cable", NOT_OFF):
        press(controller, segments)


def home_and_move(controller):
    with controller, controller.powered():
        controller.home()
        controller.move_to([1000, -501000], 100_000)


def test_a_refused_move_is_aborted(bench, lines):
    refused = [
        *lines.move[: lines.move.index(("BG AB", ":"))],
        ("BG AB", "?"),
        ("TC1", "22 Begin not possible due to limit switch\r\n:"),
    ]
    controller, _ = bench(lines.homed, refused, lines.abort)
    with pytest.raises(CommandRefused, match=r"refused 'BG AB': 22 .*limit is active") as caught:
        home_and_move(controller)
    assert caught.value.code == 22
    assert OFF in str(caught.value)


def test_an_arm_that_does_not_arrive(bench, lines):
    controller, transcript = bench(lines.homed, lines.move[:-2])
    transcript.expected += [("MG _TPA,_TPB", " 900.0000 -501000.0000\r\n:")] * 200
    limit(transcript, lines.abort)
    with pytest.raises(MotionFault, match=r"joint 1 is 100 counts .*position_tolerance, 50 "):
        home_and_move(controller)


def test_disconnect_inside_powered_switches_off(bench, lines):
    controller, _ = bench(lines.connect, lines.on, lines.off)
    with controller, controller.powered():
        controller.disconnect()


def test_disconnect_does_not_hide_an_earlier_error(bench, lines):
    lost = [(sent, OSError("gone")) for sent, _ in [lines.stop[0], *lines.abort]]
    controller, _ = bench(lines.connect, lines.on, lost)
    controller.connect()
    with pytest.raises(ZeroDivisionError) as caught, controller.powered():  # noqa: PT012
        try:
            raise ZeroDivisionError
        finally:
            controller.disconnect()
    assert "gone" in caught.value.__notes__[0]
    with pytest.raises(NotReady):
        controller.positions()
