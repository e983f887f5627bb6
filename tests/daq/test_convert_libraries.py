"""Files that a library reads in a program of its own: instruments' files, workbooks, sound."""

import pickle
import re
import sqlite3
import struct
import sys
import zipfile
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from sautereau.daq.convert import from_arrays
from sautereau.daq.convert.formats import open_source
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.convert.times import own_axis
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import MissingExtraError
from tests.budget import slow

N, RATE = 400, 1000.0
T = np.arange(N) / RATE
V = np.sin(2 * np.pi * 20 * T).round(6)
F = np.cos(2 * np.pi * 20 * T).round(6)
HEAD = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
X_Columns\t{columns}
Date\t2013/01/05
***End_of_Header***\t
\t
"""
SEGMENT = """Channels\t2\t\t
Samples\t{n}\t{n}\t
Y_Unit_Label\tmm/s\tN\t
X0\t0.5\t0.5\t
Delta_X\t0.001\t0.001\t
***End_of_Header***\t\t\t
"""


def lvm(columns="One", decimal=".", stated=N, segments=1):
    """A LabVIEW measurement file, as NI's specification 4139 describes it."""
    names = {"Multi": "X_Value\tvel\tX_Value\tforce\tComment"}.get(
        columns, "X_Value\tvel\tforce\tComment"
    )
    pattern = {
        "No": "\t{v}\t{f}\t",
        "One": "{t}\t{v}\t{f}\t",
        "Multi": "{t}\t{v}\t{t}\t{f}\t",
    }[columns]
    rows = [pattern.format(t=0.5 + t, v=v, f=f) for t, v, f in zip(T, V, F, strict=True)]
    segment = "\n".join([SEGMENT.format(n=stated) + names, *rows, ""])
    text = HEAD.format(decimal=decimal, columns=columns) + "\n".join([segment] * segments)
    return text.replace(".", decimal) if decimal == "," else text


def uff(binary=False, kind=1, spacing=1, stated=N, cut=0):
    """Two functions of a universal file, as the format's description of dataset 58 has them."""
    parts = []
    for node, values, unit in ((1, V, "mm/s"), (2, F, "N")):
        size = f"b{1:6}{2:6}{11:12}{8 * N:12}{0:6}{0:6}{0:12}{0:12}" if binary else ""
        head = [
            "    -1",
            f"    58{size}",
            *["a press"] * 5,
            f"{kind:5}{0:10}{0:5}{0:10} {'NONE':10}{node:10}{3:4} {'NONE':10}{0:10}{0:4}",
            f"{4:10}{stated:10}{spacing:10}{0.5:13.5e}{1 / RATE:13.5e}{0:13.5e}",
            f"{17:10}{0:5}{0:5}{0:5} {'Time':20} {'s':20}",
            f"{11:10}{0:5}{0:5}{0:5} {'Response':20} {unit:20}",
            *[f"{0:10}{0:5}{0:5}{0:5} {'NONE':20} {'NONE':20}"] * 2,
        ]
        body = "\n".join(head).encode() + b"\n"
        if binary:
            body += struct.pack(f"<{N}d", *values) + b"\n"
        elif spacing:
            rows = values.reshape(-1, 4)
            body += "".join("".join(f"{x:20.12e}" for x in row) + "\n" for row in rows).encode()
        else:
            pairs = zip(0.5 + T, values, strict=True)
            body += "".join(f"{t:13.5e}{x:20.12e}\n" for t, x in pairs).encode()
        parts.append(body + b"    -1\n")
    return b"".join(parts)[: -cut or None]


