"""The emulated ODrive: its line byte by byte, its filter, its moves, its watchdogs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sautereau.sim_backend.devices.odrive.axis import Setpoint, Trapezoid, filtered
from sautereau.sim_backend.devices.odrive.firmware import OdriveFirmware
from tests.emulated import Encoders

PERIOD = 1e-3
TURN = 10_000.0
LIMITS = ("vel_limit 2", "accel_limit 5", "decel_limit 5")  # Of moves: turn/s, turn/s^2
WATCHED = ("w axis0.config.watchdog_timeout 0.05", "w axis0.config.enable_watchdog 1")
"""Start the watchdog of an axis; s."""


class Bare(Encoders):
    """A controller and its arm."""

    def __init__(self, stepped=False):
        super().__init__(home=(-700, 300))
        self.firmware = OdriveFirmware(
            self,
            per_turn=(TURN, TURN / 2),
            period=PERIOD,
            stepped=stepped,
            torque_per_volt=(0.08, 0.04),
        )

    def torque_volts(self):
        return 0.5, -1.0

    def say(self, *lines):
        """Send lines one after the other; return what the last one is answered."""
        for line in lines:
            answer = self.firmware.receive(line.encode("latin-1") + b"\n").decode("latin-1")
        return answer


@pytest.fixture
def bench():
    return Bare()


SERIAL = "SIM sautereau stand-in, paced"
TRANSCRIPTS = f"""
i -> Hardware version: 3.6-56V / Firmware version: 0.5.6 / Serial number: {SERIAL}
 -> unknown command
