"""One axis of the emulated ODrive: state, setpoint and watchdog, in turns of the motor.

Setpoints are those of the filter and of the trapezoidal planner, and within a sample.

After `axis.cpp`, `controller.cpp` and `endstop.cpp` in `Firmware/MotorControl` of
odriverobotics/ODrive, tag fw-v0.5.6.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from sautereau.sim_backend.devices.emulators import Cubic, hermite
from sautereau.sim_backend.devices.odrive.properties import AXIS


@dataclass(frozen=True)
class Setpoint:
    """Position and velocity that an axis should have."""

    position: float
    velocity: float


def filtered(
    now: Setpoint, goal: Setpoint, bandwidth: float, elapsed: float
) -> tuple[Setpoint, bool]:
    """Follow a constant input by the critically damped filter of second order.

    x'' = b^2 (u - x) + 2 b (w - x'), solved exactly.

    Args:
        now: The setpoint.
        goal: The input, u and w.
        bandwidth: b [1/s].
        elapsed: s.

    Returns:
        The setpoint after that time, and whether it has reached its limit.
    """
    rest = goal.position + 2 * goal.velocity / bandwidth
    away = now.position - rest
    drive = now.velocity + bandwidth * away
    fall = math.exp(-bandwidth * elapsed)
    position = rest + (away + drive * elapsed) * fall
    velocity = (now.velocity - bandwidth * drive * elapsed) * fall
    if abs(position - rest) < 1e-9 and abs(velocity) < 1e-7:
        return Setpoint(rest, 0.0), True
    return Setpoint(position, velocity), False


def between(before: Setpoint, after: Setpoint, scale: float, zero: float, period: float) -> Cubic:
    """Return the cubic from one setpoint to that a sample later, in encoder counts.

    Args:
        before: At the sample's start.
        after: At its end.
        scale: Encoder counts per unit of the setpoints.
        zero: Encoder counts at position 0.
        period: s, of the sample.
    """
    step = (after.position - before.position) * scale
    v0, v1 = before.velocity * scale * period, after.velocity * scale * period
    return hermite(zero + before.position * scale, step, v0, v1)


class Trapezoid:
    """A move from a setpoint to a goal, by the firmware's trapezoidal planner.

    Args:
        start: The setpoint at the start.
        goal: Position at the end, at rest.
        speed: Largest speed, positive.
        acceleration: Positive.
        deceleration: Positive.
    """

    def __init__(
        self, start: Setpoint, goal: float, speed: float, acceleration: float, deceleration: float
    ):
        first, way = start.velocity, goal - start.position
        stopping = first * abs(first) / (2 * deceleration)
        sign = math.copysign(1.0, way - stopping)
        top, falling_rate = sign * speed, sign * deceleration
        rate = sign * (acceleration if sign * first <= speed else -acceleration)
        rising, falling = (top - first) / rate, top / falling_rate
        cruise = (way - (rising * (top + first) + falling * top) / 2) / top
        if cruise < 0:  # it does not reach its speed
            squared = (2 * way + first**2 / rate) / (1 / rate + 1 / falling_rate)
            top, cruise = sign * math.sqrt(max(0.0, squared)), 0.0
            rising, falling = max(0.0, (top - first) / rate), top / falling_rate
        self._start, self._goal = start, goal
        self._acceleration, self._deceleration = rate, -falling_rate
        self._top, self._rising, self._cruise = top, rising, cruise
        self.duration = rising + cruise + falling
        """s."""

    def at(self, elapsed: float) -> Setpoint:
        """Return the setpoint ``elapsed`` s after the start."""
        if elapsed >= self.duration:
            return Setpoint(self._goal, 0.0)
        start, rising = self._start, self._rising
        if elapsed < rising:
            return Setpoint(
                start.position + elapsed * (start.velocity + self._acceleration * elapsed / 2),
                start.velocity + self._acceleration * elapsed,
            )
        if elapsed < rising + self._cruise:
            risen = start.position + rising * (start.velocity + self._top) / 2
            return Setpoint(risen + self._top * (elapsed - rising), self._top)
        left = self.duration - elapsed
        return Setpoint(self._goal + self._deceleration * left**2 / 2, -self._deceleration * left)


class State(IntEnum):
    """State of an axis, in the firmware's words."""

    IDLE = 1
    CLOSED_LOOP_CONTROL = 8
    HOMING = 11


class Input(IntEnum):
    """How the inputs become a setpoint."""

    PASSTHROUGH = 1
    VEL_RAMP = 2
    POS_FILTER = 3
    TRAP_TRAJ = 5


INVALID_STATE, MOTOR_FAILED, WATCHDOG_EXPIRED, ENDSTOP_PRESSED = 0x1, 0x40, 0x800, 0x1000
HOMING_WITHOUT_ENDSTOP = 0x20000
SYSTEM_LEVEL = 1 << 24  # Error of a motor that was switched off for an error of the device


class OdriveAxis:
    """An axis at power-up: idle, no watchdog.

    Args:
        number: 0 or 1.
        per_turn: Encoder counts per turn of the motor.
        raw: Encoder counts now.
        home: Encoder counts at and below which the min endstop is pressed.
    """

    def __init__(self, number: int, per_turn: float, raw: int, home: int):
        self.per_turn, self.home = per_turn, home
        self.raw = raw
        self.zero = float(raw)
        """Encoder counts at 0 turns, where the firmware starts."""
        self.state = State.IDLE
        self.velocity = 0.0
        """Turns per second, estimate."""
        self.settings = {name: declared.default for name, declared in AXIS.items()}
        """Values of the properties; those that cannot be written are not kept up to date."""
        self.settings["encoder.config.cpr"] = float(round(per_turn))
        self.settings["controller.config.load_encoder_axis"] = float(number)
        self.setpoint = Setpoint(0.0, 0.0)
        self.pressed = False
        """Whether the min endstop is enabled and pressed, debounced."""
        self._since = 0.0  # s, since its pin changed or it was enabled
        self._pin = False
        self.done = True
        """Whether the last trapezoid has ended."""
        self._target = 0.0
        self._updated = False  # Whether a new target waits for a trapezoid to be planned
        self._trapezoid: Trapezoid | None = None
        self._elapsed = 0.0
        self._watch = 0.0
        self._found: float | None = None  # Turns at which homing has found the endstop
        self.cubic = (float(raw), 0.0, 0.0, 0.0)
        """Coefficients of the reference over the sample last ticked, in encoder counts."""

    @property
    def error(self) -> int:
        """The axis's error bits."""
        return int(self.settings["error"])

    @error.setter
    def error(self, bits: int) -> None:
        self.settings["error"] = float(bits)

    @property
    def position(self) -> float:
        """Turns."""
        return (self.raw - self.zero) / self.per_turn

    @property
    def on(self) -> bool:
        """Whether the motor has current."""
        return self.state != State.IDLE

    @property
    def following(self) -> bool:
        """Whether it filters the positions that the host sends."""
        return self.state == State.CLOSED_LOOP_CONTROL and self._mode == Input.POS_FILTER

    @property
    def moving(self) -> bool:
        """Whether the setpoint changes."""
        if self._pin_waits:
            return True
        if self.state != State.CLOSED_LOOP_CONTROL:
            return self.on
        if self._mode == Input.TRAP_TRAJ:
            return self._updated or not self.done
        return not self._settled

    @property
    def watched(self) -> bool:
        """Whether a watchdog runs while the motor is on."""
        return self.on and bool(self.settings["config.enable_watchdog"])

    def request(self, state: int) -> None:
        """Enter a state; an unknown one is an error, and the axis becomes idle."""
        self.error &= ~INVALID_STATE
        self.state = State.IDLE
        if state == State.HOMING and not self.settings["min_endstop.config.enabled"]:
            self.error |= HOMING_WITHOUT_ENDSTOP
        elif state in (State.CLOSED_LOOP_CONTROL, State.HOMING):
            # The present position is held; the input's velocity stays what it was.
            self.state, self._found = State(state), None
            self.setpoint = Setpoint(self.position, 0.0)
            self._target, self._updated = self.position, True
            if state == State.CLOSED_LOOP_CONTROL:
                self.feed()
            else:
                self.settings |= {"is_homed": 0.0, "controller.input_vel": 0.0}
                self.error &= ~ENDSTOP_PRESSED
        elif state != State.IDLE:
            self.error |= INVALID_STATE

    def take_position(self) -> None:
        """Replace setpoint and input by the position, as writing the control mode does."""
        if self.settings["controller.config.control_mode"] >= 3:
            self.setpoint = Setpoint(self.position, self.setpoint.velocity)
            self._target = self.position

    def feed(self) -> None:
        """Renew the watchdog."""
        self._watch = self.settings["config.watchdog_timeout"]

    def follow(self, position: float, velocity: float | None) -> None:
        """Set a new input: `p`, and the common part of `t`."""
        self.settings["controller.config.control_mode"] = 3.0
        if velocity is not None:
            self.settings["controller.input_vel"] = velocity
        self._target, self._updated = position, True
        self.feed()

    def move(self, goal: float) -> None:
        """Start a trapezoid to a goal [turns]: `t`."""
        self.settings["controller.config.input_mode"] = float(Input.TRAP_TRAJ)
        self.follow(goal, None)

    def enable_endstop(self) -> None:
        """Start to debounce: the switch is read when its pin has been steady for long enough."""
        self._since = 0.0
        self.pressed &= bool(self.settings["min_endstop.config.enabled"])

    def sample(self, raw: int, home: int, period: float, *, watching: bool) -> None:
        """Do one sample of the bench.

        Args:
            raw: Encoder counts now.
            home: Encoder counts at the home switch.
            period: s, of the sample.
            watching: Whether the watchdog counts: else the host is infinitely slow, but alive.
        """
        self.home = home
        self.velocity = (raw - self.raw) / self.per_turn / period
        self.raw = raw
        if self.settings["min_endstop.config.enabled"]:
            self._debounce(raw <= home, period)
        if self.error:
            self.state = State.IDLE
        if watching:
            self._watch_over(period)
        else:
            self.feed()
        self._step(period)

    def _debounce(self, pin: bool, period: float) -> None:
        """Read the endstop; pressing it is an error, except during homing."""
        self._since = 0.0 if pin != self._pin else self._since + period
        self._pin = pin
        if self._pin_waits:
            return
        if pin and not self.pressed and self.state != State.HOMING:
            self.error |= ENDSTOP_PRESSED
        self.pressed = pin

    @property
    def _pin_waits(self) -> bool:
        """Whether the endstop's pin has not been steady for long enough."""
        debounce = self.settings["min_endstop.config.debounce_ms"] * 1e-3
        return bool(self.settings["min_endstop.config.enabled"]) and self._since < debounce

    def _watch_over(self, period: float) -> None:
        """Advance the watchdog by a sample [s]; when it expires the axis becomes idle."""
        if not self.settings["config.enable_watchdog"]:
            return
        self._watch -= period
        if self._watch < 0:
            self.error |= WATCHDOG_EXPIRED
            self.state = State.IDLE

    def _step(self, period: float) -> None:
        """Advance the setpoint by a sample [s]."""
        if self.state == State.HOMING:
            self._home()
        before = self.setpoint
        if self.state == State.IDLE:
            self.setpoint = Setpoint(self.position, 0.0)
            self.cubic = (float(self.raw), 0.0, 0.0, 0.0)
            return
        if self.state == State.HOMING and self._found is None:
            self._creep(period)
        elif self.state == State.HOMING or self._mode == Input.TRAP_TRAJ:
            self._follow_trapezoid(period)
        elif self._mode == Input.POS_FILTER:
            self.setpoint, _ = filtered(self.setpoint, self._input, self._bandwidth, period)
        else:
            self.setpoint = self._input
        self.cubic = between(before, self.setpoint, self.per_turn, self.zero, period)

    @property
    def _mode(self) -> int:
        return int(self.settings["controller.config.input_mode"])

    @property
    def _input(self) -> Setpoint:
        return Setpoint(self._target, self.settings["controller.input_vel"])

    @property
    def _bandwidth(self) -> float:
        return max(1e-3, self.settings["controller.config.input_filter_bandwidth"])

    @property
    def _settled(self) -> bool:
        if self._mode != Input.POS_FILTER:
            return self.setpoint == self._input
        return filtered(self.setpoint, self._input, self._bandwidth, 0.0)[1]

    def _home(self) -> None:
        """Stop at the endstop, return to where it was found, and call that 0 turns."""
        if self._found is None and self.pressed:
            self._found = self.position
            self.setpoint = Setpoint(self.position, 0.0)
            self._target = self.position + self.settings["min_endstop.config.offset"]
            self._updated, self.done = True, False
        elif self._found is not None and self.done:
            self.zero, self.state = float(self.raw), State.IDLE
            self.settings["is_homed"] = 1.0

    def _follow_trapezoid(self, period: float) -> None:
        if self._updated:
            limits = [
                max(1e-6, self.settings[f"trap_traj.config.{name}_limit"])
                for name in ("vel", "accel", "decel")
            ]
            self._trapezoid = Trapezoid(self.setpoint, self._target, *limits)
            self._elapsed, self.done, self._updated = 0.0, False, False
        if self._trapezoid is None:
            return
        self._elapsed += period
        self.setpoint = self._trapezoid.at(self._elapsed)
        if self._elapsed >= self._trapezoid.duration:
            self._trapezoid, self.done = None, True

    def _creep(self, period: float) -> None:
        """Move towards the min endstop at the homing speed, with a ramp."""
        most = self.settings["controller.config.vel_ramp_rate"] * period
        goal = -self.settings["controller.config.homing_speed"]
        change = max(-most, min(most, goal - self.setpoint.velocity))
        speed = self.setpoint.velocity + change
        mean = speed - change / 2
        self.setpoint = Setpoint(self.setpoint.position + mean * period, speed)
