"""The plectrum's outline from a contour in pixels: scale, clamp, tilt, side, and an ensemble.

The axes are those of the rig's outline: x from the clamp to the tip, along the normal of the jack's
face if the picture shows it, otherwise along the uncut side; z towards the string.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.outline.picture import Silhouette, at_border

PLACES = np.linspace(0.0, 1.0, 27)  # Vertices [lengths]; a part is about the string's patch
MOST_TILT, DOUBTFUL_TILT = math.radians(15), math.radians(8)
SLENDER = 3.0  # Least length over thickness
BENT = 0.003  # Deviation from a line, over the length, up to which both sides may be uncut
CLICK = 0.7  # Pixels, standard uncertainty of a point that a person marks
CHAIN = 6.0  # Pixels along the contour over which its noise is correlated
LENGTHS, THICKNESSES = (2e-3, 12e-3), (0.15e-3, 1.2e-3)  # m, of plectra


class Known(NamedTuple):
    """A value with its standard uncertainty."""

    value: float
    std: float = 0.0

    @property
    def relative(self) -> float:
        """Standard uncertainty over the value."""
        return self.std / self.value


class Ruler(NamedTuple):
    """Two points in pixels, and their distance [m]."""

    start: tuple[float, float]
    end: tuple[float, float]
    distance: Known


@dataclass(frozen=True)
class Given:
    """What is known of a photograph; pixels count from (0, 0) in the middle of the first one."""

    per_metre: Known | None = None
    """Pixels per metre."""
    ruler: Ruler | None = None
    length: Known | None = None
    """m, from the clamp to the tip."""
    thickness: Known | None = None
    """m, at the clamp."""
    clamp: tuple[float, float] | None = None
    """Column and row of the centre of the clamp."""
    tilt: Known | None = None
    """rad, of the plectrum's axis, counterclockwise as displayed."""
    upper: Literal["up", "down"] | None = None
    """Side of the picture to which the string's side of the plectrum points."""


@dataclass(frozen=True)
class Edges:
    """Both edges of an outline: x from the clamp at 0 to the tip, top, bottom; shape (n,)."""

    x: Floats
    top: Floats
    bottom: Floats

    @property
    def contour(self) -> Floats:
        """The closed contour, shape (2 n, 2)."""
        x, z = np.r_[self.x, self.x[::-1]], np.r_[self.top, self.bottom[::-1]]
        return np.column_stack([x, z])

    @property
    def thickness(self) -> float:
        """Thickness at the clamp."""
        return float(self.top[0] - self.bottom[0])

    def scaled(self, scale: float) -> "Edges":
        """Return them in another unit, with the mid-line at the clamp at 0."""
        middle = (self.top[0] + self.bottom[0]) / 2
        return Edges(scale * self.x, scale * (self.top - middle), scale * (self.bottom - middle))


@dataclass(frozen=True)
class Measured:
    """An outline from a photograph [m], and how it was found."""

    edges: Edges
    ensemble: tuple[Edges, ...]
    scale: Known
    """m, size of a pixel."""
    clamp: Floats
    """Column and row of the centre of the clamp."""
    clamp_std: float
    """Pixels, along the plectrum."""
    face_found: bool
    """Whether the jack's face was found."""
    tilt: Known
    """rad, counterclockwise as displayed."""
    tip_left: bool
    upside_down: bool
    """Whether the string's side of the plectrum points down in the picture."""
    seen: Silhouette
    warnings: tuple[str, ...]

    def to_pixels(self, points: Floats) -> Floats:
        """Return points [m] of the outline's axes as columns and rows, shape (n, 2)."""
        sides = [-1 if self.tip_left else 1, -1 if self.upside_down else 1]
        points = _turned(points / self.scale.value * sides, self.tilt.value)
        return self.clamp + points * [1, -1]


