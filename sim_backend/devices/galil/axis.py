"""One axis of the controller: its settings, its reference, and its state."""

from collections import deque
from dataclasses import dataclass

from sautereau.sim_backend.devices.galil.motion import (
    FIFO_LENGTH,
    SAMPLES_PER_SECOND,
    Profile,
    Pvt,
    Ramp,
    Segment,
    StopCode,
    brake,
    jog,
    trapezoid,
)

AXES = "AB"
LARGEST = 2**31 - 1
"""Counts, the end of the controller's 32-bit positions."""


@dataclass(frozen=True)
class Setting:
    """A number stored for an axis: the command `SP 1000`, the operand `_SPA`."""

    default: float
    low: float
    high: float
    step: float = 0.0
    """The controller rounds down to a multiple of this; 0 keeps the fraction."""


SETTINGS = {
    "SP": Setting(25_000, 0, 22_000_000, 2),
    "AC": Setting(256_000, 1024, 1_073_740_800, 1024),
    "DC": Setting(256_000, 1024, 1_073_740_800, 1024),
    "ER": Setting(16_384, -1, LARGEST, 1),
    "OE": Setting(0, 0, 1, 1),
    "FL": Setting(LARGEST, -LARGEST - 1, LARGEST, 1),
    "BL": Setting(-LARGEST - 1, -LARGEST - 1, LARGEST, 1),
    "TL": Setting(9.9982, 0, 9.9982),
    "OF": Setting(0, -9.9982, 9.9982),
    "KP": Setting(6, 0, 1023.875),
    "KI": Setting(0, 0, 255.999),
    "KD": Setting(64, 0, 4095.875),
}
"""SP counts/s, AC and DC counts/s^2, ER counts (negative: no limit), FL and BL counts,
TL and OF volts."""


class Axis:
    """Reference of one axis, in the raw encoder's counts; power-up state is motor off.

    Args:
        counts: Raw encoder counts at power-up.
    """

    def __init__(self, counts: int) -> None:
        self.settings = {name: setting.default for name, setting in SETTINGS.items()}
        self.motor_on = False
        self.position, self.velocity = float(counts), 0.0
        """Raw reference at the end of the sample last ticked: counts, counts per sample."""
        self.offset = 0
        """Counts, reported positions minus raw ones."""
        self.auxiliary = 0
        """Counts of the auxiliary encoder, which does not move."""
        self.stop_code = StopCode.AT_TARGET
        self.fifo: deque[Segment] = deque()
        self.executed = 0
        """PVT segments executed since the last BT."""
        self.mode = "PR"
        """Which of PA, PR, JG and HM the next BG starts."""
        self.target = 0
        """Counts, operand of PA or PR; counts/s of JG."""
        self.profile: Profile | None = None
        self.jogging = self.homing = False
        self.cubic = (self.position, 0.0, 0.0, 0.0)
        """Reference over the sample last ticked: coefficients of 1, f, f^2, f^3."""

    @property
    def reported(self) -> int:
        """Counts, the reference in the host's frame."""
        return round(self.position) + self.offset

    @property
    def free(self) -> int:
        """Free places in the PVT buffer."""
        return FIFO_LENGTH - len(self.fifo)

    def begin_pvt(self) -> None:
        """Start the PVT sequence with the next sample."""
        self.executed = 0
        self._start(Pvt(self.position, self.fifo, self._rate("DC")))

    def begin_jog(self) -> None:
        """Ramp to the speed of JG, from rest or from another jog."""
        pieces = jog(
            self.velocity, self.target / SAMPLES_PER_SECOND, self._rate("AC"), self._rate("DC")
        )
        self._start(Ramp(self.position, self.velocity, pieces, StopCode.RUNNING))
        self.jogging = True

    def begin_move(self, target: float, *, home: bool = False) -> None:
        """Start a trapezoid from rest to ``target`` [raw counts]; ``home`` makes that 0."""
        speed = self.settings["SP"] / SAMPLES_PER_SECOND
        pieces = trapezoid(target - self.position, speed, self._rate("AC"), self._rate("DC"))
        self._start(Ramp(self.position, 0.0, pieces, StopCode.RUNNING, target))
        self.homing = home

    def stop(self, code: StopCode) -> None:
        """Decelerate from the present velocity at DC, and clear the PVT buffer."""
        if self.profile is None:
            return
        pieces = brake(self.velocity, self._rate("DC"))
        self._start(Ramp(self.position, self.velocity, pieces, code))
        self.fifo.clear()

    def halt(self, code: StopCode) -> None:
        """Stop at once, and clear the PVT buffer."""
        if self.profile is not None:
            self.stop_code = code
        self.profile = None
        self.jogging = self.homing = False
        self.velocity = 0.0
        self.fifo.clear()

    def follow(self, counts: int) -> None:
        """Set the reference to the raw encoder's position, at rest."""
        self.position, self.velocity = float(counts), 0.0

    def exceeds_error_limit(self, counts: int) -> bool:
        """Return whether the distance of raw encoder and reference exceeds ER."""
        return 0 <= self.settings["ER"] < abs(self.position - counts)

    def step(self) -> None:
        """Advance by one sample."""
        position, velocity = self.position, self.velocity
        if self.profile is None:
            self.cubic = (position, 0.0, 0.0, 0.0)
            return
        end, end_velocity = self.profile.step()
        self.position, self.velocity = end, end_velocity
        distance = end - position
        self.cubic = (
            position,
            velocity,
            3 * distance - 2 * velocity - end_velocity,
            velocity + end_velocity - 2 * distance,
        )
        self._observe(self.profile)

    def _observe(self, profile: Profile) -> None:
        self.stop_code = profile.code
        if isinstance(profile, Pvt):
            self.executed = profile.executed
        if profile.done:
            if self.homing:
                self.offset = -round(self.position)
                self.mode, self.target = "PA", 0
                self.stop_code = StopCode.HOMED
            elif profile.code == StopCode.RUNNING:
                self.stop_code = StopCode.AT_TARGET
            self.profile = None
            self.jogging = self.homing = False
        elif self.stop_code not in (StopCode.FORWARD_LIMIT, StopCode.REVERSE_LIMIT):
            reported = self.position + self.offset
            if self.velocity > 0 and reported > self.settings["FL"]:
                self.stop(StopCode.FORWARD_LIMIT)
            elif self.velocity < 0 and reported < self.settings["BL"]:
                self.stop(StopCode.REVERSE_LIMIT)

    def _start(self, profile: Profile) -> None:
        self.profile = profile
        self.jogging = self.homing = False
        self.stop_code = profile.code

    def _rate(self, name: str) -> float:
        return self.settings[name] / SAMPLES_PER_SECOND**2
