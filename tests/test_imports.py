"""A room brings no more than it needs until it is used, so that commands start quickly."""

import pytest

from benchmarks.imports import FRONTS, imported


@pytest.mark.parametrize("front", FRONTS, ids=lambda front: front.module)
def test_a_room_brings_only_what_it_needs(front):
    _, brought = imported(front.module)
    assert brought <= set(front.brings)
