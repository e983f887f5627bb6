"""The paper's rig, as it is and with lines of its file changed."""

from importlib import resources

import pytest

from sautereau.rig.load import parse_rig


@pytest.fixture(scope="session")
def paper_text():
    return resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def changed(paper_text):
    """Return a function that reads the paper's rig with pieces of its text replaced."""

    def read(*replacements):
        text = paper_text
        for old, new in replacements:
            assert text.count(old) >= 1, f"{old!r} is not in paper.toml"
            text = text.replace(old, new, 1)
        return parse_rig(text, "bench.toml")

    return read
