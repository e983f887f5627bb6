"""The pluck of a moving string: modes for the string, the quasi-static map for the plectrum.

The jack rises at a constant speed, the plectrum is massless, and the string moves in its lowest
modes. The higher modes act as a spring, so that a slow pluck is that of the spring string;
`sautereau.analysis.model.string.contact` solves a time step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.predict import rig_pluck
from sautereau.analysis.model.string.contact import STEP_FRACTION, STEP_FRACTION_MAX, ModalContact
from sautereau.analysis.model.string.string import FreeString, ModalState, ModalString
from sautereau.rig.schema import Rig

MODES = 30  # Modes that move


@dataclass(frozen=True)
class ModalPluck:
    """A pluck in time, from first contact to release; arrays of shape (n,), or (n, 2) for x, z."""

    string: ModalString
    time: Floats
    """s, from first contact."""
    height: Floats
    """m, of the jack above first contact."""
    force: Floats
    """N, normal to the plectrum's surface."""
    position: Floats
    """m, of the string along the plectrum, from the clamp."""
    angle: Floats
    """rad, by which the plectrum is bent down under the string."""
    drag: Floats
    """As of `Pluck`: the string slides towards the tip from the start."""
    displacement: Floats
    """m, of the string at the plucking point."""
    velocity: Floats
    """m/s, of the string at the plucking point."""
    state: ModalState
    """State of the moving modes at release."""

    @property
    def release(self) -> float:
        """Time of release [s] after contact, the pluck duration."""
        return float(self.time[-1])

    @property
    def plectrum_force(self) -> float:
        """Force between plectrum and string at release [N], with friction."""
        return float(self.force[-1] * np.hypot(1.0, self.drag[-1]))

    @property
    def free(self) -> FreeString:
        """The string after release; its times are in s from there."""
        return FreeString(self.string, self.state)


def modal_pluck(
    rig: Rig,
    level: str = "auto",
    *,
    step: float | None = None,
    modes: int = MODES,
    decay: ArrayLike = 0.0,
    width: float = 0.0,
) -> ModalPluck:
    """Push the plectrum up at the press's jack speed against a string at rest until release.

    Args:
        step: s; None for a thousandth of the spring string's pluck, or 0.3 of the shortest
            mode's period if that is less.
        modes: Number of modes that move.
        decay: 1/s, of the modes' amplitudes.
        width: m, along the string, over which the plectrum's force is spread.

    Raises:
        ModelError: The level has no pluck for this rig, the step is too long, or the contact
            has no solution or no end.
    """
    plectrum, static = string_map(rig.plectrum, rig.string, level), rig_pluck(rig, level)
    duration = static.release_height / rig.press.jack_speed
    string = ModalString(rig.string, modes, decay, width)
    shortest = 1 / (rig.string.frequency * modes * float(string.stretch[-1]))
    if step is None:
        step = min(duration / 1000, STEP_FRACTION * shortest)
    # At most a million steps.
    least, most = duration / 1_000_000, min(duration / 2, STEP_FRACTION_MAX * shortest)
    if not least <= step <= most:
        raise ModelError(
            f"step: {step * 1e6:.4g} us must lie between {least * 1e6:.4g} and {most * 1e6:.4g} us,"
            f" {STEP_FRACTION_MAX} of the shortest mode's period; change it, or take fewer modes"
        )
    contact = ModalContact(plectrum, rig.plectrum.overlap, string)
    # No release is expected after four times the static pluck.
    rows = _rows(contact, rig.press.jack_speed, step, 4.0 * duration)
    time, position, force, theta = rows[:, :4].T
    return ModalPluck(
        string=string,
        time=time,
        height=rig.press.jack_speed * time,
        force=force,
        position=position,
        angle=-theta,
        drag=np.full_like(time, plectrum.friction),
        displacement=rows[:, 4:6],
        velocity=rows[:, 6:8],
        state=contact.state,
    )


def _rows(contact: ModalContact, speed: float, step: float, end: float) -> Floats:
    """Pluck at a jack speed [m/s] until the string leaves.

    Returns:
        Rows of time [s], s [m], F [N], theta [rad], displacement along x and z [m] and
        velocity along x and z [m/s].

    Raises:
        ModelError: The contact is lost, or the string is still held at the end [s].
    """
    string, push = contact.string, np.zeros(2)
    time, taken = 0.0, step
    rows = [np.array([time, contact.rest, *np.zeros(6)])]
    while time < end and taken == step:
        taken = contact.advance(step, speed * time, speed * (time + step))
        time += taken
        before, push = push, np.array(contact.found[2:])
        place = string.displacement(contact.state.q) + string.residual * push
        rate = string.displacement(contact.state.v) + string.residual * (push - before) / taken
        rows.append(np.array([time, *contact.found[:2], contact.theta, *place, *rate]))
    if taken == step:
        raise ModelError(
            f"the string has not left the plectrum in {end * 1e3:.4g} ms;"
            " lower plectrum.overlap or press.jack_speed"
        )
    return np.array(rows)
