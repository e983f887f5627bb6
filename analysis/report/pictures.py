"""Pictures of the slow motion: jack head, strings, key, and force over time.

The jack head is seen along the string, to scale, in micrometres from the string at rest.
"""

import numpy as np

from sautereau.analysis.figures.jack import AXLE, FELT_HEIGHT, PIVOT
from sautereau.analysis.figures.jack import BODY as HEAD_BODY
from sautereau.analysis.figures.side import BODY, HEAD, JACK, UNDER, key_outline, string_height
from sautereau.analysis.model.choirs import choirs, key_of
from sautereau.analysis.press.replay import ChoirMotion, Replay
from sautereau.analysis.report.drawing import (
    Frames,
    Picture,
    Shape,
    box,
    envelope,
    every,
    label,
    points,
    rectangle,
    rounded,
    shifted,
)
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats

WIDE = 2000  # Width of the pictures of string and force, in units of about a third of a pixel
LOW = 600  # Height of these pictures, in the same unit
MARGIN = 60  # Distance of the curves from the sides, in the same unit
GAP = 16  # Distance of labels from what they describe, in the same unit
LETTERS = 52  # Font size, in the same unit
LINE = 4  # Step between the drawn points of the string
BAND = 8  # Step between the drawn points of the band that the string swept
TRACED = 400  # Number of points of the force
TENTH = 1e4  # 1/m; the key is drawn in units of 0.1 mm
UM = 1e6
TOP = 1.2e-3  # m, length of the tongue above the plectrum
RIGHT = 2.1e-3  # m, visible width beyond the string
DEEPEST = 2.5e-3  # m, largest visible depth below the string
BESIDE = 0.8e-3  # m, margin above and below
HEAD_LETTERS = 36  # Width of the picture of the jack head in font sizes
UPRIGHT = ("jack", "tongue")  # Parts with a vertical label
LONG = 30e-3  # m, length of the jack's body above and below the plectrum; part of it is visible


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
    x, seen = MARGIN + motion.places * across, motion.deflection * up
    line, band = (_kept(motion, every_nth) for every_nth in (LINE, BAND))
    swept = [_path(x, side)[:, band] for side in (seen.max(axis=1), seen.min(axis=1))]
    at = rounded(MARGIN + string.plucking_point * across)
    shapes = (
        Shape("path", "axis", {"d": f"M{MARGIN},0H{WIDE - MARGIN}"}),
        Shape("path", "axis", {"d": f"M{at},{-LOW // 2}V{LOW // 2}"}),
        Shape("polygon", "band", {}, {"points": every(np.hstack([swept[0], swept[1][:, ::-1]]))}),
        Shape("polyline", "string", {}, {"points": every(_path(x, seen[:, 0])[:, line])}),
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


def _kept(motion: ChoirMotion, every_nth: int) -> np.ndarray:
    """Return the points of a string that are drawn, including the one above the plectrum."""
    plucked = int(np.argmin(np.abs(motion.places - motion.choir.string.plucking_point)))
    return np.unique([*range(0, len(motion.places), every_nth), plucked])


def _path(x: Floats, z: Floats) -> Floats:
    """Return places, shape (frames, n, 2), from x, shape (n,), and z, shape (frames, n)."""
    return np.stack([np.broadcast_to(x, z.shape), z], -1)


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
    key, all_choirs = rig.key, choirs(rig)
    surface, rear = key.surface_height, key.jack_surface_height
    outline = key_outline(rig)
    front, back = outline[:, 0].min(), outline[:, 0].max()
    touched = np.array([-key.press_arm, surface])
    finger = touched + np.array([[0, 0], [-6e-3, 16e-3], [6e-3, 16e-3]])
    turned = tuple(f"rotate({-angle:.3f})" for angle in np.degrees(scene.angle).tolist())
    pin = np.array([[0, 0], [-5e-3, -UNDER - 8e-3], [5e-3, -UNDER - 8e-3]])
    shapes = [
        _felt(-key.press_arm, -UNDER - key.dip),
        _felt(key.jack_arm, -UNDER),
        Shape("polygon", "key", {"points": points(outline * TENTH)}, {"transform": turned}),
        Shape("polygon", "finger", {"points": points(finger * TENTH)}, {"transform": turned}),
        Shape("polygon", "pin", {"points": points(pin * TENTH)}),
        label("finger", (8e-3 - key.press_arm) * TENTH, (surface + 14e-3) * TENTH),
        label("balance pin", 8e-3 * TENTH, (-UNDER - 14e-3) * TENTH),
    ]
    right = back + 30e-3
    for number, choir in enumerate(all_choirs, 1):
        x, z = choir.jack_arm * TENTH, rounded(string_height(rig, choir) * TENTH)
        rise = rise_of_angle(key_of(rig, choir), scene.angle) * TENTH
        half = BODY / 2 * TENTH
        body = rectangle(-half, rear * TENTH, half, (rear + JACK + HEAD) * TENTH)
        shapes += [
            Shape("path", "string", {"d": f"M{rounded(x - 600)},{-z}H{rounded(right * TENTH)}"}),
            Shape("rect", f"jack jack-{number}", body, {"transform": shifted(x, rise)}),
        ]
    left, low = front - 15e-3, -UNDER - key.dip - 16e-3
    high = rear + JACK + HEAD + 30e-3
    width = rounded((right - left) * TENTH)
    return Picture(
        "key",
        "key and jack from the side, at the positions measured by the laser",
        rounded(left * TENTH),
        -rounded(high * TENTH),
        width,
        rounded((high - low) * TENTH),
        rounded(width * LETTERS / WIDE),
        tuple(shapes),
    )


def _felt(x: float, top: float) -> Shape:
    return box("felt", (x - 12e-3) * TENTH, (top - 4e-3) * TENTH, (x + 12e-3) * TENTH, top * TENTH)


def head_picture(number: int, motion: ChoirMotion, name: str) -> Picture:
    """Draw one string's jack, plectrum, damper and wire."""
    choir = motion.choir
    plectrum, jack = choir.plectrum, choir.jack
    clamp = (plectrum.overlap - plectrum.length) * UM
    radius = choir.string.diameter / 2 * UM
    down = radius + plectrum.clamp_thickness / 2 * UM
    pivot = (jack.tongue.pivot if jack.tongue else PIVOT) * UM
    height, wire = motion.height * UM, motion.wire * UM
    risen = shifted(0, height)
    swung = tuple(
        f"{moved} rotate({-angle:.2f} {rounded(clamp)} {rounded(pivot)})" if angle else moved
        for moved, angle in zip(risen, np.degrees(motion.tongue).tolist(), strict=True)
    )
    bent = motion.outline * UM + (clamp, -down)
    left, edge = clamp - (AXLE + HEAD_BODY) * UM, clamp - AXLE * UM
    along = shifted(0, wire[:, 0, 1])
    shapes = [
        *_damper(motion, clamp, radius),
        Shape("rect", "body", rectangle(left, -LONG * UM, edge, LONG * UM), {"transform": risen}),
        Shape("rect", "tongue", rectangle(edge, -pivot, clamp, TOP * UM), {"transform": swung}),
        Shape("polygon", "plectrum", {}, {"points": every(bent), "transform": swung}),
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
    width = RIGHT * UM - left + 0.3 * HEAD_BODY * UM
    spare = max(width - (high - low), 0) / 3  # so that the picture is a square
    low, high = low - spare, high + 2 * spare
    return Picture(
        f"head-{number}",
        f"{name}jack head seen along the string: tongue, plectrum, damper and wire",
        rounded(left - 0.3 * HEAD_BODY * UM),
        -rounded(high),
        rounded(width),
        rounded(high - low),
        rounded(width / HEAD_LETTERS),
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
