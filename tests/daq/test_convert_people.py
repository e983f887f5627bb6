"""Files as instruments and people write them: preambles, units, times, signs, arrays, profiles."""

import sys

import numpy as np
import pytest
from scipy.io import savemat

from sautereau.commands.app import app
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.convert.profile import load_profile, save_profile
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording

STARTED = "2026-02-03T04:05:06+01:00"
ROWS = 40
SPEED = 0.05 * np.sin(np.pi * np.arange(ROWS) / ROWS) ** 2  # m/s, of a key that goes down


def velocity(recorded):
    return recorded.volts["velocity"] * recorded.rig.daq.channel("velocity").scale


def table(head, row="{t:.6f},{v:.9f}", rate=1000.0, values=SPEED, start=0.0):
    rows = (row.format(n=n, t=start + n / rate, v=v) for n, v in enumerate(values))
    return head + "\n".join(rows) + "\n"


TEKTRONIX = (
    "Model,MSO54\nFirmware Version,1.2.3\n\nWaveform Type,ANALOG\nHorizontal Units,s\n"
    "Sample Interval,1.000E-03\nRecord Length,4.000E+01\nVertical Units,m/s\n\nLabels,\nTIME,CH1\n"
)
OLD_TEKTRONIX = "".join(
    f"{(['Record Length,40', 'Sample Interval,1e-3', 'Vertical Units,m/s'] + [','] * 40)[n]},,"
    f"{n / 1000:.6f},{v:.9f},\n"
    for n, v in enumerate(SPEED)
)
LECROY = (
    "LECROYHDO4034,25336,Waveform\nSegments,1,SegmentSize,40\nSegment,TrigTime,TimeSinceSegment1\n"
    "#1,07-Feb-2026 15:11:42,0\nTime,Ampl\n"
)
KEYSIGHT = "x-axis,1\nsecond,m/s\n"
RIGOL = "X,CH1,Start,Increment,\nSequence,m/s,-1.000000E-02,1.000000E-03,\n"
M_PER_S = {"velocity": "m/s"}


@pytest.mark.parametrize(
    ("text", "column", "more"),
    [
        (table(TEKTRONIX), "CH1", {"time": "TIME"}),
        (table(TEKTRONIX), "CH1", {}),
        (OLD_TEKTRONIX, "5", {"time": "4", "unit": M_PER_S}),
        (table(LECROY), "Ampl", {"time": "Time", "unit": M_PER_S}),
        (table(KEYSIGHT, "{t:+.9e},{v:+.9e}"), "1", {"time": "x-axis"}),
        (table(RIGOL, "{n},{v:.9f},"), "CH1", {"trigger": "-10 ms"}),
        (table("t (ms),v [mm/s]\n", "{n:.3f},{v:.9f}", values=1e3 * SPEED), "v [mm/s]",
         {"time": "t (ms)"}),
        (table("Zeit;v\nms;mm/s\n", "{n};{v:.9f}", values=1e3 * SPEED).replace(".", ","), "v",
         {"time": "Zeit"}),
        (table("Zeit;v;T\nms;mm/s;degC\n", "{n};{v:.9f};21.5", values=1e3 * SPEED), "v",
         {"time": "Zeit"}),
        (table("t/us;v/(mm/s)\n", "{n}000;{v:.9f}", values=1e3 * SPEED), "v/(mm/s)",
         {"time": "t/us"}),
        (table("t\tv / (mm/s)\n", "{n}\t{v:.9f}", values=1e3 * SPEED), "v / (mm/s)",
         {"time": "t", "time_unit": "ms"}),
        (table("# t v\n", "  {t:.6f}   {v:.9f}"), "v", {"time": "t", "unit": M_PER_S}),
        (table("\ufeffwann,v\n", "2026-02-03 04:05:06.{n:03}+01:00,{v:.9f}").replace("\n", "\r\n"),
         "v", {"time": "wann", "unit": M_PER_S, "started": None}),
        (table("MAX = 5,4.1\nUNIT = m/s,mm\nDATA COUNT = 40,\n", "{v:.9f},{t:.3f}"), "1",
         {"rate": "1 kHz"}),
        (table("µs-Karte\nt,v\n").encode("cp1252"), "v", {"time": "t", "unit": M_PER_S}),
    ],
)  # fmt: skip
def test_tables_of_instruments(bring, text, column, more):
    done, found = bring(text, column={"velocity": column}, **more)
    assert done.rate == 1000.0
    assert not done.warnings
    np.testing.assert_allclose(velocity(found), SPEED, atol=1e-9)
    assert found.session.started == STARTED


