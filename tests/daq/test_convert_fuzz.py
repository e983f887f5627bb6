"""Damaged files of every format are refused with a reason, or give finite samples in time."""

import io
import json
import warnings
import wave

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from sautereau.daq.convert.export import export
from sautereau.daq.convert.formats import open_source
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording

ROWS = 64
VALUES = np.sin(np.arange(ROWS) / 5)
LONGEST = 20
"""s, for one file."""


def of_csv():
    return ("Model,X\nt (ms),v\n" + "".join(f"{n},{v}\n" for n, v in enumerate(VALUES))).encode()


def of_parquet():
    field = pa.field("v", pa.float64(), metadata={"unit": "V"})
    file = io.BytesIO()
    pq.write_table(pa.table([pa.array(VALUES)], schema=pa.schema([field])), file)
    return file.getvalue()


def of_wav():
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setnchannels(1)
        writer.setsampwidth(2)
        writer.setframerate(48_000)
        writer.writeframes((VALUES * 3e4).astype("<i2").tobytes())
    return file.getvalue()


def of_tdms():
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a", "v", VALUES, {"wf_increment": 1e-3})])
    return file.getvalue()


def of_mat():
    file = io.BytesIO()
    savemat(file, {"v": VALUES, "s": {"w": VALUES}}, do_compression=False)
    return file.getvalue()


def of_npz():
    file = io.BytesIO()
    np.savez(file, v=VALUES)
    return file.getvalue()


def of_h5():
    h5py = pytest.importorskip("h5py")
    file = io.BytesIO()
    with h5py.File(file, "w") as writer:
        writer["v"] = VALUES
        writer["v"].attrs["unit"] = "V"
    return file.getvalue()


FORMATS = {"csv": of_csv, "parquet": of_parquet, "wav": of_wav, "tdms": of_tdms, "mat": of_mat,
           "npz": of_npz, "h5": of_h5}  # fmt: skip
RATED = ("wav", "tdms")
"""Formats that hold a rate."""


APART = ("mat", "h5")
"""Formats that are read in a process of their own, which takes time to start."""


def changes(size):
    """Return a strategy of mutations of a file: bytes, a cut, and a stretch that is repeated."""
    place = st.integers(0, size - 1)
    some = st.lists(st.tuples(place, st.integers(0, 255)), min_size=1, max_size=8)
    head = st.lists(st.tuples(st.integers(0, 63), st.integers(0, 255)), min_size=1, max_size=4)
    return st.one_of(some, head, place, st.tuples(place, place))


def changed(data, change):
    if isinstance(change, int):
        return data[:change]
    if isinstance(change, tuple):
        a, b = sorted(change)
        return data[:b] + data[a:]
    found = bytearray(data)
    for place, byte in change:
        found[place % len(found)] = byte
    return bytes(found)


def check(folder, rig, kind, data):
    """Return whether a file is imported; whatever it holds, only a RecordingError may be raised."""
    path, out = folder / f"a.{kind}", folder / "a.mcap"
    path.write_bytes(data)
    scale = {"full_scale": {"velocity": "4 V"}} if kind == "wav" else {"unit": {"velocity": "V"}}
    options = ImportOptions(
        column={"velocity": "1" if kind == "wav" else "v"},
        without=("force",),
        rate=None if kind in RATED else "1 kHz",
        trigger="0 s",
        started="2026-02-03T04:05:06+01:00",
        simulated=False,
        **scale,
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of libraries, about damaged files
            import_file(path, out, rig=rig, options=options)
    except RecordingError:
        return out.exists()
    recorded = read_recording(out)
    assert np.isfinite(recorded.volts["velocity"]).all()
    assert recorded.rate > 0
    out.unlink()
    return True


@pytest.mark.parametrize("kind", FORMATS)
def test_an_intact_file_is_imported(tmp_path, paper, kind):
    assert check(tmp_path, paper, kind, FORMATS[kind]())


def fuzz(folder, rig, kind, examples):
    data = FORMATS[kind]()

    @settings(
        max_examples=examples,
        deadline=LONGEST * 1000,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(changes(len(data)))
    def run(change):
        check(folder, rig, kind, changed(data, change))

    run()


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files(tmp_path, paper, kind):
    fuzz(tmp_path, paper, kind, 2 if kind in APART else 25)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.text('0123456789.,;\t eE+-#="\nabµ', max_size=12), max_size=12))
def test_any_text_is_refused_or_read(tmp_path_factory, paper, lines):
    folder = tmp_path_factory.getbasetemp()
    check(folder, paper, "csv", "\n".join(lines).encode())


PREAMBLES = ("", "Model,X\nScale,1.5\nGain;2\n", "# a\n\n", "DATE = 3.2.2026\nMAX = 5,7\n")
NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=20),
    dialect=st.sampled_from([",.", ";,", ";.", "\t,", "\t.", " ."]),
    preamble=st.sampled_from(PREAMBLES),
    named=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n"]),
)
def test_a_table_in_any_dialect_comes_back_exactly_or_is_refused(
    tmp_path_factory, rows, dialect, preamble, named, ending
):
    delimiter, decimal = dialect
    lines = [delimiter.join(repr(x).replace(".", decimal) for x in row) for row in rows]
    lines = [*preamble.splitlines(), *[f"a{delimiter}b"] * named, *lines]
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    path.write_text(ending.join([*lines, ""]), newline="")
    source = open_source(path)
    if set(source.names) >= ({"a", "b"} if named else {"1", "2"}):
        try:
            read = source.read(list(source.names[:2]))
        except RecordingError:
            return
        found = np.column_stack(list(read.values()))
        assert np.array_equal(found, np.array(rows))


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("rate", 0, "rate: 0.0 Hz is not from 0"),
        ("rate", float("inf"), "rate: inf Hz"),
        ("t0_ns", 10**30, "t0_ns"),
        ("t0_ns", float("inf"), "cannot be read"),
        ("first_sample", 2**60, "first_sample"),
        ("events", [{"time": 0, "kind": "a", "text": ""}] * 200_000, "limit MOST_EVENTS = 100000"),
        ("events", [{"time": float("nan"), "kind": "a", "text": ""}], "no finite time"),
        ("plan", {"t": [0, 1], "q1": [0], "q2": [0], "jack_rise": [0]}, "plan: not columns"),
        ("rig", {}, "cannot be read"),
        ("session", None, "cannot be read"),
    ],
)
def test_metadata_of_an_export_beyond_what_a_recording_holds(
    tmp_path, complete_recording, key, value, word
):
    table = tmp_path / "table.csv"
    export(complete_recording, "csv", table, raw=True)
    document = tmp_path / "table.csv.json"
    document.write_text(json.dumps(json.loads(document.read_text()) | {key: value}))
    with pytest.raises(RecordingError, match=word):
        import_file(table, tmp_path / "back.mcap", rig=None, options=ImportOptions())
    document.write_text("[" * 100_000)
    with pytest.raises(RecordingError, match="metadata cannot be read"):
        import_file(table, tmp_path / "back.mcap", rig=None, options=ImportOptions())
