"""The named structures that the compiled functions share, and their constants; imported as `ix`."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.physics.exact.compile import records
from sautereau.trajectory.motion import Floats

BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""States of a plectrum and its string."""
OFF, PRESSED, SLACK = 0, 1, 2
"""States of the front felt and of the fingertip's pad; a slack one expands more slowly than the
key leaves it."""
CONTACT, RELEASE, RETURN = 0, 1, 2
"""Kinds of a string's events, in the order of the lists in `PluckEvents`."""
PUSH, IDEAL, SERVO = 0, 1, 2
"""Kinds of finger."""
FINE, TURNED_OVER, LOST, JUMPED, AT_PIN = 0, 1, 2, 3, 4
"""Status after an interval of time."""
PIECES = 2
"""Most pieces of a string's force law: the string sticks, and slides."""
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
    " force push_end gravity"
)
"""kg m^2, N m, N m s/rad, N m; rad at first contact with the felt, infinite without it, N m/rad,
N m s/rad; m, of the surface under the jacks above the pin; m; a push in N, and its end in s;
m/s^2."""
JACK = _record(
    "mass friction arm clearance tongue_force tongue_stiffness travel lift damper",
    "pieces",
    first=("i8", PIECES + 1),
    border=("f8", PIECES + 1),
)
"""kg, N, m from the pin, m, infinite for a mute jack; N as the tongue starts to turn, N/m, m of
drop at which the plectrum has passed its string; m of rise at which the damper leaves, minus
infinity without it, and N/m. Pieces of the string's force law, the first cell of each and the end
of the last, and the heights [m] of their ends."""
ARM = _record(
    "base_x base_z upper lower height inertia1 inertia2 rotor2 coupling weight1 weight2"
    " integral_time radians pad_stiffness pad_damping",
    pairs="stiffness damping feedforward start limit offset integral lag torque",
    locked=("i8", 2),
)
"""Lengths in m, inertias in kg m^2, weights in N m; of the position loops s, and rad per encoder
count; of the fingertip's pad N/m, 0 if it is rigid, and N s/m. Of both joints: N m/rad, N m s/rad,
kg m^2; rad where the encoders are 0; limits, offsets and integrals [N m], following errors [rad] of
the last sample, torques [N m]; whether it is braked."""
FINGER = _record(
    "start period moment angle speed acceleration compliance lever overlap push",
    "kind still",
    "free by",
    cubics=("f8", (2, 4)),
)
"""s, of the controller sample; N m, of a push or a pad. Of a key that touches the fingertip rad,
rad/s, and rad/s^2 if no force acts on it; what a moment of 1 N m takes from that, 0 if ideal and
infinite behind a pad; m, moment per force. Of a pad m, by which a rigid fingertip would be within
the key, and the moment [N m] of its spring and damper, negative if they would pull. The kind, and
whether an ideal one is at rest. The joints' accelerations without a force [rad/s^2], what a moment
of 1 N m takes from those, and their reference over the sample [rad]."""
MODE = _record("moment up down x slip", "touch felt pad events rows ends steps")
"""N m, of the finger on the key, and by which friction holds a key at rest against a rise and
against a fall; the unknown of the last inclusion; sign of the key's velocity. Whether the finger
touches it; the felt; the pad. Numbers of recorded events and rows, of rows to come for the ends of
steps, and of steps left before a scene counts as too stiff."""
CHOIR = _record("low high load slope push dry sign", "stands string piece cell damped closed")
"""m, rises between which string and damper do not change; N, of the jack on the key; m/rad, slope
of the key under it; constant and friction of its force in an inclusion; sign of its speed
off the key, 0 where friction holds it. Whether it stands on the key; the string, piece and cell of
its law; whether the damper is on it, and whether the jack may act on the key in an inclusion."""


class Press(NamedTuple):
    """A bench and its state; all arrays and records are changed in place."""

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
    """Space for the steps; shape (13, n)."""
    events: Floats
    """Time [s], kind, choir, force [N] and jack's speed [m/s] of each; shape (EVENTS, 5)."""
    rows: Floats
    """Times and the other quantities of `Motions`; shape (rows, 6)."""


def new_presses(keys: NDArray, jacks: NDArray, cells: Floats, arm: NDArray, kind: int) -> Press:
    """Return presses at time 0 before their first sample, of which one at a time is played.

    Args:
        keys: Of `KEY`; shape (presses,).
        jacks: Of `JACK`; shape (presses, choirs).
        cells: Of the force laws.
        arm: Array of one `ARM`.
        kind: Of the finger.
    """
    finger, mode, choirs = np.zeros(1, FINGER), np.zeros(1, MODE), jacks.shape[1]
    finger["kind"] = kind
    n = 1 + choirs + (2 if kind == SERVO else 0)
    return Press(
        records(keys), records(jacks), cells, records(arm), records(finger), records(mode),
        records(np.zeros(choirs, CHOIR)), np.zeros(n), np.zeros(n), np.zeros(n),
        np.zeros((13, n)), np.zeros((EVENTS, 5)), np.zeros((0, 6)),
    )  # fmt: skip


def one_press(presses: Press, i: int) -> Press:
    """Return one of `new_presses`, which all share the state."""
    return Press(
        presses.key[i], presses.jacks[i], presses.cells, presses.arm[0], presses.finger[0],
        presses.mode[0], presses.choirs, presses.x, presses.v, presses.a, presses.work,
        presses.events, presses.rows,
    )  # fmt: skip
