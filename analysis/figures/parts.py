"""Everything that slow motion and the bench's drawings show, to scale, as parts with frames.

Matplotlib (`sautereau.analysis.figures.artists`) and SVG (`sautereau.analysis.report.pictures`)
draw the same parts. All are seen from the side, in m, x to the right and z upwards. Lengths that a
rig file does not contain have usual values: jack's length, key's thickness, rail, felt, register,
and those of a jack's head. Nut and bridge are drawn in the plane of the key.

A jack's head is seen along the string, from the string at rest. The wire lies on the upper surface,
so the plectrum's mid-line is lower by half its thickness and the wire's radius, also where the
model has the string on the mid-line.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.model.choirs import choirs, key_of
from sautereau.analysis.press.replay import ChoirMotion
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import base, fingertip_place, link_vectors
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats

JACK = 80e-3  # Distance from a jack's lower end to its plectrum (m)
HEAD = 9e-3  # Distance from the plectrum to the top of the jack (m)
WIDTH = 4e-3  # Width of a jack beside the key (m)
UNDER = 8e-3  # Thickness of the key below its pin (m)
BODY = 3.0e-3  # Width of a jack's body behind its tongue (m)
AXLE = 1.3e-3  # Width of a tongue (m)
LONG = 30e-3  # Length of a jack's body above and below the plectrum; part of it is visible (m)
FELT_HEIGHT = 1.4e-3  # Height of an unloaded damper felt (m)
HALF_FELT = 0.9e-3  # Half the width of a damper felt (m)
BESIDE = 0.8e-3  # Margin above and below (m)


@dataclass(frozen=True)
class Part:
    """One drawn part."""

    name: str
    """What it is; the last word is unique among the moving parts of a drawing."""
    points: Floats
    """m, shape (k, 2), or (frames, k, 2) for a part that changes its shape; its first point is the
    centre of a disc."""
    shift: Floats | None = None
    """m, shape (frames, 2)."""
    turn: Floats | None = None
    """rad anticlockwise about `pivot`, before the shift; shape (frames,)."""
    pivot: tuple[float, float] = (0.0, 0.0)
    closed: bool = True
    """An area; otherwise a line."""
    radius: float = 0.0
    """m, of a disc; 0 for any other shape."""

    def at(self, frame: int) -> Floats:
        """Return its points [m] in a frame, shape (k, 2)."""
        points = self.points if self.points.ndim == 2 else self.points[frame]
        if self.turn is not None:
            cosine, sine = np.cos(self.turn[frame]), np.sin(self.turn[frame])
            back = np.array([[cosine, sine], [-sine, cosine]])
            points = (points - self.pivot) @ back + self.pivot
        return points if self.shift is None else points + self.shift[frame]


def box(left: float, low: float, right: float, high: float) -> Floats:
    """Return the corners of a rectangle, shape (4, 2)."""
    return np.array([[left, low], [right, low], [right, high], [left, high]])


def upwards(z: Floats) -> Floats:
    """Return shifts [m] upwards, shape (frames, 2)."""
    return np.stack([np.zeros_like(z), z], -1)


def head_parts(motion: ChoirMotion) -> list[Part]:
    """Return a jack's head: body, tongue, plectrum, damper and wire."""
    choir, risen = motion.choir, upwards(motion.height)
    # 12 mm below the plectrum if the rig has no tongue.
    pivot, radius = choir.jack.tongue.pivot if choir.jack.tongue else 12e-3, _radius(choir)
    edge, clamp = clamp_place(choir) - AXLE, clamp_place(choir)
    swung = {"shift": risen, "turn": motion.tongue, "pivot": (clamp, -pivot)}
    body = [[-BODY, -LONG], [AXLE, -LONG], [AXLE, -pivot - 1e-3], [0, -pivot - 1e-3]]
    body = np.add([*body, [0, LONG], [-BODY, LONG]], (edge, 0))
    bent = np.add(motion.outline, (clamp, -radius - choir.plectrum.clamp_thickness / 2))
    return [
        *_damper(motion, edge),
        Part("body", body, risen),
        Part("tongue", box(edge, -pivot, clamp, 1.2e-3), **swung),  # 1.2 mm above the plectrum
        Part("plectrum", bent, **swung),
        Part("path", motion.wire, closed=False),
        Part("wire", np.zeros((1, 2)), motion.wire[:, 0], radius=radius),
    ]


def head_view(motion: ChoirMotion) -> tuple[float, float, float, float]:
    """Return the left, lower, right and upper limits [m] of the drawing of a jack's head."""
    low = max(-2.5e-3, motion.height.min()) - BESIDE  # The plectrum is visible to 2.5 mm
    low -= 2 * _radius(motion.choir) + motion.choir.plectrum.clamp_thickness
    high = motion.wire[..., 1].max() + FELT_HEIGHT + BESIDE
    # 2.4 mm beyond the string are visible.
    return clamp_place(motion.choir) - AXLE - 1.3 * BODY, float(low), 2.4e-3, float(high)


def clamp_place(choir: Choir) -> float:
    """Return the x [m] of a plectrum's clamp, from the string."""
    return choir.plectrum.overlap - choir.plectrum.length


