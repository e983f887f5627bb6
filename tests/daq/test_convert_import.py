"""Files of other programs become recordings, exactly or not at all."""

import json
import shutil
import struct
import wave
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import wavfile

from sautereau.daq.convert.export import export
from sautereau.daq.convert.importing import ENDING, import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.convert.preamble import Preamble
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recovery import recover
from sautereau.rig.load import load_rig, with_values
from tests.recordings import SESSION, write_recording

ONE = {"column": {"velocity": "a"}, "unit": {"velocity": "V"}}
"""A table with one channel."""
WAV = {"column": {"velocity": "1"}, "full_scale": {"velocity": "4 V"}}
"""A WAV file with one channel."""
NO_OPTIONS = ImportOptions()


def bits(signal):
    return np.ascontiguousarray(signal).view(np.uint64)


def not_restored(path, out, rig=None, options=NO_OPTIONS):
    with pytest.raises(RecordingError) as caught:
        import_file(path, out, rig=rig, options=options)
    assert not out.exists()
    return str(caught.value)


@pytest.fixture
def back(tmp_path):
    return tmp_path / "back.mcap"


@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_an_export_comes_back_with_everything(tmp_path, back, complete_recording, to, raw):
    table = tmp_path / f"table.{to}"
    export(complete_recording, to, table, raw=raw)
    back.with_name(f"back.mcap{ENDING}").write_text("what a killed import left")
    done = import_file(table, back, rig=None, options=NO_OPTIONS, notes="back")
    first, second = read_recording(complete_recording), read_recording(back)
    assert done.simulated is second.simulated is True
    assert second.rig == first.rig
    assert second.rig.sources == first.rig.sources
    assert (second.rate, second.t0_ns) == (first.rate, first.t0_ns)
    assert not list(tmp_path.glob(f"*{ENDING}"))
    for name, signal in first.volts.items():
        assert np.array_equal(bits(second.volts[name]), bits(signal))
    for series in ("plan", "joints"):
        a, b = getattr(first, series), getattr(second, series)
        assert all(np.array_equal(getattr(a, f), getattr(b, f)) for f in ("t", "q1", "q2"))
    (imported,) = [event for event in second.events if event.kind == "imported"]
    assert tuple(event for event in second.events if event != imported) == first.events
    origin = imported.text
    assert origin.startswith(f"imported from table.{to}, sha256 ")
    assert second.session.notes == f"{first.session.notes}\nback\n{origin}"
    assert second.session.scene == first.session.scene


@settings(max_examples=10, deadline=None)
@given(hnp.arrays(np.float64, st.tuples(st.just(2), st.integers(1, 60))))
def test_any_number_comes_back_from_any_table(tmp_path_factory, values):
    """CSV keeps every finite number, the zeros' signs and infinities; a NaN loses its payload."""
    folder = tmp_path_factory.mktemp("any")
    written = np.nan_to_num(values, nan=1.5, posinf=np.inf, neginf=-np.inf)
    measured = replace(SESSION, simulated=False)
    write_recording(
        folder / "press.mcap", load_rig("paper"), written, session=measured, t0_ns=10**18
    )
    first = read_recording(folder / "press.mcap")
    for to in ("parquet", "csv"):
        export(folder / "press.mcap", to, folder / f"table.{to}", raw=True)
        import_file(folder / f"table.{to}", folder / f"{to}.mcap", rig=None, options=NO_OPTIONS)
        second = read_recording(folder / f"{to}.mcap")
        for name, signal in first.volts.items():
            assert np.array_equal(bits(second.volts[name]), bits(signal))
    shutil.rmtree(folder)


def test_an_export_needs_no_options(tmp_path, back, complete_recording, paper):
    table = tmp_path / "table.parquet"
    export(complete_recording, "parquet", table)
    message = not_restored(table, back, options=ImportOptions(rate="48 kHz", simulated=False))
    assert "remove --rate, --simulated" in message
    other = with_values(paper, {"daq.channels.0.scale": "5 mm/s/V"})
    assert "remove --rig" in not_restored(table, back, other)
    import_file(table, back, rig=paper, options=NO_OPTIONS)


