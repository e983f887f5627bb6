"""What `make test` leaves to `make test-all`: most examples of hypothesis, and slow parameters.

`SAUTEREAU_STUDIES=1 make test-all` draws studies at random in their full size, which takes hours.
"""

import os

import pytest
from hypothesis import settings

FEW = settings(max_examples=20, deadline=None, derandomize=True)
settings.register_profile("few", FEW)
settings.register_profile("many", max_examples=100, deadline=None)


def examples(few: int, many: int) -> settings:
    """Return the settings of a test that tries other numbers of examples than the others."""
    return settings(max_examples=few if settings().derandomize else many)


def slow(*values: object):
    """Return values of parameters with which a test is slow."""
    return pytest.param(*values, marks=pytest.mark.slow)


def least(fraction: float, n: int) -> float:
    """Return how many of n must be right: in a full study a fraction of them, in its first cases
    as many as all but 1 of 1000 such samples have."""
    from scipy.stats import binom

    return fraction * n if amount(0, 1) else binom.ppf(1e-3, n, fraction)


def amount(usual: int, study: int) -> int:
    """Return the size of a slow study: the large one where full studies are requested."""
    return study if os.environ.get("SAUTEREAU_STUDIES") else usual
