"""Plans, tables and manifests of sessions."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_session
from sautereau.entrance import bench as benches
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.learning import IterativeLearning
from sautereau.robot.experiment.monitor import Samples
from sautereau.robot.experiment.plan import Plan, Row, check_same, read_plan_table, to_set
from sautereau.robot.experiment.planner import Planner, rows_of_recording
from sautereau.robot.experiment.session import Item, is_lifted, with_warm_ups
from sautereau.robot.experiment.session_folder import (
    MANIFEST,
    Manifest,
    SessionFolder,
    read_manifest,
    write_manifest,
)
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press
from tests.presses import QUICK, mute_scene
from tests.recordings import SESSION, write_recording
from tests.robot.motions import OFF

RIG = load_rig("paper")


@pytest.fixture
def table(tmp_path):
    def write(text: str):
        path = tmp_path / "plan.csv"
        path.write_text(text, encoding="utf-8")
        return read_plan_table(path, RIG, 2, "mine")

    return write


def record(path, session, item, number=1):
    """Write a complete recording of a press."""
    info = replace(SESSION, press=number, session=session, item=item)
    return write_recording(path, RIG, np.zeros((2, 64)), session=info)


def test_a_table_changes_the_values_of_its_cells(table):
    first, second = table(
        "\ufeffpress.jack_speed, jack.mass, press.speed_tolerance, press.hold, repeats, notes\n"
        '0.1 m/s, , 0.004, normal, 3, "a, b"\n'
        "\n"
        " , 7 g, , , , \n"
    )
    assert (first.rig.press.jack_speed, first.rig.press.speed_tolerance) == (0.1, 0.004)
    assert (first.rig.press.hold, first.repeats, first.notes) == ("normal", 3, "mine; a, b")
    assert first.set_up == {}
    assert second.rig.press == RIG.press
    assert (second.rig.jack.mass, second.repeats, second.notes) == (7e-3, 2, "mine")
    assert second.set_up == {"jack.mass": "7 g"}
    assert second.on(RIG) == RIG
    assert first.on(RIG) == first.rig


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_table_of_a_spreadsheet_with_decimal_commas(table, separator):
    text = "\ufeffpress.jack_speed;press.speed_tolerance;notes\r\n0,1 m/s;0,004;1,5 mm\r\n"
    (row,) = table(text.replace(";", separator))
    assert (row.rig.press.jack_speed, row.rig.press.speed_tolerance) == (0.1, 0.004)
    assert row.notes == "mine; 1,5 mm"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no columns"]),
        ("press.jack_speed\n", ["no row"]),
        ("press.jack_speed, press.jack_speed\n1 m/s, 2 m/s\n", ["twice"]),
        ("press.jack_speed, , repeats\n0.1 m/s,,1\n", ["column 2 has no name"]),
        ("press\nx\n", ["line 2"]),
        ("press.jack_speed\n0.1\n0.1 m/s, 3\n", ["line 2", "line 3: 2 cells"]),
        ("repeats\n0\n1.5\n-1\n1000000\n", ["line 2", "line 3", "line 4", "line 5"]),
        ("string.tensoin, press.hold\n1 N, sideways\n", ["'tension'", "'sideways'"]),
        ('press.jack_speed\n"0.1 m/s\n', ["cannot be read"]),
    ],
)
def test_every_fault_of_a_table_is_listed(table, text, words):
    with pytest.raises(RobotError) as caught:
        table(text)
    for word in words:
        assert word in str(caught.value)


def test_a_missing_table(tmp_path):
    with pytest.raises(RobotError, match=r"none\.csv: cannot be read"):
        read_plan_table(tmp_path / "none.csv", RIG, 1)


def test_a_table_that_changes_the_instrument_says_what_to_set():
    other = with_values(RIG, {"jack.mass": "7 g"})
    fast = with_values(RIG, {"press.jack_speed": "0.1 m/s"})
    mass = {"jack.mass": "7 g"}
    plan = Plan(RIG, (Row(RIG, 2), Row(fast, 1), Row(other, 1, mass), Row(RIG, 1)))
    assert plan.total == 5
    assert to_set(RIG, {}, plan.rows[2]) == mass
    assert to_set(RIG, mass, plan.rows[3]) == {"jack.mass": "0.006 kg"}


def test_a_table_names_the_plectrum_of_string_2(tmp_path):
    scene, key = load_scene("two-choirs"), "more_choirs.0.plectrum.overlap"
    two = scene.true_rig(RIG)
    path = tmp_path / "plan.csv"
    path.write_text("string2.plectrum.overlap,repeats\n0.2 mm,1\n")
    (row,) = read_plan_table(path, two, 1)
    assert row.rig.more_choirs[0].plectrum.overlap == pytest.approx(2e-4)
    assert to_set(two, {}, row) == {key: "0.2 mm"}
    assert to_set(two, row.set_up, Row(two)) == {key: "0.00025 m"}
    assert scene.overridden(row.set_up) == [key]
    assert load_scene("ideal").overridden(row.set_up) == []
    with pytest.raises(RobotError, match=r"more_choirs\.0\.plectrum\.overlap: .*has 0 of these"):
        read_plan_table(path, RIG, 1)


def test_an_empty_plan_is_refused_with_all_its_faults():
    with pytest.raises(RobotError, match=r"no press[\s\S]*-1 warm-up presses[\s\S]*nan s"):
        Plan(RIG, (), warm_up=-1, rest=float("nan"))


def test_a_recording_without_a_plan_is_replayed_as_measured(write_session, tmp_path):
    """The jack follows the measured rise within its noise, and the press is feasible."""
    (path,) = write_session(tmp_path, 1, noise=1e-4)
    (row,) = rows_of_recording(path, RIG, 2)
    manifest = Manifest("id", "2026-01-01T00:00:00Z", 3, Plan(RIG, (row,)).document(), {})
    write_manifest(tmp_path, manifest)
    assert read_manifest(tmp_path) == manifest
    assert (row.repeats, row.notes) == (2, "replay of press-0001.mcap")
    trajectory, _ = Planner()(row)
    law, measured = trajectory.law, load_press(path).data["jack_rise"]
    time = np.linspace(law.start, law.bottom, 5000)
    rise = law.law.at(time).position
    there = measured.index[np.argmax(measured.to_numpy() > 1e-3)]
    shift = there - time[np.argmax(rise > 1e-3)]
    followed = np.interp(time + shift, measured.index, measured)
    assert followed == pytest.approx(rise, abs=30e-6)


def test_addresses_of_devices_are_no_part_of_a_plan():
    moved = with_values(RIG, {"controller.port": "/dev/other", "daq.address": "host:1"})
    plan, other = Plan(RIG, (Row(RIG),)), Plan(moved, (Row(moved),))
    assert plan.document() == other.document()
    assert json.loads(json.dumps(plan.document())) == plan.document()


def test_a_manifest_is_read_back_and_replaced(tmp_path):
    assert read_manifest(tmp_path) is None
    manifest = Manifest("id", "2026-01-01T00:00:00Z", 3, Plan(RIG, (Row(RIG),)).document(), {})
    write_manifest(tmp_path, manifest)
    assert read_manifest(tmp_path) == manifest
    write_manifest(tmp_path, Manifest("id", "later", None, {}, {"jack.mass": "7 g"}))
    found = read_manifest(tmp_path)
    assert found
    assert found.set_up == {"jack.mass": "7 g"}
    assert [path.name for path in tmp_path.iterdir()] == [MANIFEST]


def test_what_no_reader_would_read_is_refused_before_anything_is_written(tmp_path):
    """Bytes that are not UTF-8 on the command line arrive as such characters."""
    byte = b"ma\xeetre".decode("utf-8", "surrogateescape")
    for make, said in (
        (lambda: SessionFolder(tmp_path / "a", Plan(RIG, (Row(RIG),)), 2**64, None), "seed"),
        (lambda: write_manifest(tmp_path, Manifest("id" * 101, "now", 3, {}, {})), "session"),
    ):  # fmt: skip
        with pytest.raises(RobotError, match=said):
            make()
    folder = SessionFolder(tmp_path, Plan(RIG, None), None, None)
    folder.start()
    before = (tmp_path / MANIFEST).read_bytes()
    with pytest.raises(RobotError, match="cannot be written"):
        folder.note_row(0, {"values": {}, "repeats": 0, "notes": "?", "answer": byte})
    folder.note_row(0, Row(RIG).document())
    assert len((tmp_path / MANIFEST).read_bytes()) > len(before)
    assert read_manifest(tmp_path)


def test_a_correction_that_could_not_be_read_again_is_not_learned():
    slow = with_values(RIG, {"press.bottom_hold": "25 s"})
    with pytest.raises(RobotError, match="points of its correction, 10000 at most"):
        IterativeLearning(slow, None, 3)


def test_the_first_cause_is_reported_where_the_folder_goes_away(tmp_path):
    """With the motors' state, and that the samples are lost."""
    out = tmp_path / "out"

    def watch(seen):
        if isinstance(seen, Samples) and out.exists():
            shutil.rmtree(out)

    bench = benches.stand_in(with_values(RIG, QUICK), mute_scene(), 0)
    with pytest.raises(RecordingError, match=r"warm-up-01\.mcap: cannot be written: No such") as e:
        bench.press(1, out=out, watch=watch)
    said = " ".join(e.value.__notes__)
    assert "warm-up-01.mcap.part was removed, with the samples recorded before" in said
    assert OFF in said
    assert f"{out} was removed or renamed" in said