def test_an_export_that_has_changed_is_refused(tmp_path, back, complete_recording):
    table = tmp_path / "table.csv"
    export(complete_recording, "csv", table, raw=True)
    text = table.read_text()
    table.write_text(text.replace("0.3455841", "0.3455842", 1))
    assert "volts differ" in not_restored(table, back)
    table.write_text("".join(text.splitlines(keepends=True)[:-1]))
    assert "volts differ" in not_restored(table, back)
    (tmp_path / "table.csv.json").write_text("{}")
    assert "metadata cannot be read" in not_restored(table, back)


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
    tmp_path, back, complete_recording, key, value, word
):
    table = tmp_path / "table.csv"
    export(complete_recording, "csv", table, raw=True)
    document = tmp_path / "table.csv.json"
    document.write_text(json.dumps(json.loads(document.read_text()) | {key: value}))
    assert word in not_restored(table, back)
    document.write_text("[" * 100_000)
    assert "metadata cannot be read" in not_restored(table, back)


def test_a_simulated_table_never_passes_for_measured(tmp_path, complete_recording, refused):
    """Even without its metadata."""
    export(complete_recording, "csv", tmp_path / "table.csv")
    (tmp_path / "table.csv.json").unlink()
    message = refused(None, **ONE | {"column": {"velocity": "velocity [V]"}}, rate="51.2 kHz")
    assert "`simulated`" in message.replace("'", "`")
    assert "give --simulated" in message


def write_tdms(path, volts, *, units="V", step=1 / 51_200, group="analog"):
    with TdmsWriter(path) as writer:
        channels = []
        for name, row in zip(("ai0", "ai1"), volts, strict=True):
            properties = {"wf_start_time": datetime(2026, 2, 3, 3, 5, 6), "wf_start_offset": 0.0}
            if step:
                properties["wf_increment"] = step
            if units:
                properties["NI_UnitDescription"] = units
            channels.append(ChannelObject(group, name, row, properties))
        writer.write_segment([RootObject(), *channels])
    return path


AI = {"column": {"velocity": "ai0", "force": "ai1"}, "without": (), "started": None}


@pytest.mark.parametrize("units", ["V", "Volts"])
def test_tdms_has_unit_rate_and_start(tmp_path, bring, paper, volts, units):
    write_tdms(tmp_path / "labview.tdms", volts, units=units)
    done, found = bring(None, "labview.tdms", **AI, notes="from the archive")
    assert (done.rate, done.n_samples, done.first_sample) == (51_200.0, 5000, 0)
    assert not found.simulated
    assert found.rig.daq == paper.daq
    for name, row in zip(("velocity", "force"), volts, strict=True):
        assert np.array_equal(bits(found.volts[name]), bits(row))
    expected = datetime(2026, 2, 3, 3, 5, 6, tzinfo=UTC)
    assert datetime.fromisoformat(found.session.started) == expected
    assert found.t0_ns == int(expected.timestamp()) * 10**9
    assert "imported from labview.tdms, sha256" in found.session.controller
    assert found.session.notes.startswith("from the archive\nimported from labview.tdms")
    assert found.events[-1].kind == "imported"


@pytest.mark.parametrize("kind", [np.float32, np.int16])
def test_tdms_of_floats_and_integers(tmp_path, bring, volts, kind):
    rows = (volts * 1000).astype(kind)
    write_tdms(tmp_path / "a.tdms", rows, units="mV")
    _, found = bring(None, "a.tdms", **AI)
    assert np.array_equal(found.volts["force"], rows[1].astype(float) * 1e-3)


def test_si_values_become_volts_by_the_calibration(tmp_path, bring, volts):
    write_tdms(tmp_path / "si.tdms", volts, units=None)
    _, found = bring(None, "si.tdms", **AI, unit={"velocity": "mm/s", "force": "mN"})
    np.testing.assert_allclose(found.volts["velocity"], volts[0] / 25, rtol=1e-15)
    np.testing.assert_allclose(found.volts["force"], volts[1] / 1000, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "column"),
    [("force,velocity\n1,2\n3,4\n", {}), ("1,2\n3,4\n", {"velocity": "2", "force": "1"})],
)
def test_columns_named_as_the_channels_or_not_at_all(bring, text, column):
    unit = {"velocity": "V", "force": "V"}
    _, found = bring(text, column=column, unit=unit, rate="1 kHz", without=())
    assert found.rate == 1000.0
    assert found.volts["velocity"].tolist() == [2.0, 4.0]
    assert found.volts["force"].tolist() == [1.0, 3.0]


