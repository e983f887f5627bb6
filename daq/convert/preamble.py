"""Lines before the rows of a text table: keys with values, and the units in them."""

import re
from collections.abc import Sequence

from sautereau.daq.convert.text import kind_of, number_in
from sautereau.rig.units import parse_quantity

PER = r"[ .·*]s(\^|\*\*)?-1|[ .·*]s⁻¹"  # mm s-1, mm·s⁻¹
UNIT = re.compile(rf"[^\W\d_]{{1,20}}(\^?[23]|[²³])?(/[^\W\d_]{{1,20}}(\^?[23]|[²³])?|{PER})?")
"""Spelling of a unit in a file; a longer text is not a unit."""
MEASURED_IN = ("V", "s", "m/s", "N", "m", "Hz")  # Dimensions of the units that are recognised
COMMENT = re.compile(r"[#%;\s]*")
"""What is before the key in a line of a preamble."""
SIGN = re.compile(r"[=:,;\t]")  # The sign after it
LETTER = re.compile(r"[^\W\d_]")
ROWS = (
    "record length",
    "data count",
    "data quantity",
    "segmentsize",
    "points",
    "samples",
    "number of points",
    "number of samples",
    "sample count",
)
"""Keys, in lower case, of a preamble's number of rows."""
INTERVALS = ("sample interval", "sampling interval", "sample period", "sampling period")
RATES = ("sample rate", "sampling rate", "sample frequency", "sampling frequency")
VALUE = re.compile(r"([-+.\d,]+(?:[eE][-+]?\d+)?)\s*(.*)", re.ASCII)
COUNTED = re.compile(r"(?:pts?|points|sa|samples|rows)?", re.IGNORECASE)
"""Units of a number of rows."""
PER_SECOND = re.compile(r"(?:sa|samples|s)/s(?:ec)?|sps", re.IGNORECASE)
"""Spellings of Hz, without their prefix."""


def value_in(text: str, unit: str) -> float | None:
    """Return a quantity in an SI unit, None if it has another dimension; NI writes Volts."""
    text = re.sub(f"({PER})$", "/s", text)
    for spelling in (text, text.lower()):
        try:
            return parse_quantity(spelling, unit)
        except ValueError:
            continue
    return None


def is_unit(text: str) -> bool:
    """Return whether a text is a unit that sensors, clocks or cards use."""
    return UNIT.fullmatch(text) is not None and any(
        value_in(f"1 {text}", unit) is not None for unit in MEASURED_IN
    )


class Preamble:
    """The values of each key, in lower case, of `key,value`, `key = value` and `key: value`."""

    def __init__(self, lines: list[str], delimiter: str, decimal: str):
        """Read the lines of a file whose table has this delimiter and decimal sign."""
        self._decimal = decimal
        self._found: dict[str, tuple[str, list[str]]] = {}
        self.unread: list[str] = []
        """Lines with a known key whose value is not understood."""
        for line in lines:
            # In steps, as one expression for all of it would take a long line's length cubed.
            pair = COMMENT.sub("", line.replace('"', ""), count=1)
            match = SIGN.search(pair)
            if match is None or not LETTER.search(key := pair[: match.start()].strip()):
                continue
            sign, rest = match[0], pair[match.end() :].lstrip()
            parts = rest.split(delimiter if sign in "=:" else sign)
            texts = [key, *(text.strip() for text in parts)]
            for place in (0, 2):  # LeCroy writes two pairs in a line
                if len(texts) > place + 1 and kind_of(texts[place], self._decimal) == "x":
                    self._found.setdefault(texts[place].lower(), (line.strip(), texts[place + 1 :]))

    def texts(self, key: str) -> list[str]:
        """Return the values of a key, without the name of the channel before them."""
        _, values = self._found.get(key, ("", []))
        return [value.rpartition(":")[2].strip() for value in values]

    def quantity(self, keys: Sequence[str], unit: str) -> float | None:
        """Return the value above 0 of the first of these keys that has one, in an SI unit."""
        for key in keys:
            for number, written in self._value(key):
                name = PER_SECOND.sub("Hz", written)
                value = value_in(f"{number!r} {name}", unit) if name else number
                if value is not None and 0 < value < float("inf"):
                    return value
                self.unread.append(self._found[key][0])
        return None

    def count(self) -> int | None:
        """Return the number of rows that is stated."""
        for key in ROWS:
            for number, written in self._value(key):
                if COUNTED.fullmatch(written) and 0 < number < 1e18:
                    return round(number)
                self.unread.append(self._found[key][0])
        return None

    def _value(self, key: str) -> list[tuple[float, str]]:
        """Return the number and the unit of a key, if the file has it and they are understood."""
        if key not in self._found:
            return []
        line, values = self._found[key]
        text = self.texts(key)[0]
        match = VALUE.fullmatch(text)
        parted = "," in line and len(values) > 1 and re.fullmatch(r"\d{3}\b.*", values[1])
        number = None if match is None or parted else number_in(match[1], self._decimal)
        if match is None or number is None:
            self.unread.append(line)
            return []
        return [(number, match[2])]
