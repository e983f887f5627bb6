"""docs/add-an-import-format.md, followed literally: a format from outside the package."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.app import app
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording


@pytest.fixture
def command(follow):
    (text,) = follow("add-an-import-format.md").bodies("sh")
    return shlex.split(text.replace("\\\n", " "))[1:]


def test_the_page_s_format_imports_its_file(command, capsys):
    assert app(command, print_error=False, exit_on_error=False) == 0
    assert capsys.readouterr().out.startswith("measured: press.mcap\n4 samples at 1000 Hz")
    found = read_recording(Path("press.mcap"))
    assert found.rate == 1000.0
    assert found.first_sample == -1
    np.testing.assert_array_equal(found.volts["velocity"], [0.0, 0.1, 0.2, 0.1])
    np.testing.assert_array_equal(found.volts["force"], [0.0, 1.0, 2.0, 0.5])


def test_a_damaged_file_and_an_unknown_extension_are_refused(command):
    Path("press.toy").write_text("rate: fast\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"import of press\.toy: it is damaged"):
        app(command, print_error=False, exit_on_error=False)
    Path("press.xyz").write_text("", encoding="utf-8")
    words = ["press.xyz" if word == "press.toy" else word for word in command]
    with pytest.raises(RecordingError, match=r"'\.xyz'.*\.tdms, \.csv, .*, \.hdf5, \.toy"):
        app(words, print_error=False, exit_on_error=False)


def test_the_help_lists_the_built_in_extensions(capsys):
    app(["import", "--help"], print_error=False, exit_on_error=False)
    text = " ".join(capsys.readouterr().out.split())
    assert all(f".{name}" in text for name in ("tdms", "csv", "wav", "parquet", "mat", "npz", "h5"))
