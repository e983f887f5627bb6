"""Location of events within a step of the reduced engine; compiled."""

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    fingertip,
    jack_kinematics,
)
from sautereau.sim_backend.physics.reduced.step import (
    try_step,
)

LARGEST_ANGLE = 1.2
"""rad, of the key, above which the simulation is stopped; the closed form ends at pi / 2."""
OVER_ANGLE, OVER_ANGULAR_VELOCITY, OVER_FORCE = 1e-15, 1e-12, 1e-12
"""rad, rad/s and fraction of the weights: largest violation of a guard at an event."""
OVER_RISE, OVER_SPEED = 1e-16, 1e-13
"""m and m/s, the same for jacks."""
ROUNDED = 2e-17
"""m, overlap with the key allowed to a jack that has just left it."""
TRIALS, SAME = 80, 1e-16
"""Most iterations, and the relative difference of times that counts as zero."""


@compiled
def locate(bench, cells, state, modes, guards, segment, time, step):
    """Return the time [s] into a step of its first event, and try a step of that length.

    It is the earliest root of the guards that are violated at the step's end, enclosed and found
    by inverse quadratic interpolation; the violation there is within its tolerance.
    """
    low, high, other, latest = 0.0, step, -1.0, 0.0
    conditions = guards.shape[1]
    for j in range(conditions):
        guards[ix.VIOLATED, j] = guards[ix.AFTER, j]
    try_step(bench, cells, state, modes, segment, time, 0.0)
    evaluate_guards(bench, state, modes, segment, time, guards)
    for j in range(conditions):
        guards[ix.BEFORE, j] = max(guards[ix.AFTER, j], 0.0)
    for trial in range(TRIALS):
        part, worst = high, 0.0
        for j in range(conditions):
            if guards[ix.VIOLATED, j] < 0.0:
                allowed = tolerance(bench, modes, j)
                worst = max(worst, -guards[ix.VIOLATED, j] / allowed)
                part = min(part, crossing(guards, j, low, high, other, allowed / 2))
        if worst <= 1.0 or high - low <= SAME * (time + high):
            break
        if trial > TRIALS // 4 and trial % 2 == 0:
            part = (low + high) / 2
        latest = part
        try_step(bench, cells, state, modes, segment, time, part)
        if evaluate_guards(bench, state, modes, segment, time + part, guards):
            other, low = low, part
            for j in range(conditions):
                guards[ix.PREVIOUS, j], guards[ix.BEFORE, j] = (
                    guards[ix.BEFORE, j],
                    guards[ix.AFTER, j],
                )
        else:
            other, high = high, part
            for j in range(conditions):
                guards[ix.PREVIOUS, j], guards[ix.VIOLATED, j] = (
                    guards[ix.VIOLATED, j],
                    guards[ix.AFTER, j],
                )
    if latest != high:
        try_step(bench, cells, state, modes, segment, time, high)
        evaluate_guards(bench, state, modes, segment, time + high, guards)
    return high


@compiled
def crossing(guards, j, low, high, other, beyond):
    """Return the time at which a guard is estimated to be `beyond` below zero."""
    a, b, c = (
        guards[ix.BEFORE, j] + beyond,
        guards[ix.VIOLATED, j] + beyond,
        guards[ix.PREVIOUS, j] + beyond,
    )
    if not a > b:
        return high
    if a <= 2 * beyond:  # a guard that starts at zero may rise before it falls
        return (low + high) / 2
    if other >= 0.0 and c != a and c != b:
        guess = low * b * c / ((a - b) * (a - c)) + high * a * c / ((b - a) * (b - c))
        guess += other * a * b / ((c - a) * (c - b))
        if low < guess < high:
            return guess
    return min(low + (high - low) * a / (a - b), high)


@compiled
def evaluate_guards(bench, state, modes, segment, time, guards):
    """Evaluate all guards at the end of a step; return whether all are positive."""
    angle, omega = state[0, ix.ANGLE_END], state[0, ix.ANGULAR_VELOCITY_END]
    slip, felt = modes[0, ix.SLIP], modes[0, ix.FELT]
    guards[ix.AFTER, 0] = slip * omega if slip != 0 else 1.0
    guards[ix.AFTER, 1] = angle if slip < 0 else 1.0
    guards[ix.AFTER, 2] = LARGEST_ANGLE - angle
    guards[ix.AFTER, 3] = 1.0
    if modes[0, ix.TOUCH]:
        guards[ix.AFTER, 3] = state[0, ix.FINGER_END] if slip != 0 else 1.0
    elif segment[ix.IDEAL] > 0:
        tip_angle, _, _, _ = fingertip(segment, time)
        guards[ix.AFTER, 3] = angle - tip_angle
    guards[ix.AFTER, 4], guards[ix.AFTER, 5] = bench[0, ix.DIP] - angle, 1.0
    if felt != ix.OFF:
        force = felt_push(bench, angle, omega)
        guards[ix.AFTER, 4], guards[ix.AFTER, 5] = (
            -guards[ix.AFTER, 4],
            force if felt == ix.PRESSED else -force,
        )
    good = True
    for j in range(6):
        good = good and not guards[ix.AFTER, j] < 0.0
    for k in range(1, len(bench)):
        at = 2 + 4 * k
        rise, speed, mode = state[k, ix.RISE_END], state[k, ix.SPEED_END], modes[k, ix.JACK]
        guards[ix.AFTER, at + 1] = 1.0
        if mode == ix.STANDS:
            guards[ix.AFTER, at] = state[k, ix.LOAD] if slip != 0 else 1.0
        else:
            tip_angle, _, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
            guards[ix.AFTER, at] = rise - tip_angle + ROUNDED
            if mode != ix.HANGS:
                guards[ix.AFTER, at + 1] = mode * speed
        guards[ix.AFTER, at + 2] = rise - state[k, ix.LOW]
        guards[ix.AFTER, at + 3] = state[k, ix.HIGH] - rise
        for j in range(at, at + 4):
            good = good and not guards[ix.AFTER, j] < 0.0
    return good


@compiled
def tolerance(bench, modes, j):
    """Return the largest violation of a guard that is allowed at an event."""
    if j == 0:
        return OVER_ANGULAR_VELOCITY
    if j < 3 or j == 4:
        return OVER_ANGLE
    weight = 0.0
    for k in range(1, len(bench)):
        weight += bench[k, ix.MASS] * 10.0 * bench[k, ix.ARM]
    if j == 5:
        return OVER_FORCE * weight
    if j == 3:
        return OVER_FORCE * weight if modes[0, ix.TOUCH] else OVER_ANGLE
    k, part = (j - 2) // 4, (j - 2) % 4
    if part == 0 and modes[k, ix.JACK] == ix.STANDS:
        return OVER_FORCE * bench[k, ix.MASS] * 10.0
    return OVER_SPEED if part == 1 else OVER_RISE
