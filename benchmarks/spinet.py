"""A spinet of two choirs: the second string is touched second and released first."""

from importlib import resources
from pathlib import Path

from sautereau.rig.edit import edited_text
from sautereau.rig.load import parse_rig

_VALUES = {
    "name": "spinet",
    "key.press_arm": "150 mm",
    "key.jack_arm": "190 mm",
    "key.inertia": "5e-4 kg m^2",
    "jack.mass": "5 g",
    "jack.string_clearance": "1.8 mm",
    "plectrum.length": "4.0 mm",
    "plectrum.width": "0.8 mm",
    "plectrum.thickness": "0.50 mm",
    "plectrum.overlap": "0.35 mm",
    "plectrum.contact": "surface",
    "string.name": "8'",
    "string.tension": "50 N",
    "string.length": "400 mm",
    "string.plucking_point": "90 mm",
    "string.frequency": "440 Hz",
    "string.diameter": "0.25 mm",
    "press.jack_speed": "0.03 m/s",
    "arm.tilt_limit": "15 deg",  # the base is that of a finger 21 mm farther from the pin
}
_MORE = """
[[more_choirs]]
jack_arm = "202 mm"
[more_choirs.jack]
mass = "5 g"
register_friction = "20 mN"
string_clearance = "2.4 mm"
[more_choirs.plectrum]
length = "4.0 mm"
width = "0.8 mm"
thickness = "0.45 mm"
youngs_modulus = "2.9 GPa"
poisson_ratio = 0.35
density = "1247 kg/m^3"
overlap = "0.22 mm"
contact = "surface"
[more_choirs.string]
name = "4'"
tension = "50 N"
length = "400 mm"
plucking_point = "80 mm"
frequency = "440 Hz"
diameter = "0.25 mm"
"""
SPINET_TEXT = (
    edited_text(
        resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8"),
        *("paper", Path(), _VALUES),
    )
    + _MORE
)
"""The rig's file: string 2 is touched second and released first."""
SPINET = parse_rig(SPINET_TEXT)
