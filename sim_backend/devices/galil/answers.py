"""What the controller answers: refused commands, the error codes of TC, and numbers as texts."""

import re
from collections.abc import Sequence

TEXTS = {
    0: "",
    1: "Unrecognized command",
    2: "Command only valid from program",
    3: "Command not valid in program",
    4: "Operand error",
    5: "Input buffer full",
    6: "Number out of range",
    7: "Command not valid while running",
    8: "Command not valid while not running",
    9: "Variable error",
    10: "Empty program line or undefined label",
    11: "Invalid label or line number",
    12: "Subroutine more than 16 deep",
    13: "JG only valid when running in jog mode",
    16: "IP incorrect sign during position move or IP given during forced deceleration",
    17: "ED, BN and DL not valid while program running",
    19: "Application strand already executing",
    20: "Begin not valid with motor off",
    21: "Begin not valid while running",
    22: "Begin not possible due to Limit Switch",
    24: "Begin not valid because no sequence defined",
    32: "Segment buffer full",
    39: "No time specified",
    50: "Not enough fields",
    52: 'Missing " or string too long',
    53: "Error in {}",
    55: "Missing [ or []",
    56: "Array index invalid or out of range",
    57: "Bad function or array",
    58: "Bad command response",
    59: "Mismatched parentheses",
    60: "Download error - line too long or too many lines",
    61: "Duplicate or bad label",
    62: "Too many labels",
    63: "IF statement without ENDIF",
    66: "Array space full",
    67: "Too many arrays or variables",
    80: "Record mode already running",
    81: "No array or source specified",
    82: "Undefined Array",
    83: "Not a valid number",
    84: "Too many elements",
    90: "Only A B C D valid operand",
    106: "Privilege Violation",
    123: "TCP lost sync",
    135: "Motor must be in MO",
    136: "Invalid Password",
    137: "Invalid lock setting",
    138: "Passwords not identical",
    141: "Feature not supported",
}
"""Texts of the error codes that occur, in the command reference's words."""


class CommandError(Exception):
    """A refused command: the controller answers ``?`` and keeps the code for TC.

    Args:
        code: Key of `TEXTS`.
    """

    def __init__(self, code: int) -> None:
        super().__init__(f"{code} {TEXTS[code]}")
        self.code = code


_FORMAT = re.compile(r"([FZ$])(-?[0-9]{1,2})(?:\.([0-9]{1,2}))?")


class Unended(str):
    """An answer after which no line ends, as MG's {N} has it."""

    __slots__ = ()


def write_line(answer: str) -> str:
    """Write an answer with its line end."""
    return answer if isinstance(answer, Unended) else answer + "\r\n"


def write_number(value: float, decimals: int = 4) -> str:
    """Write a number with a blank for the plus sign and without leading zeros."""
    text = f"{value: .{decimals}f}"
    return text if float(text) or not text.startswith("-") else " " + text[1:]


def write_list(values: Sequence[float], decimals: int = 0) -> str | None:
    """Write the answer of a command that reports one number per axis; None for no numbers."""
    return ",".join(write_number(value, decimals) for value in values) or None


def write_in(value: float, places: int, decimals: int, *, zeros: bool) -> str:
    """Write a number with limited digits, as VF, PF, and MG's formats give them.

    Args:
        value: Any number; beyond the digits the largest number that they hold is written.
        places: Digits before the point; negative for a hexadecimal number.
        decimals: Digits after the point.
        zeros: Whether leading zeros are written.
    """
    if places < 0:
        half = 16**-places // 2 * 65536
        digits = max(-half, min(half - 1, int(value * 65536))) % (2 * half)
        text = f"{digits >> 16:0{-places}X}"
        return f"${text}" + (f".{digits & 0xFFFF:04X}"[: 1 + decimals] if decimals else "")
    largest = 10**places - 10**-decimals
    value = min(largest, max(-largest, value))
    text = f"{abs(value):.{decimals}f}"
    width = places + (decimals + 1 if decimals else 0)
    sign = "-" if value < 0 and float(text) else " "
    return sign + (text.rjust(width, "0") if zeros else text)


def write_as(value: float, form: str) -> str:
    """Write a number in one of MG's formats: F5.2, Z5.2, $8.0 or S4.

    Raises:
        CommandError: There is no such format.
    """
    if found := re.fullmatch(r"S([1-6])?(?:\.0)?", form):
        octets = int(value * 65536) & 0xFFFFFFFFFFFF
        return octets.to_bytes(6, "big").decode("latin-1")[: int(found[1] or 6)].rstrip("\0")
    found = _FORMAT.fullmatch(form)
    if found is None:
        raise CommandError(53)
    places, decimals = int(found[2]), int(found[3] or 0)
    return write_in(value, -places if found[1] == "$" else places, decimals, zeros=found[1] == "F")
