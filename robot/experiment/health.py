"""The health of the instrument between presses, from the recording of the last one."""

import math
from dataclasses import dataclass

from sautereau.analysis.phases.checks import pulls
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.trajectory.timing import press_law

STAYED = 0.05
"""Dimensionless, fraction of the rise within which the jack must come back, and rise as far as in
the first press: far above the deflection of an arm, and below the clearance of a string."""
DRIFTED = 0.25
"""Dimensionless, fraction of the peak force by which the force at rest may change in a session: the
analysis subtracts it, but an amplifier that drifts so fast is not calibrated any more."""


@dataclass(frozen=True)
class Health:
    """What a recording shows about the instrument."""

    reason: str = ""
    """Why the next press must wait, and what to do; empty if it need not."""
    valid: bool = True
    """Whether the press itself counts; otherwise it is to be made again."""


def health_of(press: AnalysedPress, first: AnalysedPress | None = None) -> Health:
    """Return whether jack, key and force transducer are as they were before a press.

    What depends on a signal that was not recorded is not judged.

    Args:
        first: The first valid press with the same plan and instrument; None if this is the first.
    """
    names = ("full_rise", "end_rise", "peak_force", "rest_force", "plucks")
    rise, end, force, rest, plucks = (_number(press, name) for name in names)
    high, _, _, level, before = (_number(first or press, name) for name in names)
    motion = press_law(press.press.rig.press).law.states[:, 0] * 1e3
    settled = press.press.drift.before is not None  # otherwise the rise drifts
    if rise < 0.5 * motion.max():  # It has met no key
        text = (
            f"the key did not follow the finger: the jack rose by {rise:.3g} mm of"
            f" {motion.max():.3g} mm{'' if math.isnan(force) else f', with at most {force:.3g} N'};"
            " free the jack if the key is down, otherwise check the vibrometer's aim, sign and"
            " input, and daq.trigger_edge"
        )
        return Health(text, valid=False)
    if pulls(work := _number(press, "press_work"), force, rise * 1e-3):
        text = (
            f"the finger has done negative work, {work * 1e3:.3g} mJ, with a force of at most"
            f" {force:.3g} N: the force transducer has the wrong sign; invert it at its amplifier"
            " (`sautereau setup force` proves it)"
        )
        return Health(text, valid=False)
    if before and not plucks:
        text = "no pluck, and {:g} in the first press: the plectrum or the string may be broken"
        return Health(text.format(before) + "; repair it", valid=False)
    text = ""
    if settled and motion[-1] <= STAYED * rise < end:
        text = (
            f"the jack did not return: {end:.3g} mm of {rise:.3g} mm remain at the end of the"
            f" recording, {STAYED * rise:.2g} mm are permitted; free the jack in its register; if"
            " it is free, check `high_pass` of the vibrometer"
        )
    elif settled and high - rise > STAYED * high:
        text = (
            f"the key has sunk: the jack rose by {rise:.4g} mm, {high:.4g} mm in the first press;"
            f" {STAYED * high:.2g} mm less are permitted: check the key's rest and the arm's clamp"
        )
    elif abs(rest - level) > DRIFTED * force:
        text = (
            f"the force at rest has drifted from {level:.3g} to {rest:.3g} N, by more than"
            f" {DRIFTED * force:.2g} N; reset the amplifier of the transducer"
        )
    return Health(text)


def _number(press: AnalysedPress, name: str) -> float:
    """Return a feature, a length in mm; NaN, which exceeds no limit, where it is unknown."""
    value = press.features[name]
    if not isinstance(value, int | float):
        return math.nan
    return value * 1e3 if name.endswith("_rise") else value
