"""Hidden parameters: fitted in every fit because they bias the others, and not reported.

They are errors of the calibrations, numbers of the rig that are seldom known well enough, and all
numbers that the rig knows to within a range only.
"""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.identify.parameter_names import (
    CLEARANCE,
    DAMPER,
    DAMPER_LIFT,
    ENDS,
    FORCE,
    FORCE_GAIN,
    FRICTION,
    LATE_SLIDING,
    MODULUS,
    NAMES,
    OF_STRING,
    OVERLAP,
    RELEASE,
    SLIDING,
    STIFFNESS,
    TIME,
    VELOCITY_GAIN,
    VIBRATION,
    WIDTH,
    rig_key,
    split_name,
)
from sautereau.analysis.identify.parameters import Parameter, unit_of_parameter, value_of
from sautereau.rig.acquisition import Channel
from sautereau.rig.ranges import Deviation, deviations, shared_keys
from sautereau.rig.schema import Rig

CLEARANCE_STD = 0.1e-3
"""Standard uncertainty of the string clearance in the rig (m). A recording shows the clearance to
some micrometres. It is therefore always fitted, so that the rise at contact does not act as a
calibration of the vibrometer."""
SLIDING_STD = 2e-3
"""Standard uncertainty of the sliding (1/N): along a key of 150 mm a force of 1 N moves the finger
by 0.3 mm. Servos yield by more: docs/trials.md says what a wider prior changes."""
RELEASE_STD = 5e-3
"""Relative standard uncertainty of the height of release. It is that of a static string: also the
vibration along the plectrum changes it."""
VIBRATION_MEAN, VIBRATION_STD = 0.5, 1 / np.sqrt(12)
"""Prior mean and standard uncertainty of the vibration of the held strings, those of a uniform
distribution from 0 to 1."""
FRICTION_STD = 0.1
"""Standard uncertainty of the plectrum's friction in the rig, dimensionless. Friction is fitted
with stiffness and overlap because its effect resembles theirs: an error of 0.03 disappears in the
noise and makes the overlap 8 % too large. A string on the mid-line, which no instrument has, also
resembles friction. Friction is therefore not fitted there: the place of the string comes first."""
DAMPER_STD = 0.2
"""Relative standard uncertainty of the dampers' stiffness if the rig assumes no range."""
DAMPER_LIFT_STD = 0.1e-3
"""Standard uncertainty of the dampers' lift if the rig assumes no range (m)."""
STRING_STD = 0.3
"""Relative standard uncertainty of stiffness and overlap of the plectra of further strings."""
BOUND_STDS = 10
"""Distance of the bounds of a hidden parameter from its value, in standard uncertainties."""


def hidden_parameters(rig: Rig, names: Sequence[str]) -> list[Parameter]:
    """Return the hidden parameters of a rig.

    Args:
        names: Names of the free parameters; they are omitted.
    """
    found = [
        _hidden(CLEARANCE, rig.jack.string_clearance, CLEARANCE_STD, "m"),
        _hidden(TIME, 0.0, delay_std(rig), "s"),
    ]
    for name, quantity in ((FORCE_GAIN, "force"), (VELOCITY_GAIN, "velocity")):
        # Not 0, which would give an empty range.
        found.append(_hidden(name, 1.0, max(_channel(rig, quantity).gain_std, 1e-6)))
    found += [
        _hidden(SLIDING, 0.0, SLIDING_STD, "1/N"),
        _hidden(LATE_SLIDING, 0.0, SLIDING_STD, "1/N"),
        _hidden(RELEASE, 0.0, RELEASE_STD),
        _fraction(VIBRATION, VIBRATION_MEAN, VIBRATION_STD),
    ]
    for string in range(2, len(rig.more_choirs) + 2):
        stiffness, overlap, clearance = (name.format(string) for name in OF_STRING)
        free = {own for number, own in map(split_name, names) if number == string}
        found += [_hidden(stiffness, 1.0, STRING_STD)] * free.isdisjoint({MODULUS, STIFFNESS})
        found += [_hidden(overlap, 1.0, STRING_STD)] * (OVERLAP not in free)
        found += [_hidden(clearance, 0.0, CLEARANCE_STD, "m")] * (CLEARANCE not in free)
    damper = rig.jack.damper
    if damper is not None and damper.stiffness > 0:
        std = assumed_std(rig, "jack.damper.stiffness") / damper.stiffness or DAMPER_STD
        lift_std = assumed_std(rig, "jack.damper.lift") or DAMPER_LIFT_STD
        # There may be no damper: a least stiffness would bias what else the return shows.
        found += [_hidden(DAMPER, 1.0, std, least=0.0)]
        found += [_hidden(DAMPER_LIFT, damper.lift, lift_std, "m")]
    plectrum_is_free = not {MODULUS, STIFFNESS, OVERLAP}.isdisjoint(
        own for _, own in map(split_name, names)
    )
    if plectrum_is_free and rig.plectrum.contact == "surface":
        found.append(_fraction(FRICTION, rig.plectrum.friction, FRICTION_STD))
    found = [parameter for parameter in found if parameter.name not in names]
    unknown = deviations(rig, unfitted(rig, [*names, *(p.name for p in found)]))
    return found + [_within_range(rig, error) for error in unknown]


def unfitted(rig: Rig, names: Sequence[str]) -> list[str]:
    """Return the numbers of the model that are not among those of these names.

    Of modulus and bending stiffness it is the one with a range, if neither is named.
    """
    of_plectrum = {MODULUS, STIFFNESS}
    if of_plectrum.isdisjoint(names):
        of_plectrum = {STIFFNESS if MODULUS in rig.assumed else MODULUS}
    of_plectrum |= {WIDTH} if STIFFNESS in names else set()  # it has no other effect
    fitted = {key for name in names for key in shared_keys(rig, rig_key(name))}
    return [name for name in NAMES if name not in {*names, FORCE, TIME, *of_plectrum, *fitted}]


def delay_std(rig: Rig) -> float:
    """Return the standard uncertainty [s] of the delay between force and motion, above 0."""
    force, velocity = (_channel(rig, quantity) for quantity in ("force", "velocity"))
    return max(float(np.hypot(force.delay_std, velocity.delay_std)), 1e-9)


def assumed_std(rig: Rig, name: str) -> float:
    """Return the standard uncertainty of a value with an assumed range; 0 without a range."""
    return sum(deviation.std for deviation in deviations(rig, [name]))


def _hidden(name: str, value: float, std: float, unit: str = "", least: float = 0.1) -> Parameter:
    """Return a hidden parameter with its value as the mean of its prior.

    Args:
        least: Lower bound, divided by the value.
    """
    low, high = value - BOUND_STDS * std, value + BOUND_STDS * std
    low = max(low, least * value) if value else low
    return Parameter(name, unit, value, low, high, value, std, hidden=True)


def _within_range(rig: Rig, error: Deviation) -> Parameter:
    value = value_of(rig, error.name)
    ends = value + error.low, value + error.high
    unit = unit_of_parameter(error.name)
    return Parameter(error.name, unit, value, *ends, value, error.std, hidden=True)


def _fraction(name: str, mean: float, std: float) -> Parameter:
    return Parameter(name, "", mean, *ENDS[name], mean, std, hidden=True)


def _channel(rig: Rig, quantity: str) -> Channel:
    """Return the first channel of a quantity that every press has."""
    return next(c for c in rig.daq.channels if c.quantity == quantity)