def test_rows_that_a_preamble_counts(bring):
    text = table(TEKTRONIX)
    cut = "\n".join(text.splitlines()[:-3]) + "\n"
    with pytest.raises(RecordingError, match=r"40 rows.* 37"):
        bring(cut, column={"velocity": "CH1"})


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("t,v\n0,0.1\n0.001,0.497186\n0.002,0.4", "its last line has no line end.*--complete"),
        ("t,v\n0,0.1\n0.001,1e400\n", r"no finite number in 1 row, the first is row 2 \(line 3\)"),
        ("t,v\n0,0.1\n\n0.001,-inf\n", r"first is row 2 \(line 4\)"),
        ("t,v\n0,0.1\nnan,0.1\n", "column 't' has no finite"),
        ("t,v\n0,0.1\n0.001,1e308\n", "column 'v' has no finite number"),
        ("t,v\n0.002,0.1\n0.001,0.1\n0,0.1\n", r"falls in row 2 \(line 3\), from 0.002 to 0.001 s"),
        ("t,v\n0,0.1\n0,0.1\n", "all its times are 0 s"),
        ("t,v\n0,0.1\n0.001,0.1\n0.003,0.1\n", "missing, or the times jitter .*--rate"),
        ("t,v\n" + "".join(f"{n // 10 / 1000:.3f},0.{n}\n" for n in range(99)),
         "rounded to 0.001 s.*exact rate"),
    ],
)  # fmt: skip
def test_nothing_is_altered_silently(bring, text, word):
    with pytest.raises(RecordingError, match=word):
        bring(text, column={"velocity": "v"}, unit={"velocity": "km/s"}, time="t")


def test_a_complete_file_without_a_last_line_end(bring):
    _, found = bring("v\n1\n2", column={"velocity": "v"}, unit={"velocity": "V"}, rate="1 kHz",
                     complete=True)  # fmt: skip
    assert found.volts["velocity"].tolist() == [1.0, 2.0]


def test_a_rate_is_the_way_out_of_jitter_and_rounding(bring):
    rows = "".join(f"{n // 10 + 5},{v:.9f}\n" for n, v in enumerate(SPEED))
    text, given = "ms,v\n" + rows, {"column": {"velocity": "v"}, "unit": M_PER_S, "time": "ms"}
    done, _ = bring(text, **given, time_unit="ms", rate="10 kHz", trigger="5 ms")
    assert (done.rate, done.first_sample) == (10_000.0, 0)
    assert "differ from an even 10000 Hz" in done.warnings[0]


def test_a_rate_that_the_times_contradict(bring):
    text = "t,v\n" + "".join(f"{n / 1000:.3f},0.{n}\n" for n in range(40) if n != 20)
    with pytest.raises(RecordingError, match=r"row 21 \(line 22\) .* or omit --time"):
        bring(text, column={"velocity": "v"}, unit={"velocity": "V"}, time="t", rate="1 kHz")


@pytest.mark.parametrize("channel", ["velocity", "force"])
def test_an_inverted_sensor_is_recognised(bring, channel):
    other = {"velocity": "force", "force": "velocity"}[channel]
    given = {"column": {channel: "v"}, "unit": {channel: "V"}, "without": (other,), "rate": "1 kHz"}
    done, found = bring(table("v\n", "{v:.9f}", values=-SPEED), **given)
    (warning,) = done.warnings
    assert f"--invert {channel}" in warning
    assert [event.text for event in found.events if event.kind == "warning"] == [warning]
    found.path.unlink()
    done, found = bring(None, **given, invert=(channel,))
    assert not done.warnings
    np.testing.assert_allclose(found.volts[channel], SPEED, atol=1e-9)


@pytest.mark.parametrize(
    ("values", "unit", "word"),
    [
        (SPEED, "km/s", "reaches 50 m/s, which is implausible.*--unit.velocity"),
        (1e-3 * SPEED, "mm/s", "reaches 5e-08 m/s, which is implausible"),
        (0 * SPEED, "V", "all samples are 0 m/s"),
        (1e3 * SPEED, "V", "beyond the range"),
    ],
)
def test_implausible_values_are_warned_of(bring, values, unit, word):
    text = table("v\n", "{v:.12f}", values=values)
    given = {"column": {"velocity": "v"}, "unit": {"velocity": unit}, "rate": "1 kHz"}
    warnings = "\n".join(bring(text, **given)[0].warnings)
    assert word.split(".*")[0] in warnings
    assert word.split(".*")[-1] in warnings


def test_a_displacement_becomes_its_velocity(bring):
    t = np.arange(200) / 1000
    text = table("y (mm)\n", "{v:.15f}", values=1e3 * t**3)
    done, found = bring(text, column={"velocity": "y (mm)"}, rate="1 kHz")
    np.testing.assert_allclose(velocity(found), 3 * t**2, atol=1e-10)
    assert "derivative of the displacement" in done.warnings[-1]


def write_arrays(path, arrays):
    if path.suffix == ".npz":
        np.savez_compressed(path, **arrays)
    elif path.suffix == ".mat":
        savemat(path, {"press": arrays, "note": "a text", "fs": 1000.0})
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file.create_group("press")[name] = values
                file[f"press/{name}"].attrs["unit"] = "m/s"


@pytest.mark.parametrize(
    ("name", "column"),
    [("a.npz", "v(2)"), ("a.mat", "press.v(2)"), ("a.h5", "press/v(2)"), ("b.mat", "press/v(2)")],
)
def test_arrays(tmp_path, bring, name, column):
    written = tmp_path / ("a.h5" if name == "b.mat" else name)
    write_arrays(written, {"v": np.stack([SPEED, 2 * SPEED])})
    written.rename(tmp_path / name)  # MATLAB's version 7.3 is HDF5
    unit = {} if "/" in column else M_PER_S
    done, found = bring(None, name, column={"velocity": column}, unit=unit, rate="1 kHz")
    np.testing.assert_allclose(velocity(found), 2 * SPEED, atol=1e-12)
    assert done.n_samples == ROWS