def workbook(path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "press"
    sheet.append(["A press, 2026"])
    sheet.append(["t (s)", "vel (mm/s)", "force (N)", "when", "remark"])
    begun = datetime(2026, 2, 3, 4, 5, 6)
    for n, (t, v, f) in enumerate(zip(T, V, F, strict=True)):
        when = begun + timedelta(milliseconds=n)
        sheet.append([float(t), float(v), float(f), when, "start" if n == 0 else None])
    book.create_sheet("empty")
    book.save(path)


def mdf(path, version="4.10", compression=0, groups=1, **conversion):
    """A measurement of ASAM's format, written by asammdf."""
    asammdf = pytest.importorskip("asammdf")
    made = asammdf.MDF(version=version)
    made.start_time = datetime(2026, 2, 3, 4, 5, 6, tzinfo=UTC)
    counts = np.rint(F * 1000).astype(np.int16)
    for _ in range(groups):
        made.append(
            [
                asammdf.Signal(V, 0.5 + T, unit="mm/s", name="vel", conversion=conversion or None),
                asammdf.Signal(
                    counts, 0.5 + T, unit="N", name="force", conversion={"a": 1e-3, "b": 2.0}
                ),
                asammdf.Signal(np.array([b"note"] * N), 0.5 + T, name="text", encoding="utf-8"),
            ]
        )
    saved = made.save(path, overwrite=True, compression=compression)
    made.close()
    saved.replace(path)  # of version 3 it takes the extension .mdf, whatever was asked


def begun(n):
    """The date of a message, ns since 1970: not a multiple of 1 us, as clocks give it."""
    return 1_770_000_000_000_000_100 + n * 1_000_000


LITTLE_ENDIAN = b"\0\1\0\0"  # Head of a message in CDR


def bag(path, definition=b"float64 data\n", kind="std_msgs/msg/Float64", pack="d"):
    """A bag of ROS 2, of other writers than rosbags: mcap, or sqlite3 as before ROS 2 Iron."""
    messages = [(begun(n), LITTLE_ENDIAN + struct.pack(f"<{pack}", v)) for n, v in enumerate(V)]
    if path.suffix == ".db3":
        database = sqlite3.connect(path)
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
        )
        database.execute("INSERT INTO topics VALUES (1, '/laser', ?, 'cdr', '')", [kind])
        database.executemany("INSERT INTO messages VALUES (NULL, 1, ?, ?)", messages)
        database.commit()
        database.close()
        return
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "a test")
        schema = writer.register_schema(kind, "ros2msg", definition)
        channel = writer.register_channel("/laser", "cdr", schema, {"offered_qos_profiles": ""})
        for date, message in messages:
            writer.add_message(channel, date, message, date)
        writer.finish()


def stamped(path):
    """Forces with their own stamps, and the velocity, by rosbags: of ROS 1, or of ROS 2."""
    rosbags = pytest.importorskip("rosbags.typesys")
    first = path.suffix == ".bag"
    store = rosbags.get_typestore(
        rosbags.Stores.ROS1_NOETIC if first else rosbags.Stores.ROS2_HUMBLE
    )
    if first:
        from rosbags.rosbag1 import Writer

        writer, pack = Writer(path), store.serialize_ros1
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        kinds = {".mcap": StoragePlugin.MCAP, ".db3": StoragePlugin.SQLITE3}
        writer = Writer(path.parent / path.stem, version=8, storage_plugin=kinds[path.suffix])
        pack = store.serialize_cdr
    types = store.types
    header, wrench = types["std_msgs/msg/Header"], types["geometry_msgs/msg/WrenchStamped"]
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    with writer:
        scale = writer.add_connection("/scale", wrench.__msgtype__, typestore=store)
        laser = writer.add_connection("/laser", "std_msgs/msg/Float64", typestore=store)
        for n in range(N):
            stamp = time(*divmod(begun(n) - 300_000, 10**9))
            head = header(**({"seq": n} if first else {}), stamp=stamp, frame_id="key")
            zero = vector(0.0, 0.0, 0.0)
            force = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, F[n]), zero)
            writer.write(scale, begun(n), pack(wrench(head, force), wrench.__msgtype__))
            velocity = types["std_msgs/msg/Float64"](V[n])
            writer.write(laser, begun(n), pack(velocity, "std_msgs/msg/Float64"))
    return path if first else path.parent / path.stem / path.name


def read(path, *names):
    source = open_source(path)
    found = source.read(list(names))
    return source, [found[name] for name in names]


@pytest.mark.parametrize(
    ("columns", "decimal"),
    [("No", "."), ("Multi", ","), slow("One", "."), slow("No", ","), slow("Multi", ".")],
)
def test_labview(tmp_path, columns, decimal):
    pytest.importorskip("lvm_read")
    path = tmp_path / "a.lvm"
    path.write_text(lvm(columns, decimal))
    source, (v, f) = read(path, "vel", "force")
    assert np.array_equal(v, V)
    assert np.array_equal(f, F)
    assert (source.units["vel"], source.units["force"]) == ("mm/s", "N")
    assert source.rates["vel"] == source.rates["force"] == RATE
    assert source.starts["force"] == 0.5
    if columns != "No":
        times = [name for name in source.names if name.startswith("X_Value")]
        assert len(times) == (2 if columns == "Multi" else 1)
        assert np.allclose(source.read(times)[times[-1]], 0.5 + T)


