"""One axis of the emulated ODrive: state, setpoint and watchdog, in turns of the motor."""

from enum import IntEnum

from sautereau.sim_backend.devices.odrive.setpoint import Setpoint, Trapezoid, filtered


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


INVALID_STATE, WATCHDOG_EXPIRED, ENDSTOP_PRESSED = 0x1, 0x800, 0x1000
HOMING_WITHOUT_ENDSTOP = 0x20000
TORQUE_CONSTANT = 0.04
"""N m/A, of the emulated motors."""


class OdriveAxis:
    """An axis at power-up: idle, no watchdog.

    Args:
        per_turn: Encoder counts per turn of the motor.
        raw: Encoder counts now.
        home: Encoder counts at and below which the min endstop is pressed.
    """

    def __init__(self, per_turn: float, raw: int, home: int):
        self.per_turn, self.home = per_turn, home
        self.raw = raw
        self.zero = float(raw)
        """Encoder counts at 0 turns, where the firmware starts."""
        self.state = State.IDLE
        self.error = 0
        self.velocity = 0.0
        """Turns per second, estimate."""
        self.settings = {
            "config.enable_watchdog": 0.0,
            "config.watchdog_timeout": 0.0,
            "controller.config.circular_setpoints": 0.0,
            "controller.config.control_mode": 3.0,
            "controller.config.homing_speed": 0.25,
            "controller.config.input_filter_bandwidth": 2.0,
            "controller.config.input_mode": 1.0,
            "controller.config.vel_limit": 2.0,
            "controller.config.vel_ramp_rate": 1.0,
            "controller.input_torque": 0.0,
            "encoder.config.cpr": float(round(per_turn)),
            "min_endstop.config.enabled": 0.0,
            "min_endstop.config.offset": 0.0,
            "motor.config.torque_constant": TORQUE_CONSTANT,
            "motor.config.torque_lim": float("inf"),
            "trap_traj.config.accel_limit": 0.5,
            "trap_traj.config.decel_limit": 0.5,
            "trap_traj.config.vel_limit": 2.0,
        }
        self.input = Setpoint(0.0, 0.0)
        self.setpoint = Setpoint(0.0, 0.0)
        self.homed = False
        """Whether the last homing has succeeded."""
        self._was_pressed = False
        self.done = True
        """Whether the last trapezoid has ended."""
        self._trapezoid: Trapezoid | None = None
        self._elapsed = 0.0
        self._watch = 0.0
        self.cubic = (float(raw), 0.0, 0.0, 0.0)
        """Coefficients of the reference over the sample last ticked, in encoder counts."""

    @property
    def position(self) -> float:
        """Turns."""
        return (self.raw - self.zero) / self.per_turn

    @property
    def pressed(self) -> bool:
        """Whether the min endstop is pressed and enabled."""
        return bool(self.settings["min_endstop.config.enabled"]) and self.raw <= self.home

    @property
    def on(self) -> bool:
        """Whether the motor has current."""
        return self.state != State.IDLE

    @property
    def moving(self) -> bool:
        """Whether the setpoint changes."""
        if self.state == State.HOMING:
            return True
        if self.state == State.IDLE:
            return False
        return not self.done if self._mode == Input.TRAP_TRAJ else not self._settled

    @property
    def watched(self) -> bool:
        """Whether a watchdog runs while the motor is on."""
        return self.on and bool(self.settings["config.enable_watchdog"])

    def request(self, state: int) -> None:
        """Enter a state; an unknown one is an error, and the axis becomes idle."""
        self.state = State.IDLE
        if state == State.HOMING and not self.settings["min_endstop.config.enabled"]:
            self.error |= HOMING_WITHOUT_ENDSTOP
        elif state in (State.CLOSED_LOOP_CONTROL, State.HOMING):
            self.state = State(state)
            self.setpoint = self.input = Setpoint(self.position, 0.0)
            self._trapezoid, self.done = None, True
            self.homed = self.homed and state != State.HOMING
            self.feed()
        elif state != State.IDLE:
            self.error |= INVALID_STATE

    def feed(self) -> None:
        """Renew the watchdog."""
        self._watch = self.settings["config.watchdog_timeout"]

    def follow(self, position: float, velocity: float | None) -> None:
        """Set a new input: `p`, and the common part of `t`."""
        self.input = Setpoint(position, self.input.velocity if velocity is None else velocity)
        if self._mode == Input.TRAP_TRAJ:
            self._plan()
        self.feed()

    def move(self, goal: float) -> None:
        """Start a trapezoid to a goal [turns]: `t`."""
        self.settings["controller.config.input_mode"] = float(Input.TRAP_TRAJ)
        self.follow(goal, None)

    def look(self, raw: int, home: int, period: float) -> None:
        """Read encoder and endstop at the start of a sample."""
        self.home = home
        self.velocity = (raw - self.raw) / self.per_turn / period
        self.raw = raw
        self.look_at_endstop()

    def look_at_endstop(self) -> None:
        """Read the endstop; pressing it is an error, except during homing."""
        if self.pressed and not self._was_pressed and self.state != State.HOMING:
            self.error |= ENDSTOP_PRESSED
            self.state = State.IDLE
        self._was_pressed = self.pressed

    def watch(self, period: float) -> None:
        """Advance the watchdog by a sample [s]; when it expires the axis becomes idle."""
        if not self.settings["config.enable_watchdog"]:
            return
        self._watch -= period
        if self._watch < 0:
            self.error |= WATCHDOG_EXPIRED
            self.state = State.IDLE

    def step(self, period: float) -> None:
        """Advance the setpoint by a sample [s]."""
        if self.state == State.HOMING and self.pressed:
            self.zero = self.raw - self.settings["min_endstop.config.offset"] * self.per_turn
            self.state, self.homed = State.IDLE, True
        before = self.setpoint
        if self.state == State.IDLE:
            self.setpoint = self.input = Setpoint(self.position, 0.0)
            self.cubic = (float(self.raw), 0.0, 0.0, 0.0)
            return
        if self.state == State.HOMING:
            self._creep(period)
        elif self._mode == Input.POS_FILTER:
            width = self.settings["controller.config.input_filter_bandwidth"]
            self.setpoint, _ = filtered(self.setpoint, self.input, max(width, 1e-3), period)
        elif self._mode == Input.TRAP_TRAJ:
            self._follow_trapezoid(period)
        else:
            self.setpoint = self.input
        self._set_cubic(before, period)

    @property
    def _mode(self) -> int:
        return int(self.settings["controller.config.input_mode"])

    @property
    def _settled(self) -> bool:
        width = self.settings["controller.config.input_filter_bandwidth"]
        if self._mode != Input.POS_FILTER or width <= 0:
            return self.setpoint == self.input
        return filtered(self.setpoint, self.input, width, 0.0)[1]

    def _plan(self) -> None:
        limits = [
            max(1e-6, self.settings[f"trap_traj.config.{name}_limit"])
            for name in ("vel", "accel", "decel")
        ]
        self._trapezoid = Trapezoid(self.setpoint, self.input.position, *limits)
        self._elapsed, self.done = 0.0, False

    def _follow_trapezoid(self, period: float) -> None:
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

    def _set_cubic(self, before: Setpoint, period: float) -> None:
        """Set the cubic from the setpoint before a sample to that after it."""
        start = self.zero + before.position * self.per_turn
        step = (self.setpoint.position - before.position) * self.per_turn
        v0, v1 = (s.velocity * self.per_turn * period for s in (before, self.setpoint))
        self.cubic = (start, v0, 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step)
