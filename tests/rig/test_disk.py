"""Files are written completely or not at all; what is no regular file is not read."""

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from sautereau.rig.disk import (
    give_name,
    hold,
    make_folder,
    new_file,
    open_regular,
    read_limited,
    replacing,
    sealed,
    unchanged,
    write_durably,
)
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, parse_rig
from sautereau.rig.units import parse_quantity


def test_folders_deeper_than_python_recurses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # an absolute path would be too long
    make_folder(Path("x/" * 1500))
    assert Path("x/" * 1500).is_dir()
    subprocess.run(["rm", "-rf", "x"], check=True)  # rmtree does not reach all of them


LONGEST_NAME = "\N{GREEK SMALL LETTER MU}" * 125 + ".toml"  # 255 bytes


@pytest.mark.parametrize("name", ["file.txt", LONGEST_NAME], ids=["short", "longest"])
def test_a_new_file_and_its_replacement(tmp_path, name):
    path = tmp_path / name
    write_durably(path, "a\r\n")
    with pytest.raises(FileExistsError) as raised:
        write_durably(path, "b")
    assert (raised.value.filename, path.read_bytes()) == (str(path), b"a\r\n")
    path.chmod(0o640)
    write_durably(path, b"c", replace=True)
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"c", 0o640)
    assert [found.name for found in tmp_path.iterdir()] == [name]


def test_a_page_is_known_until_somebody_changes_it(tmp_path):
    path = tmp_path / "page.html"
    assert not unchanged(path)
    path.write_bytes(sealed("<p>é</p>\n"))
    assert unchanged(path)
    path.write_bytes(path.read_bytes().replace(b"<p>", b"<b>"))
    assert not unchanged(path)
    path.write_text("<p></p>")
    assert not unchanged(path)


def test_a_link_is_replaced_and_not_followed(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("precious")
    link.symlink_to(target)
    with pytest.raises(FileExistsError):
        write_durably(link, "new")
    write_durably(link, "new", replace=True)
    assert (target.read_text(), link.read_text(), link.is_symlink()) == ("precious", "new", False)


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENOTSUP, errno.ENOSYS])
def test_disks_without_hard_links(tmp_path, monkeypatch, code):
    """ExFAT and some network disks: a file is still written completely, and never over another."""

    def link(source, target, **_):
        raise OSError(code, os.strerror(code), str(source), None, str(target))

    monkeypatch.setattr(os, "link", link)
    path = tmp_path / "file.txt"
    write_durably(path, "a")
    with pytest.raises(FileExistsError):
        give_name(tmp_path / "missing", path)
    assert (path.read_text(), len(list(tmp_path.iterdir()))) == ("a", 1)


@pytest.mark.parametrize("code", [errno.EINVAL, errno.ENOTSUP])
def test_disks_that_cannot_flush_a_folder(tmp_path, monkeypatch, code):
    flushed = os.fsync

    def fsync(entry):
        if stat.S_ISDIR(os.fstat(entry).st_mode):
            raise OSError(code, os.strerror(code))
        flushed(entry)

    monkeypatch.setattr(os, "fsync", fsync)
    make_folder(tmp_path / "a" / "b")
    write_durably(tmp_path / "a" / "b" / "file.txt", "a")


def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    write_durably(path, "old")

    def fill():
        with new_file(path, replace=True) as file:
            file.write(b"half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match="the disk is full; free some space") as raised:
        fill()
    assert raised.value.filename == str(path)
    assert (path.read_text(), len(list(tmp_path.iterdir()))) == ("old", 1)


@pytest.mark.parametrize("name", ["a\0b", "\ud800"])
def test_what_no_file_can_be_called(tmp_path, name):
    with pytest.raises(OSError, match="not the name of a file"):
        read_limited(tmp_path / name)


def test_pipes_devices_and_large_files_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with (tmp_path / "large.toml").open("wb") as large:
        large.truncate(10**9)
    for name, words in (("pipe", "not a regular file"), ("large", "limit of 8 MB")):
        with pytest.raises(RigError, match=words):
            load_rig(tmp_path / f"{name}.toml")
    with pytest.raises(OSError, match="not a regular file"):
        read_limited(tmp_path / "/dev/zero")


def test_what_a_killed_process_left_is_removed_and_what_is_being_written_is_not(tmp_path):
    path = tmp_path / "file.txt"
    (tmp_path / ".file.txt.00.new").touch()
    (tmp_path / ".other.txt.00.new").touch()
    with (tmp_path / ".file.txt.11.new").open("wb") as other:
        assert hold(other)
        write_durably(path, "a")
    left = sorted(found.name for found in tmp_path.iterdir())
    assert left == [".file.txt.11.new", ".other.txt.00.new", "file.txt"]


def test_a_file_in_use_is_held_once(tmp_path):
    with (tmp_path / "file").open("wb") as first, (tmp_path / "file").open("rb") as second:
        assert hold(first)
        assert not hold(second)


@pytest.mark.parametrize(
    "unit", ["m**(9**9**9)", "m**9**9**9", "m^9^9", "m**999", "m**2e9", "m" * 61]
)
def test_exponents_without_end_are_refused(unit):
    with pytest.raises(ValueError, match="not a number with a unit"):
        parse_quantity(f"14 {unit}", "m")


def test_very_many_unknown_keys_are_refused_at_once():
    text = "".join(f"key{n} = 1\n" for n in range(3000))
    with pytest.raises(RigError, match="more faults") as caught:
        parse_rig(text)
    assert str(caught.value).count("\n") < 100


def test_what_is_no_rig_file_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("paper").mkdir()
    assert load_rig("paper").name == load_rig().name  # a folder hides no packaged rig
    Path("session").mkdir()
    Path("press-0001.mcap").write_bytes(b"\x89MCAP0\r\n\xff")
    for name, kind in (("session", "a folder"), ("press-0001.mcap", "a recording")):
        with pytest.raises(RigError, match=rf"'{name}' is {kind}; give the path of a \.toml file"):
            load_rig(name)


FEW = """
import resource
from sautereau.rig.disk import need_open_files
resource.setrlimit(resource.RLIMIT_NOFILE, (12, 80))
need_open_files()
print(resource.getrlimit(resource.RLIMIT_NOFILE))
resource.setrlimit(resource.RLIMIT_NOFILE, (12, 12))
try: need_open_files()
except Exception as error: print(type(error).__name__, error)
"""


@pytest.mark.skipif(os.name != "posix", reason="it has no such limit")
def test_open_files_are_raised_to_what_is_needed_or_the_limit_is_named():
    done = subprocess.run([sys.executable, "-c", FEW], capture_output=True, text=True, check=True)
    raised, refused = done.stdout.splitlines()
    assert raised == "(64, 80)"
    assert "allows this process 12 open files" in refused
    assert "ulimit -n 64" in refused


@pytest.mark.skipif(sys.platform != "linux", reason="the file is Linux's")
def test_an_error_while_reading_names_the_file():
    path = Path("/proc/self/mem")  # a regular file, whose first page is never there
    with open_regular(path) as file, pytest.raises(OSError, match=str(path)):
        file.read(1)
    with pytest.raises(OSError, match=str(path)):
        read_limited(path)


def test_what_may_be_replaced_may_be_so_inside_as_well(tmp_path):
    """`package --out FILE --force` refuses nothing else in between."""
    path = tmp_path / "a.zip"
    path.write_text("old", encoding="utf-8")
    with replacing([path]), replacing([]):
        write_durably(path, "new")
    assert path.read_text(encoding="utf-8") == "new"
    with pytest.raises(FileExistsError):
        write_durably(path, "newer")