def test_columns_named_as_the_channels_with_their_units(bring, refused):
    two = "velocity [V],velocity [mm/s],force [N]\n25,1,1\n50,3,2\n"
    assert "velocity: its column is missing" in refused(two)
    text = "Velocity [mm/s],force (mN)\n25,1000\n50,3000\n"
    _, found = bring(text, rate="1 kHz", without=())
    np.testing.assert_allclose(found.volts["velocity"], [1.0, 2.0], rtol=1e-12)
    np.testing.assert_allclose(found.volts["force"], [1.0, 3.0], rtol=1e-12)


def test_given_columns_may_lack_their_units(bring):
    text = "t (s),v [mm/s],force (mN)\n0,25,1000\n1e-3,50,3000\n"
    _, found = bring(text, time="t", column={"velocity": "v"}, without=())
    assert found.rate == 1000.0
    np.testing.assert_allclose(found.volts["velocity"], [1.0, 2.0], rtol=1e-12)


@pytest.mark.parametrize("unit", ["mm s-1", "mm s^-1", "mm.s-1", "mm·s⁻¹", "mm*s**-1"])
def test_a_speed_may_be_written_as_a_product(bring, unit):
    _, found = bring(f"velocity [{unit}],force (mN)\n25,1000\n", rate="1 kHz", without=())
    np.testing.assert_allclose(found.volts["velocity"], [1.0], rtol=1e-12)


def write_wav(path, frames, width, rate=48_000, channels=1):
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate)
        file.writeframes(frames)
    return path


@pytest.mark.parametrize("width", [1, 2, 3, 4])
def test_wav_integers_are_scaled_exactly(tmp_path, bring, width):
    most = 2 ** (8 * width - 1)
    values = [0, 1, -1, most - 1, -most, most // 3]
    if width == 1:
        frames = bytes(value + 128 for value in values)
    else:
        frames = b"".join(value.to_bytes(width, "little", signed=True) for value in values)
    write_wav(tmp_path / "laser.wav", frames, width)
    done, found = bring(None, "laser.wav", **WAV)
    assert done.rate == 48_000.0
    assert found.volts["velocity"].tolist() == [value * (4 / most) for value in values]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_wav_floats_may_exceed_full_scale(tmp_path, bring, kind):
    wavfile.write(tmp_path / "laser.wav", 48_000, np.array([0.5, -1.0, 1.25], kind))
    _, found = bring(None, "laser.wav", **WAV)
    assert found.volts["velocity"].tolist() == [2.0, -4.0, 5.0]


def test_wav_at_full_scale_of_the_vibrometers_range(tmp_path, bring):
    """Two channels of 16 bits; 100 mm/s are 4 V at 25 mm/s/V."""
    frames = struct.pack("<6h", 0, 16_384, 0, -32_768, 0, 1)
    write_wav(tmp_path / "laser.wav", frames, 2, channels=2)
    scale = {"velocity": "100 mm/s"}
    _, found = bring(None, "laser.wav", column={"velocity": "2"}, full_scale=scale)
    expected = [2.0, -4.0, 4 / 32_768]
    np.testing.assert_allclose(found.volts["velocity"], expected, rtol=1e-15)


def test_everything_missing_is_reported_at_once(tmp_path, back, paper):
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    message = not_restored(tmp_path / "table.csv", back, paper)
    for word in (
        "8 faults",
        "give --column.velocity NAME or --without velocity; it has 'a', 'b'",
        "give --column.force",
        "give --unit.velocity V",
        "give --unit.force V",
        'give --rate "51.2 kHz", or --time COLUMN',
        'give --trigger "12 ms"',
        "give --started 2026-02-03T04:05:06+01:00",
        "give --measured or --simulated",
    ):
        assert word in message
    path = write_wav(tmp_path / "laser.wav", b"\0\0", 2)
    message = not_restored(path, back, paper, ImportOptions(without=("force",)))
    assert 'velocity: its full scale is missing; give --full-scale.velocity "4 V"' in message
    assert "rate" not in message


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"column": {"speed": "a"}}, "--column: the rig has no channel 'speed'; it has velocity"),
        ({"column": {"velocity": "c"}}, "'c' is not a column of the file; it has 'a', 'b'"),
        ({"unit": {"velocity": "kg"}}, "'1 kg' is neither in volts nor in m/s"),
        ({"unit": {"velocity": "N"}}, "'1 N' is neither in volts nor in m/s"),
        ({"full_scale": {"force": "4 V"}}, "a CSV file has no full scale"),
        ({"without": ("force",)}, "force: both --column and --without are given"),
        ({"rate": "48"}, "'48' has no unit"),
        ({"rate": "0 Hz"}, "'0 Hz' is not above 0"),
        ({"rate": None}, "the sampling rate is missing"),
        ({"trigger": "soon"}, "--trigger: 'soon' is not a number with a unit"),
        (
            {"trigger": "1700000000 s"},
            "more than 1e+09 s; give the time of the trigger on the file's",
        ),
        ({"started": "yesterday"}, "--started 'yesterday'"),
        ({"started": "2026-02-03T04:05:06"}, "it has no time zone"),
        ({"started": "2300-01-01T00:00:00Z"}, "64 bits; correct the rate or --started"),
        ({"simulated": None}, "--measured or --simulated"),
        ({"time": "t"}, "--time 't' is not a column of the file"),
    ],
)
def test_each_fault_is_reported(refused, given, word):
    base = {
        "column": {"velocity": "a", "force": "b"},
        "unit": {"velocity": "V", "force": "V"},
        "rate": "1 kHz",
        "without": (),
    }
    merged = base | {
        key: (base[key] | value if isinstance(value, dict) and key in base else value)
        for key, value in given.items()
    }
    message = refused("a,b\n1,2\n", **merged)
    assert word in message
    assert "table.csv" in message


