"""One press of the page in slow motion: which stretch of it is shown, and its readings."""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.made import how_made
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.load import Press
from sautereau.analysis.press.replay import Replay, replay

FRAMES = 101
OF_ALL_CHOIRS = 202
"""Frames of all choirs together: a third of a megabyte of the page."""
BESIDE = 0.25
"""1, of the time from first contact to last release, that is shown before it and after it."""
LEAST_BESIDE = 4e-3
"""s, that is shown after release at least, so that the string is seen to swing."""


@dataclass(frozen=True)
class SlowMotion:
    """A press at the instants of the page's frames."""

    number: int
    """Of the press on the page."""
    scene: Replay

    @property
    def at_release(self) -> int:
        """Frame that is shown first and printed: the last one before a string is let go."""
        release = self.scene.phases.plucks[0].release
        return max(0, int(np.searchsorted(self.scene.time, release)) - 1)


@dataclass(frozen=True)
class Reading:
    """What is written beside the pictures."""

    name: str
    values: tuple[str, ...]
    """Of every frame."""


def slow_motion(number: int, press: Press, phases: Phases) -> SlowMotion:
    """Put a press together for the page, from before its first contact to after its last release.

    Args:
        number: Of the press on the page.
        press: The press, with all its samples.
        phases: Its phases, with a pluck at least.

    Raises:
        AnalysisError: It has no pluck.
        ModelError: The model has no pluck for the rig.
    """
    if not phases.plucks:
        raise AnalysisError(
            f"press {press.path}: no pluck was found in it, and a slow motion shows one;"
            " give a press with a pluck"
        )
    contact = min(held.contact for held in phases.plucks)
    release = max(held.release for held in phases.plucks)
    margin = BESIDE * (release - contact)
    first, last = float(press.data.index[0]), float(press.data.index[-1])
    start = max(first, contact - margin)
    stop = min(last, release + max(margin, LEAST_BESIDE))
    frames = min(FRAMES, max(2, OF_ALL_CHOIRS // len(choirs(press.rig))))
    return SlowMotion(number, replay(press, phases, np.linspace(start, stop, frames)))


def readings(shown: SlowMotion) -> tuple[Reading, ...]:
    """Return time, phase, force and speed of every frame in words."""
    scene = shown.scene
    data = scene.press.data
    seen = data.index.to_numpy()
    force, speed = (
        np.interp(scene.time, seen, data[column].to_numpy()) for column in ("force", "jack_speed")
    )
    return (
        Reading("time", tuple(f"{time * 1e3:.2f} ms" for time in scene.time)),
        Reading("phase", tuple(_phase(scene, float(time)) for time in scene.time)),
        Reading("finger force", tuple(f"{newton:.3f} N" for newton in force)),
        Reading("jack speed", tuple(f"{one * 1e3:.1f} mm/s" for one in speed)),
    )


def about(shown: SlowMotion) -> str:
    """Return what the pictures show, what of it was recorded, and what follows the model."""
    scene = shown.scene
    start, stop = scene.time[0] * 1e3, scene.time[-1] * 1e3
    kind = how_made(scene.press.simulated)
    strings, moved = len(scene.choirs), sum(motion.plucks for motion in scene.choirs)
    several = f" All {strings} choirs are shown, {moved} of them plucked." if strings > 1 else ""
    plucks = len(scene.phases.plucks)
    if plucks > moved:
        several += f" Of {plucks} plucks that were found {moved} can be drawn on the rig's strings."
    return (
        f"Press {shown.number} ({kind}), the first with a pluck, from {start:.2f} to {stop:.2f} ms"
        f" after the trigger in {len(scene.time)} frames. As recorded: the key, the jack where no"
        " string holds it, force and speed. By the model, set to the contact and the release that"
        " were found: plectrum, tongue, damper and string, and how far the jack is while the"
        f" string is held.{several} Jack's head and key are to scale; what no rig tells is drawn as"
        " is usual."
    )


def _phase(scene: Replay, time: float) -> str:
    plucks = scene.phases.plucks
    held = [n for n, one in enumerate(plucks, 1) if one.contact <= time < one.release]
    if held:
        return f"string held, pluck {held[0]}" if len(plucks) > 1 else "string held"
    gone = sum(time >= one.release for one in plucks)
    if not gone:
        return "going to the string"
    return f"{gone} of {len(plucks)} strings released" if len(plucks) > 1 else "string released"
