"""Rows of the reduced engine's motion; compiled."""

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import fingertip, string_force


@compiled
def write_row(bench, cells, state, modes, segment, time, row):
    """Write time, angle, angular velocity, first jack's rise, forces of finger and strings.

    The force of a push is its moment [N m].
    """
    row[0], row[1], row[2] = time, state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY]
    row[3] = state[1, ix.RISE]
    row[4] = segment[ix.PUSH]
    if segment[ix.IDEAL] > 0.0:
        row[4] = 0.0
        if state[0, ix.FINGER] != 0.0:
            _, _, _, arm = fingertip(segment, time)
            row[4] = state[0, ix.FINGER] / arm
    row[5] = 0.0
    for k in range(1, len(bench)):
        row[5] += string_force(bench, cells, modes, k, state[k, ix.RISE])


@compiled
def write_change(bench, cells, state, modes, segment, time, changes):
    """Write a row before or after a change of mode, as long as there is room."""
    n = modes[0, ix.CHANGES]
    if n < len(changes):
        write_row(bench, cells, state, modes, segment, time, changes[n])
        modes[0, ix.CHANGES] = n + 1