def test_labview_with_segments_and_a_pickle_beside_it(tmp_path):
    pytest.importorskip("lvm_read")
    path = tmp_path / "a.lvm"
    path.write_text(lvm(segments=2))
    (tmp_path / "a.lvm.pkl").write_bytes(pickle.dumps({"Segments": 0}))
    _, (v, w) = read(path, "segment(1).vel", "segment(2).vel")
    assert np.array_equal(v, V)
    assert np.array_equal(w, V)


@pytest.mark.parametrize("ending", ["uff", "unv"])
@pytest.mark.parametrize("binary", [False, True])
def test_universal_files(tmp_path, binary, ending):
    pytest.importorskip("pyuff")
    path = tmp_path / f"a.{ending}"
    path.write_bytes(uff(binary))
    source, (v, f) = read(path, "1Z", "2Z")
    assert source.names == ("1Z", "2Z")
    assert np.array_equal(v, V)
    assert np.array_equal(f, F)
    assert dict(source.units) == {"1Z": "mm/s", "2Z": "N"}
    assert dict(source.rates) == {"1Z": RATE, "2Z": RATE}
    assert dict(source.starts) == {"1Z": 0.5, "2Z": 0.5}


def test_a_universal_file_with_its_own_times(tmp_path):
    pytest.importorskip("pyuff")
    path = tmp_path / "a.uff"
    path.write_bytes(uff(spacing=0))
    source, (v, t) = read(path, "1Z", "1Z times")
    assert np.array_equal(v, V)
    assert np.allclose(t, 0.5 + T, atol=5e-6)
    assert not source.rates


def test_a_workbook_is_read_as_a_table(tmp_path, paper):
    workbook(path := tmp_path / "a.xlsx")
    source, (v, when) = read(path, "vel (mm/s)", "when")
    assert np.array_equal(v, V)
    assert np.allclose(when, T)
    assert source.units["force (N)"] == "N"
    assert "sheet 'press', one of 2" in source.guess
    options = ImportOptions(
        column={"velocity": "vel (mm/s)", "force": "force (N)"},
        time="t (s)",
        trigger="0 s",
        started="2026-02-03T04:05:06Z",
        simulated=False,
    )
    made = import_file(path, tmp_path / "a.mcap", rig=paper, options=options)
    assert made.rate == RATE
    assert np.allclose(read_recording(made.path).volts["velocity"], V * 1e-3 / 0.025)


@pytest.mark.parametrize(
    ("version", "compression"), [("4.10", 2), slow("4.10", 0), slow("3.30", 0)]
)
def test_measurement_data_of_asam(tmp_path, version, compression):
    path = tmp_path / f"a.{'mdf' if version < '4' else 'mf4'}"
    mdf(path, version, compression)
    source, (v, f, t) = read(path, "vel", "force", "time")
    assert source.names == ("time", "vel", "force")
    assert np.array_equal(v, V)
    assert np.allclose(f, np.rint(F * 1000) * 1e-3 + 2.0, rtol=1e-15)
    assert np.array_equal(t, 0.5 + T)
    assert dict(source.units) == {"time": "s", "vel": "mm/s", "force": "N"}
    assert datetime.fromisoformat(source.dates["vel"]) == datetime(2026, 2, 3, 4, 5, 6, tzinfo=UTC)


def test_measurement_data_of_several_groups_and_a_formula(tmp_path):
    """A formula is text of a file, which is never evaluated."""
    mdf(path := tmp_path / "a.mf4", groups=2, formula="X * 2")
    source = open_source(path)
    assert source.names[3:] == ("group(2)/time", "group(2)/vel", "group(2)/force")
    with pytest.raises(RecordingError, match="formula"):
        source.read(["group(1)/vel"])


def test_no_copy_of_damaged_measurement_data_is_left(tmp_path, monkeypatch):
    """By the flag of an unfinished file asammdf makes a copy, and it always makes a file."""
    flagged = bytearray(made_by(mdf, "a.mf4", cut=3000))
    flagged[60] = 1
    (tmp_path / "a.mf4").write_bytes(flagged)
    monkeypatch.setenv("TMPDIR", str(copies := tmp_path / "copies"))
    copies.mkdir()
    with pytest.raises(RecordingError, match="damaged"):
        open_source(tmp_path / "a.mf4")
    assert not list(copies.iterdir())


