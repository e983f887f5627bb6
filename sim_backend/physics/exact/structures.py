"""The named structures that the compiled functions share, and their constants; imported as `ix`."""

from typing import Any, NamedTuple

import numpy as np

from sautereau.trajectory.motion import Floats

BELOW, STUCK, SLIDING, ABOVE, PASSING = 0, 1, 2, 3, 4
"""States of a plectrum and its string; one that never sticks, or never slides, has no such range of
rises and passes through the state."""
OFF, PRESSED, SLACK = 0, 1, 2
"""States of the front felt and of the fingertip's pad; a slack one expands more slowly than the
key leaves it."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events, in the order of the lists in `PluckEvents`."""
PUSH, IDEAL, SERVO = 0, 1, 2
"""Kinds of finger."""
FINE, TURNED_OVER, LOST, JUMPED, AT_PIN = 0, 1, 2, 3, 4
"""Status after an interval of time."""
CLOSE, SLOW = 1e-13, 1e-11
"""Gap [rad, m] below which surfaces are in contact, and speed that counts as zero."""
EVENTS = 512
"""Most events of strings that one call records."""


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
"""kg m^2, N m, N m s/rad, N m; rad at first contact with the felt, infinite without it, N m/rad,
N m s/rad; m, of the surface under the jacks above the pin; m; a push in N, and its end in s;
m/s^2. Its state: the sign of its velocity; N m, by which friction holds a key at rest against a
rise and against a fall; the felt."""
JACK = _record(
    "mass friction arm clearance tongue_force tongue_stiffness lift damper low high load slope push"
    " dry sign",
    "string cell damped stands closed",
    first=("i8", 3),
    range=("f8", (5, 2)),
)
"""kg, N, m from the pin, m, infinite for a mute jack; N as the tongue starts to turn, N/m; m of
rise at which the damper leaves, minus infinity without it, and N/m. The first cells of the force
law where the string sticks and slides, and the end of the last; the rises [m] of each state of the
string. Its state: m, rises between which string and damper do not change; N, of the jack on the
key; m/rad, slope of the key under it; constant and friction of its force in an inclusion; sign of
its speed off the key, 0 where friction holds it. The string, and the cell of its law; whether the
damper is on it, whether the jack stands on the key, and whether it may act on the key in an
inclusion."""
FINGER = _record(
    "base_x base_z upper lower height inertia1 inertia2 rotor2 coupling weight1 weight2"
    " integral_time radians pad_stiffness pad_damping moment reaction angle speed acceleration"
    " compliance lever overlap push",
    "kind still touch pad",
    "stiffness damping feedforward start limit offset integral lag torque free by",
    locked=("i8", 2),
    cubics=("f8", (2, 4)),
)
"""Of the arm: lengths in m, inertias in kg m^2, weights in N m; of the position loops s, and rad
per encoder count; of the fingertip's pad N/m, 0 if it is rigid, and N s/m. Its state: N m, of a
push or a pad, and of a rigid contact. Of a key that touches the fingertip rad, rad/s, and rad/s^2
if no force acts on it; what a moment of 1 N m takes from that, 0 if ideal and infinite behind a
pad; m, moment per force. Of a pad m, by which a rigid fingertip would be within the key, and the
moment [N m] of its spring and damper, negative if they would pull. The kind; whether an ideal one
is at rest, whether it touches the key, and the pad.

Of both joints: N m/rad, N m s/rad, kg m^2; rad where the encoders are 0; limits, offsets and
integrals [N m], following errors [rad] of the last sample, torques [N m]; accelerations without a
force [rad/s^2], and what a moment of 1 N m takes from those; whether the joint is braked, and its
reference [rad] over the controller sample."""
RUN = _record(
    "period step tolerance time start",
    "order steps left crowd changed events rows ends",
)
"""s, of the controller's sample and of an undivided step, which need not be the present one's; the
relative error that a step may have; s, now and at the start of the sample. The order of the steps,
and their number in a sample; of steps left before a scene counts as too stiff; of events since the
last complete step; whether a force has jumped now; numbers of recorded events and rows, and of rows
to come for the ends of steps."""


class Press(NamedTuple):
    """A bench and its state; all arrays and records are changed in place.

    Presses to play have arrays in place of the records: of keys, of shape (presses,), and of jacks,
    of shape (presses, choirs). As one at a time is played, they share the others of one element.
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
    """Time [s], kind, choir, force [N] and jack's speed [m/s] of each; shape (EVENTS, 5)."""
    rows: Floats
    """Times and the other quantities of `Motions`; shape (rows, 6)."""


def one_press(presses: Press, i: int) -> Press:
    """Return one of some presses, which share all but key and jacks; for the types see `Press`."""
    return Press(
        presses.key[i], presses.jacks[i], presses.cells, presses.finger[0], presses.run[0],
        presses.x, presses.v, presses.a, presses.work, presses.events, presses.rows,
    )  # fmt: skip
