"""Plots, films and sounds are written as all other files: completely, and never over others."""

import os
import sys

import pytest

from tests.budget import slow

LINKS = pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
WORDS = {
    "plan": "plan paper --plot out.png",
    "phases": "phases press-0001.mcap --plot out.svg",
    "listen": "listen paper --duration 0.3s --out out.wav",
    "animate": "animate press-0001.mcap --since 50ms --until 51ms --slow 80 --out out.gif",
    "export": "export press-0001.mcap --to csv --out out.csv",
}


@pytest.fixture
def pressed(tmp_path, write_session):
    """Folder with the recording of a press."""
    write_session(tmp_path, 1)
    return tmp_path


@LINKS
@pytest.mark.parametrize("name", ["plan", "animate", "export", slow("phases"), slow("listen")])
def test_no_link_is_followed_and_no_file_replaced_without_force(sautereau, pressed, name):
    words = WORDS[name].split()
    target, out = pressed / "victim", pressed / words[-1]
    target.write_text("precious")
    out.symlink_to(target)
    refused = sautereau(*words)
    assert (refused.returncode, out.is_symlink()) == (1, True)
    assert out.name in refused.stderr
    replaced = sautereau(*words, "--force")
    assert (replaced.returncode, out.is_symlink()) == (0, False), replaced.stderr
    assert out.stat().st_size > 100
    assert target.read_text() == "precious"


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="limits of the file size are POSIX's")
@pytest.mark.parametrize("name", WORDS)
def test_a_disk_that_fills_up_leaves_the_old_file(sautereau, pressed, name):
    words = WORDS[name].split()
    out = pressed / words[-1]
    out.write_text("old")
    before = {path.name for path in pressed.iterdir()}
    done = sautereau(*words, "--force", largest_file=300)
    assert (done.returncode, out.read_text()) == (1, "old"), done.stderr
    assert out.name in done.stderr
    assert "the size that the system allows" in done.stderr
    assert {path.name for path in pressed.iterdir()} == before


@pytest.mark.slow
@LINKS
def test_a_session_keeps_the_files_that_have_the_name_of_its_plot(sautereau, tmp_path):
    session = tmp_path / "s"
    session.mkdir()
    target = tmp_path / "victim"
    target.write_text("precious")
    (session / "press-0001.png").symlink_to(target)
    (session / "press-0001-2.png").write_text("own")
    words = ["press", "paper", "--scene", "ideal", "--seed", "1", "-n", "1", "--out", "s"]
    for _ in range(2):  # the second finds its plot
        done = sautereau(*words)
        assert done.returncode == 0, done.stderr
    assert (target.read_text(), (session / "press-0001-2.png").read_text()) == ("precious", "own")
    pictures = sorted(path.name for path in session.glob("*.png"))
    assert pictures == ["press-0001-2.png", "press-0001-3.png", "press-0001.png"]
