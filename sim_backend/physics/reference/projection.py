"""What hangs together is brought together again, where integration and rounding let it apart."""

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.reference.drive_segments import Leg
from sautereau.sim_backend.physics.reference.equations import Stretch
from sautereau.sim_backend.physics.reference.linkage import Linkage
from sautereau.sim_backend.physics.reference.system import State, System

DEEP = 1e-6
"""rad, by which a fingertip and a key may overlap between two modes."""


def apart(system: System, leg: Leg, time: float, x: State) -> State:
    """Return the state with surfaces that overlap by rounding just touching.

    Raises:
        SceneError: Fingertip and key overlap by more than that.
    """
    after = list(x)
    touch = system.touch(leg, time, x)
    least = max(0.0, touch.angle) if touch else 0.0
    if least - after[0] > DEEP:
        raise SceneError(
            f"rig {system.name}: at {time:.6g} s the fingertip is suddenly {least - after[0]:.3g}"
            f" rad within the key, more than {DEEP:.3g} rad; its reference jumps: play one that is"
            " continuous"
        )
    after[0] = max(after[0], least)
    for k, jack in enumerate(system.jacks):
        after[2 + 2 * k] = max(after[2 + 2 * k], jack.foot(after[0])[0])
    return after


def settled(stretch: Stretch, time: float, x: State) -> State:
    """Return the state with what hangs together brought together, rounding apart."""
    x = stretch.complete(time, x)
    if stretch.mode.rail:
        x = stretch.complete(time, [0.0, *x[1:]])
    if stretch.system.arm and stretch.mode.touch and not stretch.mode.slip:
        return pinned(stretch.system.arm, x)
    return x


def pinned(arm: Linkage, x: State) -> State:
    """Return the state with the fingertip on the key as it stands."""
    for _ in range(2):
        touch, own = arm.touch(*x[-4:]), arm.inertia(*x[-4:])
        by1, by2 = own.solve(touch.slope1, touch.slope2)
        size = touch.slope1 * by1 + touch.slope2 * by2
        place, speed = (touch.angle - x[0]) / size, touch.spin / size
        q1, q2, d1, d2 = x[-4:]
        joints = [q1 - by1 * place, q2 - by2 * place, d1 - by1 * speed, d2 - by2 * speed]
        x = [*x[:-4], *joints]
    return x
