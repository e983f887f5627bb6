"""Previews do not depend on how the signal was cut into blocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.preview import Decimator


@given(st.lists(st.integers(0, 120), max_size=12))
def test_groups_are_carried_across_blocks(lengths):
    values = np.arange(float(sum(lengths)))
    preview = Decimator(51_200.0)
    assert preview.factor == 52
    found = [preview.feed(part) for part in np.split(values, np.cumsum(lengths))[:-1]]
    middles = np.concatenate([np.empty(0), *(middle for middle, _ in found)])
    means = np.concatenate([np.empty(0), *(mean for _, mean in found)])
    assert len(means) == len(values) // 52
    # The mean of a ramp is its value in the middle.
    np.testing.assert_allclose(means, middles)


@pytest.mark.parametrize(("rate", "factor"), [(1000.0, 1), (1000.1, 2), (1e6, 1000)])
def test_a_preview_is_never_faster_than_1_khz(rate, factor):
    assert Decimator(rate).factor == factor


def test_infinities_of_both_signs_are_no_fault():
    _, means = Decimator(2000.0).feed(np.array([np.inf, -np.inf, np.nan, 1.0, 1e308, 1e308]))
    assert np.isnan(means[:2]).all()
    assert np.isinf(means[2])
