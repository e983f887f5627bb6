"""Notes and plans that no recording or manifest could hold are refused before a bench starts."""

from dataclasses import replace

import pytest

from sautereau.daq.errors import RecordingError
from sautereau.entrance.bench import stand_in
from sautereau.entrance.learning import Learning
from sautereau.entrance.pressing import Observer, Pressing, Settings
from sautereau.rig.disk import TEXT_LIMIT
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment import session_folder
from sautereau.robot.experiment.session_folder import Manifest, read_manifest, write_manifest
from sautereau.robot.experiment.steps import Step

LATIN_1 = "caf\udce9"  # Notes of a terminal with another encoding, as Python reads them
LONG = "x" * 2_500_000
MANIFEST = Manifest("a", "2026-02-03T04:05:06+01:00", None, {"rig": {}, "presses": []}, {})


@pytest.fixture
def bench():
    return stand_in("paper", "ideal", 1)


@pytest.mark.parametrize(("notes", "said"), [(LATIN_1, "UTF-8"), (LONG, "2500000 bytes")])
def test_notes_of_a_session(tmp_path, bench, notes, said):
    out = tmp_path / "s"
    with pytest.raises(RecordingError, match=said):
        Pressing(bench, 2, out, Settings(notes=notes))
    with pytest.raises(RecordingError, match=said):
        Learning(bench, 2, out, notes, None)
    assert not out.exists()


@pytest.mark.parametrize(("notes", "said"), [(LATIN_1, "UTF-8"), (LONG, "2500000 bytes")])
def test_notes_of_a_program(tmp_path, bench, notes, said):
    def program():
        yield Step(1, {}, notes)

    with pytest.raises(RecordingError, match=said):
        Pressing(bench, program, tmp_path / "s").run(Observer())
    assert not (tmp_path / "s" / session_folder.MANIFEST).exists()


def test_a_manifest_that_is_written_is_read_back(tmp_path):
    plan = {"rig": {}, "presses": [{"values": {}, "notes": "é" * 1_000_000}]}
    manifest = replace(MANIFEST, plan=plan)
    write_manifest(tmp_path, manifest)
    assert read_manifest(tmp_path).plan["presses"] == plan["presses"]


@pytest.mark.parametrize(
    ("notes", "said"), [("x" * TEXT_LIMIT, "8 MB at most"), (LATIN_1, "surrogate")]
)
def test_a_manifest_that_could_not_be_read_is_not_written(tmp_path, notes, said):
    write_manifest(tmp_path, MANIFEST)
    plan = {"rig": {}, "presses": [{"values": {}, "notes": notes}]}
    with pytest.raises(RobotError, match=said):
        write_manifest(tmp_path, replace(MANIFEST, plan=plan))
    assert read_manifest(tmp_path).session == "a"
