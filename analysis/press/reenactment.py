"""A recorded press put together again, instant by instant, for an animation.

Key, jacks and arm are where vibrometer and encoders saw them. Plectra and strings nobody sees:
they move by the model, which is set to the contact and the release that were measured. While a
string is held, the share of the way from contact to release that its jack has gone is taken as
the model's too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import key_of
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.shape import mid_line, straight
from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.press.load import Press
from sautereau.analysis.press.sounding import Sounding, soundings, stilled
from sautereau.daq.file.recorded import Joints, Plan
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats

Flags = NDArray[np.bool_]
EXPOSURES = 12
"""Instants of a frame in which a string is seen."""
PLACES = 161
"""Of a string, from nut to bridge."""
BEFORE = 10e-3
"""s, that is shown before the jack rises."""


@dataclass(frozen=True)
class ChoirMotion:
    """What one choir does; arrays with the frames first."""

    choir: Choir
    plucks: bool
    """Whether a pluck of it was found; without one its string stays at rest."""
    height: Floats
    """m, of the jack above first contact; shape (n,)."""
    line: Floats
    """m, mid-line of the plectrum from its clamp; shape (n, POINTS + 1, 2)."""
    tongue: Floats
    """rad, by which the tongue has swung back; shape (n,)."""
    wire: Floats
    """m, places of the string at the plectrum during each frame; shape (n, EXPOSURES, 2)."""
    places: Floats
    """m, from the nut; shape (PLACES,)."""
    deflection: Floats
    """m, of the string upwards during each frame; shape (n, EXPOSURES, PLACES)."""


@dataclass(frozen=True)
class Reenactment:
    """A press at the instants of an animation's frames; arrays of shape (n, ...)."""

    press: Press
    phases: Phases
    time: Floats
    """s, from the trigger."""
    angle: Floats
    """rad, of the key."""
    joints: Floats | None
    """rad, of the arm, shape (n, 2); None where nothing recorded an arm."""
    choirs: tuple[ChoirMotion, ...]


def shown_stretch(
    press: Press, phases: Phases, since: float | None, until: float | None
) -> tuple[float, float]:
    """Return from when to when [s] a press is shown.

    Args:
        press: The press.
        phases: Its phases.
        since: s, from the trigger; None for a little before the jack rises.
        until: s; None for the end of the recording.

    Raises:
        AnalysisError: The stretch is not within the recording.
    """
    first, last = float(press.data.index[0]), float(press.data.index[-1])
    start = max(first, phases.start - BEFORE) if since is None else since
    stop = last if until is None else until
    if not first <= start < stop <= last:
        raise AnalysisError(
            f"press {press.path}: {start * 1e3:.5g} to {stop * 1e3:.5g} ms is no stretch of the"
            f" recording, which goes from {first * 1e3:.5g} to {last * 1e3:.5g} ms; change --since"
            " or --until"
        )
    return start, stop


def reenact(
    press: Press, phases: Phases, time: Floats, arm: Joints | Plan | None = None
) -> Reenactment:
    """Put a press together at instants.

    Args:
        press: The press.
        phases: Its phases; the plucks in them are those of the choirs, in the order in which
            the model meets them.
        time: s, within the press and evenly spaced; shape (n,), n at least 2.
        arm: What the encoders saw of the arm, or else its plan; None for no arm.

    Raises:
        ModelError: The model has no pluck for the rig, so that no plectrum can be shown.
    """
    seen = press.data.index.to_numpy()
    turned = press.data["angle"].to_numpy()
    strings = soundings(press.rig)
    in_turn = sorted(range(len(strings)), key=lambda number: strings[number].contact)
    found = dict(zip(in_turn, phases.plucks, strict=False))
    return Reenactment(
        press=press,
        phases=phases,
        time=time,
        angle=np.interp(time, seen, turned),
        joints=_joints(arm, time),
        choirs=tuple(
            _choir(press.rig, string, found.get(number), seen, turned, time)
            for number, string in enumerate(strings)
        ),
    )


