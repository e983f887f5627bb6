"""A package imports only what it needs, so that commands start quickly."""

import pytest

from benchmarks.imports import FRONTS, imported


@pytest.mark.parametrize("front", FRONTS, ids=lambda front: front.module)
def test_a_package_imports_only_what_it_needs(front):
    _, brought = imported(front.module)
    assert brought <= set(front.brings)
