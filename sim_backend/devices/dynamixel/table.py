"""The control table of an XM430-W350, as far as it is emulated.

After ROBOTIS's e-Manual, page `dxl/x/xm430-w350`, headings Control Table of EEPROM Area, Control
Table of RAM Area, and that of each item.
"""

from typing import NamedTuple


class Item(NamedTuple):
    """An entry of the table."""

    address: int
    size: int
    """Bytes."""
    default: int
    low: int = 0
    high: int | None = None
    """Range of a value that is written; None for an item that is only read."""
    signed: bool = False


EEPROM_END = 64
"""Items below this address are locked while the torque is on."""
SIZE = 147
"""Bytes of the table, without the indirect addresses."""
ITEMS = {
    "model_number": Item(0, 2, 1020),
    "model_information": Item(2, 4, 0),
    "firmware_version": Item(6, 1, 45),
    "id": Item(7, 1, 1, 0, 252),
    "return_delay_time": Item(9, 1, 250, 0, 254),
    "drive_mode": Item(10, 1, 0, 0, 13),
    "operating_mode": Item(11, 1, 3, 0, 16),
    "homing_offset": Item(20, 4, 0, -1_044_479, 1_044_479, True),
    "current_limit": Item(38, 2, 1193, 0, 1193),
    "velocity_limit": Item(44, 4, 350, 0, 1023),
    "max_position_limit": Item(48, 4, 4095, 0, 4095),
    "min_position_limit": Item(52, 4, 0, 0, 4095),
    "shutdown": Item(63, 1, 52, 0, 255),
    "torque_enable": Item(64, 1, 0, 0, 1),
    "hardware_error_status": Item(70, 1, 0),
    "bus_watchdog": Item(98, 1, 0, -1, 127, True),
    "goal_velocity": Item(104, 4, 0, -1023, 1023, True),
    "profile_acceleration": Item(108, 4, 0, 0, 32_767),
    "profile_velocity": Item(112, 4, 0, 0, 32_767),
    "goal_position": Item(116, 4, 0, -1_048_575, 1_048_575, True),
    "moving": Item(122, 1, 0),
    "moving_status": Item(123, 1, 0),
    "present_position": Item(132, 4, 0, signed=True),
}
BY_ADDRESS = {item.address: name for name, item in ITEMS.items()}
GOALS = ("goal_velocity", "goal_position")
"""Locked after the bus watchdog has run out."""
