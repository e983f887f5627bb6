"""Fits of a compliant key: elastic modes, one by one, where a rigid key does not fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sautereau.analysis.identify.elastic import (
    LEAST_PERIODS,
    MOST,
    SHAPES,
    Mode,
    close_modes,
    foot_parameter,
    mode_parameters,
    modes_of,
    shortest_record,
)
from sautereau.analysis.identify.fit import (
    Fit,
    fit,
    inverse_dynamics,
    problem_at,
    refined,
    scatter,
    spread,
)
from sautereau.analysis.identify.fixed import ScoreTest
from sautereau.analysis.identify.observed import LEAST, Observed
from sautereau.analysis.identify.parameters import ENDS, FINGERTIP, FORCE, Parameter, Prior
from sautereau.analysis.identify.quality import quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

FREQUENCIES, DAMPINGS = np.geomspace(80.0, 1200.0, 30), (0.03, 0.15)
"""Hz and dimensionless, of the table in which a mode is sought."""
WEIGHT = 0.02
"""Dimensionless, weight of a mode for its derivative."""
LARGEST, RINGING = 3.0, 2.0
"""Dimensionless and N, largest weight and ringing at which the fit of a mode starts."""
FINGERTIP_STD = 0.2
"""Dimensionless, of the fingertip's friction on the key: its moment scales the force by 1 %."""
AT_REST = 0.2
"""Dimensionless, by which a mode of the pressed key differs from the one found by tapping, as a
fraction of its frequency; and of its damping ratio."""
INERTIA, INERTIA_FACTOR = "key.inertia", 2.0
"""Ratio of a bound of the inertia of a compliant key to the rig's value: with the inertia that is
seen above its modes, one mode less fits almost as well."""
LEAST_GAIN = 0.9
"""Dimensionless, largest residual over that without a mode which makes the mode worthwhile."""


def fit_presses(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None,
    level: str,
    starts: int,
    robust: bool,
) -> Fit:
    """Fit parameters to presses of one rig; see `identified.identify`.

    The key has as many elastic modes as the way down without a string requires; those that the rig
    states come first.
    """
    dynamics = inverse_dynamics(presses, phases, names, priors, level)
    best = fit(dynamics, starts, robust, levelled=FORCE in names)
    good, before = quality(best), best.residual_before
    while not good.quiet and len(modes_of(_named(best))) < MOST:
        dynamics = _with_mode(best)
        if dynamics is None:
            break
        made = fit(dynamics, 1, robust, levelled=best.levelled)
        found = quality(made)
        if found.free_residual > LEAST_GAIN * good.free_residual or close_modes(_named(made)):
            break
        best, good = made, found
    return replace(refined(best, robust), residual_before=before)


def _named(made: Fit) -> dict[str, float]:
    free = made.problem.free
    return dict(zip((p.name for p in free), made.values.tolist(), strict=True))


def _with_mode(made: Fit) -> InverseDynamics | None:
    """Return the dynamics with the mode that reduces the residuals most; None without one."""
    dynamics, number = made.problem.dynamics, len(modes_of(_named(made)))
    # A fit of too stiff a key is far off: seek the first mode from the values of the rig.
    values = made.values if number else np.array([p.start for p in dynamics.free])
    free = [replace(p, start=float(v)) for p, v in zip(dynamics.free, values, strict=True)]
    free = [_near_stated(dynamics.rig, p) if p.name == INERTIA else p for p in free]
    # The way back, which separates the fingertip's friction from the force's gain, is not fitted.
    tip, ends = dynamics.rig.arm.fingertip_friction, ENDS[FINGERTIP]
    unknown = [
        foot_parameter(),
        Parameter(FINGERTIP, "", tip, *ends, tip, FINGERTIP_STD, hidden=True),
    ]
    free += [new for new in unknown if all(p.name != new.name for p in free)]
    presses = _before_release(dynamics.presses)
    if not presses:
        return None
    dynamics = InverseDynamics(dynamics.rig, free, presses, dynamics.level)
    found = _strongest(dynamics, number, made.levelled)
    if found is None:
        return None
    free += mode_parameters(number, found, _known(dynamics.rig, number))
    return dynamics.with_free(free)


