"""Reading and writing quantities with units; inside the program all floats are SI."""

import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

_NUMBER_AND_UNIT = re.compile(
    r"\s*([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL
)


@cache
def _registry():
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


@lru_cache(maxsize=1024)
def _unit(text: str):
    """Return pint's unit of a text; half of the time to load a rig without the cache."""
    return _registry().parse_units(text)


def parse_quantity(text: str, unit: str) -> float:
    """Read a quantity such as ``"14 mm"`` and return its value in ``unit``.

    Args:
        text: Number and unit.
        unit: SI unit of the result, as pint spells it; ``"rad"`` demands an angle.

    Raises:
        ValueError: The text is not a number with a unit, not of that dimension (where an angle
            counts as a dimension), or not finite.
    """
    registry = _registry()
    parts = _NUMBER_AND_UNIT.fullmatch(text)
    if parts is None:
        raise ValueError(f"{shown(text)} is not a number with a unit")
    try:
        number, given = float(parts[1]), _unit(parts[2])
    except Exception as error:  # pint raises many kinds, the tokenizer's too
        raise ValueError(f"{shown(text)} is not a number with a unit") from error
    target = _unit(unit)
    if unit and not parts[2]:
        raise ValueError(f"{shown(text)} has no unit")
    if given.dimensionality != target.dimensionality:
        dimension = f"has the dimension {given.dimensionality}"
        raise ValueError(f"{shown(text)} {'is a ratio' if given.dimensionless else dimension}")
    # Angles are dimensionless in pint, so 6 Hz would be accepted as 6 rad/s.
    _, root = registry.get_root_units(target)
    if registry.get_root_units(given)[1] != root:
        has = "no" if "radian" in str(root) else "an"
        raise ValueError(f"{shown(text)} has {has} angle in its unit")
    value = float(registry.Quantity(number, given).to(target).magnitude)
    if not math.isfinite(value):
        raise ValueError(f"{shown(text)} is not finite")
    return value


def format_quantity(value: float, unit: str) -> str:
    """Write an SI value so that `parse_quantity` gives back the same float."""
    return f"{value!r} {unit}".strip()


def readable_quantity(value: float, unit: str) -> str:
    """Write an SI value with a readable unit, to six digits: 171 mm, 2.9 GPa, 0.0007 kg·m²."""
    quantity = _registry().Quantity(value, unit)
    if unit.isidentifier():  # no prefix for a product of units
        quantity = quantity.to_compact()
    return f"{quantity:.6g~P}"


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
        try:
            if isinstance(value, str):
                return parse_quantity(value, self.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            raise ValueError(f"{shown(value)} {'has no unit' if number else 'is not a quantity'}")
        except ValueError as error:
            raise PydanticCustomError(
                "quantity",
                '{fault}; give a quantity in {unit} such as "{example}"',
                {"fault": str(error), "unit": self.name, "example": self.example},
            ) from error