def measure(seen: Silhouette, given: Given, seed: int = 0) -> Measured:
    """Return the outline of a plectrum.

    Args:
        seen: The picture's object.
        given: Clamp and scale, unless they are found.
        seed: Of the ensemble's random numbers.

    Raises:
        AnalysisError: The picture, or what is given of it, has a fault.
    """
    left = _tip_left(seen, given)
    sign = np.array([-1.0 if left else 1.0, -1.0])
    sides = _Sides(seen.contour * sign, seen.blur)
    warnings = list(seen.warnings)
    face = sides.face()
    clamp = _clamp(seen, sides, face, given, sign, warnings)
    tilt = Known(-math.atan(face.slope), face.slope_std) if face else None
    if given.tilt:
        tilt = Known(given.tilt.value * sign[0], given.tilt.std)
    level, root = sides, clamp
    if tilt:  # A leaning face hangs over the columns in front of the clamp
        level = _Sides(_turned(seen.contour * sign, -tilt.value), seen.blur)
        root = _turned(clamp, -tilt.value)
    axis = 0.0 if tilt else None
    upside = level.upside_down(float(root[0]), axis, given, warnings)
    tilt = tilt or sides.tilt(float(clamp[0]), upside)
    _check_tilt(tilt, warnings)
    placed = _turned(seen.contour * sign - clamp, -tilt.value) * [1, -1 if upside else 1]
    for name, own in at_border(seen.contour, seen.image.shape).items():
        if np.any(placed[own, 0] > 0.02 * (sides.tip - float(clamp[0]))):
            raise AnalysisError(
                f"cut off: the plectrum reaches the {name} edge of the picture in front of its"
                " clamp; photograph all of it"
            )
    # A face that is not normal to the given axis hangs over the plectrum's root.
    hangs = face and abs(math.tan(tilt.value) + face.slope) * np.abs(placed[:, 1]).max()
    chains = _Chains(placed, seen.blur, -2 * seen.blur if hangs is None else 3 * seen.blur + hangs)
    edges = chains.fitted()
    clamp_std = math.hypot(face.intercept_std, seen.level_std) if face else CLICK
    scale = _scale(edges, clamp_std, seen, given, warnings)
    _check_size(edges.scaled(scale.value), warnings)
    middle = np.array([[0.0, (edges.top[0] + edges.bottom[0]) / 2 * (-1 if upside else 1)]])
    origin = (clamp + _turned(middle, tilt.value)[0]) * sign
    uncertain = _Uncertain(clamp_std, tilt.std, seen.level_std, scale, given)
    noise = np.random.default_rng(seed)
    return Measured(
        edges.scaled(scale.value),
        tuple(uncertain.drawn(chains, edges, noise) for _ in range(30)),
        scale,
        origin,
        clamp_std,
        face is not None,
        Known(tilt.value * sign[0], tilt.std),
        left,
        upside,
        seen,
        tuple(warnings),
    )


class _Line(NamedTuple):
    """second = intercept + slope * first, in pixels, with standard uncertainties."""

    intercept: float
    slope: float
    slope_std: float
    intercept_std: float  # At the mean of the first coordinates


def _line(first: Floats, second: Floats) -> _Line:
    """Return the line through points with correlated noise, without those far off."""
    keep = np.ones(len(first), bool)
    slope = intercept = rms = 0.0
    for _ in range(3):
        slope, intercept = np.polyfit(first[keep], second[keep], 1)
        residual = second - intercept - slope * first
        rms = float(np.sqrt(np.mean(residual[keep] ** 2)))
        keep = np.abs(residual) <= 3 * rms + 1e-9
    count = max(np.ptp(first) / CHAIN, 1.0)
    spread = max(float(np.std(first[keep])), 1e-9)
    std = rms / math.sqrt(count)
    return _Line(float(intercept), float(slope), std / spread, std)


