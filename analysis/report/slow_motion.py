"""One press of the page in slow motion: its frames, its readings and its pictures."""

import json
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.palette import how_made
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.choirs import choirs, string_names
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.replay import Replay, replay
from sautereau.analysis.report.pictures import (
    Frames,
    force_picture,
    head_picture,
    key_picture,
    string_picture,
)

SLIDER = "frame"  # Id of the slider that selects the frame
READING = "reading"  # Start of the ids of the readings


@dataclass(frozen=True)
class SlowMotion:
    """A press at the times of the page's frames."""

    number: int
    """Number of the press on the page."""
    scene: Replay

    @property
    def at_release(self) -> int:
        """Frame that is shown first and printed: the last one before the first release."""
        release = self.scene.phases.plucks[0].release
        return max(0, int(np.searchsorted(self.scene.time, release)) - 1)


def slow_motion(number: int, press: Press, phases: Phases) -> SlowMotion:
    """Reconstruct a press from before its first contact to after its last release.

    Raises:
        AnalysisError: The press has no pluck.
        ModelError: The model predicts no pluck for the rig.
    """
    if not phases.plucks:
        raise AnalysisError(
            f"press {press.path}: no pluck was found, and the slow motion shows one; give a press"
            " with a pluck"
        )
    contact = min(held.contact for held in phases.plucks)
    release = max(held.release for held in phases.plucks)
    margin = 0.25 * (release - contact)
    first, last = float(press.time[0]), float(press.time[-1])
    start = max(first, contact - margin)
    stop = min(last, release + max(margin, 4e-3))  # In 4 ms the string vibrates
    # 202 frames of all strings are a third of a megabyte of the page.
    frames = min(101, max(2, 202 // len(choirs(press.rig))))
    return SlowMotion(number, replay(press, phases, np.linspace(start, stop, frames)))


def readings(shown: SlowMotion) -> dict[str, Frames]:
    """Return the values beside the pictures by their names, with one text per frame."""
    scene = shown.scene
    press = scene.press
    force, speed = (
        np.interp(scene.time, press.time, press.samples[name]) for name in ("force", "jack_speed")
    )
    return {
        "time": tuple(f"{time * 1e3:.2f} ms" for time in scene.time),
        "phase": tuple(scene.phase(float(time)) for time in scene.time),
        "finger force": tuple(f"{newton:.3f} N" for newton in force),
        "jack speed": tuple(f"{one * 1e3:.1f} mm/s" for one in speed),
    }


def about(shown: SlowMotion) -> str:
    """Return which parts of the pictures were recorded, and which follow the model."""
    scene = shown.scene
    start, stop = scene.time[0] * 1e3, scene.time[-1] * 1e3
    kind = how_made(scene.press.simulated)
    strings, moved = len(scene.choirs), sum(motion.plucks for motion in scene.choirs)
    several = f" All {strings} strings are shown, {moved} of them plucked." if strings > 1 else ""
    plucks = len(scene.phases.plucks)
    if plucks > moved:
        several += f" {plucks} plucks were found, and {moved} can be assigned to the rig's strings."
    return (
        f"Press {shown.number} ({kind}), the first with a pluck, from {start:.2f} to {stop:.2f} ms"
        f" after the trigger in {len(scene.time)} frames. Recorded: key, force and speed, and the"
        " jack while no string is in contact. Computed by the model from the times of contact and"
        " release: plectrum, tongue, damper and string, and the jack from contact to release."
        f"{several} Jack head and key are to scale; dimensions that the rig does not give have"
        " typical values."
    )


def moving(shown: SlowMotion) -> dict[str, Any]:
    """Draw a slow motion for the page.

    Returns:
        As the template reads them: `about`, `simulated`, `columns` of pictures on the left (jacks)
        and on the right (strings, force and key), `readings`, the `frame` that is shown first and
        printed, the number of the `last` frame (the first is 0), `descriptions` of every frame for
        screen readers, and `data`: the values of all changing attributes in every frame, by id and
        attribute, as JSON.
    """
    scene = shown.scene
    strings, several = string_names(scene.press.rig), len(scene.choirs) > 1
    named = [
        (i, motion, f"{strings[i - 1]}: " if several else "")
        for i, motion in enumerate(scene.choirs, 1)
    ]
    columns = (
        [head_picture(*one) for one in named],
        [*(string_picture(*one) for one in named), force_picture(scene), key_picture(scene)],
    )
    beside = readings(shown)
    descriptions = [", ".join(values) for values in zip(*beside.values(), strict=True)]
    moves: dict[str, Any] = {SLIDER: {"aria-valuetext": descriptions}}
    moves |= {f"{READING}-{i}": {"": values} for i, values in enumerate(beside.values(), 1)}
    for picture in chain(*columns):
        moves |= picture.moves
    return {
        "about": about(shown),
        "simulated": scene.press.simulated,
        "columns": columns,
        "readings": beside,
        "frame": shown.at_release,
        "last": len(scene.time) - 1,
        "descriptions": descriptions,
        "data": json.dumps(moves, separators=(",", ":")),
    }
