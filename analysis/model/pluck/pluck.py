"""The quasi-static pluck: contact, bending, sliding, release for a jack going up.

Between plectrum and spring string all is a function of the jack's height h above first
contact: equilibria of the string along and across the plectrum (paper, 2.4), followed from
contact on. Friction holds the string where it was met until the force along the plectrum is
mu F; from there it slides to the tip, where it is let go. Where the curve of equilibria folds
and h no longer rises, the plectrum gives way: the string slides off it there, released.

The string is taken as a line on the plectrum's mid-line, and the overlap is counted so. With
`rollover` its wire of radius r, once at the tip, turns about the tip's edge by phi = 0 on, the
contact's normal with it, until the jack can rise no further. The force between them then
departs from the plectrum's normal; the plectrum bends under its normal part, and what lies
along it counts as friction mu F. A wire on an edge is stable only where the string is
displaced by less than the radius, so most plucks have no such phase.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.pluck.branch import Curve, Equations

POINTS = 201
"""Points of a tabulated stretch of the pluck."""
STIFFNESS_RANGE = (1e-3, 1e12)
"""N/m, of a string that a plectrum can pluck."""
OVERLAP_MAX = 0.9999
"""1, of the length: a string closer to the clamp lifts it and does not bend the plectrum."""
NARROWINGS = 6
"""Times that a fold is looked for again, each time between two neighbours of it."""


@dataclass(frozen=True)
class Pluck(Curve):
    """Pluck from contact to release, at increasing height; arrays of shape (n,)."""

    stretches: tuple[int, ...] = (0,)
    """Points at which the string begins to stick, slide or roll."""
    gives_way: bool = False
    """Whether the pluck ends at a fold, and not at the tip."""
    rolls: bool = False
    """Whether the wire turned about the tip's edge before it was released."""

    @property
    def vertical_force(self) -> Floats:
        """N, with which the string pushes the jack down."""
        return self.force * (np.cos(self.angle) + self.drag * np.sin(self.angle))

    @property
    def release_height(self) -> float:
        """m, of the jack above first contact when the string leaves."""
        return float(self.height[-1])

    @cached_property
    def work(self) -> float:
        """J, of the jack against string and plectrum, from contact to release."""
        return sum(float(spline.integrate(*spline.x[[0, -1]])) for spline in self._splines)

    @property
    def release_slopes(self) -> tuple[float, float]:
        """1, growth of the string's shift and lift with the height just before release.

        Infinite where the pluck ends at a fold: there the quasi-static string has no speed.
        """
        if self.gives_way or self.rolls:
            return math.inf, math.inf
        # Backward differences of order 4 on points that are even in the load.
        last = np.array([3, -16, 36, -48, 25]) / 12
        height, shift, lift = (last @ a[-5:] for a in (self.height, self.shift, self.lift))
        return float(shift / height), float(lift / height)

    def force_on_jack(self, height: ArrayLike) -> Floats:
        """Return the string's downward force [N] at heights [m]; zero off the string."""
        height = np.asarray(height, float)
        found = np.zeros_like(height)
        for spline in self._splines:
            within = (height >= spline.x[0]) & (height <= spline.x[-1])
            found[within] = spline(height[within])
        return found

    @cached_property
    def _splines(self):
        from scipy.interpolate import CubicSpline, PchipInterpolator

        ends = [*(start + 1 for start in self.stretches[1:]), len(self.height)]
        parts = [slice(a, b) for a, b in zip(self.stretches, ends, strict=True)]
        force = self.vertical_force
        # At a fold the force falls with no end to its slope, where a smooth spline would swing.
        spline = PchipInterpolator if self.gives_way or self.rolls else CubicSpline
        return [spline(self.height[part], force[part]) for part in parts]


def solve_pluck(
    plectrum: PlectrumMap,
    stiffness: float,
    overlap: float,
    *,
    rollover: bool = False,
    diameter: float = 0.0,
) -> Pluck:
    """Follow the string along the plectrum from first contact to its release.

    Args:
        plectrum: The plectrum's map, with its friction.
        stiffness: N/m, of the string at the plucking point, K of the paper's equation 2.
        overlap: m, from the string at rest to the tip, along the undeformed mid-line.
        rollover: Let the wire turn about the tip's edge.
        diameter: m, of the wire, for `rollover`.

    Raises:
        ModelError: The overlap is not on the plectrum, the string has no stiffness, or it
            does not leave the plectrum within the range of its level.
    """
    _check(plectrum, stiffness, overlap, diameter)
    equations = Equations(plectrum, stiffness, plectrum.length - overlap, diameter / 2)
    traces, released = _traces(equations)
    curves = [trace.curve for trace in traces]
    fold = _first_fold(curves)
    if fold is not None:
        which, top = fold
        _refuse_jump(curves, which, top, overlap)
        return _joined([*curves[:which], traces[which].until_fold(top)], gives_way=True)
    if not released:
        limit = float(plectrum.force_limit(curves[-1].position[-1]))
        raise ModelError(
            f"plectrum.overlap: at {overlap * 1e3:.6g} mm the string is still held at"
            f" {limit:.4g} N, where the plectrum is bent beyond this level's range; lower"
            " overlap or raise string.tension"
        )
    if rollover and diameter > 0:
        force = float(curves[-1].force[-1])
        most = (math.pi / 2 + math.atan(plectrum.friction)) * 0.999
        roll = Trace(lambda turn: equations.roll(turn, force), np.linspace(0.0, most, POINTS))
        fold = _first_fold([roll.curve])
        rolled = roll.curve if fold is None else roll.until_fold(fold[1])
        return _joined([*curves, rolled], rolls=rolled.height[-1] > rolled.height[0])
    return _joined(curves)


