"""Where to take material from a plectrum's underside, so that its press has requested values.

The depth is a cubic spline over the length, whose knots are a knife's stroke apart: zero with its
slope at the root, nowhere negative because its coefficients are not. Least squares of logarithms of
the requested quantities, with little weight on bends and amount of the depth, choose among the
carvings that reach them: linear least squares between the bounds, step by step. Derivatives are
those of the finite elements' table by each coefficient.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.model.choirs import choirs, hold, with_plectrum
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.elastica import nearest_of
from sautereau.analysis.model.plectrum.fe.level import FE, elastic_of
from sautereau.analysis.model.plectrum.profile import Profile, profile_of
from sautereau.analysis.model.plectrum.surface import string_centre
from sautereau.analysis.model.plectrum.table import Table
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.analysis.model.predict import Prediction, pressed
from sautereau.rig.instrument import Outline, Plectrum
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig

ROOT = 0.1  # Fraction of the length from the clamp in which nothing is cut
UNIT = 1e-4  # m, of the coefficients of the depth
TARGET_STD = 5e-4  # Relative deviation from a target that weighs as much as a bend of one `UNIT`
STEP = 1e-6  # m, of the depth, for derivatives of the press by the table's derivatives
LEAST_STEP = 1e-6  # m, a step that needs no further one
MOST_STEPS = 20

Observe = Callable[[Rig, Prediction], Floats]  # Logarithms, or relative deviations


@dataclass(frozen=True)
class Knife:
    """What a maker can cut; m."""

    least: float = 0.12e-3
    """Least thickness that remains."""
    most: float = 0.25e-3
    """Largest depth of the cut."""
    stroke: float = 1e-3
    """Distance of the knots of the depth: the length over which a stroke changes it."""


@dataclass(frozen=True)
class Carving:
    """A cut of the underside: depth = shapes @ depths at the places; m."""

    places: Floats
    """From the clamp to the tip, shape (n,)."""
    shapes: Floats
    """Dimensionless, shape (n, cuts)."""
    most: Floats
    """Largest depth of each, shape (cuts,)."""

    def applied(self, plectrum: Plectrum, depths: Floats) -> Plectrum:
        """Return a plectrum after the cut, without its ensemble."""
        x, top, bottom = _edges(plectrum, self.places)
        cut = np.interp(x * self.places[-1] / x[-1], self.places, self.shapes @ depths)
        edges = (tuple(edge.tolist()) for edge in (x, top, bottom + cut))
        named = dict(zip(("x", "top", "bottom"), edges, strict=True))
        return plectrum.outlined(Outline.model_construct(**named))


def carving(plectrum: Plectrum, knife: Knife) -> Carving:
    """Return the cuts that a knife can make.

    Raises:
        AnalysisError: It can make none.
    """
    from scipy.interpolate import BSpline

    length = plectrum.outline.x[-1] if plectrum.outline else plectrum.length
    places = np.linspace(0.0, length, 41)  # At least 41 vertices
    parts = max(2, round((1 - ROOT) * length / knife.stroke))
    inner = np.linspace(ROOT * length, length, parts + 1)
    knots = np.r_[[inner[0]] * 3, inner, [inner[-1]] * 3]
    own = np.clip(places, inner[0], None)
    basis = BSpline.design_matrix(own, knots, 3).toarray()[:, 2:]
    x, top, bottom = _edges(plectrum, places)
    thick = np.interp(places, x, top - bottom)
    most = np.array([float((thick[shape > 0] - knife.least).min()) for shape in basis.T])
    most = np.clip(most, 0.0, knife.most)
    if not most.any():
        raise AnalysisError(
            f"voice: the plectrum is {thick.min() * 1e3:.3g} mm thick at its thinnest, and"
            f" {knife.least * 1e3:.3g} mm must remain, so that nothing can be cut; lower --least"
        )
    return Carving(places, basis[:, most > 0], most[most > 0])


def _edges(plectrum: Plectrum, places: Floats) -> tuple[Floats, Floats, Floats]:
    """Return x, top and bottom [m] at an outline's own vertices and at further places."""
    profile = profile_of(plectrum)
    length = plectrum.length
    x = np.unique(np.round(np.r_[profile.x, places / places[-1]], 9))
    top, bottom = (np.interp(x, profile.x, edge) for edge in (profile.top, profile.bottom))
    return x * length, top * length, bottom * length