@pytest.mark.parametrize("text", ["", "{", "[]", '{"version": 1}', '{"version": 2}', "\x00"])
def test_a_damaged_manifest_is_refused(tmp_path, text):
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(RobotError, match="another folder"):
        read_manifest(tmp_path)


def test_differences_are_named_and_counted(tmp_path):
    check_same(tmp_path, {"a": [1, {"b": None}]}, {"a": [1, {"b": None}]})
    started, asked = {str(i): i for i in range(20)}, {str(i): -i for i in range(20)}
    with pytest.raises(RobotError, match=r"1: 1 then, -1 now[\s\S]*and 11 more[\s\S]*--out"):
        check_same(tmp_path, started, asked)
    with pytest.raises(RobotError, match=r"a\.2: 3 then, nothing now"):
        check_same(tmp_path, {"a": [1, 3]}, {"a": [1]})


def test_a_folder_finds_its_presses_from_the_recordings(tmp_path):
    plan = Plan(RIG, (Row(RIG, 4),))
    folder = SessionFolder(tmp_path / "new" / "out", plan, None, 7)
    assert not folder.path.exists()
    assert (folder.done, folder.resumed, folder.seed) == ({}, False, 7)
    folder.start()
    made = [record(folder.path / f"press-000{i}.mcap", folder.session, i, i) for i in (1, 3)]
    record(folder.path / "press-0004.mcap", "another", 2)
    (folder.path / "press-0005.mcap.part").write_bytes(b"cut short")
    again = SessionFolder(folder.path, plan, None, 8)
    assert (again.session, again.seed, again.resumed) == (folder.session, 7, True)
    assert again.done == dict(zip((1, 3), made, strict=True))
    assert again.others == 1
    assert [path.name for path in again.left_behind] == ["press-0005.mcap.part"]
    again.note_set_up({"jack.mass": "7 g"})
    assert SessionFolder(folder.path, plan, 7, None).set_up == {"jack.mass": "7 g"}


