"""The quasi-static pluck: contact, bending, sliding, release for a jack going up.

Between plectrum and spring string all is a function of the jack's height h above first
contact: equilibria of the string along and across the plectrum (paper, 2.4), followed from
contact. Friction holds the string at its position of contact until the force along the plectrum
reaches mu F; from there it slides to the tip, where it is released. Where the curve of
equilibria folds and h no longer rises, the string slides off the plectrum and is released early.

The string's centre is on the plectrum's mid-line or, by `StringCentre`, above it on the surface.
The wire does not roll over the tip's edge: there it is stable only if the string is displaced by
less than its radius, as in hardly any pluck.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.pluck.equilibria import AT_END, Curve, Equilibria
from sautereau.analysis.model.pluck.loaded import plectra_of, shape_of
from sautereau.analysis.model.pluck.paths import Paths, Status, lasts, solve_paths

STIFFNESS_RANGE = (1e-3, 1e12)  # N/m, of a string that a plectrum can pluck
OVERLAP_MAX = 0.9999  # Of the length; nearer to the clamp a string is lifted without bending


@dataclass(frozen=True)
class Pluck(Curve):
    """Pluck from contact to release, at increasing height; read-only arrays of shape (n,)."""

    stretches: tuple[int, ...] = (0,)
    """Indices of the points at which the string starts to stick or slide."""
    released_at_fold: bool = False
    """Whether the pluck ends at a fold of the equilibrium curve instead of at the tip."""

    @property
    def vertical_force(self) -> Floats:
        """N, force of the string on the jack, downwards."""
        return self.force * (np.cos(self.angle) + self.drag * np.sin(self.angle))

    @property
    def release_height(self) -> float:
        """m, height of the jack above first contact at release."""
        return float(self.height[-1])

    @cached_property
    def work(self) -> float:
        """J, of the jack against string and plectrum, from contact to release."""
        return float(self._spline.integrate(*self._spline.x[[0, -1]]))

    @property
    def release_slopes(self) -> tuple[float, float]:
        """Derivatives of the string's shift and lift by the height just before release.

        Dimensionless; infinite if the pluck ends at a fold.
        """
        if self.released_at_fold:
            return math.inf, math.inf
        height, shift, lift = (AT_END @ a[-5:] for a in (self.height, self.shift, self.lift))
        return float(shift / height), float(lift / height)

    def force_on_jack(self, height: ArrayLike) -> Floats:
        """Return the string's downward force [N] at heights [m]; zero off the string."""
        height = np.asarray(height, float)
        found = np.zeros_like(height)
        within = (height >= 0) & (height <= self.release_height)
        found[within] = self._spline(height[within])
        return found

    @cached_property
    def _spline(self):
        from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly

        ends = [*(start + 1 for start in self.stretches[1:]), len(self.height)]
        parts = [slice(a, b) for a, b in zip(self.stretches, ends, strict=True)]
        force = self.vertical_force
        # At a fold the slope of the force is infinite, where a smooth spline would oscillate.
        spline = PchipInterpolator if self.released_at_fold else CubicSpline
        splines = [spline(self.height[part], force[part]) for part in parts]
        return PPoly(np.concatenate([s.c for s in splines], axis=1), self.height)


def solve_pluck(plectrum: PlectrumMap, stiffness: float, overlap: float) -> Pluck:
    """Follow the string along the plectrum from first contact to its release.

    Args:
        stiffness: N/m, of the string at the plucking point, K of the paper's equation 2.
        overlap: m, from the string at rest to the tip, along the undeformed mid-line.

    Raises:
        ModelError: The overlap or the string's stiffness is out of range, or the string is
            not released within the range of the level.
    """
    (found,) = solve_plucks([(plectrum, stiffness, overlap)])
    if isinstance(found, ModelError):
        raise found
    return found


