"""The judge of power cuts finds what is not flushed; a short run breaks every command."""

import random
import sys

import pytest

from tests.budget import amount
from tests.kills.commands import COMMANDS
from tests.kills.disk import after_power_cut
from tests.kills.run import Breaker

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it reads /proc")
CUTS = amount(2, 4)
CAREFUL = "make_folder(Path('a/b')); write_durably(Path('a/b/c'), 'new' * 9000)"
CARELESS = {
    "not flushed": "Path('c.new').write_text('new' * 9000); os.replace('c.new', 'c')",
    "name not flushed": "f = open('c', 'x'); f.write('new'); f.flush(); os.fsync(f.fileno())",
    "name of the folder not flushed": "os.mkdir('a'); write_durably(Path('a/c'), 'new')",
    "written in place": "Path('old').write_text('new' * 9000)",
}


def images(command_server, tmp_path, program):
    """Run a program, and yield what 40 power cuts at its end leave."""
    before, live, store = (tmp_path / name for name in ("before", "live", "store"))
    for folder in (before, live, store):
        folder.mkdir()
        (folder / "old").write_text("old" * 9000)
    (store / "old").unlink()
    start = (
        "import os\nfrom pathlib import Path\nfrom tests.kills.disk import trace\n"
        "from sautereau.rig.disk import make_folder, write_durably\n"
        f"trace(Path.cwd(), Path({str(store)!r}))\n"
    )
    done = command_server.run("-c", start + program, folder=live)
    assert done.returncode == 0, done.stderr
    for seed in range(40):
        image = tmp_path / f"image-{seed}"
        after_power_cut(before, live, store, image, random.Random(seed))
        yield {str(p.relative_to(image)): p.read_text() for p in image.rglob("*") if p.is_file()}


def test_what_is_flushed_is_there(command_server, tmp_path):
    expected = {"a/b/c": "new" * 9000, "old": "old" * 9000}
    for found in images(command_server, tmp_path, CAREFUL):
        assert found == expected


@pytest.mark.parametrize("name", CARELESS)
def test_what_is_not_flushed_is_lost(command_server, tmp_path, name):
    found = list(images(command_server, tmp_path, CARELESS[name]))
    path = {"name of the folder not flushed": "a/c", "written in place": "old"}.get(name, "c")
    whole = [each for each in found if set(each.get(path, "?")) == set("new")]
    assert 0 < len(whole) < len(found)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_short_run(command_server, tmp_path, monkeypatch, name):
    monkeypatch.setenv("PYTHONUNBUFFERED", "1")
    tally = Breaker(command_server, tmp_path, 0).run(name, CUTS, CUTS, print)
    assert tally.failures == []
    assert (tally.kills, tally.cuts) == (CUTS, CUTS)