def _radius(choir: Choir) -> float:
    return choir.string.diameter / 2


def _damper(motion: ChoirMotion, edge: float) -> list[Part]:
    """Return holder and felt, which is compressed while it is in contact with the wire."""
    jack, radius = motion.choir.jack, _radius(motion.choir)
    if jack.damper is None:
        return []
    gap = motion.height + jack.string_clearance - jack.damper.lift
    top = gap + radius + FELT_HEIGHT
    foot = np.minimum(np.maximum(gap, 0) + radius, top)
    each = [box(-HALF_FELT, *ends) for ends in zip(foot, [HALF_FELT] * len(top), top, strict=True)]
    return [
        Part("holder", box(edge, 0, HALF_FELT, 0.3e-3), upwards(top)),
        Part("felt", np.array(each)),
    ]


def string_parts(motion: ChoirMotion, step: int = 1) -> list[Part]:
    """Return a string from the nut at 0 to the bridge, and the band that it swept in each frame.

    Args:
        step: Every so many points are drawn, and the one above the plectrum; of the band a third
            as many.
    """
    plucked = int(np.argmin(np.abs(motion.places - motion.choir.string.plucking_point)))
    line, band = (
        np.union1d(np.arange(0, len(motion.places), n), plucked) for n in (step, 3 * step)
    )
    x, z = motion.places, motion.deflection
    low, high = z.min(axis=1)[:, band], z.max(axis=1)[:, band]
    swept = np.hstack([_path(x[band], high), _path(x[band], low)[:, ::-1]])
    return [Part("band", swept), Part("string", _path(x[line], z[:, 0, line]), closed=False)]


def _path(x: Floats, z: Floats) -> Floats:
    """Return points, shape (frames, n, 2), from x, shape (n,), and z, shape (frames, n)."""
    return np.stack([np.broadcast_to(x, z.shape), z], -1)


def string_height(rig: Rig, choir: Choir) -> float:
    """Return the height [m] at which a choir's string is drawn."""
    return rig.key.jack_surface_height + JACK + choir.jack.string_clearance


def key_outline(rig: Rig) -> Floats:
    """Return the outline [m] of a key at rest from its side, shape (n, 2)."""
    key = rig.key
    back = max(choir.jack_arm for choir in choirs(rig)) + 14e-3  # 14 mm behind its last jack
    front, top, rear = -key.front_arm, key.surface_height, key.jack_surface_height
    return np.array(
        [[front, -UNDER], [front, top], [0, top], [0, rear], [back, rear], [back, -UNDER]]
    )


def bench_parts(rig: Rig, angle: Floats) -> list[Part]:
    """Return a key and its jacks.

    Args:
        angle: rad, of the key; shape (frames,).
    """
    parts, rear = [Part("key", key_outline(rig), turn=angle)], rig.key.jack_surface_height
    for number, choir in enumerate(choirs(rig), 1):
        rise = np.add(upwards(rise_of_angle(key_of(rig, choir), angle)), (choir.jack_arm, 0))
        sides = box(-WIDTH / 2, rear, WIDTH / 2, rear + JACK + HEAD)
        parts.append(Part(f"jack jack-{number}", sides, rise))
    return parts


def arm_parts(rig: Rig, joints: Floats) -> list[Part]:
    """Return links, joints and fingertip of an arm.

    Args:
        joints: rad, shape (frames, 2).
    """
    start = np.broadcast_to(base(rig.arm), joints.shape)
    elbow = start + link_vectors(rig.arm.upper_length, joints[:, 0])[0]
    tip = fingertip_place(rig.arm, joints)
    return [
        Part("links", np.stack([start, elbow, tip], 1), closed=False),
        Part("tip", np.zeros((1, 2)), tip, radius=rig.arm.fingertip_radius),
        Part("joints", np.stack([start, elbow], 1), closed=False),
    ]


def fixed_parts(rig: Rig) -> list[Part]:
    """Return the fixed parts: pin, rail, felt, register, strings, nuts and bridges."""
    key, foot = rig.key, -UNDER - 8e-3
    felt, rail = -UNDER - key.dip, key.jack_arm - 6e-3
    parts = [
        Part("felt", box(-key.press_arm - 12e-3, felt - 4e-3, -key.press_arm + 12e-3, felt)),
        Part("felt", box(rail - 12e-3, -UNDER - 4e-3, rail + 12e-3, -UNDER)),
        Part("pin", np.array([[0, 0], [-5e-3, foot], [5e-3, foot]])),
    ]
    for choir in choirs(rig):
        x, z = choir.jack_arm, string_height(rig, choir)
        nut = x - choir.string.plucking_point
        ends = [nut, nut + choir.string.length]
        parts.append(Part("string", np.array([[end, z] for end in ends]), closed=False))
        support = [[0, z], [-4e-3, z - 9e-3], [4e-3, z - 9e-3]]
        parts += [Part("support", np.add(support, (end, 0))) for end in ends]
        for side in (-1, 1):
            middle = x + side * (WIDTH / 2 + 3.4e-3)
            parts.append(Part("register", box(middle - 2.5e-3, 58e-3, middle + 2.5e-3, 65e-3)))
    return parts
