"""A folder of recordings becomes one table, also after interruptions and faulty files."""

import errno
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sautereau.analysis.campaign import run as campaign_run
from sautereau.analysis.campaign import table as table_module
from sautereau.analysis.campaign.row import UNITS, plectrum_id, unit_of
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.table import SCHEMA, empty_campaign, read_campaign
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.features import features
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.progress import progress_to

GOOD = 12


@pytest.fixture
def recordings(campaign_folder, tmp_path):
    return Path(shutil.copytree(campaign_folder, tmp_path / "recordings"))


@pytest.fixture(scope="module")
def complete(campaign_folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("table") / "complete.parquet"
    return run_campaign(campaign_folder, out).campaign


def same(found, complete):
    """Return whether two tables are equal except for the dates of copied files."""
    return found.table.drop(["mtime"]).equals(complete.table.drop(["mtime"]))


@pytest.mark.slow
def test_a_row_holds_session_plectrum_and_features(campaign_folder, complete):
    assert len(complete.table) == GOOD
    assert not complete.faults
    assert complete.simulated
    path = campaign_folder / complete.data["path"][0]
    press = load_press(path)
    row = complete.table.to_pylist()[0]
    found = features(press, find_phases(press))
    for name in set(found) - {"path"}:
        assert row[name] == found[name], name
    assert row["path"] == "plectrum-01-session-1/press-0001.mcap"
    assert row["session"] == "plectrum-01-session-1"
    assert row["press"] == 1
    assert row["plectrum_bending_stiffness"] == press.rig.plectrum.bending_stiffness
    assert row["plectrum"] == plectrum_id(press.rig)
    assert list(row) == [name for name in UNITS if name in row]


def test_the_file_holds_units_and_the_returned_table(complete):
    again = read_campaign(complete.path)
    assert again.table.equals(complete.table)
    assert again.schema == SCHEMA
    field = pq.read_schema(complete.path).field("release_force")
    assert field.metadata == {b"unit": b"N"}
    assert unit_of("contact_2") == "s"


def test_plectra_differ_by_the_rigs_numbers_and_name():
    rig = load_rig()
    assert plectrum_id(rig) == plectrum_id(load_rig())
    assert plectrum_id(rig) != plectrum_id(with_values(rig, {"plectrum.overlap": "0.3 mm"}))
    assert plectrum_id(rig) != plectrum_id(rig.model_copy(update={"name": "another"}))
    assert plectrum_id(rig) == plectrum_id(with_values(rig, {"press.jack_speed": "0.1 m/s"}))


def test_faulty_files_are_listed_and_excluded(recordings, complete, tmp_path):
    victim = sorted(recordings.rglob("*.mcap"))[3]
    data = bytearray(victim.read_bytes())
    (recordings / "cut-short.mcap").write_bytes(data[: len(data) // 2])
    data[len(data) // 2] ^= 1
    (recordings / "changed.mcap").write_bytes(data)
    (recordings / "empty.mcap").touch()
    (recordings / "text.mcap").write_text("not a recording")
    (recordings / "folder.mcap").mkdir()
    (recordings / "open.mcap.part").touch()
    out = tmp_path / "table.parquet"
    found = run_campaign(recordings, out)
    assert same(found.campaign, complete)
    names = ["changed.mcap", "cut-short.mcap", "empty.mcap", "text.mcap"]
    assert [fault.source.path for fault in found.campaign.faults] == names
    assert all(fault.text for fault in found.campaign.faults)
    again = run_campaign(recordings, out)
    assert (again.read, again.kept) == (4, GOOD)
    assert again.campaign.faults == found.campaign.faults
    shutil.copy(victim, recordings / "text.mcap")
    fixed = run_campaign(recordings, out)
    assert fixed.read == 4
    assert len(fixed.campaign.table) == GOOD + 1
    assert [fault.source.path for fault in fixed.campaign.faults] == names[:3]


def test_only_new_and_changed_recordings_are_read(recordings, complete, tmp_path):
    out = tmp_path / "deep" / "table.parquet"
    run_campaign(recordings, out)
    assert run_campaign(recordings, out).read == 0
    first, second, *_ = sorted(recordings.rglob("*.mcap"))
    os.utime(first, ns=(0, 0))
    second.unlink()
    found = run_campaign(recordings, out)
    assert (found.read, found.kept, found.dropped) == (1, GOOD - 2, 2)
    paths = set(complete.data["path"]) - {second.relative_to(recordings).as_posix()}
    assert set(found.campaign.data["path"]) == paths


def test_a_table_of_another_version_is_regenerated(campaign_folder, complete, tmp_path):
    out = tmp_path / "table.parquet"
    empty_campaign(out, "0.0.1").grown(complete.table.to_pylist(), ()).write()
    assert run_campaign(campaign_folder, out).read == GOOD


def test_a_table_of_a_later_version_is_refused(complete, tmp_path, monkeypatch):
    monkeypatch.setattr(table_module, "SCHEMA", SCHEMA + 1)
    out = tmp_path / "table.parquet"
    replace(complete, path=out).write()
    monkeypatch.undo()
    with pytest.raises(AnalysisError, match="update sautereau, or make the table again"):
        read_campaign(out)


KILLED = """
import os, signal, sys
from sautereau.analysis.campaign import run
from sautereau.rig.progress import progress_to

run.BATCH = run.UNWRITTEN = 1

def kill(fraction):
    if round(fraction * int(sys.argv[3])) == 5:
        os.kill(os.getpid(), signal.SIGKILL)

with progress_to(kill):
    run.run_campaign(sys.argv[1], sys.argv[2], 2)
"""


@pytest.mark.slow
def test_a_killed_campaign_is_continued_and_leaves_no_process(
    command_server, campaign_folder, complete, tmp_path, monkeypatch
):
    out = tmp_path / "table.parquet"
    # The workers inherit the pipe, so communicate() returns when the last of them has ended.
    pipe = {"stdout": subprocess.PIPE}
    with command_server.start("-c", KILLED, campaign_folder, out, str(GOOD), **pipe) as killed:
        killed.communicate(timeout=60)
    assert len(read_campaign(out).table) == 5
    left = out.with_name(f".{out.name}.00.new")
    left.write_bytes(b"of an interrupted write")
    monkeypatch.setattr(campaign_run, "BATCH", 1)
    progress = []
    with progress_to(progress.append):
        found = run_campaign(campaign_folder, out)
    assert found.kept == 5
    assert found.campaign.table.equals(complete.table)
    assert progress == [done / (GOOD - 5) for done in range(1, GOOD - 4)]
    assert not left.exists()


def test_a_write_that_fails_once_adds_no_row_twice(
    campaign_folder, complete, tmp_path, monkeypatch
):
    out, codes, replace = tmp_path / "table.parquet", [errno.EINVAL], os.replace

    def replace_later(*paths):
        if codes:
            raise OSError(codes.pop(), "it fails once")
        replace(*paths)

    monkeypatch.setattr(campaign_run, "BATCH", 1)
    monkeypatch.setattr(campaign_run, "UNWRITTEN", 2)
    monkeypatch.setattr(os, "replace", replace_later)
    with pytest.raises(OSError, match="it fails once"):
        run_campaign(campaign_folder, out)
    assert len(read_campaign(out).table) == 2
    assert run_campaign(campaign_folder, out).campaign.table.equals(complete.table)


def test_other_files_are_refused_and_unchanged(campaign_folder, tmp_path):
    text, other = tmp_path / "text.parquet", tmp_path / "other.parquet"
    text.write_text("not a table")
    pq.write_table(pa.table({"a": [1]}), other)
    for path in (text, other):
        before = path.read_bytes()
        with pytest.raises(AnalysisError, match="give the file that `sautereau campaign`"):
            run_campaign(campaign_folder, path)
        assert path.read_bytes() == before
    with pytest.raises(AnalysisError, match="no such file"):
        read_campaign(tmp_path / "nothing.parquet")
    with pytest.raises(AnalysisError, match=r"use the file extension \.parquet"):
        run_campaign(campaign_folder, tmp_path / "table.csv")


def test_a_folder_without_recordings_is_refused(tmp_path):
    out = tmp_path / "table.parquet"
    faults = {tmp_path: "the folder holds no recordings", tmp_path / "nowhere": "no such folder"}
    for folder, fault in faults.items():
        with pytest.raises(AnalysisError, match=fault):
            run_campaign(folder, out)
    assert not out.exists()


def test_an_interrupted_campaign_is_continued(campaign_folder, complete, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_run, "BATCH", 1)
    out = tmp_path / "table.parquet"

    def stop(fraction):
        if round(fraction * GOOD) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), progress_to(stop):
        run_campaign(campaign_folder, out)
    assert len(read_campaign(out).table) == 3
    found = run_campaign(campaign_folder, out)
    assert (found.read, found.kept) == (GOOD - 3, 3)
    assert found.campaign.table.equals(complete.table)