def test_measurement_data_of_another_writer(tmp_path):
    mf4_rs = pytest.importorskip("mf4_rs")
    writer = mf4_rs.MdfWriter(str(path := tmp_path / "a.mf4"))
    writer.init_mdf_file()
    group = writer.add_channel_group("press")
    writer.add_time_channel(group, "t")
    writer.add_float_channel(group, "vel")
    writer.start_data_block(group)
    writer.write_columns(group, [0.5 + T, V], ["f64", "f64"])
    writer.finish_data_block(group)
    writer.finalize()
    _, (t, v) = read(path, "t", "vel")
    assert np.array_equal(t, 0.5 + T)
    assert np.array_equal(v, V)


@pytest.mark.parametrize("ending", ["mcap", "db3"])
def test_bags_of_other_writers(tmp_path, ending, paper):
    pytest.importorskip("rosbags")
    bag(path := tmp_path / f"a.{ending}")
    source, (v, t) = read(path, "/laser/data", "/laser/times")
    assert source.names == ("/laser/times", "/laser/data")
    assert np.array_equal(v, V)
    assert np.allclose(t, T, atol=1e-12)
    options = ImportOptions(
        column={"velocity": "/laser/data"},
        unit={"velocity": "mm/s"},
        without=("force",),
        time="/laser/times",
        trigger="0 s",
        simulated=False,
    )
    made = import_file(path, tmp_path / "out.mcap", rig=paper, options=options)
    assert made.rate == RATE
    assert read_recording(made.path).t0_ns == begun(0) // 1000 * 1000


@pytest.mark.parametrize("ending", ["bag", slow("mcap"), slow("db3")])
def test_bags_with_stamps(tmp_path, ending):
    path = stamped(tmp_path / f"a.{ending}")
    names = "/scale/wrench.force.z", "/laser/data", "/scale/header.stamp", "/scale/times"
    source, (f, v, stamps, times) = read(path, *names)
    assert np.array_equal(f, F)
    assert np.array_equal(v, V)
    assert np.allclose(times, T, atol=1e-12)
    assert np.allclose(stamps, T - 3e-4, atol=1e-12)
    assert ("/scale/header.seq" in source.names) == (ending == "bag")


FLOAT = "std_msgs/msg/Float64"
HOSTILE = (
    ("std_msgs/msg/X:\n    import os; os.mkdir('made')\nclass Y", "float64 data\n"),
    ('std_msgs/msg/X"""\nimport os; os.mkdir("made")\n"""', "float64 data\n"),
    (FLOAT, "float64 data\nuint8 A=__import__('os').mkdir('made')\n"),
    (FLOAT, "float64 data\nstring A='\\n\"\"\"\nimport os; os.mkdir('made')\n"),
    (FLOAT, "float64 data\nint32 a); __import__('os').mkdir('made'\n"),
)


@pytest.mark.parametrize(("kind", "definition"), [HOSTILE[0], *(slow(*one) for one in HOSTILE[1:])])
def test_no_definition_of_a_message_is_code(tmp_path, monkeypatch, kind, definition):
    """rosbags makes Python of the definitions that a bag holds."""
    pytest.importorskip("rosbags")
    monkeypatch.chdir(tmp_path)
    bag(path := tmp_path / "a.mcap", definition.encode(), kind)
    with suppress(RecordingError):
        open_source(path)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(("ending", "subtype"), [("flac", "PCM_24"), ("w64", "DOUBLE")])
def test_sound_files(tmp_path, ending, subtype):
    soundfile = pytest.importorskip("soundfile")
    path = tmp_path / f"a.{ending}"
    soundfile.write(path, np.stack([V, F], axis=1) / 2, 48_000, subtype=subtype)
    source, (v, f) = read(path, "1", "2")
    tolerance = 2.0**-23 if subtype == "PCM_24" else 0.0
    assert np.abs(v - V / 2).max() <= tolerance
    assert np.abs(f - F / 2).max() <= tolerance
    assert source.full_scale
    assert source.rates["1"] == 48_000


