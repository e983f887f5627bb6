"""An independent simulator of the experiment, to judge the analysis: see docs/independent.md.

It shares no code with the rest of the project.
"""

from .conditions import FORCE, VELOCITY, Choir, Conditions, Sensor
from .drawn import random_conditions
from .files import write_csv, write_rig
from .one_factor import ONE_FACTOR
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
    "random_conditions",
    "write_csv",
    "write_rig",
]