; nothing -> unknown command
x -> unknown command
q 0 1 1 1 -> unknown command
v 0 1 -> unknown command
f 0 -> 0.000000 0.000000
f 0*70 ->
f 1 ; where -> 0.000000 0.000000
f 2 -> invalid motor 2
f -> invalid command format
p 0 -> invalid command format
p 0 x -> invalid command format
p 7 1 -> invalid motor 7
p 0 1 ->
p 0 1 2 3 ->
t 0 -> invalid command format
t 0 nan -> invalid command format
t 3 1 -> invalid motor 3
t 0 0 ->
u -> invalid command format
u 2 -> invalid motor 2
u 0 ->
r -> invalid command format
r axis0 -> invalid property
r axis2.error -> invalid property
r gpio1.state -> invalid property
w gpio1.state 0 -> invalid property
r axis0.motor.config.torque_lim -> inf
r axis0.encoder.config.cpr -> 10000
r axis1.encoder.config.cpr -> 5000
r axis0.motor.current_control.Iq_setpoint -> 1.000000
r axis0.controller.trajectory_done -> 1
r axis0.min_endstop.endstop_state -> 0
w -> invalid command format
w axis0.config.watchdog_timeout 0.25 ->
r axis0.config.watchdog_timeout -> 0.250000
w axis0.controller.config.vel_limit 12345.678 ->
r axis0.controller.config.vel_limit -> 12345.677
w axis0.controller.config.vel_limit 2.5e0x ->
r axis0.controller.config.vel_limit -> 2.500000
w axis0.encoder.config.cpr 4096.9 ->
r axis0.encoder.config.cpr -> 4096
w axis0.motor.error 8589934592 ->
r axis0.motor.error -> 858993459
w axis0.motor.error 0 ->
w axis0.current_state 8 -> not implemented
r axis0.requested_state -> 0
w axis0.config.watchdog_timeout -> not implemented
w axis0.config.watchdog_timeout no -> not implemented
r error -> 0
r vbus_voltage -> 24.000000
w axis0.requested_state 8 ->
r axis0.current_state -> 8
w axis0.requested_state 1 ->
r axis0.current_state -> 1
r axis0.error -> 0
w axis0.requested_state 3 ->
r axis0.error -> 1
w axis0.requested_state 1 ->
r axis0.error -> 0
w axis1.requested_state 11 ->
r axis1.error -> 131072
w stand_in.wait 0.1 -> not implemented
"""


def test_transcript(bench):
    for pair in TRANSCRIPTS.strip("\n").splitlines():
        sent, answered = pair.split(" ->")
        expected = "".join(f"{line.strip()}\r\n" for line in answered.split(" / ") if line)
        assert bench.say(sent) == expected, sent


def test_a_checksum_is_answered_with_one_and_a_wrong_one_with_nothing(bench):
    right = 0
    for byte in b"f 0":
        right ^= byte
    answer = bench.say(f"f 0*{right}")
    text, _, told = answer.strip().partition("*")
    expected = 0
    for byte in text.encode():
        expected ^= byte
    assert int(told) == expected
    for wrong in (right ^ 1, "", "x", "-1", "²"):
        assert bench.say(f"w axis0.requested_state 8*{wrong}") == ""
    assert bench.firmware.motors_on == (False, False)


@pytest.mark.parametrize("end", [b"\n", b"\r", b"!"])
def test_line_ends(bench, end):
    assert bench.firmware.receive(b"u 0" + end + b"r axis0.error" + end) == b"0\r\n"


def test_a_second_line_end_is_a_command_that_is_unknown(bench):
    assert bench.firmware.receive(b"r axis0.error\r\n") == b"0\r\nunknown command\r\n"


def test_a_line_that_is_too_long_is_lost(bench):
    assert bench.firmware.receive(b"r axis0.error" + b" " * 300 + b"\n") == b""
    assert bench.say("r axis0.error") == "0\r\n"


@given(
    st.lists(
        st.tuples(
            st.sampled_from("ptqvciruwse"),
            st.sampled_from(["", " 0", " 1", " 9", " axis0.", " axis1.config.", " gpio1.state"]),
            st.text(alphabet="0123456789.-+einfa_*; ", max_size=12),
        ),
        max_size=10,
    )
)
def test_random_commands_move_nothing_without_power(parts):
    bench = Bare()
    for part in parts:
        bench.say("".join(part))
        bench.tick()
    assert bench.counts == [0, 0]
    assert bench.firmware.motors_on == (False, False)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(1, 300))
def test_the_filter_solves_its_equation(x, v, u, w, b):
    found, _ = filtered(Setpoint(x, v), Setpoint(u, w), b, 0.02)
    solved = solve_ivp(
        lambda _, y: [y[1], b**2 * (u - y[0]) + 2 * b * (w - y[1])],
        (0, 0.02),
        [x, v],
        rtol=1e-10,
        atol=1e-12,
    )
    assert found.position == pytest.approx(solved.y[0, -1], abs=1e-7)
    assert found.velocity == pytest.approx(solved.y[1, -1], abs=1e-5)


@given(st.floats(-2, 2), st.floats(-3, 3), st.floats(-2, 2), st.floats(0.1, 3), st.floats(0.1, 9))
def test_a_trapezoid_is_continuous_and_within_its_limits(x, v, goal, speed, rate):
    move = Trapezoid(Setpoint(x, v), goal, speed, rate, rate)
    times = np.linspace(0, move.duration, 400)
    points = [move.at(time) for time in times]
    places = np.array([point.position for point in points])
    speeds = np.array([point.velocity for point in points])
    step = move.duration / 399
    assert places[0] == pytest.approx(x, abs=1e-9)
    assert places[-1] == pytest.approx(goal, abs=1e-6)
    assert move.at(move.duration + 1) == Setpoint(goal, 0.0)
    assert np.abs(np.diff(places)).max() <= max(speed, abs(v)) * step + 1e-6
    assert np.abs(np.diff(speeds)).max() <= rate * step + 1e-6


def test_a_move_ends_at_its_goal_and_reports_it(bench):
    limits = (f"w axis0.trap_traj.config.{limit}" for limit in LIMITS)
    bench.say("w axis0.requested_state 8", *limits, "t 0 0.5")
    assert bench.say("r axis0.controller.trajectory_done") == "1\r\n"  # of the move before
    bench.tick()
    assert bench.say("r axis0.controller.trajectory_done") == "0\r\n"
    ticks = bench.run()
    assert ticks * PERIOD == pytest.approx(2 * math.sqrt(0.5 / 5), abs=3 * PERIOD)
    assert bench.say("r axis0.controller.trajectory_done") == "1\r\n"
    assert bench.counts == [5000, 0]


def test_homing_goes_down_to_the_switch_and_calls_that_zero(bench):
    bench.say(
        "w axis0.min_endstop.config.debounce_ms 1",
        "w axis0.min_endstop.config.enabled 1",
        "w axis0.controller.config.homing_speed 0.1",
        "w axis0.requested_state 11",
    )
    bench.run()
    assert bench.counts[0] == pytest.approx(-700, abs=4)
    assert bench.say("f 0").startswith(("0.000000", "-0.000"))
    assert bench.say("r axis0.is_homed") == "1\r\n"
    assert bench.say("r axis0.current_state") == "1\r\n"


@pytest.mark.parametrize("state", [1, 8])
def test_a_switch_that_closes_while_it_is_enabled_is_an_error(bench, state):
    bench.say("w axis0.min_endstop.config.enabled 1", f"w axis0.requested_state {state}")
    bench.tick(60)
    bench.follows, bench.counts = False, [-701, 0]
    bench.tick(49)
    assert bench.say("r axis0.min_endstop.endstop_state") == "0\r\n"  # not yet debounced
    bench.tick(2)
    assert bench.say("r axis0.min_endstop.endstop_state") == "1\r\n"
    assert bench.say("r axis0.error") == "4096\r\n"
    assert bench.firmware.motors_on == (False, False)


@pytest.mark.parametrize("renewal", ["u 0", "p 0 0", "t 0 0"])
def test_a_watchdog_switches_off_unless_it_is_renewed(bench, renewal):
    bench.say(*WATCHED, "w axis0.requested_state 8")
    for _ in range(5):
        bench.tick(40)
        bench.say(renewal)
    assert bench.firmware.motors_on[0]
    assert bench.firmware.watching
    bench.tick(52)
    assert not bench.firmware.motors_on[0]
    assert bench.say("r axis0.error") == "2048\r\n"


def test_stepped_time_waits_for_the_host_while_it_streams():
    bench = Bare(stepped=True)
    firmware = bench.firmware
    bench.say(*WATCHED, "w axis0.controller.config.input_mode 3")
    bench.tick(100)  # the host is slow, and lives
    assert not firmware.held
    bench.say("w axis0.requested_state 8")
    assert firmware.motors_on[0]
    bench.say("p 0 0.1")
    assert firmware.held
    assert not firmware.moving
    assert bench.say("w stand_in.wait 0.004") == "waiting 0.004000\r\n"
    assert bench.run() == 4
    assert firmware.held
    bench.say("w stand_in.wait 0.06")  # it waits and sends nothing
    bench.run()
    assert not firmware.motors_on[0]
    assert not firmware.held


@pytest.mark.parametrize("seconds", ["-1", "nan", "1e9", ""])
def test_a_wait_that_cannot_be_is_refused(seconds):
    assert Bare(stepped=True).say(f"w stand_in.wait {seconds}") == "not implemented\r\n"


def test_an_error_of_the_device_switches_both_motors_off(bench):
    bench.say("w axis0.requested_state 8", "w axis1.requested_state 8")
    bench.firmware.trip(0x2)
    assert bench.firmware.motors_on == (False, False)
    assert bench.say("r error") == "2\r\n"
    assert bench.say("r axis1.motor.error") == "16777216\r\n"
    bench.say("w axis0.requested_state 8")  # an axis with an error stays off
    bench.tick()
    assert bench.firmware.motors_on == (False, False)
    bench.say("sc")
    assert {bench.say(f"r {name}") for name in ("error", "axis0.error", "axis1.motor.error")} == {
        "0\r\n"
    }


def test_the_velocity_of_an_earlier_input_moves_an_axis_that_is_switched_on_again(bench):
    """The firmware sets the input's position when it closes the loop, and not its velocity."""
    bench.say(
        "w axis0.controller.config.input_mode 3",
        "w axis0.controller.config.input_filter_bandwidth 20",
        "p 0 0 1",
        "w axis0.requested_state 8",
    )
    bench.run()
    assert bench.counts[0] == pytest.approx(2 / 20 * TURN, rel=1e-3)


def test_writing_the_control_mode_replaces_the_target_by_the_position(bench):
    bench.say("w axis0.requested_state 8")
    bench.follows = False
    bench.say("p 0 0.5")
    bench.tick()
    bench.say("w axis0.controller.config.control_mode 3")
    bench.tick()
    positions, _ = bench.firmware.reference(np.array([1.0]))
    assert positions[0, 0] == 0
