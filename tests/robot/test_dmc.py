"""A press in DMC code, and counts."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.robot.drivers.galil.arrays import plan_capture
from sautereau.robot.drivers.galil.dmc import SETTLE, controller_program
from sautereau.robot.errors import UnsafeRequest


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
