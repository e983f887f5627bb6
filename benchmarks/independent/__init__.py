"""An independent simulator of the experiment, to judge the analysis: see docs/independent.md.

It shares no code with the rest of the project.
"""

from .chosen import ONE_FACTOR, random_carved, random_conditions, random_two_strings
from .conditions import FORCE, VELOCITY, Choir, Conditions, Sensor
from .files import write_csv, write_rig
from .press import Pluck, Pressed, Truth, press

__all__ = [
    "FORCE",
    "ONE_FACTOR",
    "VELOCITY",
    "Choir",
    "Conditions",
    "Pluck",
    "Pressed",
    "Sensor",
    "Truth",
    "press",
    "random_carved",
    "random_conditions",
    "random_two_strings",
    "write_csv",
    "write_rig",
]
