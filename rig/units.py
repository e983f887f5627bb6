"""Quantities with units, read and written, and the base class of the tables that hold them.

Inside the program all floats are SI.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

_NUMBER_AND_UNIT = re.compile(
    r"\s*([+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL
)

LONGEST_UNIT = 60  # Characters of a unit
_PREFIXES = ("p", "n", "µ", "m", "", "k", "M", "G")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_EXPONENT = re.compile(r"(?:\*\*|\^)\s*([+-]?\d{1,2}(?![\d.eE]|\s*(?:\*\*|\^)))?")


@cache
def _registry():
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


@lru_cache(maxsize=1024)
def _unit(text: str):
    """Return pint's unit of a text; half of the time to load a rig without the cache.

    Pint would compute any exponent, however large, so only numbers of two digits are allowed.
    """
    if len(text) > LONGEST_UNIT or any(not m[1] for m in _EXPONENT.finditer(text)):
        raise ValueError("too long, or an exponent is not a number of at most two digits")
    unit = _registry().parse_units(text)
    _ = unit.dimensionality  # raises for a product with a logarithmic unit
    return unit


@lru_cache(maxsize=4096)
def parse_quantity(text: str, unit: str) -> float:
    """Read a quantity such as ``"14 mm"`` and return its value in ``unit``.

    Args:
        text: Number and unit.
        unit: SI unit of the result, as pint spells it; ``"rad"`` demands an angle.

    Raises:
        ValueError: The text is not a number with a unit, not of that dimension (where an angle
            counts as a dimension), or not finite.
    """
    parts = _NUMBER_AND_UNIT.fullmatch(text)
    if parts is None:
        raise ValueError(f"{shown(text)} is not a number with a unit")
    number = float(parts[1])
    # Recordings hold SI: to read them does not need pint, which takes a third of a second to load.
    value = number if parts[2] == unit else _converted(text, number, parts[2], unit)
    if not math.isfinite(value):
        raise ValueError(f"{shown(text)} is not finite")
    return value


def _converted(text: str, number: float, written: str, unit: str) -> float:
    registry = _registry()
    try:
        given = _unit(written)
    except Exception as error:  # pint raises many kinds, the tokenizer's too
        raise ValueError(f"{shown(text)} is not a number with a unit") from error
    target = _unit(unit)
    if unit and not written:
        raise ValueError(f"{shown(text)} has no unit")
    if given.dimensionality != target.dimensionality:
        dimension = f"has the dimension {given.dimensionality}"
        raise ValueError(f"{shown(text)} {'is a ratio' if given.dimensionless else dimension}")
    # Angles are dimensionless in pint, so 6 Hz would be accepted as 6 rad/s.
    _, root = registry.get_root_units(target)
    if registry.get_root_units(given)[1] != root:
        has = "no" if "radian" in str(root) else "an"
        raise ValueError(f"{shown(text)} has {has} angle in its unit")
    return float(registry.Quantity(number, given).to(target).magnitude)


def format_quantity(value: float, unit: str) -> str:
    """Write an SI value so that `parse_quantity` gives back the same float."""
    return f"{value!r} {unit}".strip()


def readable_quantity(value: float, unit: str) -> str:
    """Write an SI value with a readable unit, to six digits: 171 mm, 2.9 GPa, 0.0007 kg·m².

    A product of units has no prefix. Pint, which could write it, takes a third of a second to load.
    """
    prefix = ""
    if unit.isidentifier() and value:
        value, unit = (value * 1e3, "g") if unit == "kg" else (value, unit)
        thousands = min(max(math.floor(math.log10(abs(value)) / 3), -4), 3)
        value, prefix = value / 1e3**thousands, _PREFIXES[thousands + 4]
    digits, _, exponent = f"{value:.6g}".partition("e")
    if exponent:
        digits += f"×10**{int(exponent)}"
    text = f"{digits} {prefix}{unit}".strip()
    raised = re.sub(r"\*\*(-?\d+)", lambda power: power[1].translate(_SUPERSCRIPTS), text)
    return raised.replace("*", "·")


def shown(value: object) -> str:
    """Return a value as messages show it, shortened to 60 characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer with more digits than Python prints
        return "a number too long to print"
    return text if len(text) <= 60 else f"{text[:57]}..."


@dataclass(frozen=True)
class Unit:
    """Annotation of a float field: its SI unit, written as a quantity in TOML."""

    name: str
    example: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._read, handler(source))

    def _read(self, value: object) -> object:
        return _read(value, self.name, self.example)


@dataclass(frozen=True)
class UnitBy:
    """Annotation of a float field whose SI unit follows from another field of its table."""

    field: str
    """Name of that field, which stands before this one."""
    names: Callable[[], list[str]]
    """Returns all values that the other field may have."""
    unit: Callable[[str], Unit]
    """Returns the unit that follows from one of them; raises where it is none of them."""

    @property
    def name(self) -> str:
        """All units that there are: `m/s/V, N/V`."""
        return ", ".join(dict.fromkeys(self.unit(name).name for name in self.names()))

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_before_validator_function(self._read, handler(source))

    def _read(self, value: object, info: ValidationInfo) -> object:
        if self.field not in info.data:
            return 1.0  # the other field is refused, and the table with it
        unit = self.unit(info.data[self.field])
        return _read(value, unit.name, unit.example)


def _read(value: object, unit: str, example: str) -> object:
    """Return the SI value of a quantity in TOML; a float inside a model is refused."""
    try:
        if isinstance(value, str):
            return parse_quantity(value, unit)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        raise ValueError(f"{shown(value)} {'has no unit' if number else 'is not a quantity'}")
    except ValueError as error:
        raise PydanticCustomError(
            "quantity",
            '{fault}; give a quantity in {unit} such as "{example}"',
            {"fault": str(error), "unit": unit, "example": example},
        ) from error


GRAVITY = 9.80665  # m/s^2, standard acceleration of gravity

Length = Annotated[float, Unit("m", "14 mm")]
Mass = Annotated[float, Unit("kg", "6 g")]
Force = Annotated[float, Unit("N", "20 mN")]
Angle = Annotated[float, Unit("rad", "30 deg")]
Time = Annotated[float, Unit("s", "10 ms")]
Frequency = Annotated[float, Unit("Hz", "22 kHz")]
Voltage = Annotated[float, Unit("V", "4 V")]
Current = Annotated[float, Unit("A", "2 mA")]
Moment = Annotated[float, Unit("N*m", "4 mN m")]
Inertia = Annotated[float, Unit("kg*m**2", "7e-4 kg m^2")]


def _replaced(node: Any, values: Mapping[str, Any]) -> Any:
    """Return a table, an array of tables or a value with other values by dotted key."""
    if "" in values:
        return values[""]
    parts: dict[str, dict[str, Any]] = {}
    for key, value in values.items():
        part, _, inner = key.partition(".")
        parts.setdefault(part, {})[inner] = value
    if isinstance(node, tuple):
        return tuple(
            _replaced(n, parts[str(k)]) if str(k) in parts else n for k, n in enumerate(node)
        )
    return node.model_copy(update={k: _replaced(getattr(node, k), v) for k, v in parts.items()})


class Section(BaseModel):
    """A table of the rig file: frozen, no unknown keys, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def replaced(self, values: Mapping[str, Any]) -> Self:
        """Return a copy with other SI values by dotted key, unchecked: ``{"press.jack_speed": 1}``.

        `sautereau.rig.load.with_values` checks them, which takes milliseconds.
        """
        return _replaced(self, values)
