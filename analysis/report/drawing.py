"""SVG pictures with moving parts, whose attributes the page's script sets frame by frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

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


def every(places: Floats) -> Frames:
    """Return places, shape (frames, n, 2), as one list of points per frame."""
    return tuple(points(one) for one in places)


def shifted(x: float, z: Floats) -> Frames:
    """Return the transforms that shift by x and, frame by frame, by z upwards; shape (frames,)."""
    return tuple(f"translate({rounded(x)} {-rounded(one)})" for one in z)


def box(kind: str, left: float, low: float, right: float, high: float) -> Shape:
    """Return a rectangle."""
    return Shape("rect", kind, rectangle(left, low, right, high))


def rectangle(left: float, low: float, right: float, high: float) -> dict[str, str | int]:
    """Return a rectangle's attributes."""
    return {
        "x": rounded(left),
        "y": -rounded(high),
        "width": rounded(right - left),
        "height": rounded(high - low),
    }


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
