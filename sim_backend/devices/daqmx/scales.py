"""Custom linear scales of voltage channels, as programs create them."""

from typing import Any

from sautereau.sim_backend.devices.daqmx.attributes import call, given, kept, number
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

VOLTS = 10348
_LINEAR = 10447
_SLOPE = number("SCALE", "LIN_SLOPE")
_INTERCEPT = number("SCALE", "LIN_Y_INTERCEPT")

SCALE = kept(
    "SCALE",
    {
        "DESCR": "",
        "LIN_SLOPE": 1.0,
        "LIN_Y_INTERCEPT": 0.0,
        "PRE_SCALED_UNITS": VOLTS,
        "SCALED_UNITS": "",
        "TYPE": _LINEAR,
    },
)
"""The properties of a scale; a channel takes those of its creation."""


class Scale:
    """Volts times a slope, plus an intercept, are units."""

    def __init__(self, slope: float, intercept: float, units: str):
        self.stored: dict[int, Any] = {
            _SLOPE: slope,
            _INTERCEPT: intercept,
            number("SCALE", "SCALED_UNITS"): units,
        }

    @property
    def line(self) -> tuple[float, float]:
        """V per unit, and the units of 0 V.

        Raises:
            DaqmxError: The slope is zero.
        """
        if not self.stored[_SLOPE]:
            raise DaqmxError(-200409, "Slope of the linear scale is zero.")
        return 1 / self.stored[_SLOPE], self.stored[_INTERCEPT]


def find_scale(server: Any, name: str) -> Scale:
    """Return a scale of a server by its name.

    Raises:
        DaqmxError: There is none.
    """
    if name not in server.scales:
        raise DaqmxError(-200378, f"Custom scale specified does not exist.\nCustom Scale: {name}")
    return server.scales[name]


@call
def CreateLinScale(self: Any, request: Any, context: Any) -> None:  # noqa: N802
    """Create a scale that lasts as long as the server."""
    if given(request, "pre_scaled_units") != VOLTS:
        raise DaqmxError(-200077, "The stand-in's scales have volts as the pre-scaled units.")
    self.scales[request.name] = Scale(request.slope, request.y_intercept, request.scaled_units)
