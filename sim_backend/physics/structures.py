"""What both engines know of a press: its named structures and states; imported as `ix`."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

BELOW, STUCK, SLIDING, ABOVE, PASSING = 0, 1, 2, 3, 4
"""States of a plectrum and its string; one that never sticks, or never slides, has no such range of
rises and passes through the state."""
OFF, PRESSED, SLACK = 0, 1, 2
"""States of the front felt and of the fingertip's pad; a slack one expands more slowly than the
key leaves it."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events, in the order of the lists in `PluckEvents`."""
NO_EVENT = -1
RISEN = (STUCK, SLIDING, ABOVE, ABOVE, ABOVE)
RISEN_EVENT = (CONTACT, NO_EVENT, RELEASE, NO_EVENT, NO_EVENT)
FALLEN = (BELOW, BELOW, STUCK, PASSING, BELOW)
FALLEN_EVENT = (NO_EVENT, NO_EVENT, NO_EVENT, NO_EVENT, RETURN)
"""Next state above and below the rises of each, and the event at which it starts."""
PUSH, IDEAL, SERVO = 0, 1, 2  # Kinds of finger
FINE, TURNED_OVER, LOST, JUMPED, AT_PIN, JAMMED, STIFF = 0, 1, 2, 3, 4, 5, 6  # Statuses
CLOSE, SLOW = 1e-13, 1e-11
"""Gap [rad, m] below which surfaces are in contact, and speed that counts as zero."""
LARGEST_ANGLE = 1.2  # rad, of the key, above which the simulation is stopped
EVENTS = 512  # Most events of strings that one call records


def _record(floats: str, ints: str = "", pairs: str = "", **arrays: Any) -> np.dtype:
    """Return a type of which a single record has attributes: names, and type and shape by name."""
    fields: list[Any] = [(name, "f8") for name in floats.split()]
    fields += [(name, "i8") for name in ints.split()]
    fields += [(name, "f8", 2) for name in pairs.split()]
    return np.dtype((np.record, [*fields, *((name, *array) for name, array in arrays.items())]))


