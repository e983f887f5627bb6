"""SVG pictures with moving parts, whose attributes the page's script sets frame by frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from sautereau.analysis.figures.parts import Part
from sautereau.trajectory.motion import Floats

Frames = tuple[str, ...]  # Values of one attribute, one per frame


@dataclass(frozen=True)
class Shape:
    """One element of a picture."""

    tag: str
    kind: str
    """CSS classes; the last one is unique if the shape moves."""
    fixed: Mapping[str, str | int] = field(default_factory=dict)
    moves: Mapping[str, Frames] = field(default_factory=dict)
    """Attributes that change, with a value for every frame."""
    text: str = ""

    @property
    def name(self) -> str:
        """Its last class, unique among the moving shapes of a picture."""
        return self.kind.split()[-1]

    def at(self, frame: int) -> dict[str, str | int]:
        """Return its attributes in a frame."""
        return {**self.fixed, **{name: values[frame] for name, values in self.moves.items()}}


@dataclass(frozen=True)
class Picture:
    """One SVG picture; it has its own unit of length."""

    name: str
    about: str
    left: int
    top: int
    width: int
    height: int
    font: int
    """Font size."""
    shapes: tuple[Shape, ...]

    @property
    def moves(self) -> dict[str, dict[str, Frames]]:
        """Values of the changing attributes in every frame, by the element's id."""
        return {
            f"{self.name}-{shape.name}": moving
            for shape in self.shapes
            if (moving := {name: each for name, each in shape.moves.items() if len(set(each)) > 1})
        }


def rounded(value: float) -> int:
    """Return a coordinate rounded to the picture's integers."""
    return round(float(value))


def points(places: Floats) -> str:
    """Return places, shape (n, 2), x to the right and z upwards, as an SVG list of points."""
    return " ".join(f"{x},{-z}" for x, z in np.rint(places).astype(int).tolist())


def drawn(
    part: Part, scale: tuple[float, float], origin: tuple[float, float] = (0.0, 0.0)
) -> Shape:
    """Return a part as a shape.

    Args:
        scale: 1/m, units of the picture along x and z; equal if the part turns.
        origin: Place of the part's (0, 0) in the picture, z upwards.
    """
    places = part.points * scale + origin
    moves = {"transform": moved} if (moved := transform(part, scale)) else {}
    if part.radius:
        (x, z), radius = places[0], rounded(part.radius * scale[0])
        return Shape("circle", part.name, {"cx": rounded(x), "cy": -rounded(z), "r": radius}, moves)
    tag = "polygon" if part.closed else "polyline"
    if places.ndim == 2:
        return Shape(tag, part.name, {"points": points(places)}, moves)
    return Shape(tag, part.name, {}, {"points": tuple(points(one) for one in places), **moves})


def transform(part: Part, scale: tuple[float, float]) -> Frames:
    """Return the transform of a part in every frame; empty for one that stays in its place."""
    moved: list[str] = []
    if part.shift is not None:
        moved = [f"translate({rounded(x)} {-rounded(z)})" for x, z in part.shift * scale]
    if part.turn is not None:
        x, z = (rounded(at * unit) for at, unit in zip(part.pivot, scale, strict=True))
        about = f" {x} {-z}" if x or z else ""
        turns = [f"rotate({-angle:.3f}{about})" if angle else "" for angle in np.degrees(part.turn)]
        moved = [f"{a} {b}".strip() for a, b in zip(moved or [""] * len(turns), turns, strict=True)]
    return tuple(moved)


def box(kind: str, left: float, low: float, right: float, high: float) -> Shape:
    """Return a rectangle."""
    width, height = rounded(right - left), rounded(high - low)
    place = {"x": rounded(left), "y": -rounded(high), "width": width, "height": height}
    return Shape("rect", kind, place)


def label(text: str, x: float, z: float, anchor: str = "start", **more: str | int) -> Shape:
    """Return a text at (x, z)."""
    place: dict[str, str | int] = {"x": rounded(x), "y": -rounded(z), "text-anchor": anchor}
    return Shape("text", "label", {**place, **more}, text=text)


def envelope(signal: Floats, points: int) -> np.ndarray:
    """Return the samples to draw: minimum and maximum of equal intervals (min-max decimation).

    A line through them covers the same area as a line through all samples, within the width of
    an interval; no sample is averaged or moved.

    Args:
        signal: Shape (n,), without NaN.
        points: Approximate number of samples to keep; the first and the last are always kept.

    Returns:
        Increasing indices, shape (m,); all of them if there are no more than ``points``.
    """
    n = len(signal)
    if n <= max(points, 2):
        return np.arange(n)
    edges = np.linspace(0, n, max(1, points // 2) + 1).astype(int)
    extremes = [
        start + place
        for start, stop in pairwise(edges)
        for place in (signal[start:stop].argmin(), signal[start:stop].argmax())
    ]
    return np.unique([0, *extremes, n - 1])
