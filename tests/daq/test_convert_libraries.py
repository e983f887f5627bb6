"""Files that a library reads in a program of its own: instruments' files, workbooks, sound."""

import pickle
import re
import struct
import sys
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pytest

from sautereau.daq.convert import from_arrays
from sautereau.daq.convert.formats import open_source
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
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
FAULTS = {
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


QUICK = ("cut.lvm", "nested.lvm", "junk.unv", "junk.xlsx", "object.npy", "a.svd")


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
