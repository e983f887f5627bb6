"""What other programs see of a recording."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from sautereau.commands.recordings import targets
from sautereau.daq.convert.export import ENDING, export
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.signals.calibration import to_si, undo_high_pass
from sautereau.rig.errors import UsageError
from tests.recordings import write_recording


@pytest.fixture
def recording(tmp_path, record, volts):
    return record(tmp_path / "press.mcap", volts)


def load(path):
    if path.suffix == ".parquet":
        return pd.read_parquet(path)
    return pd.read_csv(path, engine="pyarrow")  # bit for bit, also with pandas 2


@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_raw_volts_are_there_bit_for_bit_in_pandas(tmp_path, recording, volts, to):
    out = tmp_path / f"table.{to}"
    assert export(recording, to, out, raw=True)[0] == out
    found = load(out)
    assert list(found.columns) == ["time [s]", "velocity [V]", "force [V]", "simulated"]
    assert np.array_equal(found["velocity [V]"].to_numpy().view(np.uint64), volts[0].view("u8"))
    assert np.array_equal(found["force [V]"].to_numpy().view(np.uint64), volts[1].view("u8"))
    assert np.array_equal(found["time [s]"], np.arange(5000) / 51_200)
    assert found["simulated"].all()


@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_si_values_stand_beside_them_with_their_lag_taken_back(tmp_path, recording, paper, to):
    """1.1 ms are 56.32 samples; what the sensor saw after the end is empty."""
    out = tmp_path / f"table.{to}"
    export(recording, to, out)
    found = load(out)
    assert list(found.columns)[1:5] == ["velocity [V]", "velocity [m/s]", "force [V]", "force [N]"]
    velocity = found["velocity [m/s]"]
    assert velocity.isna().sum() == 57
    assert velocity[: 5000 - 57].notna().all()
    seen = to_si(read_recording(recording).volts["velocity"], paper.daq.channels[0])
    felt = undo_high_pass(seen, paper.daq.channels[0].high_pass, 51_200.0)
    spectrum, expected = (np.abs(np.fft.rfft(x)[5:1000]) for x in (velocity[:4900], felt[56:4956]))
    assert np.median(spectrum / expected) == pytest.approx(1, rel=0.01)
    assert found["force [N]"].isna().sum() == 1


def test_parquet_carries_units_and_all_else(tmp_path, recording, paper, session):
    out = tmp_path / "table.parquet"
    export(recording, "parquet", out)
    schema = pq.read_schema(out)
    assert schema.field("velocity [m/s]").metadata[b"unit"] == b"m/s"
    assert b"delay of 0.0011 s" in schema.field("velocity [m/s]").metadata[b"what"]
    result = json.loads(schema.metadata[b"sautereau"])
    assert result["session"] == session.to_metadata()
    assert result["rig"]["values"]["name"] == paper.name
    assert result["source"]["name"] == "press.mcap"
    assert len(result["source"]["sha256"]) == 64
    assert result["software"]["mcap"]


def test_csv_is_a_plain_table_with_its_metadata_beside_it(tmp_path, recording):
    out = tmp_path / "table.csv"
    assert export(recording, "csv", out, raw=True) == [out, tmp_path / "table.csv.json"]
    first, second = out.read_text().splitlines()[:2]
    assert first == '"time [s]","velocity [V]","force [V]","simulated"'
    assert second.startswith("0,0.3455841920")
    assert second.endswith(",true")
    result = json.loads((tmp_path / "table.csv.json").read_text())
    assert result["columns"]["force [V]"]["unit"] == "V"


def test_what_was_measured_has_no_column_simulated(tmp_path, paper, session, volts):
    measured = replace(session, simulated=False)
    path = write_recording(tmp_path / "press.mcap", paper, volts, session=measured)
    export(path, "csv", tmp_path / "table.csv")
    assert "simulated" not in load(tmp_path / "table.csv").columns


def test_quality_flags_are_exported(tmp_path, record):
    volts = np.zeros((2, 2000))
    volts[1, 100:200] = 10.0
    export(record(tmp_path / "press.mcap", volts), "parquet", tmp_path / "table.parquet")
    result = json.loads(pq.read_schema(tmp_path / "table.parquet").metadata[b"sautereau"])
    (flag,) = result["quality_flags"]
    assert (flag["kind"], flag["channel"]) == ("clipped", "force")


@pytest.mark.parametrize("taken", ["table.csv", "table.csv.json"])
def test_nothing_is_overwritten_and_nothing_left_behind(tmp_path, recording, taken):
    (tmp_path / taken).write_text("precious")
    with pytest.raises(RecordingError, match="never overwritten"):
        export(recording, "csv", tmp_path / "table.csv")
    assert (tmp_path / taken).read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["press.mcap", taken]


def test_a_folder_that_is_not_there(tmp_path, recording):
    with pytest.raises(RecordingError, match="there is no folder"):
        export(recording, "parquet", tmp_path / "none" / "table.parquet")


def test_targets(tmp_path):
    files = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    assert targets(files, "csv", None) == [
        (files[0], tmp_path / "a.csv"),
        (files[1], tmp_path / "b.csv"),
    ]
    folder = tmp_path / "out"
    folder.mkdir()
    assert [t for _, t in targets(files, "csv", folder)] == [folder / "a.csv", folder / "b.csv"]
    assert targets(files[:1], "csv", tmp_path / "x.csv") == [(files[0], tmp_path / "x.csv")]
    assert targets(files[:1], "csv", tmp_path / "new") == [(files[0], tmp_path / "new" / "a.csv")]
    with pytest.raises(RecordingError, match=r"x\.csv: 2 files would be converted to it"):
        targets(files, "csv", tmp_path / "x.csv")


@pytest.mark.parametrize("name", ["a.parquet", "a.mcap", "a.v2"])
def test_a_file_is_not_written_with_the_extension_of_another_format(tmp_path, name):
    with pytest.raises(UsageError, match=r"use \.csv"):
        targets([Path("a.mcap")], "csv", tmp_path / name)


def test_targets_that_are_given_twice_are_all_named(tmp_path):
    files = [tmp_path / f"{name}.mcap" for name in "aabb"]
    with pytest.raises(RecordingError, match=r"(?s)a\.csv: 2 files would.*b\.csv: 2 files would"):
        targets(files, "csv", None)


def test_the_leftover_of_a_killed_export_is_replaced(tmp_path, recording):
    (tmp_path / f"table.csv{ENDING}").write_text("half")
    export(recording, "csv", tmp_path / "table.csv")
    assert len(list(tmp_path.glob(f"*{ENDING}"))) == 0