def solve_plucks(cases: Sequence[tuple[PlectrumMap, float, float]]) -> list[Pluck | ModelError]:
    """Return the plucks of several arguments of `solve_pluck`, or why there is none.

    Those of one table and friction are solved together, in little more than the time of one.
    """
    found: dict[int, Pluck | ModelError] = {}
    alike = defaultdict(list)
    for k, case in enumerate(cases):
        if faults := _faults(*case):
            found[k] = ModelError("\n".join(faults))
        else:
            alike[shape_of(case[0]) or k].append(k)
    for rows in alike.values():
        plectra, *values = zip(*(cases[k] for k in rows), strict=True)
        stiffness, overlap = np.array(values)
        equilibria = Equilibria(plectra_of(plectra, overlap), stiffness, overlap)
        paths = solve_paths(equilibria, 201)  # Points of a stretch
        for row, k in enumerate(rows):
            try:
                found[k] = _followed(paths, row, *cases[k])
            except ModelError as error:
                found[k] = error
    return [found[k] for k in range(len(cases))]


def _followed(
    paths: Paths, row: int, plectrum: PlectrumMap, stiffness: float, overlap: float
) -> Pluck:
    """Return the pluck of one row of paths; other arguments and errors as for `solve_pluck`."""
    status = Status(paths.status[row])
    curves = [
        Curve(*(values[row] for values in vars(curve).values()))
        for curve in paths.curves
        if lasts(curve.load)[row]
    ]
    at = f"plectrum.overlap: at {overlap * 1e3:.6g} mm the string"
    if status == Status.NOT_CONVERGED:
        raise ModelError(
            f"{at} has no position on the plectrum that balances its {stiffness:.4g} N/m;"
            " string.tension or plectrum.overlap are out of the model's range"
        )
    if status == Status.JUMPS:
        raise ModelError(
            f"{at} jumps along the plectrum at a jack height of"
            f" {curves[-1].height[-1] * 1e3:.4g} mm and is held again, which is no quasi-static"
            " pluck; lower overlap or raise plectrum.thickness"
        )
    if status == Status.STILL_HELD:
        limit = float(plectrum.force_limit(curves[-1].position[-1]))
        raise ModelError(
            f"{at} is still held at {limit:.4g} N, where the plectrum is bent beyond this level's"
            " range; lower overlap or raise string.tension"
        )
    if status == Status.RELEASED_AT_FOLD:
        # A fold at the very start of a stretch leaves nothing of it but rounding.
        curves = [curve for curve in curves if np.all(np.diff(curve.height) > 0)]
        return _joined(curves, released_at_fold=True)
    return _joined(curves)


def _faults(plectrum: PlectrumMap, stiffness: float, overlap: float) -> list[str]:
    faults = []
    low, high = STIFFNESS_RANGE
    if not low <= stiffness <= high:
        faults.append(
            f"string: its stiffness of {stiffness:.4g} N/m is not within {low:.4g} to"
            f" {high:.4g} N/m; see string.tension and string.plucking_point"
        )
    if not 0 < overlap <= OVERLAP_MAX * plectrum.length:
        faults.append(
            f"plectrum.overlap: {overlap * 1e3:.6g} mm must lie between 0 and {OVERLAP_MAX:.6g} of"
            f" the plectrum's length of {plectrum.length * 1e3:.6g} mm; change it"
        )
    return faults


def _joined(curves: list[Curve], released_at_fold: bool = False) -> Pluck:
    """Return one pluck of stretches, each of which starts where the last one ends."""
    curves = [curve for curve in curves if len(curve.height) > 1]
    if not curves:
        raise ModelError(
            "plectrum.overlap: the plectrum lets the string slip off at first contact; lower"
            " overlap"
        )
    starts = np.cumsum([0, *(len(curve.height) - 1 for curve in curves[:-1])])
    fields = [list(vars(curves[0]).values())]
    fields += [[values[1:] for values in vars(curve).values()] for curve in curves[1:]]
    joined = Curve(*(np.concatenate(values) for values in zip(*fields, strict=True)))
    joined.height[0] = 0.0  # rounding apart
    for values in vars(joined).values():
        values.setflags(write=False)
    return Pluck(
        **vars(joined), stretches=tuple(starts.tolist()), released_at_fold=released_at_fold
    )
