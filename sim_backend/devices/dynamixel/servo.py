"""One emulated servo: control table, profile and watchdog, in counts of 4096 per turn."""

from sautereau.sim_backend.devices.dynamixel.table import (
    BY_ADDRESS,
    EEPROM_END,
    GOALS,
    ITEMS,
    SIZE,
    Item,
)
from sautereau.sim_backend.devices.emulators import Cubic
from sautereau.sim_backend.devices.setpoint import Setpoint, between, filtered

RANGE, LENGTH, LIMIT, ACCESS = 4, 5, 6, 7
"""Error numbers of a status packet."""
ALERT = 0x80
"""Added to them after a hardware error."""
TIME_BASED = 4
"""Bit of the drive mode: the profile's velocity and acceleration are times in ms."""
TURN = 4096
"""Counts in a turn."""
CENTRE = 2048
_WATCHDOG = 20e-3  # s, its unit
_VELOCITY = 0.229 * TURN / 60  # counts/s, unit of a profile that is not time-based
_ONGOING = 0x02  # bit of the moving status
BANDWIDTH = 100.0
"""1/s, of the position loop, which follows its profile like a critically damped filter of second
order: assumed, since the manual gives gains without units."""


class Servo:
    """A servo at power-up: torque off.

    Args:
        offset: Raw encoder counts at position 0.
        raw: Raw encoder counts now.
        information: Its model information, which a servo may choose.
    """

    def __init__(self, number: int, offset: int, raw: int, information: bytes):
        self.number, self._offset, self.raw = number, offset, raw
        self._values = {name: item.default for name, item in ITEMS.items()}
        self._values["id"] = number
        self._values["model_information"] = int.from_bytes(information, "little")
        self._from = self._goal = self._at = float(raw - offset)
        self._shaft = Setpoint(self._at, 0.0)
        self._elapsed = self._duration = self._rising = 0.0
        self._silent = 0.0
        self.cubic: Cubic = (float(raw), 0.0, 0.0, 0.0)
        """Coefficients of the reference over the sample last ticked, in encoder counts."""

    @property
    def on(self) -> bool:
        """Whether its motor has current."""
        return bool(self._values["torque_enable"])

    @property
    def moving(self) -> bool:
        """Whether it moves, because a profile is in progress or the loop follows it."""
        return self.on and (self._elapsed < self._duration or abs(self._behind) > 0.1)

    @property
    def _behind(self) -> float:
        return self._at - self._shaft.position

    @property
    def watched(self) -> bool:
        """Whether its watchdog runs."""
        return self.on and self._values["bus_watchdog"] > 0

    @property
    def alert(self) -> int:
        """`ALERT` after a hardware error, else 0."""
        return ALERT if self._values["hardware_error_status"] else 0

    def value(self, name: str) -> int:
        """Return the value of an item of the control table."""
        if name == "present_position":
            return self.raw - self._offset + self._values["homing_offset"]
        if name in ("moving", "moving_status"):
            return int(self.moving) * (_ONGOING if name == "moving_status" else 1)
        return self._values[name]

    def read(self, address: int, length: int) -> bytes | int:
        """Return bytes of the control table, or the number of an error."""
        if address not in BY_ADDRESS or address + length > SIZE or length == 0:
            return ACCESS
        table = bytearray(SIZE)
        for name, item in ITEMS.items():
            data = self.value(name).to_bytes(item.size, "little", signed=item.signed)
            table[item.address : item.address + item.size] = data
        return bytes(table[address : address + length])

    def write(self, address: int, data: bytes) -> int:
        """Write items of the control table; return the number of an error, 0 for none."""
        while data:
            name = BY_ADDRESS.get(address)
            if name is None:
                return ACCESS
            item = ITEMS[name]
            if len(data) < item.size:
                return LENGTH
            value = int.from_bytes(data[: item.size], "little", signed=item.signed)
            if error := self._refused(name, item, value):
                return error
            self._set(name, value)
            address, data = address + item.size, data[item.size :]
        return 0

    def _refused(self, name: str, item: Item, value: int) -> int:
        if item.high is None or (item.address < EEPROM_END and self.on):
            return ACCESS
        if not item.low <= value <= item.high:
            return RANGE
        if name in GOALS and self._values["bus_watchdog"] < 0:
            return RANGE
        low, high = self._values["min_position_limit"], self._values["max_position_limit"]
        if name == "goal_position" and self._values["operating_mode"] == 3:
            return 0 if low <= value <= high else LIMIT
        return 0

    def _set(self, name: str, value: int) -> None:
        before = self._values[name]
        self._values[name] = value
        if name == "torque_enable" and value != before:
            self._from = self._goal = self._at = float(self.raw - self._offset)
            self._elapsed = self._duration = self._silent = 0.0
            self._shaft = Setpoint(self._at, 0.0)
            self._values["goal_position"] = self.value("present_position")
            if value and self._values["hardware_error_status"]:
                self._values["torque_enable"] = 0  # only a reboot resets it
        elif name == "goal_position":
            self._plan(float(value - self._values["homing_offset"]))

    def _plan(self, goal: float) -> None:
        """Start a profile from where the last one is; without a velocity it is a step."""
        velocity = self._values["profile_velocity"]
        self._from, self._goal, self._elapsed = self._at, goal, 0.0
        if self._values["drive_mode"] & TIME_BASED:
            self._duration = velocity * 1e-3
            rising = self._values["profile_acceleration"] * 1e-3
            self._rising = min(rising, self._duration / 2)
        else:
            away = abs(goal - self._at)
            self._duration = away / (velocity * _VELOCITY) if velocity else 0.0
            self._rising = 0.0

    def hear(self) -> None:
        """Note an instruction packet on the bus."""
        self._silent = 0.0

    def shut_down(self, bits: int) -> None:
        """Switch the torque off for a hardware error, such as overload (0x20)."""
        self._values |= {"hardware_error_status": bits, "torque_enable": 0}

    def reboot(self) -> None:
        """Switch off and on; the EEPROM keeps its values."""
        ram = {n: item.default for n, item in ITEMS.items() if item.address >= EEPROM_END}
        self._values |= ram

    def sample(self, raw: int, home: int, period: float, *, watching: bool) -> None:
        """Do one sample of the bench; see `StreamedAxis`."""
        self.raw = raw
        if watching:
            self._watch(period)
        self._step(period)

    def _watch(self, period: float) -> None:
        """Advance the watchdog by a sample [s]; where it runs out, the servo stops there."""
        self._silent += period
        if self.watched and self._silent > self._values["bus_watchdog"] * _WATCHDOG:
            self._values["bus_watchdog"] = -1
            self._goal, self._duration = self._at, 0.0

    def _step(self, period: float) -> None:
        """Advance the profile by a sample [s]."""
        if not self.on:
            self.cubic = (float(self.raw), 0.0, 0.0, 0.0)
            return
        before = self._shaft
        self._elapsed += period
        self._at = self._from + self._part(self._elapsed) * (self._goal - self._from)
        self._shaft, _ = filtered(before, Setpoint(self._at, 0.0), BANDWIDTH, period)
        self.cubic = between(before, self._shaft, 1.0, self._offset, period)

    def _part(self, elapsed: float) -> float:
        """Return the fraction of the profile's way that is done, a trapezium of velocity."""
        whole, rising = self._duration, self._rising
        if elapsed >= whole:
            return 1.0
        if rising <= 0:
            return elapsed / whole
        top = 1 / (whole - rising)
        if elapsed < rising:
            return top * elapsed**2 / (2 * rising)
        if elapsed < whole - rising:
            return top * (elapsed - rising / 2)
        return 1 - top * (whole - elapsed) ** 2 / (2 * rising)
