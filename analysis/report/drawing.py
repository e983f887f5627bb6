"""Pictures of which some parts move from frame to frame, as SVG and as numbers for the script."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sautereau.trajectory.motion import Floats

Frames = tuple[str, ...]
"""A value of an attribute in every frame."""


@dataclass(frozen=True)
class Shape:
    """One element of a picture."""

    tag: str
    kind: str
    """Its classes in the page's style; the last of them is its own, where it moves."""
    fixed: Mapping[str, str | int] = field(default_factory=dict)
    moves: Mapping[str, Frames] = field(default_factory=dict)
    """Attributes that change."""
    text: str = ""

    @property
    def name(self) -> str:
        """What tells it from the others of a picture that move."""
        return self.kind.split()[-1]

    def at(self, frame: int) -> dict[str, str | int]:
        """Return its attributes in a frame."""
        return {**self.fixed, **{name: values[frame] for name, values in self.moves.items()}}


@dataclass(frozen=True)
class Picture:
    """A picture, in units of its own."""

    name: str
    about: str
    left: int
    top: int
    width: int
    height: int
    font: int
    """Size of its letters."""
    shapes: tuple[Shape, ...]

    @property
    def moves(self) -> dict[str, dict[str, Frames]]:
        """All that moves: the frames of every attribute, by the element's id."""
        return {
            f"{self.name}-{shape.name}": moving
            for shape in self.shapes
            if (moving := {name: each for name, each in shape.moves.items() if len(set(each)) > 1})
        }


def whole(value: float) -> int:
    """Return a coordinate as a picture holds it."""
    return round(float(value))


def points(places: Floats) -> str:
    """Return places, shape (n, 2), x to the right and z up, as an SVG's list of points."""
    return " ".join(f"{x},{-z}" for x, z in np.rint(places).astype(int).tolist())


def every(places: Floats) -> Frames:
    """Return places of every frame, shape (frames, n, 2), as lists of points."""
    return tuple(points(one) for one in places)


def shifted(x: float, z: Floats) -> Frames:
    """Return what moves an element by x and, in every frame, by z upwards; shape (frames,)."""
    return tuple(f"translate({whole(x)} {-whole(one)})" for one in z)


def box(kind: str, left: float, low: float, right: float, high: float) -> Shape:
    """Return a rectangle."""
    return Shape("rect", kind, rectangle(left, low, right, high))


def rectangle(left: float, low: float, right: float, high: float) -> dict[str, str | int]:
    """Return a rectangle's attributes."""
    return {
        "x": whole(left),
        "y": -whole(high),
        "width": whole(right - left),
        "height": whole(high - low),
    }


def label(text: str, x: float, z: float, anchor: str = "start", **more: str | int) -> Shape:
    """Return a text at a place."""
    place: dict[str, str | int] = {"x": whole(x), "y": -whole(z), "text-anchor": anchor}
    return Shape("text", "label", {**place, **more}, text=text)
