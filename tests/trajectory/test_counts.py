"""Conversion between angles and encoder counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.trajectory.segments import to_angles, to_counts


def test_a_quarter_turn():
    assert to_counts([np.pi / 2, -np.pi / 2], 2_000_000).tolist() == [500_000, -500_000]
    assert to_angles([500_000, -250_000], 2_000_000) == pytest.approx([np.pi / 2, -np.pi / 4])


def test_shapes_and_types_are_kept():
    assert to_counts(np.zeros((3, 2)), 4096).shape == (3, 2)
    assert to_counts(0.1, 4096).dtype == np.int64
    assert to_angles(np.zeros((3, 2), dtype=int), 4096).dtype == np.float64


@given(st.integers(-(2**40), 2**40), st.integers(16, 2**31))
def test_counts_are_recovered_from_angles(counts, turn):
    assert to_counts(to_angles(counts, turn), turn) == counts


@given(st.floats(-10, 10), st.integers(16, 2**31))
def test_an_angle_is_wrong_by_at_most_half_a_count(angle, turn):
    step = 2 * np.pi / turn
    assert abs(to_angles(to_counts(angle, turn), turn) - angle) <= step / 2 + 1e-14