def test_no_channel_at_all(refused):
    message = refused("a\n1\n", without=("velocity", "force"), rate="1 kHz")
    assert "--without names every channel" in message


def test_a_rate_that_is_not_the_files_replaces_it_with_a_warning(tmp_path, bring, volts):
    write_tdms(tmp_path / "labview.tdms", volts)
    done, found = bring(None, "labview.tdms", **AI, rate="48 kHz")
    assert done.rate == found.rate == 48_000.0
    assert "'48 kHz'" in done.warnings[0]
    assert "51200 Hz" in done.warnings[0]


GAP = "no finite number in 1 row, the first is row 2 (line 3); gaps"


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("a,b\n1,2\n,4\n", GAP),
        ("a,b\n1,2\nnan,4\n", GAP),
        ("a,b\n1,2\nx,4\n", "'x' in line 3 is not a number"),
        ("a,b\n1,2\n3\n", "line 3, '3', has 1 cells"),
        ("a,b\n", "it has no rows of numbers"),
        ("", "it has no rows"),
        ("# nothing\n", "it has no rows of numbers"),
        ("a,a\n1,2\n", "it has 'a (column 1)', 'a (column 2)'"),
        ("a,b\n1,2\n\0\n", "byte 8 is 0, as in UTF-16 or a damaged file"),
    ],
)
def test_rows_that_are_none(refused, text, word):
    assert word in refused(text, **ONE, rate="1 kHz")


def test_a_missing_file_and_no_rig(tmp_path, back, refused):
    assert "no such file" in refused(None, "none.wav")
    (tmp_path / "table.csv").write_text("a\n1\n")
    assert "--rig is required" in not_restored(tmp_path / "table.csv", back)


def test_nothing_is_overwritten(tmp_path, complete_recording):
    export(complete_recording, "parquet", tmp_path / "table.parquet")
    before = complete_recording.read_bytes()
    with pytest.raises(RecordingError, match="never overwritten"):
        import_file(tmp_path / "table.parquet", complete_recording, rig=None, options=NO_OPTIONS)
    assert complete_recording.read_bytes() == before


