"""Rigs to plan on."""

import pytest

from sautereau.rig.load import with_values


@pytest.fixture(scope="session")
def bench(paper):
    """Return a function that changes values of the paper's rig, lengths and angles in SI."""

    def change(**values):
        return with_values(paper, {key.replace("__", "."): v for key, v in values.items()})

    return change