class _Sides:
    """The upper and the lower side of a contour whose tip points to the right, by columns."""

    def __init__(self, points: Floats, blur: float):
        self.points, self.blur = points, blur
        upper, lower = _split(points)
        self.tip = float(points[:, 0].max())
        self.x: Floats = np.arange(math.ceil(points[:, 0].min()) + 2, math.floor(self.tip) - 1.0)
        self.upper = _outermost(upper, self.x)
        self.lower = -_outermost(lower * [1, -1], self.x)

    def at(self, x: float) -> tuple[float, float]:
        """Return lower and upper at a column."""
        return float(np.interp(x, self.x, self.lower)), float(np.interp(x, self.x, self.upper))

    def face(self) -> _Line | None:
        """Return the jack's face as x over y, if there is one."""
        depth = self.upper - self.lower
        for i in range(len(self.x) - 1, 0, -1):
            before = i - max(3, round(depth[i] / 2))
            if before < 0:
                return None
            rise = min(self.upper[before] - self.upper[i], self.lower[i] - self.lower[before])
            # A jack's face is at least 0.3 of the thickness high on each side. The depth grows as
            # fast at the tip itself.
            if rise > 0.3 * depth[i] and self.tip - self.x[i] > depth[i]:
                return self._face_at(i, max(2 * before - i, 0))
        return None

    def _face_at(self, i: int, before: int) -> _Line | None:
        x, y = self.points.T
        near = (x > self.x[before]) & (x < self.x[i] + 2)
        upper, lower, depth = self.upper[i], self.lower[i], self.upper[i] - self.lower[i]
        # Between the fillets at the plectrum and the jack's own corners.
        up, down = 0.8 * (self.upper[before] - upper), 0.8 * (lower - self.lower[before])
        clear = 0.15 * depth + 2 * self.blur
        beyond = [
            (y > upper + clear) & (y < upper + up),
            (y < lower - clear) & (y > lower - down),
        ]
        on_face = near & (beyond[0] | beyond[1])
        if on_face.sum() < 4 * CHAIN:
            return None
        return _line(y[on_face], x[on_face])

    def middle(self, start: float, end: float) -> _Line:
        """Return the mid-line between two columns."""
        own = (self.x > start) & (self.x < end)
        if own.sum() < CHAIN:
            raise AnalysisError(
                "wrong clamp: no plectrum lies in front of it; give --clamp at the plectrum's root"
            )
        return _line(self.x[own], (self.upper[own] + self.lower[own]) / 2)

    def upside_down(
        self, clamp: float, axis: float | None, given: Given, warnings: list[str]
    ) -> bool:
        """Return whether the cut side is the upper one: the uncut one runs along the axis.

        Args:
            axis: Slope of the plectrum's axis; None: that of the part behind the clamp, or, where
                little of it is seen, that of each side.
        """
        span = self.tip - clamp
        own = (self.x > clamp + 0.03 * span) & (self.x < self.tip - 3 * self.blur)
        behind = self.x < clamp
        sides = np.stack([self.upper, self.lower])
        if axis is None and behind.sum() > 0.1 * span:
            axis = _line(self.x[behind], sides[:, behind].mean(axis=0)).slope
        bent = []
        for side in sides[:, own]:
            slope = np.polyfit(self.x[own], side, 1)[0] if axis is None else axis
            bent.append(float(np.std(side - slope * self.x[own])))
        # The uncut side deviates less from a line.
        known = max(bent) > max(BENT * span, 1.5 * min(bent))
        found = known and bent[0] > bent[1]
        if given.upper is None:
            if not known and max(bent) > BENT * span:
                warnings.append(
                    "both sides of the plectrum are bent or cut, so that its upper side is not"
                    " known and taken to point up; give --upper"
                )
            return found
        if known and found != (given.upper == "down"):
            warnings.append(
                f"the side that points {given.upper} is the cut one, but a plectrum is cut from"
                " below; check --upper"
            )
        return given.upper == "down"

    def tilt(self, clamp: float, upside: bool) -> Known:
        """Return the direction of the uncut side at the clamp."""
        own = self.x < clamp + 0.35 * (self.tip - clamp)
        side = self.lower if upside else self.upper
        line = _line(self.x[own], side[own])
        return Known(math.atan(line.slope), math.hypot(line.slope_std, 5e-4))


