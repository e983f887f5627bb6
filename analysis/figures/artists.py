"""Parts of a drawing as Matplotlib's artists, in mm."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.patches import Circle, Polygon

from sautereau.analysis.figures.palette import ARM, FELT, GRAIN, METAL, PRESSED, WOOD
from sautereau.analysis.figures.parts import (
    Part,
    arm_parts,
    bench_parts,
    head_parts,
    head_view,
)
from sautereau.analysis.press.replay import ChoirMotion
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

_WOOD = {"fc": WOOD, "ec": GRAIN}
STYLES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "body": {**_WOOD, "zorder": 2},
        "felt": {"fc": FELT, "ec": "none", "zorder": 2.4},
        "holder": {"fc": "#9a9a9a", "ec": "none", "zorder": 2.5},
        "tongue": {"fc": "#dcc9a0", "ec": GRAIN, "zorder": 3},
        "plectrum": {"fc": PRESSED, "ec": PRESSED, "lw": 0.5, "zorder": 4},
        "path": {"color": ARM, "lw": 1.2, "alpha": 0.45, "zorder": 5},
        "wire": {"fc": ARM, "ec": "none", "zorder": 6},
        "pin": {"fc": METAL, "zorder": 4},
        "string": {"color": "black", "lw": 1.3, "zorder": 4},
        "support": {"fc": GRAIN},
        "register": {"fc": "#d8d8d8", "ec": METAL, "lw": 0.8, "zorder": 1},
        "key": {**_WOOD, "lw": 1.2, "zorder": 3},
        "jack": {**_WOOD, "lw": 1.2, "zorder": 3},
        "links": {"color": ARM, "lw": 5, "solid_capstyle": "round", "zorder": 5},
        "tip": {"fc": "white", "ec": ARM, "lw": 1.2, "zorder": 5.5},
        "joints": {
            "marker": "o", "mfc": "white", "mec": ARM, "mew": 1.5, "ms": 7, "ls": "", "zorder": 6,
        },
    }
)  # fmt: skip
"""How each part is drawn, by the first word of its name."""


class Artists:
    """Parts as artists that can be moved, at their first frame.

    Args:
        axes: In mm.
        styles: Changes of `STYLES`, by the part's name.
    """

    def __init__(
        self, axes, parts: Sequence[Part], styles: Mapping[str, Mapping[str, Any]] | None = None
    ):
        self._parts, self.artists = parts, list[Artist]()
        for part in parts:
            name = part.name.split()[0]
            style = dict(STYLES.get(name, {})) | dict((styles or {}).get(name, {}))
            if not part.closed:
                self.artists += axes.plot([], [], **style)
                continue
            patch = Circle((0, 0), part.radius * 1e3) if part.radius else Polygon([(0, 0)])
            patch.set(**style)
            self.artists.append(axes.add_patch(patch))
        self.put(0)

    def put(self, frame: int) -> None:
        """Move all to a frame."""
        for part, artist in zip(self._parts, self.artists, strict=True):
            places: Floats = part.at(frame) * 1e3
            match artist:
                case Circle():
                    artist.set_center(tuple(places[0]))
                case Polygon():
                    artist.set_xy(places)
                case _:
                    artist.set(data=places.T)


def draw_head(axes, motion: ChoirMotion) -> Artists:
    """Draw a jack's head, seen along the string, and a cross at the string at rest."""
    left, low, right, high = (edge * 1e3 for edge in head_view(motion))
    axes.plot(0, 0, "+", color="#666666", ms=9, mew=0.8, zorder=7)
    axes.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    axes.set(xlabel="along the plectrum, from the string (mm)", ylabel="z (mm)")
    return Artists(axes, head_parts(motion))


def draw_pose(
    axes, rig: Rig, angle: float, joints: Floats, colour: str = ARM, *, ghost: bool = False,
    label: str | None = None,
) -> None:  # fmt: skip
    """Draw key, jacks and arm at a key's angle [rad] and joints [rad], shape (2,).

    Args:
        ghost: As dashed outlines in that colour.
    """
    styles: dict[str, dict[str, Any]] = {
        "links": {"color": colour, "label": label}, "tip": {"ec": colour}, "joints": {"mec": colour}
    }  # fmt: skip
    if ghost:
        outline = {"fc": "none", "ec": colour, "ls": "--", "zorder": 2}
        styles["key"] = styles["jack"] = outline
        styles["links"] |= {"lw": 1.2, "ls": "--", "zorder": 4}
        styles["joints"]["visible"] = False
    parts = bench_parts(rig, np.array([angle])) + arm_parts(rig, joints[None])
    Artists(axes, parts, styles)