def test_without_h5py_the_message_says_what_to_install(monkeypatch, bring):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(RecordingError, match=r"pip install 'sautereau\[hdf5\]'"):
        bring(b"\x89HDF\r\n\x1a\n", "a.h5")


def test_limits_have_names(tmp_path, monkeypatch, bring):
    monkeypatch.setattr("sautereau.daq.convert.formats.MOST_ROWS", 10)
    given = {"column": {"velocity": "v"}, "unit": {"velocity": "V"}, "rate": "1 kHz"}
    write_arrays(tmp_path / "a.npz", {"v": SPEED})
    for content, name in ((table("v\n", "{v}"), "table.csv"), (None, "a.npz")):
        with pytest.raises(RecordingError, match="more than the limit of 10;"):
            bring(content, name, **given)
    monkeypatch.setattr("sautereau.daq.convert.from_arrays.MOST_VALUES", 10)
    with pytest.raises(RecordingError, match="MOST_VALUES = 10"):
        bring(None, "a.npz", **given)
    monkeypatch.setattr("sautereau.daq.convert.from_tables.MOST_BYTES", 10)
    with pytest.raises(RecordingError, match="MOST_BYTES = 10"):
        bring(None, **given)


def test_a_fault_leaves_nothing_behind(tmp_path, monkeypatch, bring):
    given = {"column": {"velocity": "v"}, "unit": {"velocity": "V"}}
    with pytest.raises(RecordingError, match="beyond the dates of 64 bits"):
        bring("v\n1\n2\n", **given, rate="1e-15 Hz")
    with monkeypatch.context() as patch:
        patch.setattr("sautereau.daq.file.recording.Recording.write_block", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            bring(None, **given, rate="1 kHz")
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]
    bring(None, **given, rate="1 kHz")


def run(*words):
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


OPTIONS = (
    *("--rig", "paper", "--without", "force", "--column.velocity", "v", "--time", "t"),
    *("--unit.velocity", "m/s", "--trigger", "0 s", "--started", "modified", "--measured"),
)


def test_a_profile_for_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "lab").mkdir()
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text(table("t,v\n"))
    assert run("import", "a.csv", "--out", "a.mcap", *OPTIONS, "--save-profile", "lab/p.toml") == 0
    assert load_profile(tmp_path / "lab" / "p.toml").rig == "paper"
    (tmp_path / "c.csv").write_text("t,w\n1,2\n")
    capsys.readouterr()
    words = ["a.csv", "b.csv", "c.csv", "--out", "out", "--profile", "lab/p.toml"]
    assert run("import", *words, "--invert", "velocity") == 1
    text = " ".join(capsys.readouterr().err.split())
    assert text.startswith("sautereau: not imported: c.csv: missing or wrong options")
    np.testing.assert_allclose(velocity(read_recording(tmp_path / "out/b.mcap")), -SPEED, atol=1e-9)
    with pytest.raises(RecordingError, match=r"b\.mcap: 2 files"):
        run("import", "a.csv", "b.csv", "--out", "b.mcap", "--profile", "lab/p.toml")


def test_what_applies_to_several_files_is_said_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in "abcd":
        (tmp_path / f"{name}.csv").write_text(table("t,v\n"))
        (tmp_path / f"{name}{name}.csv").write_text("t,w\n1,2\n")
    files = sorted(path.name for path in tmp_path.glob("*.csv"))
    assert run("import", *files, "--out", "out", *OPTIONS, "--invert", "velocity") == 1
    said = capsys.readouterr()
    text = " ".join(said.out.split())
    assert text.count("seems inverted") == 1
    assert "warning: 4 recordings (out/a.mcap, out/b.mcap, out/c.mcap, ...): velocity: " in text
    text = " ".join(said.err.split())
    assert text.count("'v' is not a column") == 1
    assert "not imported: 4 files (aa.csv, bb.csv, cc.csv, ...): missing or wrong options" in text


def test_faults_of_a_profile(tmp_path):
    path = tmp_path / "p.toml"
    save_profile(path, ImportOptions(started=STARTED, trigger="0 s", column={"force": "a"}), None)
    assert load_profile(path).under(ImportOptions(column={"velocity": "b"})).column == {
        "force": "a",
        "velocity": "b",
    }
    assert load_profile(path).started is None
    with pytest.raises(RecordingError, match="nothing is overwritten"):
        save_profile(path, ImportOptions(), None)
    path.write_text('unti = 3\ntrigger = 5\n[column]\nvelocity = "v"\n')
    with pytest.raises(RecordingError, match=r"line 1: unti: unknown key; did you mean 'unit'"):
        load_profile(path)
    with pytest.raises(RecordingError, match=r"No such file"):
        load_profile(tmp_path / "none.toml")