def test_samples_before_the_trigger_have_negative_indices(tmp_path, back, bring):
    """From a table of times, and again through an export."""
    text = "t,a\n" + "".join(f"{k / 1000!r},{k}\n" for k in range(5000))
    done, first = bring(text, **ONE, time="t", trigger="1.5 s")
    assert (done.first_sample, done.rate) == (-1500, 1000.0)
    assert first.first_sample == -1500
    assert first.t0_ns == 1_770_087_907_500_000_000
    export(back, "csv", tmp_path / "again.csv")
    import_file(tmp_path / "again.csv", tmp_path / "again.mcap", rig=None, options=NO_OPTIONS)
    again = read_recording(tmp_path / "again.mcap")
    assert (again.first_sample, again.t0_ns) == (-1500, first.t0_ns)
    assert np.array_equal(again.time, first.time)
    assert np.array_equal(again.volts["velocity"], np.arange(5000.0))


def test_a_file_that_begins_after_the_trigger(refused):
    message = refused("t,a\n0.010,1\n0.011,2\n", **ONE, time="t")
    assert "starts 10 ms after the trigger" in message


def test_a_truncated_recording_is_not_complete_after_export_and_import(tmp_path, back, record):
    noise = np.random.default_rng(0).standard_normal((2, 60_000))
    data = record(tmp_path / "press.mcap", noise).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    recovered = recover(tmp_path / "cut.mcap", tmp_path / "recovered.mcap").path
    first = read_recording(recovered)
    assert first.gaps
    export(recovered, "parquet", tmp_path / "table.parquet")
    import_file(tmp_path / "table.parquet", back, rig=None, options=NO_OPTIONS)
    second = read_recording(back)
    assert not second.complete
    assert str(first.gaps[0]) in [event.text for event in second.events]
    assert np.array_equal(second.volts["force"], first.volts["force"])


def test_a_trigger_between_two_samples_is_reported(bring):
    """The nearest sample is 0; by how much it is not the trigger is in the answer."""
    done, _ = bring("a\n1\n2\n", **ONE, rate="1 kHz", trigger="0.2 ms")
    assert done.first_sample == 0
    assert done.trigger_shift == pytest.approx(0.2e-3)


@pytest.mark.parametrize(
    ("times", "word"),
    [
        ([0, 1e-3, 2e-3, 4e-3], "is not even at"),
        ([0, 1e-3, 1e-3, 3e-3], "is not even at"),
        ([0], "fewer than two rows"),
    ],
)
def test_uneven_times_are_never_resampled(refused, times, word):
    text = "t,a\n" + "".join(f"{t!r},1\n" for t in times)
    assert word in refused(text, **ONE, time="t")


@pytest.mark.parametrize("kind", ["tdms", "wav", "parquet"])
def test_truncated_files_are_refused(tmp_path, back, refused, volts, complete_recording, kind):
    """No truncation changes the number of samples silently; of CSV it cannot be detected."""
    path = tmp_path / f"complete.{kind}"
    if kind == "tdms":
        write_tdms(path, volts)
    elif kind == "wav":
        write_wav(path, np.arange(1000, dtype="<i2").tobytes(), 2)
    else:
        export(complete_recording, "parquet", path, raw=True)
    data = path.read_bytes()
    for size in (0, 3, 40, len(data) // 2, len(data) - 9, len(data) - 1):
        if kind == "parquet":  # an export, which takes no options
            path.write_bytes(data[:size])
            not_restored(path, back)
        else:
            refused(data[:size], f"cut.{kind}", **(WAV if kind == "wav" else AI))


def test_a_long_line_above_a_table_takes_no_time():
    """Of 100,000 characters; one expression for a line took the cube of its length."""
    lines = ["# " + " a" * 50_000, "Sample Rate: 1000 Hz", "; scale = 2,3"]
    preamble = Preamble(lines, ",", ".")
    assert preamble.quantity(("sample rate",), "Hz") == 1000
    assert preamble.texts("scale") == ["2", "3"]


def test_a_unit_that_replaces_the_files_is_said(bring):
    done, _ = bring("time,velocity [mm/s]\n0,1\n1e-3,2\n", unit={"velocity": "m/s"}, time="time")
    warning, _ = done.warnings  # then that of the range
    assert "'m/s'" in warning
    assert "mm/s" in warning


def test_a_column_is_of_one_channel(refused):
    both = {"velocity": "a", "force": "a"}
    message = refused("time,a [V]\n0,1\n1e-3,2\n", column=both, without=(), time="time")
    assert "'a [V]'" in message
    assert "force" in message
    assert "velocity" in message
