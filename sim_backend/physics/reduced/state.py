"""Presses in numbers for the reduced engine: places in its arrays.

Three arrays of a press have a row for the key and one for each jack after it: the bench, which
stays, the state, and what everything does. The cells are those of the strings' laws, the marks
what must stay positive, the events what the strings have met, and a leg is what the finger does
while its drive is smooth.
"""

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

Ints = NDArray[np.int64]

FALLS, HANGS, RISES, STANDS = -1, 0, 1, 2
"""What a jack does: off the key with the sign of its speed, held in its register by friction
off the key, or on the key."""
BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""Where a plectrum is with its string."""
OFF, PRESSED, SLACK = 0, 1, 2
"""What the front felt does; slack is a felt that the key leaves faster than it follows."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events."""

INERTIA, GRAVITY_MOMENT, VISCOUS, DRY, DIP, FELT_STIFFNESS, FELT_DAMPING, HEIGHT = range(8)
"""Of a bench's key: kg m^2, N m, N m s/rad, N m; rad at which the felt is met, infinite without
it, N m/rad, N m s/rad; m, of the surface under the jacks above the pin."""
PUSHES, PUSH_END = 8, 9
"""Of a bench's key: N m, of a push, 0 without it, and s."""
MASS, FRICTION, ARM, CLEARANCE, TONGUE_FORCE, TONGUE_STIFFNESS, TRAVEL, LIFT, DAMPER = range(9)
"""Of a bench's jack: kg, N, m from the pin, m, infinite for a mute jack; N as the tongue begins
to turn, N/m, m of drop at which the plectrum has passed its string; m of rise at which the
damper leaves the string, minus infinity without it, and N/m."""
STRETCHES, FIRST, BORDER, NUMBERS = 9, 10, 14, 18
"""Of a bench's jack: stretches of its string's law, 3 at most; the first cell of each, and the
end of the last; heights [m] at which they begin and end. The last is how many numbers a row has."""
ANGLE, ANGULAR_VELOCITY, ANGULAR_ACCELERATION, FINGER = range(4)
"""Of a state's key: rad, rad/s, rad/s^2, N m of an ideal finger on it."""
ANGLE_END, ANGULAR_VELOCITY_END, ANGULAR_ACCELERATION_END, FINGER_END = range(4, 8)
"""The same at the end of the step that is tried."""
RISE, SPEED, ACCELERATION, LOW, HIGH = range(5)
"""Of a state's jack: m, m/s, m/s^2 off the key; m, rises between which neither string nor damper
changes."""
RISE_END, SPEED_END, ACCELERATION_END, LOAD, SLOPE = range(5, 10)
"""Of a state's jack, at the end of the step that is tried: as above, N on the key and m/rad of
the key under it."""
SLIP, TOUCH, FELT, FINGER_RELEASES, LEAVING_JACK, COUNT = range(6)
"""What the key does: sign of its speed, whether an ideal finger leads it, the felt; whether the
finger has just let it go, the jack that has just left it, or -1, and events noted."""
JACK, STRING, STRETCH, DAMPED, CELL = range(5)
"""What a jack does: itself, its string, the stretch of the string's law, whether the damper is
on, and the law's cell that was looked up last."""
BEFORE, AFTER, VIOLATED, PREVIOUS = range(4)
"""Rows of what must stay positive: where it is, at the end of the step that is tried, where it is
not, and where the one or the other was before."""
TIME, FORCE, JACK_SPEED, KIND, CHOIR = range(5)
"""Of an event of a string: s, N on the jack before it, m/s of the jack, which of `CONTACT`,
`RELEASE` and `RETURN`, and the choir."""
PUSH, IDEAL, START, PERIOD, CUBICS, LINKAGE, SEGMENT_NUMBERS = 0, 1, 2, 3, 4, 12, 17
"""Of a leg: moment of a push [N m], whether the finger is ideal; its path's start and length [s],
four coefficients of each joint [rad]; base x and z, both lengths, the fingertip's height over the
key [m]. The last is how many there are."""
FINE, TURNED_OVER, CHATTERS, LOST, JUMPED, AT_PIN = 0, 1, 2, 3, 4, 5
"""How a stretch of time ended."""
EVENTS = 512
"""Events of strings that are kept of one stretch of time."""


def new_state(choirs: int) -> tuple[Floats, Ints, Floats, Floats]:
    """Return room for a press: its state, what everything does, marks and events."""
    rows = 1 + choirs
    return (
        np.zeros((rows, 10)),
        np.zeros((rows, 6), np.int64),
        np.zeros((4, 2 + 4 * rows)),
        np.zeros((EVENTS, 5)),
    )
