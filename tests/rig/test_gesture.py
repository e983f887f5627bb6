"""Files of gestures and touches: what is read, and what is refused with its line."""

import math

import pytest

from sautereau.rig.csv_files import read_gesture, read_touched_points
from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, with_values

GOOD = "time [s], rise [mm]\n0, 0\n0.01, 0.5\n0.02, 2\n"


@pytest.fixture
def file(tmp_path):
    def write(text, name="gesture.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


@pytest.fixture
def rig_with(paper_text, tmp_path, file):
    """Return a function that loads the paper's rig with a gesture's file beside it."""

    def load(text):
        file(text)
        gesture = 'hold = "point"\ngesture = { file = "gesture.csv" }'
        assert paper_text.count('hold = "point"\n') == 1
        path = tmp_path / "bench.toml"
        rig = paper_text.replace('hold = "point"\n', gesture + "\n").replace("\n", "\r\n")
        path.write_bytes(f"\ufeff{rig}".encode())  # as some editors write it
        return load_rig(path)

    return load


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        "time,rise\n0,0\n0.01,0.0005\n0.02,0.002\n",
        "rise (um), time (ms)\n0,0\n500,10\n2000,20\n",
        "time [s], note, rise [mm]\n0,start,0\n\n0.01,,0.5\n , ,\n0.02,end,2\n",
        "time [ms],rise [mm]\r\n0,0\r\n10,0.5\r\n20,2e0\r\n",
        b"\xef\xbb\xbf" + GOOD.encode(),
        "\ufefftime [ms];rise [mm]\r\n0;0\r\n10;0,5\r\n20;2,0e0\r\n",
    ],
)
def test_the_header_gives_the_units(rig_with, text):
    gesture = rig_with(text).press.gesture
    assert gesture.time == pytest.approx((0, 0.01, 0.02))
    assert gesture.rise == pytest.approx((0, 0.5e-3, 2e-3))


def test_the_file_lies_beside_the_rig_and_not_in_the_working_directory(
    rig_with, tmp_path, monkeypatch
):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert rig_with(GOOD).press.gesture is not None


def test_a_rig_with_a_gesture_reads_back(rig_with):
    rig = rig_with("time [s], rise [mm]\n0, 0\n0.0123, 0.1\n0.3, 7.7\n")
    assert rig_from_json(rig_json(rig)) == rig
    faster = with_values(rig, {"press.jack_speed": "0.1 m/s"})
    assert faster.press.gesture == rig.press.gesture


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "no column time and no rise; start the file with"),
        ("time [s]\n0\n", "no column rise;"),
        ("0, 0\n0.1, 1\n", "no column time and no rise"),
        ("time [s], rise [mm], rise [m]\n0,0,0\n", "names rise twice"),
        ("time [s], rise [mm]\n0, 0\n0.1, two\n", "line 3: rise: 'two mm' is not a number"),
        ("time [s], rise [mm]\n0, 0\n0.1\n", "line 3: rise: ' mm' is not a number"),
        ("time [s], rise [mm]\n0, nan\n", "line 2: rise: 'nan mm' is not a number"),
        ("time [s], rise [kg]\n0, 0\n", "line 2: rise: '0 kg' has the dimension"),
        ("time [s], rise [foo]\n0, 0\n", "line 2: rise: '0 foo' is not a number with a unit"),
        ("time [s], rise [mm]\n0, 1e999\n", "is not finite"),
        (b"time [s], rise [mm]\n0, 0 \xff\n", "cannot be read.*UTF-8"),
    ],
)
def test_a_bad_file_is_one_clear_message(file, text, fault):
    with pytest.raises(RigError, match=fault):
        read_gesture(file(text))


def test_many_bad_cells_are_counted(file):
    with pytest.raises(RigError, match=r"line 2: .*(\n.*){4}\n  and 3 more"):
        read_gesture(file("time [s], rise [mm]\n" + "0, x\n" * 8))


def test_a_file_that_does_not_exist(tmp_path):
    for name in ("nowhere.csv", "."):
        with pytest.raises(RigError, match="cannot be read"):
            read_gesture(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("time [s], rise [mm]\n0, 0\n0.02, 1\n0.01, 2\n", "start at 0 s and increase"),
        ("time [s], rise [mm]\n0.1, 0\n0.2, 1\n0.3, 2\n", "start at 0 s and increase"),
        ("time [s], rise [m]\n0, 0\n0.1, 1\n0.2, 2\n", "not within 0 to 15 mm; check the unit"),
        ("time [s], rise [mm]\n0, 1\n0.1, 2\n0.2, 3\n", "rise of 1 mm, not at 0 mm"),
        ("time [s], rise [mm]\n0, 0\n0.1, -1\n0.2, 3\n", "not within 0 to 15 mm"),
        ("time [s], rise [mm]\n0, 0\n0.1, 1\n", "3"),
        ("time [s], rise [mm]\n0, 0\n0.1, x\n", "line [0-9]+: press.gesture: gesture file"),
    ],
)
def test_a_gesture_that_no_jack_makes_is_refused(rig_with, text, fault):
    with pytest.raises(RigError, match=fault):
        rig_with(text)


def test_touches_are_counts_or_angles(paper, file):
    header = "point [mm], joint1 [{0}], joint2 [{0}]\n"
    quarter = paper.arm.counts_per_revolution // 4
    for unit, first, second in (("counts", quarter, -quarter), ("deg", 90, -90)):
        text = header.format(unit) + f"-171, {first}, {second}\n-140, 0, 0\n"
        touches = read_touched_points(file(text), paper.arm)
        assert touches.points == pytest.approx((-0.171, -0.14))
        assert touches.joints[0] == pytest.approx((math.pi / 2, -math.pi / 2))
        assert touches.joints[1] == (0, 0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("point [mm], joint1 [counts]\n", "touches file .*no column joint2"),
        ("point [mm], joint1 [counts], joint2 [counts]\n-171, a, 0\n", "line 2: joint1: 'a'"),
        ("point [mm], joint1 [counts], joint2 [mm]\n-171, 1, 0\n", "line 2: joint2: .*dimension"),
        ("point [counts], joint1 [deg], joint2 [deg]\n-1, 1, 0\n", "line 2: point"),
    ],
)
def test_bad_touches_are_refused(paper, file, text, fault):
    with pytest.raises(RigError, match=fault):
        read_touched_points(file(text), paper.arm)
