"""The calls that create channels, with the sensitivities of their sensors, and custom scales."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2_grpc
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from sautereau.sim_backend.device_types import DeviceType
from sautereau.sim_backend.devices.daqmx.attributes import (
    Attribute,
    call,
    given,
    kept,
    number,
    stored,
)
from sautereau.sim_backend.devices.daqmx.card import (
    INTERNAL,
    LINEAR,
    DaqmxError,
    invalid,
    physical_channels,
)

G = 9.80665  # m/s^2, standard gravity
POUND_FORCE = 0.45359237 * G  # N
INCH = 0.0254  # m
CUSTOM_SCALE = 10065
MOST_POINTS = 1_000_000  # Limit of the points that a reverse polynomial is fitted to

_UNITS = {
    15875: 1.0,  # N
    15876: POUND_FORCE,
    15877: G,  # kgf
    10186: G,
    12470: 1.0,  # m/s^2
    12471: INCH,
    15959: 1.0,  # m/s
    15960: INCH,
    10081: 1.0,  # Pa
    10348: 1.0,  # V
    10342: 1.0,  # A
}
"""SI units, or V, per unit of a channel."""
_SENSITIVITIES = {
    15891: 1e-3,  # mV/N
    15892: 1e-3 / POUND_FORCE,
    12509: 1e-3 / G,
    12510: 1 / G,
    15963: 1.0,  # mV per mm/s
    15964: 1e-3 / INCH,
}
"""V per SI unit, per unit of a sensitivity."""
_UNIT_OF = {"sensitivity": 0.0, "mic_sensitivity": 1e-3, "ext_shunt_resistor_val": 1.0}
"""V per SI unit, per unit of the sensitivity by its field; 0 for one that has units of its own."""
_VOLTAGE_WITH_EXCITATION = 10323
_USE_VOLTAGE, _USE_CURRENT = 10322, 10134


@dataclass(frozen=True)
class Sensor:
    """What one kind of channel measures with a sensor, and the names of its properties."""

    measurement: int
    units: str
    sensitivity: str = ""
    sensitivity_units: str = ""


SENSORS = {
    "CreateAIVoltageChan": Sensor(10322, "AI_VOLTAGE_UNITS"),
    "CreateAIVoltageChanWithExcit": Sensor(_VOLTAGE_WITH_EXCITATION, "AI_VOLTAGE_UNITS"),
    "CreateAIForceIEPEChan": Sensor(
        15895,
        "AI_FORCE_UNITS",
        "AI_FORCE_IEPE_SENSOR_SENSITIVITY",
        "AI_FORCE_IEPE_SENSOR_SENSITIVITY_UNITS",
    ),
    "CreateAIAccelChan": Sensor(
        10356, "AI_ACCEL_UNITS", "AI_ACCEL_SENSITIVITY", "AI_ACCEL_SENSITIVITY_UNITS"
    ),
    "CreateAIVelocityIEPEChan": Sensor(
        15966,
        "AI_VELOCITY_UNITS",
        "AI_VELOCITY_IEPE_SENSOR_SENSITIVITY",
        "AI_VELOCITY_IEPE_SENSOR_SENSITIVITY_UNITS",
    ),
    "CreateAICurrentChan": Sensor(10134, "AI_CURRENT_UNITS", "AI_CURRENT_SHUNT_RESISTANCE"),
    "CreateAIMicrophoneChan": Sensor(10354, "AI_SOUND_PRESSURE_UNITS", "AI_MICROPHONE_SENSITIVITY"),
}
"""Kinds of channels, by the call of nidaqmx.proto that adds one."""


def _sensitivity(request: Any) -> tuple[float | None, float]:
    """Return the sensitivity as it is requested, None without one, and in V per SI unit."""
    field = next((name for name in _UNIT_OF if hasattr(request, name)), None)
    if field is None:
        return None, 1.0
    kind, value = given(request, "sensitivity_units"), getattr(request, field)
    unit = _UNIT_OF[field] or _SENSITIVITIES.get(kind)
    if unit is None:
        raise invalid("the sensitivity's units", kind, f"one of {list(_SENSITIVITIES)}")
    return value, value * unit


def _limits(request: Any) -> tuple[float, float]:
    if hasattr(request, "max_snd_press_level"):
        # Amplitude of a sine of that level, dB of its RMS relative to 20 uPa.
        high = math.sqrt(2) * 20e-6 * 10 ** (request.max_snd_press_level / 20)
        return -high, high
    return request.min_val, request.max_val


def _excitation(request: Any, device: DeviceType) -> dict[str, Any]:
    """Return the properties of an excitation, if the device can supply it."""
    for kind in ("current", "voltage"):
        source = given(request, f"{kind}_excit_source")
        if source is None:
            continue
        value = getattr(request, f"{kind}_excit_val")
        if source == INTERNAL and value not in (0.0, *device.excitations):
            raise invalid("AI.Excit.Val", value, f"one of {list(device.excitations)}")
        used = _USE_VOLTAGE if kind == "voltage" else _USE_CURRENT
        return {"AI_EXCIT_SRC": source, "AI_EXCIT_VAL": value, "AI_EXCIT_VOLTAGE_OR_CURRENT": used}
    return {}


def _creator(name: str, sensor: Sensor) -> Callable[..., Any]:
    def create(self: Any, request: Any, context: Any) -> None:
        units, scale, polynomials = given(request, "units"), "", LINEAR
        sensitivity, volts_per_unit = _sensitivity(request)
        if units == CUSTOM_SCALE and not sensor.sensitivity:
            scale = request.custom_scale_name
            polynomials = find_scale(self, scale).polynomials
        elif units not in _UNITS:
            raise invalid("the units", units, "those of the sensor")
        elif (volts_per_unit := volts_per_unit * _UNITS[units]) <= 0:
            raise invalid("the sensitivity", volts_per_unit, "above 0")
        elif given(request, "shunt_resistor_loc") == INTERNAL:
            raise invalid("AI.CurrentShunt.Loc", INTERNAL, "external")
        else:
            polynomials = (0.0, 1 / volts_per_unit), (0.0, volts_per_unit)
        task = self._task(request)
        (module, _), *_ = physical_channels(request.physical_channel, task.card)
        kept = {sensor.units: units, **_excitation(request, module.device)}
        if sensor.sensitivity:
            kept[sensor.sensitivity] = sensitivity
        if sensor.sensitivity_units:
            kept[sensor.sensitivity_units] = given(request, "sensitivity_units")
        if sensor.measurement == _VOLTAGE_WITH_EXCITATION:
            kept["AI_BRIDGE_CFG"] = given(request, "bridge_config")
            kept["AI_EXCIT_USE_FOR_SCALING"] = request.use_excit_for_scaling
        low, high = _limits(request)
        added = task.add(
            request.physical_channel,
            request.name_to_assign_to_channel,
            low=low,
            high=high,
            configuration=given(request, "terminal_config"),
            measurement=sensor.measurement,
            forward=polynomials[0],
            reverse=polynomials[1],
            custom_scale=scale,
        )
        for channel in added:
            channel.stored.update((number("CHANNEL", name), kept[name]) for name in kept)

    return call(create, name)


VOLTS = 10348
_LINEAR, _POLYNOMIAL = 10447, 10449
_SLOPE, _INTERCEPT = number("SCALE", "LIN_SLOPE"), number("SCALE", "LIN_Y_INTERCEPT")
_FORWARD, _REVERSE = number("SCALE", "POLY_FORWARD_COEFF"), number("SCALE", "POLY_REVERSE_COEFF")
_KIND, _SCALED_UNITS = number("SCALE", "TYPE"), number("SCALE", "SCALED_UNITS")


class Scale:
    """Units of volts: a line or a polynomial, by its properties."""

    def __init__(self, kind: int, units: str, properties: dict[int, Any]):
        self.stored: dict[int, Any] = {_KIND: kind, _SCALED_UNITS: units, **properties}

    def must_be(self, kind: int) -> None:
        """Refuse a property of another kind of scale."""
        if self.stored[_KIND] != kind:
            raise DaqmxError(-200601, "Property is not supported for the custom scale type.")

    @property
    def polynomials(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Coefficients from degree 0 up: units of volts, and volts of units.

        Raises:
            DaqmxError: The slope is zero, or there are no coefficients, or all are zero.
        """
        if self.stored[_KIND] == _LINEAR:
            slope, intercept = self.stored[_SLOPE], self.stored[_INTERCEPT]
            if not slope:
                raise DaqmxError(-200409, "Slope of the linear scale is zero.")
            return (intercept, slope), (-intercept / slope, 1 / slope)
        forward, reverse = tuple(self.stored[_FORWARD]), tuple(self.stored[_REVERSE])
        for coefficients, absent, zero, which in (
            (forward, -200405, -200407, "forward"),
            (reverse, -200406, -200408, "reverse"),
        ):
            if not any(coefficients):
                code, what = (zero, "are all zero") if coefficients else (absent, "are missing")
                raise DaqmxError(code, f"The {which} coefficients of the scale {what}.")
        return forward, reverse


