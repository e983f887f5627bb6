"""Pictures of the slow motion: jack head, strings, key, and force over time.

The jack head is to scale, in micrometres from the string at rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from sautereau.analysis.figures.parts import (
    AXLE,
    BODY,
    HEAD,
    JACK,
    UNDER,
    Part,
    bench_parts,
    clamp_place,
    fixed_parts,
    head_parts,
    head_view,
    key_outline,
    string_height,
    string_parts,
)
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.press.replay import ChoirMotion, Replay
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


WIDE = 2000  # Width of the pictures of string and force, in units of about a third of a pixel
LOW = 600  # Height of these pictures, in the same unit
MARGIN = 60  # Distance of the curves from the sides, in the same unit
GAP = 16  # Distance of labels from what they describe, in the same unit
LETTERS = 52  # Font size, in the same unit
TENTH = 1e4  # 1/m; the key is drawn in units of 0.1 mm
UM = 1e6


def string_picture(number: int, motion: ChoirMotion, name: str) -> Picture:
    """Draw a string, and the band that it swept during the frame.

    Args:
        number: Number of the string, from 1.
        name: Its name, a colon and a space; empty for a single string.
    """
    string = motion.choir.string
    across = (WIDE - 2 * MARGIN) / string.length
    most = max(float(np.abs(motion.deflection).max()), 1e-4)
    up = (LOW / 2 - MARGIN) / most
    at = rounded(MARGIN + string.plucking_point * across)
    shapes = (
        Shape("path", "axis", {"d": f"M{MARGIN},0H{WIDE - MARGIN}"}),
        Shape("path", "axis", {"d": f"M{at},{-LOW // 2}V{LOW // 2}"}),
        *(drawn(part, (across, up), (MARGIN, 0)) for part in string_parts(motion, 4)),
        label("nut", MARGIN, GAP - LOW / 2),
        label("plectrum", at + GAP, GAP - LOW / 2),
        label("bridge", WIDE - MARGIN, GAP - LOW / 2, "end"),
    )
    named = name.removesuffix(": ") or "string"
    about = f"{named} from nut to bridge, at rest: no pluck was found"
    if motion.plucks:
        about = (
            f"{named} from nut to bridge; its deflection of at most {most * 1e3:.2g} mm is"
            f" magnified {up / across:.0f} times; shaded: band swept during the frame"
        )
    return Picture(f"string-{number}", about, 0, -LOW // 2, WIDE, LOW, LETTERS, shapes)


def force_picture(scene: Replay) -> Picture:
    """Draw the finger force over time, with a mark at the frame."""
    start, stop = float(scene.time[0]), float(scene.time[-1])
    rows = scene.press.between(start, stop)
    newton, time = scene.press.samples["force"][rows], scene.press.time[rows]
    kept = envelope(newton, 400)
    newton, time = newton[kept], time[kept]
    low, high = min(float(newton.min()), 0.0), max(float(newton.max()), 1e-3)
    across = (WIDE - 2 * MARGIN) / (stop - start)
    up = (LOW - 2 * (GAP + LETTERS)) / (high - low)

    def place(at: float) -> int:
        return rounded(MARGIN + (at - start) * across)

    held = [
        box("held", place(one.contact), low * up, place(one.release), high * up)
        for one in scene.phases.plucks
    ]
    trace = np.stack([MARGIN + (time - start) * across, newton * up], -1)
    now = tuple(f"translate({place(float(at))} 0)" for at in scene.time)
    foot = low * up - LETTERS
    shapes = (
        *held,
        Shape("path", "axis", {"d": f"M{MARGIN},0H{WIDE - MARGIN}"}),
        Shape("polyline", "trace", {"points": points(trace)}),
        Shape(
            "path",
            "now",
            {"d": f"M0,{-rounded(high * up)}V{-rounded(low * up)}"},
            {"transform": now},
        ),
        label(f"{high:.3g} N", MARGIN, high * up + GAP),
        label(f"{start * 1e3:.2f} ms", MARGIN, foot),
        label(f"{stop * 1e3:.2f} ms", WIDE - MARGIN, foot, "end"),
    )
    top, bottom = rounded(high * up + GAP + LETTERS), rounded(foot - GAP)
    about = "finger force over time; shaded: string held, darker: several strings held"
    about = about if len(scene.phases.plucks) > 1 else about.partition(",")[0]
    return Picture("force", about, 0, -top, WIDE, top - bottom, LETTERS, shapes)


def key_picture(scene: Replay) -> Picture:
    """Draw the key and its jacks from the side."""
    rig = scene.press.rig
    key, outline = rig.key, key_outline(rig)
    front, back = outline[:, 0].min(), outline[:, 0].max()
    finger = np.array([[0, 0], [-6e-3, 16e-3], [6e-3, 16e-3]])
    finger += (-key.press_arm, key.surface_height)
    parts = [*bench_parts(rig, scene.angle), Part("finger", finger, turn=scene.angle)]
    left, right = front - 15e-3, back + 30e-3
    low, high = -UNDER - key.dip - 16e-3, key.jack_surface_height + JACK + HEAD + 30e-3
    strings = [
        (choir.jack_arm - 0.06, rounded(string_height(rig, choir) * TENTH)) for choir in choirs(rig)
    ]
    fixed = {name: [p for p in fixed_parts(rig) if p.name == name] for name in ("felt", "pin")}
    shapes = [
        *(drawn(part, (TENTH, TENTH)) for part in (*fixed["felt"], *parts, *fixed["pin"])),
        *(
            Shape("path", "string", {"d": f"M{rounded(x * TENTH)},{-z}H{rounded(right * TENTH)}"})
            for x, z in strings
        ),
        label("finger", (8e-3 - key.press_arm) * TENTH, (key.surface_height + 14e-3) * TENTH),
        label("balance pin", 8e-3 * TENTH, (-UNDER - 14e-3) * TENTH),
    ]
    width, height = rounded((right - left) * TENTH), rounded((high - low) * TENTH)
    return Picture(
        "key",
        "key and jack from the side, at the positions measured by the laser",
        rounded(left * TENTH),
        -rounded(high * TENTH),
        width,
        height,
        rounded(width * LETTERS / WIDE),
        tuple(shapes),
    )


def head_picture(number: int, motion: ChoirMotion, name: str) -> Picture:
    """Draw one string's jack, plectrum, damper and wire."""
    choir = motion.choir
    radius, parts = choir.string.diameter / 2, {part.name: part for part in head_parts(motion)}
    clamp = clamp_place(choir)
    labels = [
        ("body", "jack", clamp - AXLE - BODY / 2, 0.0),
        ("tongue", "tongue", clamp - AXLE / 2, 0.0),
        ("body", "plectrum", clamp / 2, radius + choir.plectrum.clamp_thickness / 2),
        ("holder", "damper", clamp / 2, 0.5e-3),
    ]
    shapes = [drawn(part, (UM, UM)) for part in parts.values()]
    shapes += [_named(parts[part], text, x, z) for part, text, x, z in labels if part in parts]
    shapes += [
        label("string", 0.35e-3 * UM, -radius * UM),
        Shape("path", "cross", {"d": "M-150,0H150M0,-150V150"}),
    ]
    left, low, right, high = (edge * UM for edge in head_view(motion))
    width = right - left
    spare = max(width - (high - low), 0) / 3  # so that the picture is a square
    low, high = low - spare, high + 2 * spare
    return Picture(
        f"head-{number}",
        f"{name}jack head seen along the string: tongue, plectrum, damper and wire",
        rounded(left),
        -rounded(high),
        rounded(width),
        rounded(high - low),
        rounded(width / 36),  # The width is 36 font sizes
        tuple(shapes),
    )


def _named(part: Part, text: str, x: float, z: float) -> Shape:
    """Return a label at (x, z), in m, that moves with a part; upright parts have an upright one."""
    place = {"x": rounded(x * UM), "y": -rounded(z * UM), "text-anchor": "middle"}
    moved = transform(part, (UM, UM))
    if text in ("jack", "tongue"):
        moved = tuple(f"{one} rotate(-90 {place['x']} {place['y']})" for one in moved)
    return Shape("text", f"named name-{text}", place, {"transform": moved}, text)