@pytest.mark.parametrize(
    ("repeats", "extended"),
    [
        ((3, 2), True),
        ((3, 4), True),
        ((3, 2, 1), True),
        ((3, 1), False),
        ((4, 2), False),
        ((3,), False),
        ((3, 1, 1), False),
    ],
)
def test_a_session_is_extended_where_every_press_keeps_its_number(tmp_path, repeats, extended):
    plan = Plan(RIG, (Row(RIG, 3), Row(RIG, 2)))
    folder = SessionFolder(tmp_path, plan, None, 7)
    folder.start()
    before = (tmp_path / MANIFEST).read_bytes()
    asked = Plan(RIG, tuple(Row(RIG, n) for n in repeats))
    if not extended:
        with pytest.raises(RobotError, match=r"presses\."):
            SessionFolder(tmp_path, asked, None, 7)
        return
    again = SessionFolder(tmp_path, asked, None, 7)
    assert (tmp_path / MANIFEST).read_bytes() == before  # nothing is written before a press
    again.start()
    found = read_manifest(tmp_path)
    assert found is not None
    assert found.session == folder.session
    assert [row["repeats"] for row in found.plan["presses"]] == list(repeats)


def test_a_session_of_version_0_1_that_counted_its_warm_up_presses_continues(tmp_path):
    """Of 2 rows with a warm-up press each, the second press of the first row is missing."""
    other = {"jack.mass": "7 g"}
    plan = Plan(RIG, (Row(RIG, 2), Row(with_values(RIG, other), 1, other)), warm_up=1)
    folder = SessionFolder(tmp_path, plan, None, 7)
    folder.start()
    for item, warm_up in ((1, True), (2, False), (4, True), (5, False)):
        info = replace(SESSION, session=folder.session, item=item, warm_up=warm_up)
        write_recording(tmp_path / f"press-{item:04}.mcap", RIG, np.zeros((2, 64)), session=info)
    again = SessionFolder(tmp_path, replace(plan, warm_up=0), None, 7)
    names = {number: path.name for number, path in again.done.items()}
    assert names == {1: "press-0002.mcap", 3: "press-0005.mcap"}
    assert [path.name for path in again.warm_ups] == ["press-0001.mcap", "press-0004.mcap"]
    assert again.others == 0