def _joints(arm: Joints | Plan | None, time: Floats) -> Floats | None:
    if arm is None:
        return None
    return np.stack([np.interp(time, arm.t, q) for q in (arm.q1, arm.q2)], -1)


def _choir(
    rig: Rig,
    sounding: Sounding,
    held: HeldString | None,
    seen: Floats,
    turned: Floats,
    time: Floats,
) -> ChoirMotion:
    choir = sounding.choir
    rise = rise_of_angle(key_of(rig, choir), turned)
    places = np.linspace(0, choir.string.length, PLACES)
    first, last = np.interp([held.contact, held.release], seen, rise) if held else (0.0, 0.0)
    if held is None or not last > first:
        height = np.interp(time, seen, rise) - choir.jack.string_clearance
        return _at_rest(choir, height, places)
    pluck = sounding.pluck
    way = float(pluck.height[-1])
    # The jack's height as the model has it: at 0 the string is met, at `way` it is let go.
    known = np.interp(rise, [first, last], [0.0, way])
    known += np.minimum(rise - first, 0) + np.maximum(rise - last, 0)
    after = seen > held.release
    sounding = _with_damper(sounding, rise, after, seen - held.release)
    exposed = np.linspace(0, time[1] - time[0], EXPOSURES, endpoint=False)
    clock = _model_clock(sounding, held, seen, known, (time[:, None] + exposed).ravel())
    shape = sounding.displacement(clock, places)[1].reshape(len(time), EXPOSURES, PLACES)
    wire = sounding.displacement(clock, np.array([choir.string.plucking_point]))[:, :, 0]
    height = np.interp(time, seen, known)
    holding = (time >= held.contact) & (time < held.release)
    line = np.repeat(straight(choir.plectrum)[None], len(time), 0)
    line[holding] = mid_line(
        Elastica(choir.plectrum),
        np.interp(height[holding], pluck.height, pluck.position),
        np.interp(height[holding], pluck.height, pluck.force),
    )
    return ChoirMotion(
        choir=choir,
        plucks=True,
        height=height,
        line=line,
        tongue=_tongue(choir, height, time > held.release),
        wire=wire.T.reshape(len(time), EXPOSURES, 2),
        places=places,
        deflection=shape,
    )


def _at_rest(choir: Choir, height: Floats, places: Floats) -> ChoirMotion:
    """Return a choir whose string nothing plucks."""
    n = len(height)
    return ChoirMotion(
        choir=choir,
        plucks=False,
        height=height,
        line=np.repeat(straight(choir.plectrum)[None], n, 0),
        tongue=np.zeros(n),
        wire=np.zeros((n, EXPOSURES, 2)),
        places=places,
        deflection=np.zeros((n, EXPOSURES, PLACES)),
    )


def _model_clock(
    sounding: Sounding, held: HeldString, seen: Floats, known: Floats, time: Floats
) -> Floats:
    """Return what the time [s] is on the model's clock: as much after its own release."""
    share = np.interp(time, seen, known) / sounding.pluck.height[-1]
    during = sounding.contact + np.clip(share, 0, 1) * sounding.pluck.release
    early = sounding.contact - (held.contact - time)
    late = sounding.release + (time - held.release)
    clock = np.where(time < held.contact, early, np.where(time < held.release, during, late))
    return np.maximum.accumulate(clock)


def _with_damper(sounding: Sounding, rise: Floats, after: Flags, since_release: Floats) -> Sounding:
    """Let the damper come down when the jack has fallen to where its felt meets the string."""
    damper = sounding.choir.jack.damper
    if damper is None:
        return sounding
    down = np.flatnonzero(after & (rise < damper.lift))
    if len(down) == 0:
        return sounding
    return stilled(sounding, sounding.release + float(since_release[down[0]]))


def _tongue(choir: Choir, height: Floats, after: Flags) -> Floats:
    """Return by how much the tongue has swung back [rad] as the plectrum falls past the string.

    It swings as far as keeps the drawn plectrum off the drawn wire.
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