def _of_kind(name: str, kind: int) -> dict[int, Attribute]:
    check: Callable[[Any], None] = lambda scale: scale.must_be(kind)  # noqa: E731
    return {number("SCALE", name): stored("SCALE", name, None, check=check)}


SCALE = {
    **kept("SCALE", {"DESCR": "", "PRE_SCALED_UNITS": VOLTS, "SCALED_UNITS": "", "TYPE": _LINEAR}),
    **_of_kind("LIN_SLOPE", _LINEAR),
    **_of_kind("LIN_Y_INTERCEPT", _LINEAR),
    **_of_kind("POLY_FORWARD_COEFF", _POLYNOMIAL),
    **_of_kind("POLY_REVERSE_COEFF", _POLYNOMIAL),
}
"""The properties of a scale; a channel takes those of its creation."""


def find_scale(server: Any, name: str) -> Scale:
    """Return a scale of a server by its name.

    Raises:
        DaqmxError: There is none.
    """
    if name not in server.scales:
        raise DaqmxError(-200378, f"Custom scale specified does not exist.\nCustom Scale: {name}")
    return server.scales[name]


def _scale_creator(name: str, kind: int, fields: dict[int, str]) -> Callable[..., Any]:
    """Return the call that creates a scale, which lasts as long as the server.

    Args:
        fields: The request's field of each property.
    """

    def create(self: Any, request: Any, context: Any) -> None:
        if given(request, "pre_scaled_units") != VOLTS:
            raise DaqmxError(-200077, "The stand-in's scales have volts as the pre-scaled units.")
        found = {key: getattr(request, field) for key, field in fields.items()}
        self.scales[request.name] = Scale(kind, request.scaled_units, found)

    return call(create, name)


