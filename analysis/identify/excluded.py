"""Instants at which the equation of motion holds: impacts, rests, felts and gaps are excluded."""

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.identify.noise import REST_SPEED, TURN_MARGIN, WINDOW
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.acquisition import Channel
from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats, Motion

RELEASE_MARGIN = 1.5e-3
"""Time excluded before and after a release (s). Filters spread the force drop over it."""
DIP_MARGIN = 0.1e-3  # Travel of the pressing point that is excluded before the front felt (m)
CATCH_RATIO = 2.5
"""Multiple of the planned return acceleration above which the finger catches a key that it had
lost. What precedes a catch is excluded: the force transducer does not measure the load then."""
STRING_MARGIN = 0.3e-3
"""Height of the jack above the string below which its way down is excluded (m). Tongue and damper
act there."""


def landing(key: Key, time: Floats, motion: Motion, contact: float) -> float | None:
    """Return the time [s] at which a thrown jack lands, or None if the jack is not thrown.

    A key that decelerates faster than a free fall loses its jack. Until the jack is back, the key
    has another inertia and other modes.

    Args:
        time: s, shape (n,).
        motion: Motion of the key [rad], arrays of shape (n,).
        contact: s, first contact with a string; the search ends there.
    """
    rise, speed = rise_of_angle(key, motion.position), key.jack_arm * motion.velocity
    thrown = (key.jack_arm * motion.acceleration < -GRAVITY) & (time < contact)
    landed = None
    for start in np.flatnonzero(thrown):
        if landed is None or time[start] >= landed:
            flown = time[start:] - time[start]
            flight = rise[start] + speed[start] * flown - GRAVITY / 2 * flown**2
            down = np.flatnonzero(flight[1:] < rise[start + 1 :])
            landed = float(time[start + 1 + down[0]]) if len(down) else landed
    return landed


def used_instants(
    press: Press, phases: Phases, time: Floats, motion: Motion, shift: float
) -> NDArray[np.bool_]:
    """Return the instants at which the equation of motion is fitted."""
    rig, speed, step = press.rig, np.abs(motion.velocity), float(time[1] - time[0])
    edge = WINDOW / 2 + shift
    used = (time - time[0] > shift) & (time[-1] - time > shift)
    resting = speed <= REST_SPEED * speed.max(initial=0.0)
    resting |= np.sign(motion.velocity) != np.sign(np.roll(motion.velocity, 1))
    used &= ~_beside(resting, (TURN_MARGIN + shift) / step)
    planned = rig.press.return_acceleration / rig.key.jack_arm
    back, low = motion.velocity < 0, rise_of_angle(rig.key, motion.position) < _highest_string(rig)
    caught = back & ~low & (np.abs(motion.acceleration) > CATCH_RATIO * planned)
    # It is not known when the finger lost the key.
    used &= ~(back & (low | (time <= np.max(time[caught], initial=-np.inf) + edge)))
    for pluck in phases.plucks:
        used &= np.abs(time - pluck.release) > RELEASE_MARGIN + edge
        if pluck.string is None:  # and its force is not modelled
            used &= (time < pluck.contact - edge) | (time > pluck.release)
    used &= clear_of_flags(press, time, edge)
    coupled, stretch = coupled_force(rig), np.zeros(len(time), int)
    for mark in press.quality_flags:
        if coupled and mark.channel == coupled.name and mark.kind != "drop-out":
            stretch += time > mark.stop
    used &= rig.key.press_arm * motion.position < rig.key.dip - DIP_MARGIN
    # An AC-coupled force has another level after an overload.
    return used & (stretch == np.argmax(np.bincount(stretch, used)))


def clear_of_flags(press: Press, time: Floats, edge: float) -> NDArray[np.bool_]:
    """Return which times are more than `edge` [s] away from all drop-outs and overloads."""
    clean = np.ones(len(time), bool)
    for mark in press.quality_flags:
        clean &= (time < mark.start - edge) | (time > mark.stop + edge)
    return clean


def coupled_force(rig: Rig) -> Channel | None:
    """Return the force channel if it is AC-coupled: the force at rest is then unknown."""
    channel = rig.daq.channel("force")
    return channel if channel is not None and channel.high_pass > 0 else None


def _beside(which: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """Return which instants are at most `reach` instants away from one of those in `which`."""
    wide = np.ones(2 * max(1, round(reach)) + 1)
    return np.asarray(np.convolve(which, wide, "same") > 0.5)


def _highest_string(rig: Rig) -> float:
    """Return the first jack's rise [m] below which a falling plectrum may touch a string."""
    clearances = [rig.jack.string_clearance]
    clearances += [c.jack.string_clearance * rig.key.jack_arm / c.jack_arm for c in rig.more_choirs]
    return max(clearances) + STRING_MARGIN