def test_an_array_of_numpy(tmp_path):
    np.save(tmp_path / "a.npy", np.stack([V, F], axis=1))
    _, (v, f) = read(tmp_path / "a.npy", "data(1)", "data(2)")
    assert np.array_equal(v, V)
    assert np.array_equal(f, F)
    np.save(tmp_path / "t.npy", np.stack([T, V, F], axis=1))
    assert own_axis(open_source(tmp_path / "t.npy"), "data(3)", "data(1)") is None
    np.savez(tmp_path / "t.npz", t=np.stack([T, T + 1], axis=1), v=np.stack([V, F], axis=1))
    assert own_axis(open_source(tmp_path / "t.npz"), "v(2)", "t(1)") == "t(2)"
    np.save(tmp_path / "b.npy", np.array([(1, 2.5), (2, 3.5)], [("t", "i4"), ("v", "f8")]))
    assert open_source(tmp_path / "b.npy").names == ("data.t", "data.v")


def bomb(path):
    """A workbook whose sheet has 400 MB of rows and is 1 MB."""
    workbook(path)
    with zipfile.ZipFile(path) as book:
        parts = {name: book.read(name) for name in book.namelist()}
    begin, rows, end = parts["xl/worksheets/sheet1.xml"].partition(b"</row>")
    parts["xl/worksheets/sheet1.xml"] = (
        begin + rows + b"<row><c><v>1</v></c></row>" * 15_000_000 + end
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        for name, part in parts.items():
            book.writestr(name, part)


HUGE = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000,), }"


def made_by(write, name, cut=0, **options):
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path, **options)
        return path.read_bytes()[: -cut or None]


FAULTS = {
    "cut.mf4": (lambda: made_by(mdf, "a.mf4", cut=3000), "MDF"),
    "unfinished.mf4": (lambda: b"UnFinMF " + made_by(mdf, "a.mf4")[8:], "never finished"),
    "archive.mf4": (lambda: b"PK\x03\x04" + bytes(100), "MDF"),
    "cut.mcap": (lambda: made_by(bag, "a.mcap", cut=3000), "ROS bag"),
    "cut.db3": (lambda: made_by(bag, "a.db3", cut=5000), "ROS bag"),
    "other.mcap": (lambda: made_by(bag, "a.mcap", definition=b"float64[9] data\n"), "ROS bag"),
    "junk.bag": (lambda: b"#ROSBAG V2.0\n" + b"\xff" * 300, "ROS bag"),
    "cut.lvm": (lambda: lvm(stated=N + 1).encode(), "has 400 of 401"),
    "other.lvm": (lambda: b"a,b\n1,2\n", "no data segment"),
    "empty.lvm": (lambda: b"", "lvm"),
    "nested.lvm": (
        lambda: lvm().replace("Channels\t2", "Channels\t" + "[" * 3000).encode(),
        "lvm file",
    ),
    "cut.uff": (lambda: uff(cut=3000), "no end"),
    "short.uff": (lambda: uff(stated=N + 1), "has 400 of 401"),
    "spectrum.uff": (lambda: uff(kind=12), "spectra"),
    "junk.unv": (lambda: b"\xff" * 1000, "no vector"),
    "junk.xlsx": (lambda: b"PK\x03\x04" + bytes(100), "workbook"),
    "junk.flac": (lambda: b"fLaC" + b"\xff" * 300, "sound"),
    "huge.npy": (lambda: HUGE.ljust(127) + b"\n" + bytes(80), "numpy"),
    "object.npy": (lambda: pickled(), "allow_pickle"),
    "a.svd": (lambda: b"", "universal file"),
}


def pickled():
    import io

    file = io.BytesIO()
    np.save(file, np.array([{}, "a"], dtype=object), allow_pickle=True)
    return file.getvalue()


QUICK = (
    "cut.lvm",
    "cut.mf4",
    "cut.mcap",
    "nested.lvm",
    "junk.unv",
    "junk.xlsx",
    "object.npy",
    "a.svd",
)


