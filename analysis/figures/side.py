"""The bench from its side to scale: arm, key, jacks and strings, in mm.

Lengths that a rig file does not contain have usual values: the jack's length, the key's
thickness, rail, felt and register. Nut and bridge are drawn in the plane of the key.
"""

from typing import TYPE_CHECKING

import numpy as np

from sautereau.analysis.figures.palette import ARM, FELT, GRAIN, METAL, WOOD
from sautereau.analysis.model.choirs import choirs, key_of
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import base, fingertip_place, link_vectors
from sautereau.trajectory.key import rise_of_angle, surface_axes
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist

JACK = 80e-3  # Distance from a jack's lower end to its plectrum (m)
HEAD = 9e-3  # Distance from the plectrum to the top of the jack (m)
BODY = 4e-3  # Width of a jack (m)
UNDER = 8e-3  # Thickness of the key below its pin (m)
KEY_HEAD = 14e-3  # Length of the key behind its last jack (m)


class BenchPose:
    """Key, jacks and arm in one pose, as movable artists.

    Args:
        axes: In mm, with equal aspect.
        ghost: Draw a dashed outline in that colour.
    """

    def __init__(
        self, axes, rig: Rig, colour: str = ARM, *, ghost: bool = False, label: str | None = None
    ):
        from matplotlib.patches import Circle, Polygon

        self.rig, self.choirs = rig, choirs(rig)
        edge, order = (colour if ghost else GRAIN), (2 if ghost else 3)
        face, dashes = ("none", "--") if ghost else (WOOD, "-")

        def body() -> Polygon:
            return Polygon(np.zeros((1, 2)), fc=face, ec=edge, ls=dashes, lw=1.2, zorder=order)

        self._key, self._jacks = body(), [body() for _ in self.choirs]
        line = {"lw": 1.2, "ls": "--"} if ghost else {"lw": 5, "solid_capstyle": "round"}
        (self._links,) = axes.plot([], [], color=colour, zorder=order + 2, label=label, **line)
        joints = {"mfc": "white", "mec": colour, "mew": 1.5, "ms": 7, "ls": ""}
        (self._joints,) = axes.plot([], [], "o", zorder=order + 3, **joints)
        radius = rig.arm.fingertip_radius * 1e3
        self._tip = Circle((0, 0), radius, fc="white", ec=colour, lw=1.2, zorder=order + 2.5)
        for patch in (self._key, *self._jacks, self._tip):
            axes.add_patch(patch)
        if ghost:
            self._joints.set_visible(False)

    @property
    def artists(self) -> "list[Artist]":
        """All moving artists."""
        return [self._key, *self._jacks, self._links, self._joints, self._tip]

    def put(self, angle: float, joints: Floats | None) -> None:
        """Move to a key's angle [rad] and joints [rad], shape (2,); None for no arm."""
        along, up = key_outline(self.rig).T
        tangent, normal = surface_axes(angle)
        self._key.set_xy((np.outer(along, tangent) + np.outer(up, normal)) * 1e3)
        for patch, choir in zip(self._jacks, self.choirs, strict=True):
            foot = jack_foot(self.rig, choir, angle)
            sides = np.array([[-1, 0], [1, 0], [1, 1], [-1, 1]]) * (BODY / 2, JACK + HEAD)
            patch.set_xy((foot + sides) * 1e3)
        for artist in (self._links, self._tip):
            artist.set_visible(joints is not None)
        if joints is not None:
            start = base(self.rig.arm)
            elbow = start + link_vectors(self.rig.arm.upper_length, joints[0])[0]
            tip = fingertip_place(self.rig.arm, joints)
            self._links.set_data(*np.array([start, elbow, tip]).T * 1e3)
            self._joints.set_data(*np.array([start, elbow]).T * 1e3)
            self._tip.set_center(tuple(tip * 1e3))


def jack_foot(rig: Rig, choir: Choir, angle: float) -> Floats:
    """Return the position [m] of a jack's lower end at a key angle [rad], shape (2,)."""
    rise = float(rise_of_angle(key_of(rig, choir), angle))
    return np.array([choir.jack_arm, rig.key.jack_surface_height + rise])


def string_height(rig: Rig, choir: Choir) -> float:
    """Return the height [m] at which a choir's string is drawn."""
    return rig.key.jack_surface_height + JACK + choir.jack.string_clearance


def draw_surroundings(axes, rig: Rig) -> None:
    """Draw the fixed parts: pin, rail, felt, register and strings, in mm."""
    from matplotlib.patches import Polygon, Rectangle

    key = rig.key
    block = {"ec": METAL, "lw": 0.8, "zorder": 1}
    axes.add_patch(
        Polygon([(0, 0), (-5, -1e3 * UNDER - 8), (5, -1e3 * UNDER - 8)], fc=METAL, zorder=4)
    )
    felt = (-key.press_arm * 1e3 - 12, (-UNDER - key.dip) * 1e3 - 4)
    axes.add_patch(Rectangle(felt, 24, 4, fc=FELT, **block))
    rail = (key.jack_arm * 1e3 - 18, -UNDER * 1e3 - 4)
    axes.add_patch(Rectangle(rail, 24, 4, fc=FELT, **block))
    for choir in choirs(rig):
        x, z = choir.jack_arm * 1e3, string_height(rig, choir) * 1e3
        nut = x - choir.string.plucking_point * 1e3
        bridge = nut + choir.string.length * 1e3
        axes.plot([nut, bridge], [z, z], color="black", lw=1.3, zorder=4)
        for end in (nut, bridge):
            axes.add_patch(Polygon([(end, z), (end - 4, z - 9), (end + 4, z - 9)], fc=GRAIN))
        for side in (-1, 1):
            middle = x + side * (BODY * 1e3 / 2 + 3.4)
            axes.add_patch(Rectangle((middle - 2.5, 58), 5, 7, fc="#d8d8d8", **block))


def key_outline(rig: Rig) -> Floats:
    """Return the outline [m] of a key at rest from its side, shape (n, 2)."""
    key = rig.key
    back = max(choir.jack_arm for choir in choirs(rig)) + KEY_HEAD
    front, top, rear = -key.front_arm, key.surface_height, key.jack_surface_height
    return np.array(
        [[front, -UNDER], [front, top], [0, top], [0, rear], [back, rear], [back, -UNDER]]
    )