class _Chains:
    """Both edges in pixels in the outline's axes, as points; shape (n, 2) each."""

    def __init__(self, points: Floats, blur: float, start: float):
        upper, lower = _split(points)
        near = points[np.argsort(points[:, 0])[-max(5, len(points) // 400) :]]
        self.tip = float(np.mean(near[:, 0]))
        """Mean of the outermost points, which the noise moves less than the last one."""
        # The blur rounds the corners of the tip, which are extrapolated.
        end = self.tip - 2 * blur
        self.top, self.bottom = (
            chain[(chain[:, 0] > start) & (chain[:, 0] < end)] for chain in (upper, lower)
        )
        self.top, self.bottom = (c[np.argsort(c[:, 0])] for c in (self.top, self.bottom))
        for chain in (upper, lower):
            x = chain[chain[:, 0] > 0, 0]
            back = float(np.max(x - np.minimum.accumulate(x), initial=0.0))
            if back > 0.05 * self.tip + 3 * blur:
                raise AnalysisError(
                    "no plectrum: an edge of the object folds back over itself; clean the picture,"
                    " or photograph the plectrum from its side"
                )

    def fitted(self, moved: float = 0.0, noise: np.random.Generator | None = None) -> Edges:
        """Return the least-squares polyline of each edge.

        Args:
            moved: Pixels, of the clamp towards the tip.
            noise: Draws of the residuals, in blocks, are added once more.
        """
        from scipy.interpolate import make_lsq_spline

        places = PLACES * self.tip
        found = []
        for chain in (self.top, self.bottom):
            x, z = np.clip(chain[:, 0], 0.0, None), chain[:, 1]
            inner = places[(places > x[0] + CHAIN) & (places < x[-1] - CHAIN)]
            knots = np.r_[[x[0]] * 2, inner, [x[-1]] * 2]
            spline = make_lsq_spline(x, z, knots, k=1)
            if noise is not None:
                residual, block = z - spline(x), int(CHAIN * len(x) / np.ptp(x))
                starts = noise.integers(0, len(x) - block, len(x) // block + 1)
                drawn = residual[(starts[:, None] + np.arange(block)).ravel()[: len(x)]]
                spline = make_lsq_spline(x, spline(x) + drawn, knots, k=1)
            found.append(spline(moved + PLACES * (self.tip - moved), extrapolate=True))
        return Edges(PLACES * (self.tip - moved), *found)


@dataclass(frozen=True)
class _Uncertain:
    """What an ensemble draws from, in pixels."""

    clamp_std: float
    tilt_std: float
    level_std: float
    scale: Known
    given: Given

    def drawn(self, chains: _Chains, edges: Edges, noise: np.random.Generator) -> Edges:
        """Return one outline [m]."""
        clamp, tilt, level, scale = noise.standard_normal(4)
        found = chains.fitted(clamp * self.clamp_std, noise)
        grown, lean = level * self.level_std, tilt * self.tilt_std * found.x
        x = found.x * (1 + grown / found.x[-1])
        found = Edges(x, found.top + grown - lean, found.bottom - grown - lean)
        if self.given.per_metre or self.given.ruler:
            return found.scaled(self.scale.value + scale * self.scale.std)
        # A size of the plectrum gives the scale.
        known, size = self.given.length, found.x[-1]
        if known is None:
            known, size = cast(Known, self.given.thickness), found.thickness
        return found.scaled((known.value + scale * known.std) / size)


def _scale(
    edges: Edges, clamp_std: float, seen: Silhouette, given: Given, warnings: list[str]
) -> Known:
    """Return the size of a pixel [m] by the most direct way that is given."""
    ways = {"--pixels-per-mm and --ruler": _direct_scale(given)}
    length, thickness = float(edges.x[-1]), edges.thickness
    of_depth = math.sqrt(2) * seen.level_std + 0.1  # what blur and noise leave
    for name, known, size, std in (
        ("--length", given.length, length, clamp_std),
        ("--thickness", given.thickness, thickness, of_depth),
    ):
        if known:
            ways[name] = Known(
                known.value / size, known.value / size * math.hypot(known.relative, std / size)
            )
    found = [(name, way) for name, way in ways.items() if way]
    if not found:
        raise AnalysisError(
            "no scale: give --pixels-per-mm, --ruler, --length or --thickness of the plectrum"
        )
    (first, scale), *others = found
    for name, other in others:
        # They contradict each other.
        if abs(other.value - scale.value) > 3.0 * math.hypot(scale.std, other.std):
            warnings.append(
                f"by {first} a pixel is {scale.value * 1e6:.4g} µm, by {name}"
                f" {other.value * 1e6:.4g} µm; check the clamp and both values"
            )
    return scale


def _direct_scale(given: Given) -> Known | None:
    if given.per_metre:
        return Known(1 / given.per_metre.value, given.per_metre.relative / given.per_metre.value)
    if given.ruler is None:
        return None
    pixels = math.dist(given.ruler.start, given.ruler.end)
    if pixels < 50:
        raise AnalysisError(
            f"ruler: its points are {pixels:.3g} pixels apart, too few for a scale; mark points at"
            " both ends of the picture"
        )
    scale = given.ruler.distance.value / pixels
    relative = math.hypot(given.ruler.distance.relative, math.sqrt(2) * CLICK / pixels)
    return Known(scale, scale * relative)


def _tip_left(seen: Silhouette, given: Given) -> bool:
    border = {
        name: bool(own.any()) for name, own in at_border(seen.contour, seen.image.shape).items()
    }
    if border["left"] and border["right"]:
        raise AnalysisError(
            "cut off: the object reaches the left and the right edge of the picture, so that it"
            " shows no tip; move the camera, or cut away what is not the plectrum"
        )
    if border["left"] or border["right"]:
        return border["right"]
    if border["top"] or border["bottom"]:
        raise AnalysisError(
            "cut off, or upright: the object reaches the upper or lower edge of the picture only;"
            " turn the picture so that the tip points to the left or right"
        )
    if given.clamp is None:
        raise AnalysisError(
            "no clamp: the object lies free in the picture, so that its tip is not known; give"
            " --clamp COLUMN,ROW of the centre of the clamp"
        )
    x = seen.contour[:, 0]
    return given.clamp[0] - x.min() > x.max() - given.clamp[0]


def _clamp(
    seen: Silhouette,
    sides: _Sides,
    face: _Line | None,
    given: Given,
    sign: Floats,
    warnings: list[str],
) -> Floats:
    """Return the centre of the clamp, in the axes of the sides."""
    found = None
    if face:
        start = face.intercept + face.slope * float(np.mean(sides.at(sides.tip - 10)))
        depth = -float(np.subtract(*sides.at(start + 3 * sides.blur + 5)))
        line = sides.middle(start + 3 * sides.blur, start + 3 * sides.blur + depth)
        x = (face.intercept + face.slope * line.intercept) / (1 - face.slope * line.slope)
        found = np.array([x, line.intercept + line.slope * x])
    if given.clamp is None:
        direct = _direct_scale(given)
        if found is not None:
            return found
        if given.length is None or direct is None:
            raise AnalysisError(
                "no clamp: the picture shows no face of a jack; give --clamp COLUMN,ROW, or"
                " --length with --pixels-per-mm or --ruler"
            )
        x = sides.tip - given.length.value / direct.value
        low, high = sides.at(x)
        _check_clamp(seen, sides, np.array([x, (low + high) / 2]), sign)
        return np.array([x, (low + high) / 2])
    clamp = np.array(given.clamp) * sign
    if found is not None and 0 <= given.clamp[0] < seen.image.shape[1]:
        off = float(clamp[0] - found[0])
        at = "column {:.0f}, row {:.0f}".format(*(found * sign))
        if off < -3 * sides.blur - 2:
            raise AnalysisError(
                f"wrong clamp: it lies {-off:.0f} pixels behind the jack's face at {at}; omit"
                " --clamp, or correct it"
            )
        if off > 3 * sides.blur + 2:
            warnings.append(
                f"the clamp lies {off:.0f} pixels in front of the jack's face at {at}; omit --clamp"
                " to use the face"
            )
    _check_clamp(seen, sides, clamp, sign)
    return clamp


def _check_clamp(seen: Silhouette, sides: _Sides, clamp: Floats, sign: Floats) -> None:
    rows, columns = seen.image.shape
    column, row = clamp * sign
    at = f"wrong clamp: column {column:.0f}, row {row:.0f}"
    if not (0 <= column < columns and 0 <= row < rows):
        raise AnalysisError(f"{at} is outside the picture of {columns} x {rows} pixels; correct it")
    low, high = sides.at(float(clamp[0]))
    slack = 0.1 * (high - low) + 2
    if not (sides.x[0] - 3 <= clamp[0] < sides.tip and low - slack < clamp[1] < high + slack):
        raise AnalysisError(f"{at} is not on the plectrum; give the centre of its clamped section")
    depth = high - low
    if sides.tip - clamp[0] < SLENDER * depth:
        raise AnalysisError(
            f"{at} is only {(sides.tip - clamp[0]) / depth:.1f} thicknesses from the tip, and a"
            f" plectrum is at least {SLENDER:g} long; correct it"
        )


def _check_tilt(tilt: Known, warnings: list[str]) -> None:
    degrees = math.degrees(tilt.value)
    if abs(tilt.value) > MOST_TILT:
        raise AnalysisError(
            f"the plectrum is tilted by {degrees:.1f} degrees, more than"
            f" {math.degrees(MOST_TILT):.0f}; turn the picture"
        )
    if abs(tilt.value) > DOUBTFUL_TILT:
        warnings.append(
            f"the plectrum is tilted by {degrees:.1f} degrees; the accuracy is known up to"
            f" {math.degrees(DOUBTFUL_TILT):.0f}"
        )


def _check_size(edges: Edges, warnings: list[str]) -> None:
    """Check the outline [m]."""
    length, thickness = float(edges.x[-1]), edges.thickness
    thin = edges.x[edges.top - edges.bottom <= 0]
    if len(thin):
        raise AnalysisError(
            f"the edges cross {thin[0] * 1e3:.3g} mm from the clamp; clean the picture there"
        )
    if length < SLENDER * thickness:
        raise AnalysisError(
            f"no plectrum: the object is {length / thickness:.1f} times as long as it is thick in"
            f" front of its clamp, less than {SLENDER:g}; check the clamp"
        )
    for name, value, (low, high) in (
        ("long", length, LENGTHS),
        ("thick at the clamp", thickness, THICKNESSES),
    ):
        if not low <= value <= high:
            warnings.append(
                f"the plectrum would be {value * 1e3:.3g} mm {name}, and plectra are"
                f" {low * 1e3:g} to {high * 1e3:g} mm; check the scale"
            )


def _split(points: Floats) -> tuple[Floats, Floats]:
    """Return the upper and the lower side of a closed contour, from its rightmost point."""
    x, y = points.T
    if np.dot(x, np.roll(y, -1)) < np.dot(np.roll(x, -1), y):
        points = points[::-1]
    points = np.roll(points, -int(np.argmax(points[:, 0])), axis=0)
    end = int(np.argmin(points[:, 0]))
    return points[: end + 1], np.vstack([points[end:], points[:1]])[::-1]


def _outermost(chain: Floats, x: Floats) -> Floats:
    """Return the largest y of a chain in each column, interpolated where it has no point."""
    column: NDArray[np.intp] = np.round(chain[:, 0] - x[0]).astype(int)
    within = (column >= 0) & (column < len(x))
    found = np.full(len(x), -np.inf)
    np.maximum.at(found, column[within], chain[within, 1])
    known = np.isfinite(found)
    return np.interp(x, x[known], found[known])


def _turned(points: Floats, angle: float) -> Floats:
    """Return points turned counterclockwise, y upwards."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return points @ np.array([[cosine, sine], [-sine, cosine]])
