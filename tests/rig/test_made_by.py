"""The version and the hash of the code that recordings and tables state."""

import re
import shutil
from importlib.metadata import version
from pathlib import Path

import pytest

from sautereau.rig.errors import SautereauError
from sautereau.rig.version import COMPUTING, code_hash, made_by

ROOT = Path(__file__).parents[2]


@pytest.fixture
def code(tmp_path):
    """A folder with a little code in each of the four packages."""
    for name in COMPUTING:
        (tmp_path / name / "deep").mkdir(parents=True)
        (tmp_path / name / "errors.py").write_text(f'"""Errors of {name}."""\n')
        (tmp_path / name / "deep" / "table.csv").write_text("a,b\n1,2\n")
    return tmp_path


def test_version_and_hash():
    assert re.fullmatch(r"[\d.]+ \(code [0-9a-f]{12}\)", made_by())
    assert made_by() == f"{version('sautereau')} (code {code_hash(ROOT)})"


@pytest.mark.parametrize("name", ["daq/errors.py", "analysis/deep/table.csv"])
def test_every_changed_byte_counts_but_line_ends(code, name):
    before = code_hash(code)
    text = (code / name).read_bytes()
    (code / name).write_bytes(text.replace(b"\n", b"\r\n"))
    assert code_hash(code) == before
    (code / name).write_bytes(text + b" ")
    assert code_hash(code) != before


def test_names_count_and_other_files_do_not(code):
    before = code_hash(code)
    for name in ("errors.cpython-311.pyc", "errors.py~", "press.mcap"):
        (code / "daq" / name).write_bytes(b"other")
    assert code_hash(code) == before
    (code / "daq" / "errors.py").rename(code / "daq" / "faults.py")
    assert code_hash(code) != before


def test_code_that_cannot_be_read_is_an_error(code):
    (code / "daq" / "gone.py").symlink_to("nowhere")
    with pytest.raises(SautereauError, match=r"gone\.py: cannot be read: No such file"):
        code_hash(code)
    shutil.rmtree(code / "analysis")
    with pytest.raises(SautereauError, match=r"analysis: cannot be read: No such file"):
        code_hash(code)
