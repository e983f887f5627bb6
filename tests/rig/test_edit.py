"""Found values go into a rig file, and nothing else of it changes."""

import errno
import os
from importlib import resources

import pytest

from sautereau.rig.edit import edit_rig
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig

TEXT = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_only_the_lines_of_the_values_change(file):
    found = {"controller.port": "/dev/ttyACM3", "arm.base_x": "-270.5 mm"}
    edit = edit_rig(file, found, "touched on 2026-11-21")
    assert file.read_text() == TEXT
    edit.save()
    pairs = zip(TEXT.splitlines(), file.read_text().splitlines(), strict=True)
    changed = [new for old, new in pairs if old != new]
    assert len(changed) == 2
    assert changed[0].startswith('base_x = {value = "-270.5 mm"')
    assert changed[1] == 'port = "/dev/ttyACM3"'
    rig = load_rig(file)
    assert rig.arm.base_x == pytest.approx(-0.2705)
    assert rig.sources["arm.base_x"] == "touched on 2026-11-21"
    assert "arm.base_x" not in rig.assumed


def test_the_difference_shows_old_and_new(file):
    difference = edit_rig(file, {"controller.port": "COM4"}).difference
    assert '-port = "/dev/ttyUSB0"\n+port = "COM4"' in difference
    assert len(difference.splitlines()) == 4
    assert edit_rig(file, {"controller.port": "/dev/ttyUSB0"}).difference == ""


def test_lists_tables_of_lists_and_defaults(file):
    edit_rig(
        file,
        {"arm.home_angles.1": "-91 deg", "daq.channels.1.range": "5 V", "controller.kind": "galil"},
    ).save()
    rig = load_rig(file)
    assert rig.arm.home_angles[1] == pytest.approx(-1.588, abs=1e-3)
    assert rig.daq.channels[1].range == 5
    assert 'kind = "galil"' in file.read_text()


def test_every_unknown_key_is_reported_at_once(file):
    with pytest.raises(RigError) as caught:
        edit_rig(file, {"arm.base_q.z": "1 mm", "daq.channels.7.range": "1 V", "key": 3})
    for key in ("arm.base_q.z", "daq.channels.7.range", "key"):
        assert f"{key}: unknown quantity" in str(caught.value)


@pytest.mark.parametrize(
    ("found", "said"),
    [({"controller.baud_rate": -1}, "baud_rate"), ({"arm.base_w": "1 mm"}, "base_w")],
)
def test_a_rig_that_would_not_be_valid_is_refused(file, found, said):
    with pytest.raises(RigError, match=said):
        edit_rig(file, found)
    assert file.read_text() == TEXT


def test_a_change_of_somebody_else_is_not_lost(file):
    edit = edit_rig(file, {"controller.port": "COM4"})
    file.write_text(TEXT.replace("baud_rate = 115200", "baud_rate = 19200"))
    with pytest.raises(RigError, match="another program changed it"):
        edit.save()
    assert load_rig(file).controller.baud_rate == 19200


def test_a_packaged_rig_is_not_written_into():
    with pytest.raises(RigError, match="packaged rigs are never changed"):
        edit_rig("paper", {})


def test_line_ends_and_mode_stay(file):
    file.write_bytes(TEXT.replace("\n", "\r\n").encode())
    file.chmod(0o640)
    edit_rig(file, {"controller.port": "COM4"}).save()
    data = file.read_bytes()
    assert data.count(b"\r\n") == data.count(b"\n")
    assert file.stat().st_mode & 0o777 == 0o640
    assert not list(file.parent.glob("*.new"))


def test_a_failing_save_changes_nothing(file, monkeypatch):
    def full(entry):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RigError, match="the disk is full"):
        edit_rig(file, {"controller.port": "COM4"}).save()
    assert file.read_text() == TEXT
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_save_follows_no_link(file, tmp_path):
    target = tmp_path / "another.txt"
    target.write_text("precious")
    edit = edit_rig(file, {"controller.port": "COM4"})
    for link in (".rig.toml.new", "rig.toml.new"):
        file.with_name(link).symlink_to(target)
    edit.save()
    assert file.read_text() == edit.after
    assert target.read_text() == "precious"
