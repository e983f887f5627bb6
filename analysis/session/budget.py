"""The uncertainty budget of a comparison: what the ranges of the rig do to the model's errors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.batch import VARIABLES
from sautereau.analysis.phases import Phases
from sautereau.rig.ranges import Deviation, deviations, drawn
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import moving_inertia
from sautereau.trajectory.motion import Floats

INPUTS = (
    *(n for n in VARIABLES if not n.startswith(("press.", "key.dip", "key.felt"))),
    "key.laser_arm",
)
"""Values of the rig that change the force and the motion while a string is held."""
BENDING = "key bending"  # Name of the contribution of a key that is not rigid
MEASUREMENT = "measurement"  # Name of the contribution of presses, gains, contact and release


@dataclass(frozen=True)
class Contribution:
    """What one input contributes to the uncertainty of the model's errors."""

    name: str
    """Dotted key of a value with an assumed range, `BENDING`, or `MEASUREMENT`."""
    std: float | None
    """SI, its standard uncertainty; None for the last two."""
    effects: dict[str, float]
    """Relative change of the model by that, of each error; positive if the model's value rises with
    the input."""
    fractions: dict[str, float]
    """Fraction of the variance of each error, and so of the error that it is expected to
    explain."""


@dataclass(frozen=True)
class Budget:
    """The 95 % intervals of model errors with the model's inputs, and the contributions to them."""

    intervals: dict[str, tuple[float, float]]
    """Interval of each error [1]; the model is consistent with the presses if it contains 0."""
    contributions: tuple[Contribution, ...]
    """The largest first."""
    omitted: tuple[str, ...]
    """Why inputs are not among them."""

    @property
    def of_ranges(self) -> bool:
        """Whether any value of the rig has an assumed range."""
        return any(each.std is not None for each in self.contributions)


def budget(
    rig: Rig,
    predict: Callable[[Rig], Mapping[str, float]],
    errors: Mapping[str, float],
    stds: Mapping[str, float],
    bending: float = 0.0,
    string: int = 1,
) -> Budget:
    """Return the uncertainty budget of model errors.

    The logarithm of the model over its value for the rig is a parabola in each input, through both
    ends of its range, and a sum over the inputs: exact for products of powers, as forces of a
    plectrum nearly are. The intervals are those of its distribution (JCGM 101).

    Args:
        rig: The bench that is predicted.
        predict: Returns the model's values for a rig, by the names of the errors.
        errors: Model errors [1].
        stds: Relative standard uncertainties of the measured values.
        bending: Part of the held string's rise by which the laser may exaggerate it (`bending_of`).
        string: Number of the compared string; the ranges of its own values are among the inputs.
    """
    names, omitted, inputs = list(errors), [], []

    def of_model(of: Rig) -> Floats:
        values = predict(of)
        return np.array([values[name] for name in names])

    nominal = of_model(rig)

    def logarithm(of: Rig) -> Floats:
        ratios = of_model(of) / nominal
        if not (ratios > 0).all():
            raise ModelError("the force slope or rise changes its sign, or is 0")
        return np.log(ratios)

    names_of_inputs = INPUTS
    if string > 1:
        own = (n for n in INPUTS if n.startswith(("jack.", "plectrum.", "string.")))
        names_of_inputs += tuple(f"more_choirs.{string - 2}.{name}" for name in own)
    for deviation in deviations(rig, names_of_inputs):
        try:
            inputs.append((deviation, _parabola(rig, deviation, logarithm)))
        except ModelError as error:
            omitted.append(f"the range of {deviation.name} is not in the intervals: {error}")
    if bending:
        longer = {"slope_error": -1.0, "duration_error": 1.0}
        error = Deviation(BENDING, 0.0, bending, ())
        inputs.append((error, error.std * np.array([[longer.get(n, 0.0) for n in names]])))
    changes = drawn(np.array([stds[name] for name in names]), inputs)
    each = [
        np.exp(np.quantile(c, (0.025, 0.975), axis=0)) for c in (np.sum(changes, 0), changes[0])
    ]
    # With ranges on one side of the rig's values, the rig itself stays possible.
    ends = np.stack([np.min(each, axis=0)[0], np.max(each, axis=0)[1]])
    ratios = 1 + np.array([errors[name] for name in names])
    ends = np.sort(ratios * ends - 1, axis=0)  # a ratio of opposite signs is negative
    # Of an input whose range is on one side of the rig's value all of the change is unknown.
    squares = [np.mean(change**2, axis=0) for change in changes]
    total = np.maximum(np.sum(squares, axis=0), 1e-300)
    stated = [(MEASUREMENT, None, np.sqrt(squares[0]))] + [
        (d.name, d.std if d.keys else None, np.sqrt(own) * np.sign(c[0]))
        for (d, c), own in zip(inputs, squares[1:], strict=True)
    ]
    contributions = [
        Contribution(name, std, _named(names, effect), _named(names, own / total))
        for (name, std, effect), own in zip(stated, squares, strict=True)
    ]
    return Budget(
        {n: (float(a), float(b)) for n, a, b in zip(names, *ends, strict=True)},
        # Of inputs without an effect but for rounding errors, the order is that of `INPUTS`.
        tuple(sorted(contributions, key=lambda c: -round(max(c.fractions.values()), 12))),
        tuple(omitted),
    )


def bending_of(rig: Rig, phases: Sequence[Phases]) -> float:
    """Return the largest part of the held string's rise that may be bending of the key.

    The laser then sees more motion than the jack has. The compliance that the phases fit is that of
    finger, key and cloth together, so that it is an upper bound.
    """
    held = [(f.plucks[0], f.held_speed, f.fit) for f in phases if f.plucks]
    parts = [
        fit.compliance * pluck.force_rise / (pluck.pluck_duration * speed)
        for pluck, speed, fit in held
        if fit and speed
    ]
    key, bent = rig.key, float(np.mean(parts or [0.0]))
    # (1 - u) (1 - v) of a key in its first bending, u = v = -0.6; see identify/elastic.py.
    return 2.6 * key.jack_arm * key.press_arm / moving_inertia(rig) * max(0.0, bent)


def _named(names: list[str], values: Floats) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _parabola(rig: Rig, deviation: Deviation, logarithm: Callable[[Rig], Floats]) -> Floats:
    """Return the coefficients of an input over its standard uncertainty and of the square, shape
    (2, errors)."""
    ends = [end for end in (deviation.low, deviation.high) if end]
    changed = [logarithm(deviation.applied(rig, end)) for end in ends]
    along = np.array(ends) / deviation.std
    if len(ends) < 2:  # the rig's value is one end of its range
        return np.stack([changed[0] / along[0], np.zeros_like(changed[0])])
    return np.asarray(np.linalg.solve(np.stack([along, along**2], 1), np.array(changed)), float)
