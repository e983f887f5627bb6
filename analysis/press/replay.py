"""The motion of a recorded press at the instants of an animation's frames.

Key, jacks and arm move as the vibrometer and the encoders measured. Plectra and strings were not
measured: they move as in the model, aligned with the measured contact and release. While a string
is held, the model is at the same fraction of the way from contact to release as the jack.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.choirs import key_of
from sautereau.analysis.model.plectrum.tapered import bent, straight
from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.phases.found import pluck_names
from sautereau.analysis.press.strings import VibratingString, stilled, vibrating_strings
from sautereau.daq.file.recorded import Joints, Plan
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats

Flags = NDArray[np.bool_]
EXPOSURES = 12  # Positions of a string that one frame shows
PLACES = 161  # Points of a string, from nut to bridge


@dataclass(frozen=True)
class ChoirMotion:
    """The motion of one choir; the first axis of each array is the frame."""

    choir: Choir
    plucks: bool
    """Whether its pluck was found; otherwise its string stays at rest."""
    height: Floats
    """m, of the jack above first contact; shape (n,)."""
    outline: Floats
    """m, of the bent plectrum in its clamp's frame, shape (n, points, 2); see
    `sautereau.analysis.model.plectrum.tapered.bent`."""
    tongue: Floats
    """rad, rotation of the tongue; shape (n,)."""
    wire: Floats
    """m, positions of the string at the plectrum during each frame; shape (n, EXPOSURES, 2)."""
    places: Floats
    """m, from the nut; shape (PLACES,)."""
    deflection: Floats
    """m, of the string, upwards, during each frame; shape (n, EXPOSURES, PLACES)."""


@dataclass(frozen=True)
class Replay:
    """A press at the instants of an animation's frames; arrays of shape (n, ...)."""

    press: Press
    phases: Phases
    time: Floats
    """s after the trigger."""
    angle: Floats
    """rad, of the key."""
    joints: Floats | None
    """rad, of the arm, shape (n, 2); None without a recorded arm."""
    choirs: tuple[ChoirMotion, ...]

    def phase(self, time: float) -> str:
        """Return the phase of the press at a time [s], in words."""
        plucks, names = self.phases.plucks, pluck_names(self.phases.plucks)
        held = [n for n, p in zip(names, plucks, strict=True) if p.contact <= time < p.release]
        if held:
            several = len(plucks) > 1 or len(self.choirs) > 1
            return f"{' and '.join(held) if several else 'string'} held"
        gone = sum(time >= one.release for one in plucks)
        if not gone:
            return "before contact"
        return f"{gone} of {len(plucks)} strings released" if len(plucks) > 1 else "string released"


def shown_stretch(
    press: Press, phases: Phases, since: float | None, until: float | None
) -> tuple[float, float]:
    """Return the start and the end [s] of the part of a press that is shown.

    Args:
        since: s after the trigger; None for 10 ms before the jack rises.
        until: s after the trigger; None for the end of the recording.

    Raises:
        AnalysisError: The interval is not within the recording.
    """
    first, last = float(press.time[0]), float(press.time[-1])
    start = max(first, phases.start - 10e-3) if since is None else since
    stop = last if until is None else until
    if not first <= start < stop <= last:
        raise AnalysisError(
            f"press {press.path}: an animation from {start * 1e3:.5g} to {stop * 1e3:.5g} ms is not"
            " possible: it must start before it ends, within the recording from"
            f" {first * 1e3:.5g} to {last * 1e3:.5g} ms after the trigger; change --since or"
            " --until"
        )
    return start, stop


def replay(press: Press, phases: Phases, time: Floats, arm: Joints | Plan | None = None) -> Replay:
    """Return the motion of a press at given instants.

    Args:
        phases: Its phases; a pluck of an unknown string moves none.
        time: s after the trigger, within the press and evenly spaced; shape (n,), n at least 2.
        arm: The arm as recorded by the encoders, or else as planned; None for no arm.

    Raises:
        ModelError: The model has no pluck for the rig.
    """
    seen, turned = press.time, press.samples["angle"]
    strings = vibrating_strings(press.rig)
    return Replay(
        press=press,
        phases=phases,
        time=time,
        angle=np.interp(time, seen, turned),
        joints=arm and np.stack([np.interp(time, arm.t, q) for q in (arm.q1, arm.q2)], -1),
        choirs=tuple(
            _choir(press.rig, string, phases.of_string(number), seen, turned, time)
            for number, string in enumerate(strings, 1)
        ),
    )