def observed(
    rig: Rig, cut: Carving, depths: Floats, observe: Observe, string: int = 1
) -> tuple[Prediction, Floats, Floats]:
    """Return the press after a cut, what is observed of it, and its derivatives by the depths.

    Args:
        depths: m, shape (cuts,).
        string: Number of the string whose plectrum is cut.

    Returns:
        The press; shape (values,); and shape (values, cuts), per m.

    Raises:
        ModelError: The model has no pluck for the carved plectrum.
    """
    from sautereau.analysis.model.plectrum.fe.build import build

    plectrum = cut.applied(choirs(rig)[string - 1].plectrum, depths)
    carved = with_plectrum(rig, string, plectrum)
    profile = profile_of(plectrum)
    cuts = [np.interp(profile.x, cut.places / cut.places[-1], shape) for shape in cut.shapes.T]
    base, rates = build(profile, elastic_of(plectrum), nearest_of(plectrum), cuts)
    press = _pressed(carved, string, base.table())
    rows = []
    for number in range(len(depths)):
        step = np.zeros(len(depths))
        step[number] = STEP / plectrum.length
        ends = [
            observe(carved, _pressed(carved, string, rates.moved(base, sign * step).table()))
            for sign in (1, -1)
        ]
        rows.append((ends[0] - ends[1]) / (2 * STEP))
    return press, observe(carved, press), np.array(rows).T


def _pressed(rig: Rig, string: int, table: Table) -> Prediction:
    """Return the press of a rig in which the plectrum of a string has a table."""
    choir = choirs(rig)[string - 1]
    plectrum = choir.plectrum
    centre = string_centre(_Tabled(plectrum, table), plectrum, choir.string)
    pluck = solve_pluck(centre, choir.string.static_stiffness, plectrum.overlap)
    return pressed(rig, hold(rig, "fe", {string: pluck}), "fe")


class _Tabled(FE):
    """The level `fe` with a given table."""

    def __init__(self, plectrum: Plectrum, table: Table):
        self._table = table
        super().__init__(plectrum)

    def _table_of(self, plectrum: Plectrum, profile: Profile) -> Table:
        return self._table


def carve(
    rig: Rig, cut: Carving, observe: Observe, target: Floats, string: int = 1
) -> tuple[Floats, Floats]:
    """Return the depths [m] that bring what is observed closest to a target.

    Args:
        target: Shape (values,), as `observe` returns them; NaN where nothing is requested.
        string: Number of the string whose plectrum is cut.

    Returns:
        The depths, shape (cuts,), and the derivatives before the cut, shape (values, cuts), per m.

    Raises:
        ModelError: The plectrum has no pluck before it is cut.
    """
    from scipy.optimize import lsq_linear

    count = len(cut.most)
    # Bends from the root, where the depth is zero, to the tip.
    bends = np.diff(np.eye(count + 2, count, -2), 2, axis=0)
    gentle = np.vstack([bends, 0.1 * np.eye(count)])  # The depth itself counts a little
    requested = np.isfinite(target)

    def linearised(depths: Floats) -> tuple[Floats, Floats, Floats]:
        """Return residuals, their derivatives, and all derivatives of what is observed."""
        values, rates = observed(rig, cut, UNIT * depths, observe, string)[1:]
        residual = np.r_[(values - target)[requested] / TARGET_STD, gentle @ depths]
        return residual, np.vstack([UNIT * rates[requested] / TARGET_STD, gentle]), rates

    depths = np.zeros(count)
    residual, jacobian, before = linearised(depths)
    for _ in tracked(range(MOST_STEPS)):
        aim = jacobian @ depths - residual
        found = lsq_linear(jacobian, aim, (0.0, cut.most / UNIT), method="bvls").x
        step = found - depths
        while (size := np.abs(step).max()) > LEAST_STEP / UNIT:
            with suppress(ModelError):
                trial = linearised(depths + step)
                if trial[0] @ trial[0] < residual @ residual:
                    residual, jacobian, _ = trial
                    break
            step = step / 2
        depths = depths + step
        if size <= LEAST_STEP / UNIT:
            break
    return UNIT * depths, before
