"""The features of one press: a flat row in SI units, for tables of many presses.

The work on a string and the deflection start at contact, where the paper aligns its presses.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.phases import Phases
from sautereau.analysis.phases.found import FINGERTIP
from sautereau.analysis.press.string_start import OF_START, measured_start
from sautereau.rig.quantities import QUANTITIES, Quantity
from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import press_law

Value = float | int | str | bool | None
Row = dict[str, Value]
"""Values of one press by the columns of `UNITS`, and of later plucks by those of `column`."""

OF_PHASES = ("start", "bottom", "bottomed", "returned", "free_speed", "held_speed",
             "released_speed")  # fmt: skip
"""Columns that are attributes of the phases."""
OF_SPEED = ("held_speed_mean", "held_speed_min", "held_speed_max", "held_speed_error")
"""Columns of `held_speeds`."""
OF_REST = ("full_rise", "end_rise", "rest_force", "unseen_force")
"""Columns that show from press to press whether the key comes back, and whether sensors drift."""
COMPARED = (
    "pluck_duration",
    "contact_rise",
    "release_rise",
    "held_deflection",
    "contact_force",
    "release_force",
    "force_drop",
    "force_slope",
    "held_work",
)
"""Features of a pluck that the model predicts; forces are counted from those at rest."""
OF_PLUCK = (
    *("string", "string_probability", "contact", "contact_std", "release", "release_std"),
    *COMPARED,
    *OF_START,
    "force_drop_std",
    "force_slope_std",
)
"""Columns of each pluck."""
UNITS = {
    name: QUANTITIES[name].unit
    for name in (
        *("path", "simulated", "plucks", *OF_PHASES, *OF_SPEED),
        *OF_PLUCK,
        *("peak_force", "press_work", *OF_REST, "warnings"),
    )
}

"""Unit of each column, in the order of the columns; those of later plucks have these units too.
`sautereau.rig.quantities` defines the columns; times are in s after the trigger."""

NEED_BOTH = ("bottomed", "force_drop", "force_drop_std", "force_slope", "force_slope_std",
             "held_work", "press_work", "rest_force", "unseen_force")  # fmt: skip
"""Columns that need the force and the velocity."""
NEED = {
    "force": ("contact_force", "release_force", "peak_force", *NEED_BOTH),
    "velocity": (
        *("start", "bottom", "returned", "free_speed", "held_speed", "released_speed", *OF_SPEED),
        *("contact_rise", "release_rise", "held_deflection", "full_rise", "end_rise", *NEED_BOTH),
    ),
}
"""Columns that are None where this signal was not recorded."""
OF_SATURATED = ("release_force", "force_drop", "force_drop_std", "force_rise", "force_slope",
                "force_slope_std", "held_work")  # fmt: skip
"""Columns of a pluck that are None where its force is `saturated`."""

GAINED = {
    "force": ("contact_force", "release_force", "peak_force"),
    "velocity": (
        *("free_speed", "held_speed", "released_speed", *OF_SPEED[:-1]),
        *("contact_rise", "release_rise", "held_deflection", "full_rise", "end_rise"),
    ),
}
HELD = "contact", "release"
AT = {
    **{f"{end}_{what}": (end,) for end in HELD for what in ("rise", "force")},
    **dict.fromkeys(("pluck_duration", "held_deflection", "held_work"), HELD),
}
"""Instants at which, or between which, columns of a pluck are measured."""
FROM_REST = (
    "release force and work: of an AC-coupled sensor counted from that at rest, and predictions are"
    " not; the force drop does not depend on it"
)
"""What tables say of presses with an `unseen_force`."""
GAINED_BY_BOTH = ("force_slope", "held_work", "press_work")
"""Columns that are proportional to a signal, and to both or to their quotient."""


def column(name: str, pluck: int = 1) -> str:
    """Return the column of a quantity of a pluck, counted from 1: `release`, `release_2`."""
    return name if pluck == 1 else f"{name}_{pluck}"


def split_column(column: str) -> tuple[str, int]:
    """Return the quantity of a column and the number of its pluck, from 1: `release_2` is 2."""
    name, _, number = column.rpartition("_")
    return (name, int(number)) if name and number.isdecimal() else (column, 1)


def quantity_of(column: str) -> Quantity:
    """Return the quantity of a column."""
    return QUANTITIES[split_column(column)[0]]


def by_string(row: Row) -> Row:
    """Return a row whose columns are numbered by string: those of string 2 end in `_2`.

    A string without a pluck has no values, and a pluck of an unknown string is omitted.
    """
    found: Row = {
        name: value for name, value in row.items() if split_column(name)[0] not in OF_PLUCK
    }
    found |= dict.fromkeys(OF_PLUCK)
    for pluck in range(1, int(row.get("plucks") or 0) + 1):
        string = row.get(column("string", pluck))
        if isinstance(string, int):
            found |= {column(name, string): row.get(column(name, pluck)) for name in OF_PLUCK}
    return found


def title_of(column: str, strings: Sequence[str] = ()) -> str:
    """Return the label of a column with its displayed unit; of several strings with the string.

    Args:
        column: Of a row of `by_string`.
        strings: Names of the rig's strings.
    """
    name, string = split_column(column)
    title = QUANTITIES[name].title
    return f"{title}, {strings[string - 1]}" if len(strings) > 1 and name in OF_PLUCK else title


def gain_stds(rig: Rig) -> dict[str, float]:
    """Return the relative standard uncertainties of columns by the sensors' `gain_std`.

    A gain is wrong by the same factor in all presses, so that their mean is not more certain.
    Instants do not depend on gains, beyond the error of the rig's inertia that their fit includes.

    Args:
        rig: With the calibrations of the channels; a missing one leaves its columns out.
    """
    found = {quantity: rig.daq.channel(quantity) for quantity in ("force", "velocity")}
    gains = {quantity: channel.gain_std for quantity, channel in found.items() if channel}
    stds = {name: gain for q, gain in gains.items() for name in GAINED[q]}
    if len(gains) == len(found):
        stds |= dict.fromkeys(GAINED_BY_BOTH, math.hypot(*gains.values()))
        # The finger's force and the key's inertia have parts in it that are unknown: at most this.
        stds["force_drop"] = max(gains.values())
    return stds


def std_of(row: Row, name: str, gains: Mapping[str, float]) -> float | None:
    """Return the standard uncertainty of a column of one press, in its unit; None if unknown.

    It is the fit's for instants, what depends on them, force drop and slope, and the calibration's
    for columns that are proportional to a signal, with what AC coupling hides of a force; the noise
    that remains in these shows in repeated presses.

    Args:
        row: Of `features`.
        gains: Relative standard uncertainties of the press, of `gain_stds`.
    """
    (feature, pluck), value = split_column(name), row.get(name)
    ends = AT.get(feature, (feature,))
    known = (row.get(column(f"{end}_std", pluck)) for end in ends)
    stds = [std for std in known if isinstance(std, float)]
    parts = stds if len(stds) == len(ends) else []
    if feature in AT:  # times the rate at which it changes while the string is held
        of = [feature] if ends == HELD else [feature.replace(ends[0], end) for end in HELD]
        needed = [row.get(column(one, pluck)) for one in ("pluck_duration", *of)]
        numbers = [number for number in needed if isinstance(number, float)]
        rate = 0.0
        if len(numbers) == len(needed) and numbers[0]:
            rate = abs(numbers[-1] - (numbers[1] if len(of) > 1 else 0.0)) / numbers[0]
        parts = [std * rate for std in parts] if rate else []
    if isinstance(value, float) and feature in gains:
        parts = [*parts, abs(value) * gains[feature]]
    unseen = row.get("unseen_force")
    if isinstance(unseen, float) and feature in GAINED["force"]:
        parts = [*parts, abs(unseen)]
    if isinstance(unseen, float) and feature == "held_work" and isinstance(value, float):
        ends = (row.get(column(end, pluck)) for end in ("contact_force", "release_force"))
        mean = sum(force for force in ends if isinstance(force, float)) / 2
        parts = [*parts, abs(unseen * value / mean)] if mean else parts  # Times the travel
    return math.hypot(*parts) if parts else None


def level_std(row: Row, name: str) -> float:
    """Return the part of `std_of` that does not cancel in a difference between conditions.

    It is that of the fit, which may be wrong alike in all presses of a condition and otherwise in
    another. Gains, friction of the fingertip, and what AC coupling hides are the same in both.
    """
    std = std_of(row | {"unseen_force": None}, name, {}) or 0.0
    drop = row.get(name) if split_column(name)[0] == "force_drop" else None
    same = FINGERTIP * drop if isinstance(drop, float) else 0.0
    return math.sqrt(max(0.0, std**2 - same**2))


def work_along(travel: Floats, force: Floats) -> float:
    """Return the work [J] of a force [N] on its travel [m], both of shape (n,), by trapezia."""
    return float(np.diff(travel) @ (force[1:] + force[:-1]) / 2)


def held_speeds(press: Press, phases: Phases) -> Row:
    """Return mean, least and largest jack speed while any string is held, and its RMS error.

    The error is that from the plan without a correction, relative to the largest planned speed. All
    are None without a pluck or a velocity, and the error also without a planned motion.
    """
    found: Row = dict.fromkeys(OF_SPEED)
    if press.missing == "velocity" or not phases.plucks:
        return found
    ends = [(held.contact, held.release) for held in phases.plucks]
    first, last = min(start for start, _ in ends), max(stop for _, stop in ends)
    # Over at most 1 ms each, so that the vibrometer's noise is below 0.2 % of a jack speed of 5
    # mm/s.
    time = np.linspace(first, last, 1 + max(4, math.ceil((last - first) / 1e-3)))
    held = np.any([(time[:-1] >= start) & (time[1:] <= stop) for start, stop in ends], axis=0)
    if not held.any():
        return found
    per_step = (len(time) - 1) / (last - first)
    rise = np.interp(time, press.time, press.samples["jack_rise"])
    speed = np.diff(rise)[held] * per_step
    found |= zip(OF_SPEED, map(float, (speed.mean(), speed.min(), speed.max())), strict=False)
    if press.motion is not None:
        with suppress(TrajectoryError):  # of a rig that describes no press
            law = press_law(press.rig.press).law
            planned = np.diff(law.at(time - press.motion.time).position)[held] * per_step
            error = np.sqrt(np.mean((speed - planned) ** 2)) / np.abs(planned).max()
            found["held_speed_error"] = float(error) if math.isfinite(error) else None
    return found


def unknown_of(press: Press, phases: Phases) -> tuple[str, ...]:
    """Return the columns of a complete press that are None: a signal is missing or saturated."""
    saturated = any(held.saturated for held in phases.plucks)
    whole = ("peak_force", "press_work") if saturated else ()
    return (*NEED.get(press.missing or "", ()), *whole)


def features(press: Press, phases: Phases) -> Row:
    """Return the features of a press: the columns of `UNITS`, and those of further plucks.

    Without a pluck the columns of the first one are None; those of `NEED` are where the press
    lacks that signal.
    """
    time = press.time
    unknown = unknown_of(press, phases)
    nothing = np.zeros(len(time))
    rise, deflection, angle, force = (
        press.samples.get(name, nothing) for name in ("jack_rise", "deflection", "angle", "force")
    )

    def work(start: float, stop: float, *ends: float) -> float:
        """Return the finger's work [J] between two instants [s]: the integral of F a_p da.

        Args:
            ends: N, force at both, if they lie within the recording.
        """
        inside = slice(*np.searchsorted(time, (start, stop)))
        turned, pushed = angle[inside], force[inside]
        if ends:
            turned = np.insert(np.interp((start, stop), time, angle), 1, turned)
            pushed = np.insert(np.array(ends), 1, pushed)
        return work_along(press.rig.key.press_arm * turned, pushed)

    row: Row = {
        "path": str(press.path),
        "simulated": press.simulated,
        "plucks": len(phases.plucks),
        **{name: getattr(phases, name) for name in OF_PHASES},
        **held_speeds(press, phases),
        **dict.fromkeys(OF_PLUCK),
    }
    for number, held in enumerate(phases.plucks, 1):
        ends = (held.contact, held.release)
        contact_rise, release_rise = np.interp(ends, time, rise).tolist()
        start, end = np.interp(ends, time, deflection).tolist()
        found = vars(held) | {
            "pluck_duration": held.pluck_duration,
            "contact_rise": contact_rise,
            "release_rise": release_rise,
            "held_deflection": end - start,
            "held_work": work(*ends, held.contact_force, held.release_force),
        }
        found |= dict.fromkeys(OF_SATURATED) if held.saturated else {}
        row |= {column(name, number): found.get(name) for name in OF_PLUCK}
        for channel, values in press.string_signals:
            if channel.string == held.string:
                string = choirs(press.rig)[channel.string - 1].string
                start = measured_start(channel, string, time, values, *ends)
                row |= {column(name, number): value for name, value in start.items()}
    still = slice(*np.searchsorted(time, press.drift.before or (0.0, 0.0)))
    row |= {
        "peak_force": phases.peak_force,
        "press_work": work(-np.inf, phases.bottom),
        "full_rise": float(rise.max()),
        "end_rise": float(rise[-1]),
        "unseen_force": phases.unseen_force,
        "rest_force": press.drift.force + float(force[still].mean()) if force[still].size else None,
        "warnings": len(press.warnings) + len(phases.warnings),
    }
    return row | {name: None for name in row if unknown and split_column(name)[0] in unknown}
