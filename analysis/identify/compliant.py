"""Fits of a compliant key: elastic modes, one by one, where a rigid key does not fit."""

from dataclasses import replace

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.elastic import (
    MOST,
    SHAPES,
    Mode,
    foot_parameter,
    mode_parameters,
    modes_of,
)
from sautereau.analysis.identify.fit import Fit, fit, rms
from sautereau.analysis.identify.observed import Observed
from sautereau.analysis.identify.parameters import FOOT
from sautereau.analysis.identify.problem import Problem, whitening
from sautereau.analysis.identify.quality import quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

FREQUENCIES, DAMPINGS = np.geomspace(90.0, 1500.0, 20), (0.02, 0.15)
"""Hz and dimensionless, of the table in which a mode is sought."""
WEIGHT = 0.02
"""Dimensionless, weight of a mode for its derivative."""
LARGEST = 3.0
"""Dimensionless, largest weight at which the search for a mode starts."""
AT_REST = 0.2
"""Dimensionless, by which a mode of the pressed key differs from the one found by tapping, as a
fraction of its frequency; and of its damping ratio."""
LEAST_GAIN = 0.7
"""Dimensionless, largest residual over that without a mode which makes the mode worthwhile."""


def fit_compliant(rigid: Fit, robust: bool = False) -> Fit:
    """Return the fit with as many elastic modes as the way down without a string requires.

    Args:
        rigid: The fit of a rigid key, or of one whose modes the rig states.
        robust: As for `fit`.
    """
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
    dynamics = made.problem.dynamics
    number = len(modes_of(_named(made)))
    # A fit of too stiff a key is far off: seek the first mode from the values of the rig.
    values = made.values if number else np.array([p.start for p in dynamics.free])
    free = [replace(p, start=float(v)) for p, v in zip(dynamics.free, values, strict=True)]
    if all(p.name != FOOT for p in free):
        free.append(foot_parameter())
    presses = [_before_release(press) for press in dynamics.presses]
    found = _strongest(made, InverseDynamics(dynamics.rig, free, presses, dynamics.level))
    if found is None:
        return None
    free += mode_parameters(number, found, _known(dynamics.rig, number))
    return InverseDynamics(dynamics.rig, free, presses, dynamics.level)


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


def _before_release(press: Observed) -> Observed:
    """Return a press without what follows its first release.

    There the jack leaves the key, which springs up, and excites it by an impact when it falls back.
    """
    if not len(press.releases):
        return press
    return replace(press, used=press.used & (press.time < press.releases[0]))


def _strongest(made: Fit, dynamics: InverseDynamics) -> Mode | None:
    """Return the mode of the table that reduces the residuals most."""
    values = np.array([p.start for p in dynamics.free])
    forces, _ = dynamics.residuals(values)
    spread = max(rms([f - f.mean() for f in forces]), dynamics.floor)
    white = tuple(
        whitening(p.used, np.ones(1), made.levelled, spread, p.step) for p in dynamics.presses
    )
    scales = np.array([p.scale(v) for p, v in zip(dynamics.free, values.tolist(), strict=True)])
    problem = Problem(dynamics, scales, white)
    point = values / scales
    prior = problem.prior_jacobian(point)
    basis, _ = np.linalg.qr(np.vstack([problem.jacobian(point, problem.all)[: -len(prior)], prior]))
    before = np.concatenate([problem.data(point), problem.prior(point)])
    best: tuple[float, Mode | None] = (0.0, None)
    number = len(modes_of(dict.fromkeys(p.name for p in dynamics.free)))  # pyright: ignore
    stated = dynamics.rig.key.modes[number : number + 1]
    for frequency in [m.frequency for m in stated] or FREQUENCIES.tolist():
        for damping in [m.damping for m in stated] or DAMPINGS:
            for u, v in SHAPES.values():
                mode = Mode(frequency, damping, WEIGHT, u, v)
                try:
                    column = _column(problem, before[: -len(prior)], number, mode, values)
                except ModelError:
                    continue
                column = np.concatenate([column, np.zeros(len(prior))])
                left = column - basis @ (basis.T @ column)
                along, size = float(left @ before), float(left @ left)
                if size > 0 and along**2 / size > best[0]:
                    weight = float(np.clip(-along / size, -LARGEST, LARGEST))
                    best = along**2 / size, replace(mode, weight=weight)
    return best[1]


def _column(problem: Problem, before: Floats, number: int, mode: Mode, values: Floats) -> Floats:
    """Return the derivative of the whitened residuals by the weight of a mode."""
    dynamics = problem.dynamics
    free = [*dynamics.free, *mode_parameters(number, mode)]
    moved = InverseDynamics(dynamics.rig, free, dynamics.presses, dynamics.level)
    own = [p.start for p in free[len(values) :]]
    point = np.array([*values, *own])
    after = replace(problem, dynamics=moved, scales=np.ones(len(point))).data(point)
    return (after - before) / mode.weight
