"""Jack head seen along the string, to scale, in micrometres from the string at rest."""

import numpy as np

from sautereau.analysis.figures.jack import AXLE, BODY, FELT_HEIGHT, PIVOT
from sautereau.analysis.press.replay import ChoirMotion
from sautereau.analysis.report.drawing import (
    Frames,
    Picture,
    Shape,
    every,
    label,
    rectangle,
    rounded,
    shifted,
)

UM = 1e6
TOP = 1.2e-3
"""m, length of the tongue above the plectrum."""
RIGHT = 2.1e-3
"""m, visible width beyond the string."""
DEEPEST = 2.5e-3
"""m, largest visible depth below the string."""
BESIDE = 0.8e-3
"""m, margin above and below."""
EVERY_NTH = 2
"""Step between the points of a plectrum that are drawn."""
LETTERS = 36
"""Width of a picture in font sizes."""
UPRIGHT = ("jack", "tongue")
"""Parts with a vertical label."""
LONG = 30e-3
"""m, length of the jack's body above and below the plectrum; part of it is visible."""


def head_picture(number: int, motion: ChoirMotion, name: str) -> Picture:
    """Draw one choir's jack, plectrum, damper and wire.

    Args:
        number: Number of the choir, from 1.
        motion: Its motion.
        name: Start of the caption.
    """
    choir = motion.choir
    plectrum, jack = choir.plectrum, choir.jack
    clamp = (plectrum.overlap - plectrum.length) * UM
    radius = choir.string.diameter / 2 * UM
    down = radius + plectrum.thickness / 2 * UM
    pivot = (jack.tongue.pivot if jack.tongue else PIVOT) * UM
    height, wire = motion.height * UM, motion.wire * UM
    risen = shifted(0, height)
    swung = tuple(
        f"{moved} rotate({-angle:.2f} {rounded(clamp)} {rounded(pivot)})" if angle else moved
        for moved, angle in zip(risen, np.degrees(motion.tongue).tolist(), strict=True)
    )
    bent = motion.line[:, ::EVERY_NTH] * UM + (clamp, -down)
    left, edge = clamp - (AXLE + BODY) * UM, clamp - AXLE * UM
    thick = rounded(plectrum.thickness * UM)
    along = shifted(0, wire[:, 0, 1])
    shapes = [
        *_damper(motion, clamp, radius),
        Shape("rect", "body", rectangle(left, -LONG * UM, edge, LONG * UM), {"transform": risen}),
        Shape("rect", "tongue", rectangle(edge, -pivot, clamp, TOP * UM), {"transform": swung}),
        Shape(
            "polyline",
            "plectrum",
            {"stroke-width": thick},
            {"points": every(bent), "transform": swung},
        ),
        _named("jack", (left + edge) / 2, 0, risen),
        _named("tongue", (edge + clamp) / 2, 0, swung),
        _named("plectrum", clamp / 2, down, risen),
        Shape("polyline", "path", {}, {"points": every(wire)}),
        Shape(
            "circle",
            "wire",
            {"r": rounded(radius)},
            {"cx": tuple(str(rounded(x)) for x in wire[:, 0, 0]), "transform": along},
        ),
        label("string", 0.35e-3 * UM, -radius),
        Shape("path", "cross", {"d": "M-150,0H150M0,-150V150"}),
    ]
    low = max(-DEEPEST * UM, height.min()) - 2 * down - BESIDE * UM
    high = wire[..., 1].max() + (FELT_HEIGHT + BESIDE) * UM
    width = RIGHT * UM - left + 0.3 * BODY * UM
    spare = max(width - (high - low), 0) / 3  # so that the picture is a square
    low, high = low - spare, high + 2 * spare
    return Picture(
        f"head-{number}",
        f"{name}jack head seen along the string: tongue, plectrum, damper and wire",
        rounded(left - 0.3 * BODY * UM),
        -rounded(high),
        rounded(width),
        rounded(high - low),
        rounded(width / LETTERS),
        tuple(shapes),
    )


def _named(part: str, x: float, z: float, moved: Frames) -> Shape:
    """Return the label of a part, which moves with it."""
    place = {"x": rounded(x), "y": -rounded(z), "text-anchor": "middle"}
    if part in UPRIGHT:
        moved = tuple(f"{one} rotate(-90 {rounded(x)} {-rounded(z)})" for one in moved)
    return Shape("text", f"named name-{part}", place, {"transform": moved}, part)


def _damper(motion: ChoirMotion, clamp: float, radius: float) -> list[Shape]:
    """Return holder and felt; the felt is compressed while it is in contact with the wire."""
    jack = motion.choir.jack
    if jack.damper is None:
        return []
    gap = (motion.height + jack.string_clearance - jack.damper.lift) * UM
    top = gap + radius + FELT_HEIGHT * UM
    foot = np.minimum(np.maximum(gap, 0) + radius, top)
    half = 0.9e-3 * UM
    holder = rectangle(clamp - AXLE * UM, 0, half, 0.3e-3 * UM)
    felt = rectangle(-half, 0, half, 0)
    heights: Frames = tuple(str(rounded(high - low)) for low, high in zip(foot, top, strict=True))
    return [
        Shape("rect", "holder", holder, {"transform": shifted(0, top)}),
        Shape("rect", "felt", felt, {"transform": shifted(0, top), "height": heights}),
        _named("damper", clamp / 2, 0.5e-3 * UM, shifted(0, top)),
    ]