def test_a_press_is_lifted_unless_it_starts_where_the_last_has_ended():
    first, *others = (
        plan_press(with_values(RIG, values))
        for values in ({}, {"press.jack_speed": "0.1 m/s"}, {"arm.fingertip_radius": "5 mm"})
    )
    assert [is_lifted(first, last) for last in (None, *others)] == [True, False, True]


def test_rows_that_differ_do_not_extend_a_session(tmp_path):
    SessionFolder(tmp_path, Plan(RIG, (Row(RIG, 1),)), None, 7).start()
    with pytest.raises(RobotError, match=r"presses\.1\.notes"):
        SessionFolder(tmp_path, Plan(RIG, (Row(RIG, 2, notes="other"),)), None, 7)


def test_a_press_that_exists_twice_is_refused(tmp_path):
    plan = Plan(RIG, (Row(RIG, 2),))
    folder = SessionFolder(tmp_path, plan, None, None)
    folder.start()
    for number in (1, 2):
        record(tmp_path / f"press-000{number}.mcap", folder.session, 1)
    with pytest.raises(RobotError, match=r"press-0002\.mcap and press-0001\.mcap are both press 1"):
        SessionFolder(tmp_path, plan, None, None)


def test_the_session_is_read_from_the_head_alone(tmp_path):
    path = record(tmp_path / "press-0001.mcap", "id", 5)
    found = read_session(path)
    assert (found.session, found.item, found.warm_up) == ("id", 5, False)
    content = path.read_bytes()
    start = content.index(b"\7\0\0\0session") - 9
    end = start + 9 + int.from_bytes(content[start + 1 : start + 9], "little")
    for size in (20_000, end + 20, end):  # the record after it may be truncated
        path.write_bytes(content[:size])
        assert read_session(path) == found
    path.write_bytes(content[: end - 1])
    with pytest.raises(RecordingError, match="beyond its section"):
        read_session(path)


def test_warm_up_presses_precede_every_press_from_a_lift():
    low, high = (plan_press(with_values(RIG, {"press.hold": hold})) for hold in ("point", "normal"))
    items = [Item(RIG, plan, n) for n, plan in enumerate((low, low, high), 1)]
    made = [(item.number, item.trajectory is low) for item in with_warm_ups(items, 2)]
    first = [(None, True), (None, True), (1, True), (2, True)]
    assert made == [*first, (None, False), (None, False), (3, False)]
    assert [item.warm_up for item in with_warm_ups(items[:1], 2)] == [True, True, False]
    assert [item.number for item in with_warm_ups(items[:2], 0)] == [1, 2]
    assert len(list(with_warm_ups(items, 2, lambda: False))) == 1
