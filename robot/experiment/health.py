"""The health of the instrument between presses, from the recording of the last one."""

import math
from dataclasses import dataclass

from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.trajectory.timing import press_law

FOLLOWED = 0.5  # Fraction of the planned rise below which the finger has met no key
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
    motion = press_law(press.press.rig.press).law.states[:, 0]
    planned, returns = float(motion.max()), abs(motion[-1]) <= STAYED * motion.max()
    names = ("full_rise", "end_rise", "peak_force", "rest_force", "plucks")
    rise, end, force, rest, plucks = (_number(press, name) for name in names)
    high, _, _, level, before = (_number(first or press, name) for name in names)
    most = "" if math.isnan(force) else f", and the force was at most {force:.3g} N"
    if rise < FOLLOWED * planned:
        return Health(
            f"the key did not follow the finger: the jack rose by {rise * 1e3:.3g} mm of"
            f" {planned * 1e3:.3g} mm{most}; if the key is down, free the jack; if not, check the"
            " aim and the sign of the vibrometer",
            valid=False,
        )
    if before and not plucks:
        return Health(
            f"no pluck, and {before:g} in the first press{most}; the plectrum or the string"
            " may be broken: repair it",
            valid=False,
        )
    if press.press.drift.before:  # otherwise the rise drifts
        if returns and end > STAYED * rise:
            return Health(
                f"the jack did not return: {end * 1e3:.3g} mm of {rise * 1e3:.3g} mm remain at the"
                f" end of the recording, {STAYED * rise * 1e3:.2g} mm are permitted; free the jack"
                " in its register; if it is free, check `high_pass` of the vibrometer"
            )
        if (sunk := high - rise) > STAYED * high:
            return Health(
                f"the key has sunk: the jack rose by {rise * 1e3:.4g} mm, by {high * 1e3:.4g} mm in"
                f" the first press, a difference of {sunk * 1e3:.2g} mm where"
                f" {STAYED * high * 1e3:.2g} mm are permitted; check the key's rest, and the arm's"
                " clamp"
            )
    if abs(rest - level) > DRIFTED * force:
        return Health(
            f"the force at rest has drifted from {level:.3g} to {rest:.3g} N, by more than"
            f" {DRIFTED * force:.2g} N; reset the amplifier of the transducer"
        )
    return Health()


def _number(press: AnalysedPress, name: str) -> float:
    """Return a feature; NaN, with which no limit is exceeded, where it is unknown."""
    value = press.features[name]
    return value if isinstance(value, int | float) else math.nan