KEY = _record(
    "inertia gravity_moment viscous dry dip felt_stiffness felt_damping height press_arm"
    " force push_end gravity slip up down",
    "felt",
)
"""The key.

- inertia [kg m^2]; gravity_moment, viscous and dry friction [N m, N m s/rad, N m]
- dip [rad]: where the felt begins, infinite without it; felt_stiffness, felt_damping [N m/rad,
  N m s/rad]
- height [m]: of the surface under the jacks above the pin; press_arm [m]
- force [N], push_end [s]: a push and its end; gravity [m/s^2]
- slip: state, the sign of the key's velocity; felt: state of the felt
- up, down [N m]: by how much friction holds a key at rest against a rise and against a fall
"""
JACK = _record(
    "mass friction arm clearance tongue_force tongue_stiffness lift damper low high load slope push"
    " dry sign",
    "string cell damped stands closed",
    first=("i8", 3),
    range=("f8", (5, 2)),
)
"""A jack with its string and damper.

- mass [kg], friction [N], arm [m] from the pin; clearance [m]: infinite for a mute jack
- tongue_force [N], tongue_stiffness [N/m]: force when the tongue starts to turn, and its increase
- lift [m]: rise at which the damper leaves the string, minus infinity without it; damper [N/m]
- first: first cells of the force law where the string sticks and slides, and the end of the last
- range [m]: lowest and highest rise of each state of the string
- low, high [m]: rises between which neither string nor damper changes
- load [N]: force of the jack on the key; slope [m/rad]: slope of the key under it
- push, dry [N]: constant part and friction of the jack's force in an inclusion
- sign: sign of its speed off the key, 0 if friction holds it
- string: state; cell: present cell of its law
- damped, stands, closed: whether the damper is on the string, whether the jack stands on the key,
  and whether it may act on the key in an inclusion
"""
FINGER = _record(
    "base_x base_z upper lower height inertia1 inertia2 rotor2 coupling weight1 weight2"
    " integral_time radians pad_stiffness pad_damping friction surface force moment reaction angle"
    " speed acceleration compliance reach lever overlap push impulse blow",
    "kind still touch pad",
    "stiffness damping feedforward start limit offset integral lag torque free by turn bare aside",
    locked=("i8", 2),
    cubics=("f8", (2, 4)),
)
"""The finger; names in the plural or of both joints have one value for each joint.

- base_x, base_z, upper, lower, height [m]: of the arm, and of the fingertip's centre in contact
- inertia1, inertia2, rotor2, coupling [kg m^2], weight1, weight2 [N m]: of the arm
- pad_stiffness [N/m]: 0 for a rigid fingertip; pad_damping [N s/m]
- friction: of the fingertip; surface [m]: height of the key's surface above the pin
- force [N]: of a push or a pad; moment, reaction [N m]: on the key, of that, and of a rigid contact
- angle, speed, acceleration [rad, rad/s, rad/s^2]: of a key in contact with the fingertip; the
  acceleration is the one without a force
- compliance [rad/s^2 per N m]: what a moment takes from it, 0 if ideal, infinite behind a pad
- reach [m]: of the force, from the pin; lever [m]: moment per force, with friction
- overlap [m]: of a pad; push [N m]: moment of its spring and damper, negative if they would pull
- impulse [N s]: of impacts on the key in this undivided step; blow [N]: of those in the last one,
  as a force
- kind; still: whether an ideal finger is at rest; touch: whether it touches the key; pad: state
- stiffness [N m/rad], damping [N m s/rad], feedforward [kg m^2], integral_time [s]: of the loops
- radians [rad]: of an encoder count; start [rad]: where the encoders are 0
- limit, offset, integral, torque [N m]; lag [rad]: following error of the last sample
- free [rad/s^2], by [rad/s^2 per N m]: accelerations without a force, and what a moment takes
- turn: of the key in contact, per turn of the joint; bare: `by` without friction; aside [rad m/s^2
  per N m]: what the friction adds, times the force along the key over the moment
- locked: whether the joint is braked; cubics [rad]: its reference over the controller sample
"""
RUN = _record("period step tolerance time start", "order steps left crowd changed events rows ends")
"""The course of the simulation.

- period, step [s]: of the controller's sample, and of an undivided step
- tolerance: relative error that a step may have; order: of the steps
- time, start [s]: now, and the start of the sample
- steps: in a sample; left: before the scene counts as too stiff
- crowd: events since the last complete step; changed: whether a force has jumped now
- events, rows: recorded so far; ends: rows to come for the ends of steps, two for each
"""


class Press(NamedTuple):
    """A bench and its state; all arrays and records are changed in place.

    Compiled functions take it from Python with arrays of one element in place of the records.
    """

    key: Any
    """Record of `KEY`."""
    jacks: Any
    """Records of `JACK`."""
    cells: Floats
    """Starts of the cells of all force laws [m], and cubics of the force [N]; shape (cells, 5)."""
    finger: Any
    """Record of `FINGER`."""
    run: Any
    """Record of `RUN`."""
    x: Floats
    """Key [rad], jacks [m], joints of a servo's arm [rad]; shape (n,)."""
    v: Floats
    """Their speeds; shape (n,)."""
    a: Floats
    """Their accelerations; shape (n,)."""
    work: Floats
    """Space for the steps, in which x, v and a are the first rows; shape (16, n)."""
    events: Floats
    """Time [s], kind, choir and force [N] of each; shape (EVENTS, 4)."""
    rows: Floats
    """Times and the other quantities of `Motions`; shape (rows, 7)."""


def opened(press: Press) -> Press:
    """Return a press with the records in place of arrays of one element."""
    return Press(
        press.key[0], press.jacks, press.cells, press.finger[0], press.run[0],
        press.x, press.v, press.a, press.work, press.events, press.rows,
    )  # fmt: skip


def as_objects(array: NDArray[Any]) -> list[Any]:
    """Return records, whose attributes are slow outside compiled functions, as objects."""
    names = array.dtype.names or ()
    return [
        SimpleNamespace(
            **{name: row[name] if row[name].ndim > 1 else row[name].tolist() for name in names}
        )
        for row in array
    ]
