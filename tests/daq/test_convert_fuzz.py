"""Any table of text is read exactly or refused; damaged files of programs are in tests/fuzz."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.daq.convert.export import export
from sautereau.daq.convert.formats import open_source
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from tests.budget import examples

PREAMBLES = ("", "Model,X\nScale,1.5\nGain;2\n", "# a\n\n", "DATE = 3.2.2026\nMAX = 5,7\n")
NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)


@examples(20, 300)
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
    try:
        source = open_source(path)
        if not set(source.names) >= ({"a", "b"} if named else {"1", "2"}):
            return
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
        ("plan", {"t": [0, 1], "q1": [0], "q2": [0], "jack_rise": [0]}, "plan: its columns must"),
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