class Trace:
    """A stretch of the curve over its parameter."""

    def __init__(self, at: Callable[[Floats], Curve], parameter: Floats):
        self.at, self.parameter = at, parameter
        self.curve = at(parameter)

    def until_fold(self, top: int) -> Curve:
        """Return the stretch up to its fold, which is next to the point `top`."""
        parameter = self.parameter
        low, high = parameter[max(top - 1, 0)], parameter[min(top + 1, len(parameter) - 1)]
        best = low
        for _ in range(NARROWINGS):
            near = np.linspace(low, high, 33)
            highest = int(np.argmax(self.at(near).height))
            low, best, high = near[max(highest - 1, 0)], near[highest], near[min(highest + 1, 32)]
        curve = self.at(np.linspace(parameter[0], best, POINTS))
        # A fold at the very start leaves no stretch but what is rounding.
        return curve if np.all(np.diff(curve.height) > 0) else self.at(parameter[:1])


def _traces(equations: Equations) -> tuple[list[Trace], bool]:
    """Return the stretches that stick and slide, and whether the string comes to the tip."""
    plectrum, rest = equations.plectrum, equations.rest
    length = plectrum.length
    traces = []
    slip = equations.sliding_force(rest) if plectrum.friction else 0.0
    if slip != 0.0:
        most = float(plectrum.force_limit(rest)) if slip is None else slip
        traces.append(Trace(equations.stick, np.linspace(0.0, most, POINTS)))
        if slip is None:
            return traces, False
    release = equations.sliding_force(length)
    most = float(plectrum.force_limit(length)) if release is None else release
    first, last = (slip or 0.0) * rest**2, most * length**2
    if last > first:

        def slide(load: Floats) -> Curve:
            return equations.slide(load, rest + (length - rest) * (load / last) ** 2)

        traces.append(Trace(slide, np.linspace(first, last, POINTS)))
    return traces, release is not None


def _first_fold(curves: list[Curve]) -> tuple[int, int] | None:
    """Return which stretch, and which point of it, is the last one before the height falls."""
    for which, curve in enumerate(curves):
        height = curve.height
        falling = np.diff(height) <= 0
        # Turned at its end, by a difference of order 2: the fold is in the last step.
        falling[-1] |= 3 * height[-1] - 4 * height[-2] + height[-3] <= 0
        if falling.any():
            return which, int(np.argmax(falling))
    return None


def _refuse_jump(curves: list[Curve], which: int, top: int, overlap: float) -> None:
    """Refuse a string that, past a fold, would be held again further out on the plectrum."""
    if which == len(curves) - 1 and top == len(curves[which].height) - 2:
        return  # the fold is within the last step, and nothing beyond
    highest = curves[which].height[top]
    beyond = [curves[which].height[top + 1 :], *(c.height for c in curves[which + 1 :])]
    if max(float(h.max()) for h in beyond) > highest:
        raise ModelError(
            f"plectrum.overlap: at {overlap * 1e3:.6g} mm the string jumps along the plectrum at"
            f" a jack height of {highest * 1e3:.4g} mm and is held again, which is no"
            " quasi-static pluck; lower overlap or raise plectrum.thickness"
        )


def _check(plectrum: PlectrumMap, stiffness: float, overlap: float, diameter: float) -> None:
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
    if not 0 <= diameter < math.inf:
        faults.append(
            f"string.diameter: {diameter * 1e3:.6g} mm must be finite and at least 0; change it"
        )
    if faults:
        raise ModelError("\n".join(faults))


def _joined(curves: list[Curve], gives_way: bool = False, rolls: bool = False) -> Pluck:
    """Return one pluck of stretches, each of which begins where the last one ends."""
    starts, fields = [0], [list(vars(curves[0]).values())]
    for curve in curves[1:]:
        if len(curve.height) < 2:
            continue
        starts.append(starts[-1] + len(fields[-1][0]) - (1 if len(starts) == 1 else 0))
        fields.append([values[1:] for values in vars(curve).values()])
    joined = [np.concatenate(values) for values in zip(*fields, strict=True)]
    if len(joined[0]) < 2:
        raise ModelError(
            "plectrum.overlap: the plectrum gives way as the string is met; lower overlap"
        )
    joined[0][0] = 0.0  # rounding apart
    return Pluck(*joined, stretches=tuple(starts), gives_way=gives_way, rolls=rolls)
