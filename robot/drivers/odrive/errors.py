"""The error properties of an ODrive, and the names of their bits.

errors.csv has them as `Firmware/odrive-interface.yaml` of odriverobotics/ODrive, tag fw-v0.5.6,
where flags without a `bit` follow the one before them.
"""

from sautereau.rig.packaged import table_beside

DEVICE = "error"  # Property of the device; those below are an axis's
CUT = 9  # Characters to which the firmware cuts a value: an error of so many digits may be longer
_BITS: dict[str, dict[int, str]] = {}
"""Names by number of the bit, by property; `axis` stands for `axis0` and `axis1`."""
for _property, _bit, _name in table_beside(__file__):
    _BITS.setdefault(_property, {})[int(_bit)] = _name
OF_AXIS = tuple(name.removeprefix("axis.") for name in _BITS if name != DEVICE)
"""Names of an axis's properties."""


def error_names(register: str, digits: str) -> str:
    """Return the names of the bits that are set, empty for none.

    Args:
        register: `DEVICE`, or one of `OF_AXIS` with `axis.` before it.
        digits: The value as the controller has sent it.

    Raises:
        ValueError: It is not a number.
    """
    value = int(digits)
    if not value:
        return ""
    if len(digits) >= CUT:  # which bits are set cannot be known
        return f"an error whose number begins with {digits}; `dump_errors(odrv0)` in odrivetool"
    bits = _BITS[register]
    names = [name for bit, name in bits.items() if value >> bit & 1]
    if unknown := value & ~sum(1 << bit for bit in bits):
        names.append(f"0x{unknown:x}")
    return ", ".join(names)
