"""A jack's head seen along the string, to scale: tongue, plectrum, damper and wire.

The wire lies on the upper surface, so the plectrum's mid-line is drawn lower by half its thickness
and the wire's radius, also where the model has the string on the mid-line.
"""

from typing import TYPE_CHECKING

import numpy as np

from sautereau.analysis.figures.palette import ARM, FELT, GRAIN, PRESSED, WOOD
from sautereau.analysis.model.plectrum.shape import straight
from sautereau.rig.instrument import Choir
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist

PLECTRUM, WIRE, TONGUE, AXLE_METAL = PRESSED, ARM, "#dcc9a0", "#9a9a9a"
BODY = 3.0e-3  # Width of a jack's body behind its tongue (m)
AXLE = 1.3e-3  # Width of a tongue (m)
PIVOT = 12e-3  # Depth of a tongue's pivot below the plectrum if the rig has no tongue (m)
FELT_HEIGHT = 1.4e-3  # Height of an unloaded damper felt (m)


class JackView:
    """A jack's head and its string, as artists that can be moved, in mm from the string at rest.

    Args:
        travel: m, height of the jack above first contact that must be visible.
    """

    def __init__(self, axes, choir: Choir, travel: float = 0.0):
        from matplotlib.patches import Circle, Polygon

        self.axes, self.choir = axes, choir
        plectrum, jack = choir.plectrum, choir.jack
        self.clamp = plectrum.overlap - plectrum.length
        """m, x of the clamp."""
        self.radius = choir.string.diameter / 2
        nothing = np.zeros((1, 2))
        self._body = Polygon(nothing, fc=WOOD, ec=GRAIN, zorder=2)
        self._tongue = Polygon(nothing, fc=TONGUE, ec=GRAIN, zorder=3)
        self._holder = Polygon(nothing, fc=AXLE_METAL, ec="none", zorder=2.5)
        self._felt = Polygon(nothing, fc=FELT, ec="none", zorder=2.4)
        self._plectrum = Polygon(nothing, fc=PLECTRUM, ec=PLECTRUM, lw=0.5, zorder=4)
        self._wire = Circle((0, 0), self.radius * 1e3, fc=WIRE, ec="none", zorder=6)
        (self._path,) = axes.plot([], [], color=WIRE, lw=1.2, alpha=0.45, zorder=5)
        for patch in (
            self._body, self._tongue, self._holder, self._felt, self._plectrum, self._wire,
        ):  # fmt: skip
            axes.add_patch(patch)
        axes.plot(0, 0, "+", color="#666666", ms=9, mew=0.8, zorder=7)
        below = min(jack.string_clearance, 2.5e-3) + plectrum.thickness + 0.8e-3
        left, top = self.clamp - AXLE - BODY * 0.7, travel + FELT_HEIGHT + 1.0e-3
        axes.set(xlim=(left * 1e3, 2.1), ylim=(-below * 1e3, top * 1e3), aspect="equal")
        axes.set(xlabel="along the plectrum, from the string (mm)", ylabel="z (mm)")

    @property
    def artists(self) -> "list[Artist]":
        """All moving artists."""
        return [
            self._body, self._tongue, self._holder, self._felt, self._plectrum, self._path,
            self._wire,
        ]  # fmt: skip

    def put(self, height: float, outline: Floats, tongue: float, wire: Floats) -> None:
        """Move to a height and a shape.

        Args:
            height: m, of the jack above first contact.
            outline: m, of the plectrum in its clamp's frame, shape (n, 2).
            tongue: rad, rotation of the tongue backwards.
            wire: m, positions of the wire during the frame, the present one first; shape (k, 2).
        """
        choir = self.choir
        clamp = np.array([self.clamp, height])
        shape = outline + clamp - (0.0, self.radius + choir.plectrum.clamp_thickness / 2)
        pivot = choir.jack.tongue.pivot if choir.jack.tongue else PIVOT
        axle = clamp - (0.0, pivot)
        upper = 1.2e-3
        own = np.array([[-AXLE, 0], [0, 0], [0, pivot + upper], [-AXLE, pivot + upper]]) + axle
        self._tongue.set_xy(_turned(own, axle, tongue) * 1e3)
        self._plectrum.set_xy(_turned(shape, axle, tongue) * 1e3)
        top, left = 30e-3, -AXLE - BODY
        body = [[left, -top], [0, -top], [0, -pivot - 1e-3], [-AXLE, -pivot - 1e-3]]
        body += [[-AXLE, top], [left, top]]
        self._body.set_xy((np.array(body) + clamp) * 1e3)
        self._put_damper(height)
        self._wire.set_center(tuple(wire[0] * 1e3))
        self._path.set_data(*wire.T * 1e3)

    def rest(self) -> None:
        """Move to the jack at rest, with the string at rest."""
        self.put(
            -self.choir.jack.string_clearance, straight(self.choir.plectrum), 0.0, np.zeros((1, 2))
        )

    def label(self) -> None:
        """Label the parts, at rest."""
        choir = self.choir
        clearance, middle = choir.jack.string_clearance * 1e3, self.clamp * 500
        low = -clearance - (self.radius + choir.plectrum.clamp_thickness / 2) * 1e3
        arrow = {"arrowstyle": "<->", "color": "#444444"}
        self.axes.annotate("", (0.9, 0), (0.9, -clearance), arrowprops=arrow)
        self.axes.plot([0.1, 1.2], [-clearance] * 2, color="#444444", lw=0.6, ls=":")
        self.axes.plot([0.1, 1.2], [0, 0], color="#444444", lw=0.6, ls=":")
        self.axes.text(1.0, -clearance / 2, "clearance", va="center", fontsize=8)
        self.axes.text(middle, low - 0.35, "plectrum", ha="center", va="top", fontsize=8)
        self.axes.annotate(
            "wire", (-self.radius * 1e3, 0), (-30, -12), textcoords="offset points", fontsize=8
        )
        if choir.jack.damper:
            top = (self.radius + FELT_HEIGHT - choir.jack.damper.lift) * 1e3 + 0.4
            self.axes.text(middle, top, "damper", ha="center", va="bottom", fontsize=8)
        side = (self.clamp - AXLE / 2) * 1e3
        self.axes.text(side, low - 0.1, "tongue", rotation=90, ha="center", va="bottom", fontsize=8)

    def _put_damper(self, height: float) -> None:
        choir = self.choir
        damper = choir.jack.damper
        for artist in (self._holder, self._felt):
            artist.set_visible(damper is not None)
        if damper is None:
            return
        gap = height + choir.jack.string_clearance - damper.lift
        foot, top = max(gap, 0.0) + self.radius, gap + self.radius + FELT_HEIGHT
        self._felt.set_xy(_box(-0.9e-3, 0.9e-3, foot, max(top, foot)) * 1e3)
        self._holder.set_xy(_box(self.clamp - AXLE, 0.9e-3, top, top + 0.3e-3) * 1e3)


def _turned(points: Floats, about: Floats, angle: float) -> Floats:
    cosine, sine = np.cos(angle), np.sin(angle)
    return (points - about) @ np.array([[cosine, sine], [-sine, cosine]]) + about


def _box(left: float, right: float, low: float, high: float) -> Floats:
    return np.array([[left, low], [right, low], [right, high], [left, high]])
