"""The bus of Dynamixel servos: the vendor's packets of Protocol 2.0 over a port of ours.

Registers are those of the X series, by ROBOTIS's e-Manual, page `dxl/x/xm430-w350`, headings
Control Table of EEPROM Area and Control Table of RAM Area.
"""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from sautereau.robot.drivers.serial_port import Port, Wire
from sautereau.robot.errors import GarbledAnswer, RobotError, SettingNotTaken
from sautereau.trajectory.segments import Counts

SERVOS = (1, 2)
"""IDs of the servos of joints 1 and 2."""


class Item(NamedTuple):
    """An entry of the control table."""

    name: str
    address: int
    size: int
    """Bytes."""
    signed: bool = False


MODEL_NUMBER = Item("Model Number", 0, 2)
MODEL_INFORMATION = Item("Model Information", 2, 4)
FIRMWARE_VERSION = Item("Firmware Version", 6, 1)
DRIVE_MODE = Item("Drive Mode", 10, 1)
OPERATING_MODE = Item("Operating Mode", 11, 1)
HOMING_OFFSET = Item("Homing Offset", 20, 4, True)
MAX_POSITION_LIMIT = Item("Max Position Limit", 48, 4)
MIN_POSITION_LIMIT = Item("Min Position Limit", 52, 4)
TORQUE_ENABLE = Item("Torque Enable", 64, 1)
HARDWARE_ERROR_STATUS = Item("Hardware Error Status", 70, 1)
BUS_WATCHDOG = Item("Bus Watchdog", 98, 1, True)
PROFILE_ACCELERATION = Item("Profile Acceleration", 108, 4)
PROFILE_VELOCITY = Item("Profile Velocity", 112, 4)
GOAL_POSITION = Item("Goal Position", 116, 4, True)
MOVING = Item("Moving", 122, 1)
PRESENT_POSITION = Item("Present Position", 132, 4, True)
WAIT = Item("wait", 1000, 4)
HOLD = Item("hold", 1004, 1)
"""The last two are items of the stand-in only, see docs/decisions/0006."""

_ALERT = 0x80  # of the error byte: see Hardware Error Status
_REASONS = {
    1: "it failed",
    2: "it does not know the instruction",
    3: "the packet was corrupted",
    4: "the value is out of range, or the bus watchdog has run out",
    5: "the data are too short",
    6: "the value is outside its limits",
    7: "the register cannot be accessed, or is locked while the torque is on",
}
"""Error numbers, by the e-Manual, page `dxl/protocol2`, heading Error."""


class _Bus:
    """A port as the vendor's packet handler uses it."""

    def __init__(self, port: Port, timeout: float):
        self.is_using = False
        self._port, self._timeout, self._end = port, timeout, 0.0

    def clearPort(self) -> None:  # noqa: N802 - the vendor's names
        self._port.reset_input_buffer()

    def readPort(self, length: int) -> bytes:  # noqa: N802
        return self._port.read(length) or b""

    def writePort(self, packet: Sequence[int]) -> int:  # noqa: N802
        self._port.write(bytes(packet))
        return len(packet)

    def setPacketTimeout(self, _length: int) -> None:  # noqa: N802
        self._end = time.monotonic() + self._timeout

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return time.monotonic() > self._end