def _reverse_polynomial(self: Any, request: Any, context: Any) -> dict[str, list[float]]:
    """Return the polynomial that fits the inverse of another one best, by least squares."""
    forward, points = list(request.forward_coeffs), request.num_points_to_compute
    order = request.reverse_poly_order
    if not forward:
        raise DaqmxError(-200405, "The forward coefficients are missing.")
    order = len(forward) - 1 if order == -1 else order
    if order < 1:
        raise DaqmxError(-200402, f"The order of the reverse polynomial is {order}, not above 0.")
    if not order < points <= MOST_POINTS:
        raise DaqmxError(
            -200403, f"{points} points are not above the order {order} and up to {MOST_POINTS}."
        )
    volts = np.linspace(request.min_val_x, request.max_val_x, points)
    units = polyval(volts, forward)
    if not (np.isfinite(units).all() and np.ptp(units) > 0):
        raise DaqmxError(-200077, "The forward polynomial is constant or not finite there.")
    fitted = Polynomial.fit(units, volts, order).convert().coef
    return {"reverse_coeffs": [*fitted, *[0.0] * (order + 1 - len(fitted))]}


def _refused(name: str, code: int, what: str) -> Any:
    def refuse(self: Any, request: Any, context: Any) -> None:
        raise DaqmxError(code, f"The stand-in has no {what}.")

    return call(refuse, name)


_TEDS = ("ConfigureTEDS", "ClearTEDS", "WriteToTEDSFromArray", "WriteToTEDSFromFile")
CREATING = {
    **{
        name: _refused(name, -200431, "sensor for this measurement")
        for name in vars(nidaqmx_pb2_grpc.NiDAQmxServicer)
        if name.startswith(("CreateAI", "CreateTEDSAI"))
    },
    **{name: _refused(name, -200741, "TEDS sensors") for name in _TEDS},
    **{name: _creator(name, sensor) for name, sensor in SENSORS.items()},
    **{
        name: _refused(name, -200077, "scales of this kind: use a linear or a polynomial one")
        for name in ("CreateMapScale", "CreateTableScale")
    },
    "CreateLinScale": _scale_creator(
        "CreateLinScale", _LINEAR, {_SLOPE: "slope", _INTERCEPT: "y_intercept"}
    ),
    "CreatePolynomialScale": _scale_creator(
        "CreatePolynomialScale",
        _POLYNOMIAL,
        {_FORWARD: "forward_coeffs", _REVERSE: "reverse_coeffs"},
    ),
    "CalculateReversePolyCoeff": call(_reverse_polynomial, "CalculateReversePolyCoeff"),
}
"""Methods that create channels and scales, or refuse to, by the call of nidaqmx.proto."""
