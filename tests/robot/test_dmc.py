"""A press in DMC code, and counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.robot.drivers.galil.capture import plan_capture
from sautereau.robot.drivers.galil.dmc import segment_commands
from sautereau.robot.drivers.galil.program import SETTLE, controller_program
from sautereau.robot.errors import UnsafeRequest
from sautereau.trajectory.segments import Segments

row = st.tuples(
    *[st.integers(-(2**31), 2**31)] * 4,
    st.integers(1, 2048),
)


@given(st.lists(row, min_size=1, max_size=20))
def test_each_segment_is_one_command_of_each_axis(rows):
    table = np.array(rows, dtype=np.int64)
    segments = Segments(np.array([5, -5]), table[:, :2], table[:, 2:4], table[:, 4])
    assert segment_commands(segments) == [
        command
        for first, second, first_speed, second_speed, samples in rows
        for command in (
            f"PVA={first},{first_speed},{samples}",
            f"PVB={second},{second_speed},{samples}",
        )
    ]


@pytest.mark.parametrize("output", [1, 16])
def test_capture_trigger_and_motion_start_on_one_line(output):
    program = controller_program(output)
    assert f"XQ #PUSH,2;RC rate;SB {output};BT AB" in program
    assert max(map(len, program)) < 80
    assert not any(mark in line for line in program for mark in "?:")


@given(st.integers(1, 20_000), st.integers(30, 1000))
def test_a_capture_covers_the_motion_and_is_full_before_it_ends(total, room):
    plan = plan_capture(total, 16 * room)
    interval = 2**plan.exponent
    last = interval * (plan.rows - 1)
    assert total + SETTLE - 3 * interval < last <= total + SETTLE - interval
    assert 6 * plan.rows <= 16 * room
    assert plan.exponent == 1 or 6 * (2 * plan.rows) > 16 * room - 6 * SETTLE


def test_a_capture_that_does_not_fit():
    with pytest.raises(UnsafeRequest, match="20000 samples does not fit into 100 array elements"):
        plan_capture(20_000, 100)
