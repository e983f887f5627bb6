"""The named structures that the compiled functions share, and their constants."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.physics.exact.compile import records
from sautereau.trajectory.motion import Floats

BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""States of a plectrum and its string."""
OFF, PRESSED, SLACK = 0, 1, 2
"""States of the front felt; the key leaves a slack felt faster than it expands."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events."""
PUSH, IDEAL, SERVO = 0, 1, 2
"""Kinds of finger."""
FINE, TURNED_OVER, LOST, JUMPED, AT_PIN = 0, 1, 2, 3, 4
"""Status after an interval of time."""
PIECES = 3
"""Most pieces of a string's force law: the string sticks, slides and rolls."""
EVENTS = 512
"""Most events of strings that one call records."""


def _record(fields: list[Any]) -> np.dtype:
    """Return a type of which a single record has attributes."""
    return np.dtype((np.record, fields))


KEY = _record(
    [
        ("inertia", "f8"),  # kg m^2
        ("gravity_moment", "f8"),  # N m
        ("viscous", "f8"),  # N m s/rad
        ("dry", "f8"),  # N m
        ("dip", "f8"),  # rad at first contact with the felt, infinite without it
        ("felt_stiffness", "f8"),  # N m/rad
        ("felt_damping", "f8"),  # N m s/rad
        ("height", "f8"),  # m, of the surface under the jacks above the pin
        ("press_arm", "f8"),  # m
        ("force", "f8"),  # N, of a push
        ("push_end", "f8"),  # s
    ]
)
JACK = _record(
    [
        ("mass", "f8"),  # kg
        ("friction", "f8"),  # N
        ("arm", "f8"),  # m from the pin
        ("clearance", "f8"),  # m, infinite for a mute jack
        ("tongue_force", "f8"),  # N, as the tongue starts to turn
        ("tongue_stiffness", "f8"),  # N/m
        ("travel", "f8"),  # m of drop at which the plectrum has passed its string
        ("lift", "f8"),  # m of rise at which the damper leaves, minus infinity without it
        ("damper", "f8"),  # N/m
        ("pieces", "i8"),  # of the string's force law
        ("first", "i8", PIECES + 1),  # cell of each piece, and the end of the last
        ("border", "f8", PIECES + 1),  # m, heights of their ends
    ]
)
ARM = _record(
    [
        *((name, "f8") for name in ("base_x", "base_z", "upper", "lower", "height")),  # m
        *((name, "f8") for name in ("inertia1", "inertia2", "rotor2", "coupling")),  # kg m^2
        *((name, "f8") for name in ("weight1", "weight2")),  # N m
        *((name, "f8", 2) for name in ("stiffness", "damping", "feedforward")),  # of the loops
        ("integral_time", "f8"),  # s
        ("radians", "f8"),  # rad per encoder count
        ("start", "f8", 2),  # rad, where the encoders are 0
        ("limit", "f8", 2),  # N m
        ("offset", "f8", 2),  # N m, added to the loops' torques
        ("locked", "i8", 2),  # whether a joint is held by its brake
        ("integral", "f8", 2),  # N m
        ("lag", "f8", 2),  # rad, following errors of the last sample
        ("torque", "f8", 2),  # N m
    ]
)
FINGER = _record(
    [
        ("kind", "i8"),
        ("still", "i8"),  # whether an ideal finger is at rest
        ("start", "f8"),  # s, of the controller sample
        ("period", "f8"),  # s
        ("cubics", "f8", (2, 4)),  # rad, of the joints' reference over it
        ("moment", "f8"),  # N m, of a push
        ("angle", "f8"),  # rad, of a key that touches the fingertip, as the next two
        ("speed", "f8"),  # rad/s
        ("acceleration", "f8"),  # rad/s^2, if no force acts on the fingertip
        ("compliance", "f8"),  # rad/s^2 that a moment of 1 N m takes from it; 0 if ideal
        ("lever", "f8"),  # m, moment per force
        ("free", "f8", 2),  # rad/s^2, of the joints without a force
        ("by", "f8", 2),  # 1/(kg m^2), of the joints per moment
    ]
)
MODE = _record(
    [
        ("slip", "i8"),  # sign of the key's velocity; 0 at rest
        ("touch", "i8"),  # whether the finger touches the key
        ("felt", "i8"),
        ("moment", "f8"),  # N m, of the finger on the key
        ("up", "f8"),  # N m, by which friction holds a key at rest against a rise
        ("down", "f8"),  # N m, against a fall
        ("x", "f8"),  # the unknown of the last inclusion
        ("events", "i8"),  # number of recorded ones
        ("rows", "i8"),
        ("spare", "i8"),  # rows left for changes of mode
    ]
)
CHOIR = _record(
    [
        ("stands", "i8"),  # whether the jack stands on the key
        ("sign", "i8"),  # of the speed of a jack off the key; 0 where friction holds it
        ("string", "i8"),
        ("piece", "i8"),  # of the string's force law
        ("cell", "i8"),  # of its last evaluation
        ("damped", "i8"),
        ("low", "f8"),  # m, rises between which string and damper do not change
        ("high", "f8"),
        ("load", "f8"),  # N, on the key
        ("closed", "i8"),  # whether it may act on the key, in an inclusion
        ("slope", "f8"),  # m/rad, of the key under it
        ("push", "f8"),  # constant of its force in an inclusion
        ("dry", "f8"),  # its friction there
    ]
)

class Press(NamedTuple):
    """A bench and its state; the records are changed in place."""

    key: Any
    """Record of `KEY`."""
    jacks: Any
    """Records of `JACK`."""
    cells: Floats
    """Starts of the cells of all force laws [m], and cubics of the force [N]; shape (cells, 5)."""
    arm: Any
    """Record of `ARM`."""
    finger: Any
    """Record of `FINGER`."""
    mode: Any
    """Record of `MODE`."""
    choirs: Any
    """Records of `CHOIR`."""
    x: Floats
    """Key [rad], jacks [m], joints of a servo's arm [rad]; shape (n,)."""
    v: Floats
    """Their speeds; shape (n,)."""
    a: Floats
    """Their accelerations; shape (n,)."""
    work: Floats
    """Space for the steps; shape (16, n)."""
    events: Floats
    """Time [s], kind, choir, force [N] and jack's speed [m/s] of each; shape (EVENTS, 5)."""
    rows: Floats
    """Times and the other quantities of `Motions`; shape (rows, 6)."""


def new_press(key: Any, jacks: Any, cells: Floats, arm: NDArray, kind: int, rows: int) -> Press:
    """Return a press at time 0 before its first sample.

    Args:
        key: Record of `KEY`.
        jacks: Records of `JACK`.
        cells: Of the force laws.
        arm: Array of one `ARM`.
        kind: Of the finger.
        rows: Most rows of motion that one call records.
    """
    finger, mode = np.zeros(1, FINGER), np.zeros(1, MODE)
    finger["kind"] = kind
    n = 1 + len(jacks) + (2 if kind == SERVO else 0)
    return Press(
        key, jacks, cells, records(arm)[0], records(finger)[0], records(mode)[0],
        records(np.zeros(len(jacks), CHOIR)), np.zeros(n), np.zeros(n), np.zeros(n),
        np.zeros((16, n)), np.zeros((EVENTS, 5)), np.zeros((rows, 6)),
    )  # fmt: skip
