"""One axis of the controller: its settings, its reference, and its state."""

import math
from collections import deque

from sautereau.sim_backend.devices.emulators import hermite
from sautereau.sim_backend.devices.galil import motion
from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.reference import entries

AXES = "AB"
LIMIT_CODES = (motion.StopCode.FORWARD_LIMIT, motion.StopCode.REVERSE_LIMIT)
SEARCHES = ("HM", "FE", "FI")  # Modes of motion that end at a switch or an index


def factory_settings() -> dict[str, float]:
    """Return the numbers stored for an axis, by their commands, as the factory sets them."""
    return {
        code: entry.arguments[0].accept(entry.arguments[0].default)
        for code, entry in entries().items()
        if entry.form == "values" and entry.arguments[0].default is not None
        if code not in ("DE", "DP", "JG", "PA")
    }


class Axis:
    """Reference of one axis, in the raw encoder's counts.

    Args:
        counts: Raw encoder counts at power-up.
    """

    def __init__(self, counts: int) -> None:
        self.settings = factory_settings()
        self.motor_on = False
        self.brake_samples = 0
        """Samples for which the amplifier stays on after MO, while the brake engages."""
        self.position, self.velocity = float(counts), 0.0
        """Raw reference at the end of the sample last ticked: counts, counts per sample."""
        self.offset = -counts
        """Counts, reported positions minus raw ones."""
        self.held = 0
        """Counts that RP reports while the motor is off."""
        self.auxiliary = 0
        """Counts of the auxiliary encoder, which does not move."""
        self.brushless = False
        self.stop_code = motion.StopCode.AT_TARGET
        self.fifo: deque[motion.Segment] = deque()
        self.last_samples = 0
        """Duration of the last PVT segment, for one without."""
        self.executed = 0
        """PVT segments executed since the last BT."""
        self.mode = "PR"
        """Which of PA, PR, JG, HM, FE and FI the next BG starts."""
        self.distance, self.jog_speed = 0, 25_000
        """Counts of the next PR, counts/s of JG."""
        self.stopped_at = 0
        """Counts reported by RP when the last motion ended."""
        self.target = 0
        """Counts reported by RP where PA ends."""
        self.profile: motion.Profile | None = None
        self.jogging = False
        self.latched: int | None = None
        """Raw counts of the index, or None."""
        self.latch_armed = False
        self.weak_samples, self.weak_from = 0, 0
        """Samples for which the torque exceeds OV, and the encoder's counts then."""
        self.encoder_failed = False
        self.last_raw = counts
        self.filtered_speed = 0.0
        """Counts/s, of the encoder, averaged over 0.25 s."""
        self.cubic = (self.position, 0.0, 0.0, 0.0)
        """Reference over the sample last ticked: coefficients of 1, f, f^2, f^3."""

    @property
    def powered(self) -> bool:
        """Whether the amplifier is on."""
        return self.motor_on or self.brake_samples > 0

    @property
    def reported(self) -> int:
        """Counts that RP reports."""
        return round(self.position) + self.offset if self.motor_on else self.held

    @property
    def free(self) -> int:
        """Free places in the PVT buffer of 255 segments besides the one being executed."""
        return 255 - len(self.fifo)

    def rate(self, name: str) -> float:
        """Return AC, DC or SD [counts per sample squared]."""
        return self.settings[name] / motion.SAMPLES_PER_SECOND**2

    def speed(self, name: str) -> float:
        """Return SP or HV [counts per sample]."""
        return self.settings[name] / motion.SAMPLES_PER_SECOND

    def arm_latch(self) -> None:
        """Wait for the index, and forget the last one."""
        self.latched, self.latch_armed = None, True

    def begin_pvt(self, *, stop_at_once: bool = False) -> None:
        """Start the PVT sequence with the next sample.

        Args:
            stop_at_once: Whether an empty buffer stops it without deceleration.
        """
        self.executed = 0
        deceleration = math.inf if stop_at_once else self.rate("DC")
        self.start(motion.Pvt(self.position, self.fifo, deceleration))

    def begin_jog(self) -> None:
        """Ramp to the speed of JG, from rest or from another jog."""
        speed = self.jog_speed / motion.SAMPLES_PER_SECOND
        pieces = motion.jog(self.velocity, speed, self.rate("AC"), self.rate("DC"))
        self.start(motion.Ramp(self.position, self.velocity, pieces))
        self.jogging = True

    def begin_move(self, distance: float) -> None:
        """Start a trapezoid from rest over a distance [counts]."""
        pieces = motion.trapezoid(distance, self.speed("SP"), self.rate("AC"), self.rate("DC"))
        start = round(self.position)
        self.start(motion.Ramp(self.position, 0.0, pieces, start + distance))

    def increment(self, distance: int) -> None:
        """IP in motion: move the end of a move, or the reference of a jog at once.

        Raises:
            CommandError: The motion is neither, or goes the other way.
        """
        profile = self.profile
        if isinstance(profile, motion.Ramp) and self.jogging:
            self.position += distance
            self.start(profile.moved(distance))
            self.jogging = True
            return
        if not isinstance(profile, motion.Ramp):
            raise CommandError(7)
        if profile.target is None or distance * (profile.target - self.position) < 0:
            raise CommandError(16)
        end = profile.target + distance
        rates = self.rate("AC"), self.rate("DC")
        pieces = motion.trapezoid(end - self.position, self.speed("SP"), *rates, self.velocity)
        self.start(motion.Ramp(self.position, self.velocity, pieces, end))

    def stop(self, code: motion.StopCode, rate: str = "DC") -> None:
        """Decelerate from the present velocity, and clear the PVT buffer."""
        if self.profile is None:
            return
        pieces = motion.brake(self.velocity, self.rate(rate))
        self.start(motion.Ramp(self.position, self.velocity, pieces, code=code))
        self.fifo.clear()

    def halt(self, code: motion.StopCode) -> None:
        """Stop at once, and clear the PVT buffer."""
        if self.profile is not None:
            self.stop_code = code
            self.stopped_at = self.reported
        self.profile = None
        self.jogging = False
        self.velocity = 0.0
        self.fifo.clear()

    def switch_on(self, counts: int) -> None:
        """Power the motor with the reference at the raw encoder's position."""
        self.follow(counts)
        self.motor_on, self.brake_samples = True, 0
        self.weak_samples, self.encoder_failed = 0, False

    def switch_off(self, *, brake_first: bool) -> None:
        """Switch the motor off, after BW's samples if its brake engages first."""
        if self.motor_on:
            self.held = self.reported
            self.brake_samples = int(self.settings["BW"]) if brake_first else 0
        self.motor_on = False

    def follow(self, counts: int) -> None:
        """Set the reference to the raw encoder's position, at rest."""
        self.position, self.velocity = float(counts), 0.0

    def define(self, value: int, counts: int) -> None:
        """DP: make a value the reported position of encoder and reference."""
        self.offset = value - counts
        self.held = value
        self.follow(counts)

    def step(self) -> None:
        """Advance by one sample."""
        position, velocity = self.position, self.velocity
        if self.profile is None:
            self.cubic = (position, 0.0, 0.0, 0.0)
            return
        end, end_velocity = self.profile.step()
        self.position, self.velocity = end, end_velocity
        self.cubic = hermite(position, end - position, velocity, end_velocity)
        self._observe(self.profile)

    def _observe(self, profile: motion.Profile) -> None:
        self.stop_code = profile.code
        if isinstance(profile, motion.Pvt):
            self.executed = profile.executed
        if not profile.done:
            return
        if profile.homes and self.latched is not None:
            self.offset = -round(self.position)
        if profile.code == motion.StopCode.RUNNING:
            self.stop_code = motion.StopCode.AT_TARGET
        self.profile = None
        self.jogging = False
        self.stopped_at = self.reported

    def start(self, profile: motion.Profile) -> None:
        """Start a profile with the next sample."""
        self.profile = profile
        self.jogging = False
        self.stop_code = profile.code
