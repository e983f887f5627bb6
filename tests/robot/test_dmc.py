"""A press in DMC code, and counts."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.dmc import capture_rows, press_program, segment_commands, segments_from
from trajectory.counts import to_angles, to_counts
from trajectory.segments import Segments

row = st.tuples(
    *[st.integers(-(2**31), 2**31)] * 4,
    st.integers(1, 2048),
)


@given(st.lists(row, min_size=1, max_size=20))
def test_segments_survive_the_wire(rows):
    table = np.array(rows, dtype=np.int64)
    segments = Segments(np.array([5, -5]), table[:, :2], table[:, 2:4], table[:, 4])
    back = segments_from(segment_commands(segments), segments.start)
    for name in ("start", "steps", "velocities", "samples"):
        np.testing.assert_array_equal(getattr(back, name), getattr(segments, name))


@pytest.mark.parametrize("output", [1, 16])
def test_capture_trigger_and_motion_begin_on_one_line(output):
    assert press_program(output)[1] == f"RC 1;SB {output};BT AB"
    assert press_program(output)[-2:] == [f"CB {output}", "EN"]


@given(st.integers(1, 20_000))
def test_a_capture_sees_the_whole_motion_and_is_full_before_it_ends(total):
    last = 2 * (capture_rows(total) - 1)
    assert total + 10 < last < total + 20


@given(st.lists(st.floats(-10, 10), min_size=2, max_size=2), st.integers(16, 2**31))
def test_counts_are_the_nearest(angles, turn):
    counts = to_counts(angles, turn)
    assert counts.dtype == np.int64
    np.testing.assert_allclose(to_angles(counts, turn), angles, atol=math.pi / turn * 1.000001)
    np.testing.assert_array_equal(to_counts(to_angles(counts, turn), turn), counts)


def test_counts_keep_the_shape():
    angles = np.linspace(-1, 1, 12).reshape(2, 3, 2)
    assert to_counts(angles, 4096).shape == angles.shape
    assert to_counts(2 * math.pi, 4096) == 4096
