"""Pictures of the slow motion: jack head, strings, key, and force over time.

The jack head is to scale, in micrometres from the string at rest.
"""

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
from sautereau.analysis.report.drawing import (
    Picture,
    Shape,
    box,
    drawn,
    envelope,
    label,
    points,
    rounded,
    transform,
)

WIDE = 2000  # Width of the pictures of string and force, in units of about a third of a pixel
LOW = 600  # Height of these pictures, in the same unit
MARGIN = 60  # Distance of the curves from the sides, in the same unit
GAP = 16  # Distance of labels from what they describe, in the same unit
LETTERS = 52  # Font size, in the same unit
STEP = 4  # Step between the drawn points of the string
TRACED = 400  # Number of points of the force
TENTH = 1e4  # 1/m; the key is drawn in units of 0.1 mm
UM = 1e6
HEAD_LETTERS = 36  # Width of the picture of the jack head in font sizes


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
        *(drawn(part, (across, up), (MARGIN, 0)) for part in string_parts(motion, STEP)),
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
    kept = envelope(newton, TRACED)
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
        rounded(width / HEAD_LETTERS),
        tuple(shapes),
    )


def _named(part: Part, text: str, x: float, z: float) -> Shape:
    """Return a label at (x, z), in m, that moves with a part; upright parts have an upright one."""
    place = {"x": rounded(x * UM), "y": -rounded(z * UM), "text-anchor": "middle"}
    moved = transform(part, (UM, UM))
    if text in ("jack", "tongue"):
        moved = tuple(f"{one} rotate(-90 {place['x']} {place['y']})" for one in moved)
    return Shape("text", f"named name-{text}", place, {"transform": moved}, text)
