"""Expected force of a press."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sautereau.trajectory.expected import Expectation

CURVE = Expectation(
    np.array([0.001, 0.002, 0.0021, 0.005]), np.array([0.5, 3.0, -1.0, 2.0]), 0.001, 0.002
)


def test_the_force_is_constant_beyond_the_curve():
    assert CURVE.force_at(np.array([-1.0, 0.0015, 0.02])).tolist() == [0.5, 1.75, 2.0]


def test_a_peak_between_two_rises_is_included():
    low, high = np.array([[0.0015, 0.0, 0.003]]), np.array([[0.00205, 0.01, 0.003]])
    least, most = CURVE.range_between(low, high)
    assert most.shape == low.shape
    assert most[0].tolist() == [3.0, 3.0, CURVE.force_at(np.array(0.003))]
    assert np.allclose(least[0], [1.0, -1.0, CURVE.force_at(np.array(0.003))])


@given(
    st.lists(st.tuples(st.integers(0, 1000), st.floats(-9, 9)), min_size=1, max_size=12),
    st.lists(st.tuples(st.floats(-5, 1005), st.floats(0, 500)), min_size=1, max_size=6),
)
def test_the_range_is_that_of_a_dense_sampling(points, windows):
    rise, first = np.unique([p[0] for p in points], return_index=True)
    force = np.array([points[i][1] for i in first])
    curve = Expectation(rise.astype(float), force, 0.0, 0.0)
    low = np.array([w[0] for w in windows])
    high = low + np.array([w[1] for w in windows])
    least, most = curve.range_between(low, high)
    for a, b, down, up in zip(low, high, least, most, strict=True):
        inside = curve.rise[(curve.rise >= a) & (curve.rise <= b)]
        sampled = curve.force_at(np.concatenate([[a, b], inside, np.linspace(a, b, 50)]))
        assert np.isclose(sampled.min(), down, rtol=1e-12, atol=1e-12)
        assert np.isclose(sampled.max(), up, rtol=1e-12, atol=1e-12)
