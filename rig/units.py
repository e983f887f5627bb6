"""Quantities with units at the edge of the program, SI floats inside."""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

_ANGLES = {"radian", "degree", "turn", "milliradian", "arcminute", "arcsecond"}


@cache
def _registry():
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


def parse_quantity(text: str, unit: str) -> float:
    """Read a quantity such as ``"14 mm"`` and return its value in ``unit``.

    Args:
        text: Number and unit.
        unit: SI unit of the result, as pint spells it; ``"rad"`` demands an angle.

    Raises:
        ValueError: The text is no quantity, or not one of that dimension, or not finite.
    """
    registry = _registry()
    try:
        quantity = registry.Quantity(text)
    except Exception as error:  # pint raises its own, tokenizer's and arithmetic errors alike
        raise ValueError(f"{text!r} is not a quantity") from error
    wanted = registry.Unit(unit)
    names = set(quantity._units)
    if unit == "rad" and not names & _ANGLES:
        raise ValueError(f"{text!r} is no angle")
    if unit != "rad" and names and names <= _ANGLES:
        raise ValueError(f"{text!r} is an angle")
    if quantity.dimensionality != wanted.dimensionality:
        raise ValueError(f"{text!r} has the dimension {quantity.dimensionality}")
    if not names and unit:
        raise ValueError(f"{text!r} has no unit")
    value = float(quantity.to(wanted).magnitude)
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is not finite")
    return value


def format_quantity(value: float, unit: str) -> str:
    """Write an SI value so that `parse_quantity` gives back the same float."""
    return f"{value!r} {unit}".strip()


@dataclass(frozen=True)
class Unit:
    """Annotation of a float field: the SI unit it holds, written as a quantity in TOML."""

    name: str
    example: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._read, handler(source))

    def _read(self, value: object) -> object:
        hint = {"example": self.example, "unit": self.name}
        if not isinstance(value, str):
            raise PydanticCustomError(
                "quantity", 'a quantity in {unit}, written like "{example}"', hint
            )
        try:
            return parse_quantity(value, self.name)
        except ValueError as error:
            raise PydanticCustomError(
                "quantity",
                '{fault}; a quantity in {unit} is needed, written like "{example}"',
                hint | {"fault": str(error)},
            ) from error
