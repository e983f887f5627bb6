"""A check reports value and limit, and NaN never passes."""

import numpy as np

from sautereau.trajectory.checks import at_least, at_most


def test_a_check_prints_value_limit_and_margin():
    assert str(at_most("speed", 7.0, 6.0, "rad/s", "")) == (
        "speed: 7 rad/s, at most 6 rad/s: fails by 1 rad/s"
    )
    assert str(at_least("segments", 10, 8, "1", "")) == "segments: 10, at least 8: holds by 2"


def test_a_check_holds_at_the_limit_and_fails_for_nan():
    assert at_most("", 1.0, 1.0, "m", "").holds
    assert at_least("", 1.0, 1.0, "m", "").holds
    for value in (np.nan, np.inf, -np.inf):
        assert not at_most("", value, 1.0, "m", "").holds
        assert not at_least("", value, 1.0, "m", "").holds
    assert at_most("", 3.0, 1.0, "m", "").margin == -2.0
