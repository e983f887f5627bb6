"""A slow motion as the page holds it: its pictures at one frame, and what the script moves."""

import json
from dataclasses import dataclass
from itertools import chain

from sautereau.analysis.report.drawing import Picture
from sautereau.analysis.report.head_picture import head_picture
from sautereau.analysis.report.scene_pictures import force_picture, key_picture, string_picture
from sautereau.analysis.report.slow_motion import Reading, SlowMotion, about, readings

SLIDER, READING = "frame", "reading"
"""Id of what chooses the frame, and the beginning of those of the readings."""


@dataclass(frozen=True)
class Moving:
    """What the template draws of a slow motion."""

    about: str
    simulated: bool
    columns: tuple[tuple[Picture, ...], tuple[Picture, ...]]
    """Jacks; strings, force and key."""
    readings: tuple[Reading, ...]
    frame: int
    """That is shown first, and printed."""
    last: int
    """Number of the last frame; the first is 0."""

    @property
    def told(self) -> tuple[str, ...]:
        """Every frame in words, for those who do not see it."""
        each = zip(*(reading.values for reading in self.readings), strict=True)
        return tuple(", ".join(values) for values in each)

    @property
    def data(self) -> str:
        """The values of everything that moves in every frame, by id and attribute, as JSON."""
        moves = {SLIDER: {"aria-valuetext": self.told}}
        moves |= {f"{READING}-{i}": {"": one.values} for i, one in enumerate(self.readings, 1)}
        for picture in chain(*self.columns):
            moves |= picture.moves
        return json.dumps(moves, separators=(",", ":"))


def moving(shown: SlowMotion) -> Moving:
    """Draw a slow motion for the page."""
    scene = shown.scene
    several = len(scene.choirs) > 1
    named = [
        (i, motion, f"choir {i}: " if several else "") for i, motion in enumerate(scene.choirs, 1)
    ]
    return Moving(
        about=about(shown),
        simulated=scene.press.simulated,
        columns=(
            tuple(head_picture(*one) for one in named),
            (*(string_picture(*one) for one in named), force_picture(scene), key_picture(scene)),
        ),
        readings=readings(shown),
        frame=shown.at_release,
        last=len(scene.time) - 1,
    )