class DynamixelLine(Wire):
    """Reads and writes registers of both servos, from several threads.

    Arguments as for `Wire`.

    Raises:
        RobotError: The vendor's package is not installed.
    """

    def __init__(self, port: Port, name: str, timeout: float):
        super().__init__(port, name, timeout)
        try:
            from dynamixel_sdk import COMM_RX_TIMEOUT, COMM_SUCCESS, PacketHandler
        except ImportError as error:
            raise RobotError(
                "controller: Dynamixel servos need the vendor's package: pip install"
                " 'sautereau[servos]'"
            ) from error
        self._success, self._no_answer = COMM_SUCCESS, COMM_RX_TIMEOUT
        self._packets: Any = PacketHandler(2.0)
        self._bus = _Bus(port, timeout)
        self._lock = threading.RLock()

    def read(self, item: Item) -> Counts:
        """Read a register of both servos at once; shape (2,).

        Raises:
            RobotError: As `write`.
        """
        asked = f"read {item.name}({item.address})"
        with self._exchange(asked):
            result = self._packets.syncReadTx(
                self._bus, item.address, item.size, list(SERVOS), len(SERVOS), False
            )
            self._check(asked, 0, result, 0)
            values = []
            for servo in SERVOS:
                data, result, error = self._packets.readRx(self._bus, servo, item.size)
                self._check(asked, servo, result, error)
                if len(data) != item.size:
                    raise GarbledAnswer(
                        f"servo {servo} on {self.name} answered {asked!r} with {len(data)} bytes"
                        f" instead of {item.size}; check the cable, then connect() again"
                    )
                values.append(int.from_bytes(bytes(data), "little", signed=item.signed))
        return np.array(values, dtype=np.int64)

    def write(self, item: Item, values: Sequence[int] | Counts) -> None:
        """Write a register of each servo, acknowledged.

        Raises:
            SilentController: No answer within the timeout.
            GarbledAnswer: A corrupted one.
            SettingNotTaken: The servo refuses it, or reports a hardware error.
            LineLost: The port has gone away.
        """
        for servo, value in zip(SERVOS, values, strict=True):
            self.write_one(servo, item, int(value))

    def write_one(self, servo: int, item: Item, value: int) -> None:
        """Write a register of one servo, as `write`."""
        asked = f"write {value} to {item.name}({item.address})"
        data = list(value.to_bytes(item.size, "little", signed=item.signed))
        with self._exchange(asked):
            result, error = self._packets.writeTxRx(self._bus, servo, item.address, item.size, data)
            self._check(asked, servo, result, error)

    def say(self, item: Item, values: Sequence[int] | Counts) -> None:
        """Write a register of both servos at once, which they do not acknowledge."""
        data: list[int] = []
        for servo, value in zip(SERVOS, values, strict=True):
            data += [servo, *int(value).to_bytes(item.size, "little", signed=item.signed)]
        asked = f"write {item.name}({item.address})"
        with self._exchange(asked):
            result = self._packets.syncWriteTxOnly(
                self._bus, item.address, item.size, data, len(data)
            )
            self._check(asked, 0, result, 0)

    def set(self, item: Item, values: Sequence[int] | Counts) -> None:
        """Write a register of both servos where it differs, and read it back.

        The EEPROM wears out by being written.
        """
        due = np.asarray(values)
        if (self.read(item) != due).any():
            self.write(item, due)
            if ((found := self.read(item)) != due).any():
                raise SettingNotTaken(
                    f"controller on {self.name}: {item.name}({item.address}) is {found[0]} and"
                    f" {found[1]} and should be {due[0]} and {due[1]}; check the servos' model"
                )

    @contextmanager
    def _exchange(self, asked: str) -> Iterator[None]:
        """Use the bus in the block, whatever an earlier exchange has left."""
        with self._lock, self._reaching(asked):
            self._bus.is_using = False
            yield

    def _check(self, asked: str, servo: int, result: int, error: int) -> None:
        """Refuse an exchange that failed."""
        who = f"servo {servo} on {self.name}" if servo else f"bus on {self.name}"
        if result == self._no_answer:
            raise self._silence(f"{asked} of servo {servo}", "")
        if result != self._success:
            text = self._packets.getTxRxResult(result)
            raise GarbledAnswer(
                f"{who}, {asked}: {text}; check the cable, and that no two servos have one ID"
            )
        if number := error & ~_ALERT:
            raise SettingNotTaken(
                f"{who} refused {asked!r}: {_REASONS.get(number, f'error {number}')}; compare the"
                " rig file with the servo's control table"
            )
