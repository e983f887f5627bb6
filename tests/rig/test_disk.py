"""Files are written completely or not at all; what is no regular file is not read."""

import os

import pytest

from sautereau.rig.disk import hold, read_limited, write_durably
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, parse_rig
from sautereau.rig.units import parse_quantity


def test_a_new_file_and_its_replacement(tmp_path):
    path = tmp_path / "file.txt"
    write_durably(path, "a\r\n", new=True)
    with pytest.raises(FileExistsError) as raised:
        write_durably(path, "b", new=True)
    assert raised.value.filename == str(path)
    path.chmod(0o640)
    write_durably(path, b"c")
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"c", 0o640)
    assert [found.name for found in tmp_path.iterdir()] == ["file.txt"]


def test_a_link_is_replaced_and_not_followed(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("precious")
    link.symlink_to(target)
    write_durably(link, "new")
    assert (target.read_text(), link.read_text(), link.is_symlink()) == ("precious", "new", False)


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
