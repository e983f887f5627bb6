"""Fits of a compliant key: elastic modes, one by one, where a rigid key does not fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sautereau.analysis.identify.elastic import (
    MOST,
    SHAPES,
    Mode,
    foot_parameter,
    mode_parameters,
    modes_of,
)
from sautereau.analysis.identify.fit import Fit, fit, inverse_dynamics, problem_at, spread
from sautereau.analysis.identify.fixed import ScoreTest
from sautereau.analysis.identify.observed import Observed
from sautereau.analysis.identify.parameters import ENDS, FINGERTIP, FORCE, Parameter, Prior
from sautereau.analysis.identify.quality import quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.schema import Rig

FREQUENCIES, DAMPINGS = np.geomspace(90.0, 1500.0, 20), (0.02, 0.15)
"""Hz and dimensionless, of the table in which a mode is sought."""
WEIGHT = 0.02
"""Dimensionless, weight of a mode for its derivative."""
LARGEST = 3.0
"""Dimensionless, largest weight at which the search for a mode starts."""
FINGERTIP_STD = 0.2
"""Dimensionless, of the fingertip's friction on the key: its moment scales the force by 1 %."""
AT_REST = 0.2
"""Dimensionless, by which a mode of the pressed key differs from the one found by tapping, as a
fraction of its frequency; and of its damping ratio."""
LEAST_GAIN = 0.7
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
    rigid = fit(dynamics, starts, robust, levelled=FORCE in names)
    best, good = rigid, quality(rigid)
    while not good.quiet and len(modes_of(_named(best))) < MOST:
        dynamics = _with_mode(best)
        if dynamics is None:
            break
        made = fit(dynamics, 1, robust, levelled=best.levelled)
        found = quality(made)
        if found.free_residual > LEAST_GAIN * good.free_residual:
            break
        best, good = replace(made, residual_before=rigid.residual_before), found
    return best


def _named(made: Fit) -> dict[str, float]:
    free = made.problem.free
    return dict(zip((p.name for p in free), made.values.tolist(), strict=True))


def _with_mode(made: Fit) -> InverseDynamics | None:
    """Return the dynamics with the mode that reduces the residuals most; None without one."""
    dynamics, number = made.problem.dynamics, len(modes_of(_named(made)))
    # A fit of too stiff a key is far off: seek the first mode from the values of the rig.
    values = made.values if number else np.array([p.start for p in dynamics.free])
    free = [replace(p, start=float(v)) for p, v in zip(dynamics.free, values, strict=True)]
    # The way back, which separates the fingertip's friction from the force's gain, is not fitted.
    tip, ends = dynamics.rig.arm.fingertip_friction, ENDS[FINGERTIP]
    unknown = [
        foot_parameter(),
        Parameter(FINGERTIP, "", tip, *ends, tip, FINGERTIP_STD, hidden=True),
    ]
    free += [new for new in unknown if all(p.name != new.name for p in free)]
    presses = _before_release(dynamics.presses)
    dynamics = InverseDynamics(dynamics.rig, free, presses, dynamics.level)
    found = _strongest(dynamics, number, made.levelled)
    if found is None:
        return None
    free += mode_parameters(number, found, _known(dynamics.rig, number))
    return dynamics.with_free(free)


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
    return [p.until(max(ends), end) for p, end in zip(presses, ends, strict=True)]


def _strongest(dynamics: InverseDynamics, number: int, levelled: bool) -> Mode | None:
    """Return the mode of the table that reduces the residuals most, as the mode of this number."""
    values = np.array([p.start for p in dynamics.free])
    forces, _ = dynamics.residuals(values)
    size = spread(dynamics, forces, levelled)
    test = ScoreTest(problem_at(dynamics, values), values, size, levelled)
    best: tuple[float, Mode | None] = (0.0, None)
    stated = dynamics.rig.key.modes[number : number + 1]
    for frequency in [m.frequency for m in stated] or FREQUENCIES.tolist():
        for damping in [m.damping for m in stated] or DAMPINGS:
            for u, v in SHAPES.values():
                mode = Mode(frequency, damping, WEIGHT, u, v)
                own = mode_parameters(number, mode)
                point = np.append(values, [p.start for p in own])
                moved = dynamics.with_free([*dynamics.free, *own])
                weight, reduction = test.freed(moved, point, WEIGHT)
                if reduction > best[0]:
                    weight = float(np.clip(weight, -LARGEST, LARGEST))
                    best = reduction, replace(mode, weight=weight)
    return best[1]
