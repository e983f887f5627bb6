"""Base class of the rig file's tables, and the kinds of quantities in them."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict

from sautereau.rig.units import Unit

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


class Section(BaseModel):
    """A table of the rig file: frozen, no unknown keys, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def replaced(self, values: Mapping[str, Any]) -> Self:
        """Return a copy with other SI values by dotted key, unchecked: ``{"press.jack_speed": 1}``.

        `sautereau.rig.load.with_values` checks them, which takes milliseconds.
        """
        parts: dict[str, dict[str, Any]] = {}
        for key, value in values.items():
            part, _, name = key.partition(".")
            parts.setdefault(part, {})[name] = value
        changed = {part: getattr(self, part).model_copy(update=new) for part, new in parts.items()}
        return self.model_copy(update=changed)