def at_rest(choir: Choir, height: Floats) -> ChoirMotion:
    """Return a choir whose string and plectrum are at rest while its jack moves.

    Args:
        height: m, of the jack above first contact; shape (n,).
    """
    n, places = len(height), np.linspace(0, choir.string.length, PLACES)
    return ChoirMotion(
        choir=choir,
        plucks=False,
        height=height,
        outline=np.repeat(straight(choir.plectrum)[None], n, 0),
        tongue=np.zeros(n),
        wire=np.zeros((n, EXPOSURES, 2)),
        places=places,
        deflection=np.zeros((n, EXPOSURES, PLACES)),
    )


def _choir(
    rig: Rig,
    string: VibratingString,
    held: HeldString | None,
    seen: Floats,
    turned: Floats,
    time: Floats,
) -> ChoirMotion:
    choir = string.choir
    rise = rise_of_angle(key_of(rig, choir), turned)
    first, last = np.interp([held.contact, held.release], seen, rise) if held else (0.0, 0.0)
    still = at_rest(choir, np.interp(time, seen, rise) - choir.jack.string_clearance)
    if held is None or not last > first:
        return still
    n, places = len(time), still.places
    pluck = string.pluck
    way = float(pluck.height[-1])
    # Height of the jack in the model: 0 at contact, `way` at release.
    known = np.interp(rise, [first, last], [0.0, way])
    known += np.minimum(rise - first, 0) + np.maximum(rise - last, 0)
    after = seen > held.release
    damper = choir.jack.damper
    if damper is not None and (down := np.flatnonzero(after & (rise < damper.lift))).size:
        # The jack has fallen so far that the damper touches the string.
        string = stilled(string, string.release + float(seen[down[0]] - held.release))
    exposed = np.linspace(0, time[1] - time[0], EXPOSURES, endpoint=False)
    clock = _model_clock(string, held, seen, known, (time[:, None] + exposed).ravel())
    shape = string.displacement(clock, places)[1].reshape(n, EXPOSURES, PLACES)
    wire = string.displacement(clock, np.array([choir.string.plucking_point]))[:, :, 0]
    height = np.interp(time, seen, known)
    holding = (time >= held.contact) & (time < held.release)
    outline = still.outline.copy()
    held_at = (
        np.interp(height[holding], pluck.height, values)
        for values in (pluck.position, pluck.force, pluck.drag)
    )
    outline[holding] = bent(choir.plectrum, *held_at)
    return replace(
        still,
        plucks=True,
        height=height,
        outline=outline,
        tongue=_tongue(choir, height, time > held.release),
        wire=wire.T.reshape(n, EXPOSURES, 2),
        deflection=shape,
    )


def _model_clock(
    string: VibratingString, held: HeldString, seen: Floats, known: Floats, time: Floats
) -> Floats:
    """Return the time of the model [s] at measured times: aligned at contact and at release."""
    fraction = np.interp(time, seen, known) / string.pluck.height[-1]
    during = string.contact + np.clip(fraction, 0, 1) * string.pluck.release
    early = string.contact - (held.contact - time)
    late = string.release + (time - held.release)
    clock = np.where(time < held.contact, early, np.where(time < held.release, during, late))
    return np.maximum.accumulate(clock)


def _tongue(choir: Choir, height: Floats, after: Flags) -> Floats:
    """Return the rotation of the tongue [rad] while the plectrum falls past the string.

    It is just large enough that the drawn plectrum does not cross the drawn string.
    """
    swung = np.zeros_like(height)
    tongue, plectrum = choir.jack.tongue, choir.plectrum
    if tongue is None or not after.any():
        return swung
    radius = choir.string.diameter / 2
    lever = plectrum.length - plectrum.overlap
    top = np.argmax(np.where(after, height, -np.inf))
    falling = after & (np.arange(len(height)) > top)
    most = (plectrum.overlap + radius) / tongue.pivot
    swung[falling] = np.clip((2 * radius + plectrum.thickness - height[falling]) / lever, 0, most)
    passed = falling & (height < -lever * plectrum.overlap / tongue.pivot)
    swung[passed] = 0.0
    return swung
