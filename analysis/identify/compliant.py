"""Fits of a compliant key: elastic modes are added one by one while a stiffer key does not fit.

Before that, a rigid key is tried with wrong calibrations: a force that is 0.5 ms late or drifts, or
a wrong lever arm, leaves a residual that modes imitate, with wrong values of other parameters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sautereau.analysis.identify import elastic, parameters
from sautereau.analysis.identify.fit import (
    Fit,
    fit,
    inverse_dynamics,
    problem_at,
    refined,
    scatter,
    spread,
)
from sautereau.analysis.identify.fixed import ScoreTest, derivative
from sautereau.analysis.identify.observed import Observed, too_short
from sautereau.analysis.identify.problem import ROUGH
from sautereau.analysis.identify.quality import quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

FREQUENCIES = np.geomspace(80.0, 1200.0, 30)  # Frequencies at which a mode is tried (Hz)
WEIGHT = 0.02  # Weight of a mode for numerical derivatives, dimensionless
TAPPED_STD = 0.2
"""Standard uncertainty of a mode that was found by tapping the resting key: relative for its
frequency, absolute for its damping ratio. The pressed key has other modes."""
INERTIA_FACTOR = 2.0
"""Ratio of the bounds of a compliant key's inertia to the rig's value. Above its modes a key shows
a smaller inertia; with that inertia, one mode less would fit almost as well."""


def fit_presses(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, parameters.Prior] | None,
    level: str,
    starts: int,
    robust: bool,
) -> Fit:
    """Fit parameters to presses of one rig; see `identified.identify`.

    The key gets as many elastic modes as the residuals on the way down without a string require,
    unless a rigid key with wrong calibrations fits. The modes that the rig states are tried first.
    """
    dynamics = inverse_dynamics(presses, phases, names, priors, level)
    best = fit(dynamics, starts, robust, free_offset=parameters.FORCE in names)
    good = quality(best)
    stiff = refined(best, robust) if good.quiet else None
    # The noise at rest may hide modes, but it does not repeat as their residual does.
    if stiff and not quality(stiff).repeats:
        return stiff
    if (rigid := _uncalibrated(best, robust)) is not None:
        return rigid
    while (good.repeats or not good.quiet) and len(elastic.modes_of(_named(best))) < elastic.MOST:
        dynamics = _with_mode(best)
        if dynamics is None:
            break
        fitted = fit(dynamics, 1, robust, free_offset=best.free_offset, tolerance=ROUGH)
        # Beside the residuals of its start, which are larger, the priors weigh more.
        dynamics = _from(dynamics, fitted.values)
        fitted = fit(dynamics, 1, robust, free_offset=best.free_offset)
        found = quality(fitted)
        # A mode is kept if it reduces the residual below this fraction.
        if found.free_residual > 0.9 * good.free_residual or elastic.close_modes(_named(fitted)):
            break
        best, good = fitted, found
    if stiff and not elastic.modes_of(_named(best)):
        return stiff
    return refined(best, robust)


def _uncalibrated(fitted: Fit, robust: bool) -> Fit | None:
    """Return the fit of a rigid key whose calibrations are wrong; None if none of them fits.

    The calibrations are found without their priors, which count again when the fit is continued.
    """
    dynamics, found = fitted.problem.dynamics, []
    sensors, zero = parameters.CALIBRATIONS, () if fitted.free_offset else (parameters.FORCE,)
    for names in filter(None, dict.fromkeys((sensors, zero, (*sensors, *zero)))):
        if found and names == (*sensors, *zero):
            break
        free = [replace(p, std=None) if p.hidden and p.name in names else p for p in dynamics.free]
        free_offset = fitted.free_offset or parameters.FORCE in names
        made = fit(dynamics.with_free(free), 1, robust, free_offset=free_offset)
        good = quality(made)
        if good.quiet and not good.repeats:
            problem = replace(made.problem, dynamics=dynamics)
            found.append(replace(made, problem=problem, instead=names))
    if not found:
        return None
    instead = tuple(name for each in found for name in each.instead)
    return refined(replace(found[0], instead=instead), robust)


def _named(fitted: Fit) -> dict[str, float]:
    free = fitted.problem.free
    return dict(zip((p.name for p in free), fitted.values.tolist(), strict=True))


def _from(dynamics: InverseDynamics, values: Floats) -> InverseDynamics:
    """Return the dynamics whose fit starts at these values [SI]."""
    pairs = zip(dynamics.free, values.tolist(), strict=True)
    return dynamics.with_free([replace(p, start=value) for p, value in pairs])


def _with_mode(fitted: Fit) -> InverseDynamics | None:
    """Return the dynamics with the mode that reduces the residuals most; None if none does."""
    dynamics, number = fitted.problem.dynamics, len(elastic.modes_of(_named(fitted)))
    # The fit of a rigid key may be far off: search the first mode at the values of the rig.
    values = fitted.values if number else np.array([p.start for p in dynamics.free])
    free = [*_from(dynamics, values).free]
    for k, p in enumerate(free):
        # Unless it has a prior, near the rig's value.
        if (
            p.name == parameters.INERTIA
            and p.std is None
            and p.low < dynamics.rig.key.inertia < p.high
        ):
            low = max(p.low, dynamics.rig.key.inertia / INERTIA_FACTOR)
            high = min(p.high, dynamics.rig.key.inertia * INERTIA_FACTOR)
            start = float(np.clip(p.start, low, high))
            free[k] = replace(p, low=low, high=high, start=start)
    dynamics = compliant(dynamics.with_free(free))
    if dynamics is None:
        return None
    found = _strongest(dynamics, number, fitted.free_offset)
    if found is None:
        return None
    own = elastic.mode_parameters(number, found, known_mode(dynamics.rig, number))
    return dynamics.with_free([*dynamics.free, *own])


def compliant(dynamics: InverseDynamics) -> InverseDynamics | None:
    """Return the dynamics with the parameters of a compliant key, until the first release.

    It is None if no press is usable.
    """
    # Only the way back separates the fingertip's friction from the force's gain. It is not fitted.
    tip, free = dynamics.rig.arm.fingertip_friction, [*dynamics.free]
    unknown = [
        parameters.hidden(
            parameters.CLOTH, 0.0, elastic.CLOTH_STD, (0.0, 10 * elastic.CLOTH_STD), "m/N"
        ),
        # 0.2 changes the moment of the force by 1 %.
        parameters.hidden(parameters.FINGERTIP, tip, 0.2, parameters.ENDS[parameters.FINGERTIP]),
    ]
    free += [new for new in unknown if all(p.name != new.name for p in free)]
    presses, short = before_release(dynamics.presses)
    if not presses:
        return None
    unusable = (*dynamics.unusable, *short)
    return InverseDynamics(dynamics.rig, free, presses, dynamics.level, unusable)


def known_mode(rig: Rig, number: int) -> tuple[float, float] | None:
    """Return the standard uncertainties of a tapped mode's frequency [Hz] and damping in a press.

    They are None if the rig states no mode of this number.
    """
    if number >= len(rig.key.modes):
        return None
    mode = rig.key.modes[number]
    return (
        float(np.hypot(mode.frequency_std, TAPPED_STD * mode.frequency)),
        float(np.hypot(mode.damping_std, TAPPED_STD)),
    )


def before_release(presses: Sequence[Observed]) -> tuple[list[Observed], list[str]]:
    """Return each press up to its first release, and why others are not usable.

    After the release the key springs up and loses the jack. The jack falls back onto it, and the
    impact excites the modes.
    """
    ends = [
        int(np.searchsorted(p.time, p.releases[0])) if len(p.releases) else len(p.time)
        for p in presses
    ]
    cut = [p.until(end) for p, end in zip(presses, ends, strict=True)]
    faults = [too_short(p.name, p.used, " before its first release") for p in cut]
    usable = [press for press, fault in zip(cut, faults, strict=True) if not fault]
    return usable, [f"{fault}; on a compliant key, press more slowly" for fault in faults if fault]


def _strongest(dynamics: InverseDynamics, number: int, free_offset: bool) -> elastic.Mode | None:
    """Return the tried mode that reduces the residuals most, to become the mode of this number.

    The residuals are linear in its weight and in the amplitudes of its ringing. These are freed
    together.
    """
    values = np.array([p.start for p in dynamics.free])
    forces, rises = dynamics.residuals(values)
    size = spread(dynamics, forces, free_offset)
    problem = problem_at(dynamics, values, factor=scatter(rises))
    slopes = problem.differences(values / problem.scales)
    test, before = ScoreTest(problem, values, slopes, size, free_offset), dynamics.joined(values)

    def tried(mode: elastic.Mode) -> tuple[float, elastic.Mode]:
        columns: list[Floats] = []
        for ringing in ({}, {"cosine": 1.0}, {"sine": 1.0}):
            own = elastic.mode_parameters(number, replace(mode, weight=WEIGHT, **ringing))
            moved = dynamics.with_free([*dynamics.free, *own])
            column = derivative(before, moved, np.append(values, [p.start for p in own]), WEIGHT)
            if column is None:
                return 0.0, mode
            columns.append(column - columns[0] if columns else column)
        steps, reduction = test.freed(columns)
        # A linear step may be too long: the fit starts at most at a weight of 3 and at 2 N.
        weight = float(np.clip(steps[0], -3.0, 3.0))
        cosine, sine = np.clip(steps[1:] / (weight or 1.0), -2.0, 2.0).tolist()
        return reduction, replace(mode, weight=weight, cosine=cosine, sine=sine)

    stated = dynamics.rig.key.modes[number : number + 1]
    lowest = elastic.LEAST_PERIODS / elastic.shortest_record(dynamics.presses)
    u, v = elastic.SHAPES["key"]
    table = [
        elastic.Mode(frequency, damping, WEIGHT, u, v)
        for frequency in [m.frequency for m in stated] or FREQUENCIES[lowest < FREQUENCIES].tolist()
        # Damping ratios that are tried where none is stated.
        for damping in [m.damping for m in stated] or (0.03, 0.15)
    ]
    if not table:
        return None
    best = max(map(tried, table), key=lambda found: found[0])
    others = [
        tried(replace(best[1], jack_by_finger=u, jack_by_laser=v, cosine=0.0, sine=0.0))
        for name, (u, v) in elastic.SHAPES.items()
        if name != "key"
    ]
    reduction, mode = max([best, *others], key=lambda found: found[0])
    return mode if reduction > 0 else None