def _near_stated(rig: Rig, inertia: Parameter) -> Parameter:
    """Return the inertia with bounds near the rig's value, unless it has its own prior."""
    if inertia.std is not None or not inertia.low < rig.key.inertia < inertia.high:
        return inertia
    low, high = rig.key.inertia / INERTIA_FACTOR, rig.key.inertia * INERTIA_FACTOR
    low, high = max(inertia.low, low), min(inertia.high, high)
    return replace(inertia, low=low, high=high, start=float(np.clip(inertia.start, low, high)))


def _known(rig: Rig, number: int) -> tuple[float, float] | None:
    """Return the standard uncertainties of a mode's frequency [Hz] and damping in a press.

    A key that rests on its rail, untouched or under a resting finger, has other modes.
    """
    if number >= len(rig.key.modes):
        return None
    mode = rig.key.modes[number]
    return (
        float(np.hypot(mode.frequency_std, AT_REST * mode.frequency)),
        float(np.hypot(mode.damping_std, AT_REST)),
    )


def _before_release(presses: Sequence[Observed]) -> list[Observed]:
    """Return presses without what follows the first release of each.

    There the jack leaves the key, which springs up, and excites it by an impact when it falls back.
    """
    ends = [
        int(np.searchsorted(p.time, p.releases[0])) if len(p.releases) else len(p.time)
        for p in presses
    ]
    # Presses of one motion keep one length.
    cut = [p.until(max(ends), end) for p, end in zip(presses, ends, strict=True)]
    return [press for press in cut if press.used.sum() >= LEAST]


def _strongest(dynamics: InverseDynamics, number: int, levelled: bool) -> Mode | None:
    """Return the mode of the table that reduces the residuals most, as the mode of this number.

    Its weight and its ringing from the lift of the key on are linear: they are freed together.
    """
    values = np.array([p.start for p in dynamics.free])
    forces, rises = dynamics.residuals(values)
    size = spread(dynamics, forces, levelled)
    problem = problem_at(dynamics, values, factor=scatter(rises))
    test = ScoreTest(problem, values, size, levelled)

    def tried(mode: Mode) -> tuple[float, Mode]:
        columns: list[Floats] = []
        for ringing in ({}, {"cosine": 1.0}, {"sine": 1.0}):
            own = mode_parameters(number, replace(mode, weight=WEIGHT, **ringing))
            moved = dynamics.with_free([*dynamics.free, *own])
            column = test.column(moved, np.append(values, [p.start for p in own]), WEIGHT)
            columns.append(column - columns[0] if columns else column)
        steps, reduction = test.freed(columns)
        weight = float(np.clip(steps[0], -LARGEST, LARGEST))
        cosine, sine = np.clip(steps[1:] / (weight or 1.0), -RINGING, RINGING).tolist()
        return reduction, replace(mode, weight=weight, cosine=cosine, sine=sine)

    stated = dynamics.rig.key.modes[number : number + 1]
    lowest = LEAST_PERIODS / shortest_record(dynamics.presses)
    u, v = SHAPES["key"]
    table = [
        Mode(frequency, damping, WEIGHT, u, v)
        for frequency in [m.frequency for m in stated] or FREQUENCIES[lowest < FREQUENCIES].tolist()
        for damping in [m.damping for m in stated] or DAMPINGS
    ]
    if not table:
        return None
    best = max(map(tried, table), key=lambda found: found[0])
    others = [
        tried(replace(best[1], jack_by_finger=u, jack_by_laser=v, cosine=0.0, sine=0.0))
        for name, (u, v) in SHAPES.items()
        if name != "key"
    ]
    reduction, mode = max([best, *others], key=lambda found: found[0])
    return mode if reduction > 0 else None
