"""Arrays of the reduced engine, and the indices into them; imported as `ix`.

Three arrays of a press have a row for the key, followed by one for each jack: the bench (its
constant parameters), the state, and the discrete modes. The cells are those of the strings' force
laws, a guard is positive as long as its mode lasts, the events are those of the strings, and a
drive segment is an interval of smooth action of the finger.
"""

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

Ints = NDArray[np.int64]

FALLS, HANGS, RISES, STANDS = -1, 0, 1, 2
"""Modes of a jack: off the key with the sign of its speed, held in its register by friction
off the key, or on the key."""
BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""Modes of a plectrum and its string."""
OFF, PRESSED, SLACK = 0, 1, 2
"""Modes of the front felt; the key leaves a slack felt faster than it expands."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events."""

INERTIA, GRAVITY_MOMENT, VISCOUS, DRY, DIP, FELT_STIFFNESS, FELT_DAMPING, HEIGHT = range(8)
"""Of a bench's key: kg m^2, N m, N m s/rad, N m; rad, at first contact with the felt, infinite
without it, N m/rad, N m s/rad; m, of the surface under the jacks above the pin."""
PUSHES, PUSH_END = 8, 9
"""Of a bench's key: N m, of a push, 0 without it, and s."""
MASS, FRICTION, ARM, CLEARANCE, TONGUE_FORCE, TONGUE_STIFFNESS, TRAVEL, LIFT, DAMPER = range(9)
"""Of a bench's jack: kg, N, m from the pin, m, infinite for a mute jack; N as the tongue starts
to turn, N/m, m of drop at which the plectrum has passed its string; m of rise at which the
damper leaves the string, minus infinity without it, and N/m."""
STRETCHES, FIRST, BORDER, NUMBERS = 9, 10, 14, 18
"""Of a bench's jack: number of pieces of its string's law, 3 at most; the first cell of each, and
the end of the last; heights [m] of their ends. The last is the length of a row."""
ANGLE, ANGULAR_VELOCITY, ANGULAR_ACCELERATION, FINGER = range(4)
"""Of a state's key: rad, rad/s, rad/s^2, N m of an ideal finger on it."""
ANGLE_END, ANGULAR_VELOCITY_END, ANGULAR_ACCELERATION_END, FINGER_END = range(4, 8)
"""The same at the end of the trial step."""
RISE, SPEED, ACCELERATION, LOW, HIGH = range(5)
"""Of a state's jack: m, m/s, m/s^2 off the key; m, rises between which string and damper do not
change their mode."""
RISE_END, SPEED_END, ACCELERATION_END, LOAD, SLOPE = range(5, 10)
"""Of a state's jack, at the end of the trial step: as above, N on the key, and m/rad of the key
under it."""
SLIP, TOUCH, FELT, FINGER_RELEASES, LEAVING_JACK, COUNT, CHANGES = range(7)
"""Modes of the key: sign of its velocity, whether an ideal finger is in contact, the felt; whether
the finger has just left it, the jack that has just left it, or -1, the number of events, and the
number of rows at changes of mode."""
JACK, STRING, STRETCH, DAMPED, CELL = range(5)
"""Modes of a jack: its own, its string's, the piece of the string's law, whether the damper is on
the string, and the law's cell of the last evaluation."""
BEFORE, AFTER, VIOLATED, PREVIOUS = range(4)
"""Rows of the guards: at the last time before the event, at the end of the trial step, at the first
time after the event, and at the previous one of these times."""
TIME, FORCE, JACK_SPEED, KIND, CHOIR = range(5)
"""Of an event of a string: s, N on the jack before it, m/s of the jack, which of `CONTACT`,
`RELEASE` and `RETURN`, and the choir."""
PUSH, IDEAL, START, PERIOD, CUBICS, LINKAGE, SEGMENT_NUMBERS = 0, 1, 2, 3, 4, 12, 17
"""Of a drive segment: moment of a push [N m], whether the finger is ideal; start and length of its
path [s], four coefficients of each joint [rad]; base x and z, both lengths, the fingertip's height
over the key [m]. The last is the length."""
FINE, TURNED_OVER, CHATTERS, LOST, JUMPED, AT_PIN = 0, 1, 2, 3, 4, 5
"""Status after an interval of time."""
EVENTS = 512
"""Most events of strings in one interval of time."""
CHANGE_ROWS = 64
"""Most rows at changes of mode in one interval of time; further ones are not kept."""


def new_state(choirs: int) -> tuple[Floats, Ints, Floats, Floats]:
    """Return the work space of a press: state, modes, guards and events."""
    rows = 1 + choirs
    return (
        np.zeros((rows, 10)),
        np.zeros((rows, 7), np.int64),
        np.zeros((4, 2 + 4 * rows)),
        np.zeros((EVENTS, 5)),
    )
