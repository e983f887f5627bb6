"""The plectrum's bend at one point against its map on arrays, which has tests of its own."""

import numpy as np
import pytest

from sautereau.analysis.model.plectrum.levels import LEVELS, plectrum_map
from sautereau.analysis.model.string.bend import point_bend
from sautereau.rig.load import load_rig

PLECTRUM = load_rig().plectrum


@pytest.mark.parametrize(
    ("level", "friction"),
    [*((level, 0.0) for level in LEVELS.names()), ("elastica", 0.5), ("rods", 0.2)],
)
def test_one_point_is_that_of_the_map(level, friction):
    plectrum = plectrum_map(PLECTRUM.model_copy(update={"friction": friction}), level)
    point, length = point_bend(plectrum), plectrum.length
    for place, share in [(0.95, 0.0), (0.95, 0.3), (1.0, 0.6), (1.004, 0.99)]:
        s = place * length
        limit = point.limit(s)
        assert limit == pytest.approx(float(plectrum.force_limit(s)), rel=1e-12)
        x, z, theta, x_s, z_s, theta_s, x_f, z_f, theta_f = plectrum.bend(s, share * limit)
        out = -np.sin(theta) - friction * np.cos(theta)
        up = np.cos(theta) - friction * np.sin(theta)
        at, by_s, by_f = np.reshape(point.at(s, share * limit), (3, 4))
        # In lengths and limits of force, whatever the plectrum's size.
        unit = np.array([length, length, 1, 1])
        expected = np.array([x, z, out, up])
        np.testing.assert_allclose(at / unit, expected / unit, atol=1e-9)
        expected = np.array([x_s, z_s, -up * theta_s, out * theta_s])
        np.testing.assert_allclose(by_s * length / unit, expected * length / unit, atol=1e-7)
        expected = np.array([x_f, z_f, -up * theta_f, out * theta_f])
        np.testing.assert_allclose(by_f * limit / unit, expected * limit / unit, atol=1e-7)