@pytest.mark.parametrize("name", [n if n in QUICK else slow(n) for n in FAULTS])
def test_damaged_and_hostile_files_are_refused_in_a_sentence(tmp_path, name):
    content, words = FAULTS[name]
    (tmp_path / name).write_bytes(content())
    with pytest.raises(RecordingError, match=words) as caught:
        open_source(tmp_path / name)
    assert "Traceback" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_workbook_may_have_more_rows_than_it_states(tmp_path):
    workbook(path := tmp_path / "a.xlsx")
    with zipfile.ZipFile(path) as book:
        parts = {name: book.read(name) for name in book.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    parts[sheet] = re.sub(rb'(<dimension ref="A1:\w+?)\d+"', rb'\g<1>9"', parts[sheet])
    assert b'9"' in parts[sheet]
    with zipfile.ZipFile(path, "w") as book:
        for name, part in parts.items():
            book.writestr(name, part)
    _, (time, velocity) = read(path, "t (s)", "vel (mm/s)")
    np.testing.assert_array_equal(time, T)
    np.testing.assert_array_equal(velocity, V)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="it limits no memory")
def test_a_workbook_that_unpacks_to_much_more_is_refused_within_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(from_arrays, "MOST_VALUES", 10_000_000)
    bomb(path := tmp_path / "a.xlsx")
    assert path.stat().st_size < 3e6
    with pytest.raises(RecordingError, match=r"MOST_VALUES|memory"):
        open_source(path)


def test_a_reader_that_takes_too_much_memory_ends_in_a_sentence(tmp_path, monkeypatch):
    if sys.platform == "win32":
        pytest.skip("it limits no memory")
    monkeypatch.setattr(from_arrays, "MOST_VALUES", 1_000)
    np.save(tmp_path / "a.npy", np.zeros(100_000_000, dtype=np.uint8))
    with pytest.raises(RecordingError, match=r"MemoryError|MOST_VALUES"):
        open_source(tmp_path / "a.npy")


BUSY = """
import sys, time
from sautereau.daq.convert.readers.__main__ import limit
limit(1e9, int(sys.argv[-1]))
while "{name}" == "busy" or time.sleep(60):
    pass
"""


@pytest.mark.skipif(sys.platform == "win32", reason="it limits no processor time")
@pytest.mark.parametrize(("name", "limit"), [("busy", "LONGEST = 1 s of pro"), ("hung", "HANGING")])
def test_the_limit_of_time_is_of_the_reader_and_not_of_a_busy_machine(
    tmp_path, monkeypatch, name, limit
):
    (tmp_path / "reader.py").write_text(BUSY.format(name=name))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(from_arrays, "READERS", "reader")
    monkeypatch.setattr(from_arrays, "LONGEST", 1)
    if name == "hung":
        monkeypatch.setattr(from_arrays, "HANGING", 3)
    np.save(tmp_path / "a.npy", V)
    with pytest.raises(RecordingError, match=limit):
        open_source(tmp_path / "a.npy")


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    (tmp_path / "a.lvm").write_text(lvm())
    monkeypatch.setattr("sautereau.rig.errors.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"sautereau\[formats\]"):
        open_source(tmp_path / "a.lvm")


TABLES = {
    "drawn.txt": "| t (s) | v (mm/s) |\n|:------|-----:|\n| 0.000 | 1.5 |\n| 0.001 | -2.5 |\n",
    "framed.log": "+---+---+\n| t | v |\n+===+===+\n| 0.000 | 1.5 |\n| 0.001 | -2.5 |\n+---+---+\n",
    "pipes.txt": "t|v\n0,000|1,5\n0,001|-2,5\n",
    "quoted.csv": "'t';'v'\n'0.000';'1.5'\n'0.001';'-2.5'\n",
    "quoted.asc": '"t" "v"\n"0.000" "1.5"\n"0.001" "-2.5"\n',
    "minus.csv": "t,v\n0.000,1.5\n0.001,\N{MINUS SIGN}2.5\n",
    "fortran.prn": "  t   v\n  0.0000D+00  1.5000D+00\n  1.0000d-03 -0.2500D+01\n",
}


@pytest.mark.parametrize("name", TABLES)
def test_text_tables_of_other_programs(tmp_path, name):
    (tmp_path / name).write_text(TABLES[name], encoding="utf-8")
    source = open_source(tmp_path / name)
    t, v = source.read(list(source.names)).values()
    assert [name.split()[0] for name in source.names] == ["t", "v"]
    assert t.tolist() == [0.0, 0.001]
    assert v.tolist() == [1.5, -2.5]


def test_a_recording_of_ours_needs_no_import():
    with pytest.raises(RecordingError, match="it is a recording already"):
        open_source(Path(__file__).parents[1] / "data" / "format_1.mcap", ImportOptions())
