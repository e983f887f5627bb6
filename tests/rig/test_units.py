"""Quantities: their dimension, their angles, and the exact way there and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.units import format_quantity, parse_quantity, readable_quantity

UNITS = [
    "m", "kg", "N", "rad", "s", "Hz", "V", "Pa", "N*m", "kg*m**2", "N*m*s/rad", "N/m", "N*s/m",
    "kg/m**3", "m/s", "m/s**2", "m/s**3", "rad/s", "rad/s**2", "m/s/V", "N/V",
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("14 mm", "m", 0.014),
        ("14mm", "m", 0.014),
        ("-274.94 mm", "m", -0.27494),
        (".5 mm", "m", 0.0005),
        ("7e-4 kg m^2", "kg*m**2", 7e-4),
        ("0.1 mN m s/rad", "N*m*s/rad", 1e-4),
        ("2.9 GPa", "Pa", 2.9e9),
        ("976.5625 us", "s", 976.5625e-6),
        ("25 mm/s/V", "m/s/V", 0.025),
        ("30 deg", "rad", math.pi / 6),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 turn/s^2", "rad/s**2", 2 * math.pi),
        ("0.35", "", 0.35),
    ],
)
def test_reads_a_quantity_in_the_requested_unit(text, unit, value):
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "fault"),
    [
        ("14 g", "m", "has the dimension [mass]"),
        ("14", "m", "has no unit"),
        ("0", "rad", "has no unit"),
        ("5 %", "m", "is a ratio"),
        ("5 percent", "rad", "has no angle in its unit"),
        ("5 count", "rad", "has no angle in its unit"),
        ("3 rad", "", "has an angle in its unit"),
        ("6 Hz", "rad/s", "has no angle in its unit"),
        ("365 rad/s", "Hz", "has an angle in its unit"),
        ("60 rpm", "Hz", "has an angle in its unit"),
        ("0.1 mN m s", "N*m*s/rad", "has no angle in its unit"),
        ("20 degC", "m", "has the dimension [temperature]"),
        ("nan m", "m", "is not a number with a unit"),
        ("inf m", "m", "is not a number with a unit"),
        ("1e400 m", "m", "is not finite"),
        ("9e307 km", "m", "is not finite"),
        ("mm", "m", "is not a number with a unit"),
        ("2*7 mm", "m", "is not a number with a unit"),
        ("1 m + 1 s", "m", "is not a number with a unit"),
        ("5 furlong/", "m", "is not a number with a unit"),
        ("5 zorkmid", "m", "is not a number with a unit"),
        ("", "m", "is not a number with a unit"),
    ],
)
def test_refuses_what_is_no_such_quantity(text, unit, fault):
    with pytest.raises(ValueError, match=r"is |has ") as raised:
        parse_quantity(text, unit)
    assert fault in str(raised.value)
    assert repr(text) in str(raised.value)


@given(st.text(max_size=20), st.sampled_from(UNITS))
def test_any_text_is_a_finite_quantity_or_a_value_error(text, unit):
    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        value, fault = 0.0, str(error)
    else:
        fault = " is "
    assert math.isfinite(value)
    assert " is " in fault or " has " in fault


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.171, "m", "171 mm"),
        (0.00048, "m", "480 µm"),
        (0.0, "m", "0 m"),
        (2.9e9, "Pa", "2.9 GPa"),
        (-51200.0, "Hz", "-51.2 kHz"),
        (7e-4, "kg*m**2", "0.0007 kg·m²"),
        (0.072, "m/s", "0.072 m/s"),
        (0.25, "", "0.25"),
        (0.0123, "kg", "12.3 g"),
        (0.2, "N*m", "0.2 N·m"),
        (-1e-13, "N*s/m", "-1×10⁻¹³ N·s/m"),
        (1.7e308, "N", "1.7×10²⁹⁹ GN"),
        (5e-324, "m", "4.94066×10⁻³¹² pm"),
    ],
)
def test_a_quantity_that_people_read(value, unit, text):
    assert readable_quantity(value, unit) == text


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(UNITS))
def test_a_written_float_reads_back_as_itself(value, unit):
    assert parse_quantity(format_quantity(value, unit), unit) == value
