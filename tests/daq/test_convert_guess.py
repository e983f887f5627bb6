"""What a file does not state is guessed openly, asked for or refused; nothing is cut off."""

import struct
from datetime import datetime

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import wavfile

from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from tests.budget import slow

STARTED = "2026-02-03T04:05:06+01:00"
V = {"column": {"velocity": "v"}, "unit": {"velocity": "V"}}
RATED = V | {"rate": "1 kHz"}
TIMED = V | {"time": "t"}
N = 40
VALUES = 0.1 + np.sin(np.pi * np.arange(N) / N) ** 2  # V; none has three decimals, and none is 0


@pytest.fixture
def bring(bring):
    """Return a function that imports a text or a file, and returns its answer and its volts."""

    def brought(*content, **given):
        done, found = bring(*content, **given)
        return done, found.volts["velocity"]

    return brought


def rows(form="{t:.6f},{v:.9f}", values=VALUES):
    return [form.format(n=n, t=n / 1000, v=v) for n, v in enumerate(values)]


def text(lines, end="\n"):
    return end.join([*lines, ""])


@pytest.mark.parametrize("sign", ["\x0b", "\x0c", "\x1c", "\x85", "\u2028", "\u2029"])
def test_only_line_ends_end_lines(bring, sign):
    done, volts = bring(text([f"# a{sign}b", f"c{sign}", "t,v", *rows()]), **TIMED)
    np.testing.assert_allclose(volts, VALUES, atol=1e-9)
    assert "3 lines before the rows, names in line 3" in done.read_as


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_line_ends_of_other_systems(bring, refused, end):
    lines = ["# a", "t,v", *rows()]
    assert "2 lines before the rows" in bring(text(lines, end), **TIMED)[0].read_as
    assert "line 12" in refused(text([*lines[:11], "8,OVL", *lines[12:]], end), **TIMED)


@pytest.mark.parametrize("bad", ["# marker", "8,OVL", "8,∞", "OVL,OVL", "8", "8,1,2", "8;1", ","])
@pytest.mark.parametrize(("head", "place"), [(["t,v"], 8), (["t,v"], 30), ([], 1)])
def test_a_row_without_a_number_is_named(refused, bad, place, head):
    every = [*head, *rows()]
    every.insert(len(head) + place, bad)
    given = RATED if head else RATED | {"column": {"velocity": "2"}}
    assert f"line {len(head) + place + 1}" in refused(text(every), **given)


@pytest.mark.parametrize("bad", ["0,OVL", "OVL,0.5", "0"])
def test_a_damaged_first_row_is_no_preamble(refused, bad):
    given = RATED | {"column": {"velocity": "2"}}
    assert "--skip 1" in refused(text([bad, *rows()[1:]]), **given)


def test_skip_decides_where_the_rows_begin(bring, refused):
    lines = ["1,2", "3,4", "t,v", *rows()]
    assert "--skip 3" in refused(text(lines), **RATED)
    done, volts = bring(text(lines), **RATED, skip=3)
    assert len(volts) == N
    assert "3 lines before the rows" in done.read_as
    assert "line 3" in refused(text(lines), **RATED, skip=2)


def test_rows_far_below(bring):
    assert bring(text([*["a note"] * 600, "t,v", *rows()]), **RATED, skip=601)[0].n_samples == N


def test_a_footer_is_no_sample(refused):
    assert "'Mean' in line 42" in refused(text(["t,v", *rows(), "Mean,0.5"]), **RATED)


@pytest.mark.parametrize("blank", ["", ",", ",\n,", " , "])
def test_blank_rows_end_the_table(bring, refused, blank):
    assert bring(text(["t,v", *rows(), blank]), **TIMED)[0].n_samples == N
    if blank:
        assert "line 42 is empty" in refused(text(["t,v", *rows(), blank, "1,1"]), **RATED)


def test_a_blank_line_in_one_column_may_be_a_missing_sample(refused):
    lines = ["v", *rows("{v:.9f}")]
    assert "line 9 is empty" in refused(text([*lines[:8], "", *lines[8:]]), **RATED)


def test_an_unclosed_quotation_mark_swallows_no_rows(refused):
    lines = rows('{t:.6f},{v:.9f},"ok"')
    lines[30] = lines[30].removesuffix('ok"')
    lines[31] = lines[31].replace('"ok"', 'ok"')
    lines[32] = '"' + lines[32]
    assert "line 34" in refused(text(["t,v,state", *lines]), **RATED)


@pytest.mark.parametrize(
    ("cell", "number"), [("1,234", 1.234), ("12.345", 12.345), ("-999,001", -999.001)]
)
def test_a_decimal_sign_that_may_separate_thousands(bring, refused, cell, number):
    sign = "," if "," in cell else "."
    lines = text(["n;v", *[f"{n};{cell}" for n in range(5)]])
    message = refused(lines, **RATED)
    assert f"--decimal '{sign}'" in message
    assert repr(number) in message
    assert str(round(1000 * number)) in message
    assert bring(lines, **RATED, decimal=sign)[1].tolist() == [number] * 5
    other = refused(lines, **RATED, decimal="," if sign == "." else ".")
    assert "separators of thousands" in other


@pytest.mark.parametrize("cell", ["1.234,5", "1,234.5", "1'234.5", "1,234,567", "1\u202f234,5"])
def test_separators_of_thousands_are_refused(refused, cell):
    message = refused(text(["n;v", "0;1", f"1;{cell}", "2;3"]), **RATED)
    assert "line 3" in message
    assert "separators of thousands" in message


def test_another_number_shows_the_decimal_sign(bring):
    lines = ["n;v", *[f"{n};1" for n in range(600)], "600;1,234", "601;0,5"]
    done, volts = bring(text(lines), **RATED)
    assert volts[-2:].tolist() == [1.234, 0.5]
    assert "decimal" not in done.read_as


@pytest.mark.parametrize("cell", ["0.5", "0,5"])
def test_one_column_whose_first_rows_are_integers(bring, cell):
    done, volts = bring(text(["v", *["1"] * 600, cell]), **RATED)
    assert volts[-1] == 0.5
    assert "decimal" not in done.read_as


@pytest.mark.parametrize("skip", [-1, 10**9])
def test_a_skip_beyond_its_limit(refused, skip):
    assert "MOST_SKIPPED" in refused(text(["v", "1"]), **RATED, skip=skip)


def test_two_columns_or_a_decimal_comma(bring, refused):
    lines = text(["0,512", "1,513", "2,498"])
    one = RATED | {"column": {"velocity": "1"}}
    message = refused(lines, **one)
    assert "--decimal ." in message
    assert "--decimal ," in message
    assert bring(lines, **one, decimal=",")[1].tolist() == [0.512, 1.513, 2.498]


def test_the_columns_that_are_asked_for_decide(bring):
    lines = text(["n,adc", "0,512", "1,513"])
    given = RATED | {"column": {"velocity": "adc"}}
    assert bring(lines, **given)[1].tolist() == [512.0, 513.0]


SIGLENT = [
    "Record Length,Analog:40",
    "Sample Interval,Analog:1.000000E-03",
    "Vertical Units,CH1:V,,",
]
HEADS = [
    [*SIGLENT, "Second,v"],
    ["#Sample rate: 1000Hz", "#Samples: 40", "", "Time (s),v"],
    ["Sampling rate = 1 kSa/s", "Points = 40 pts", "t,v"],
    ["# sample frequency; 1e3 Hz", "Number of samples; 40", "t,v"],
    ['"Record Length","40"', '"Sample Interval","1 ms"', "t,v"],
]


@pytest.mark.parametrize("head", HEADS)
def test_decorated_keys(bring, refused, head):
    lines = [*head, *rows("{t:+.6E},{v:+.9E}")]
    done, volts = bring(text(lines), **V)
    assert done.rate == 1000.0
    assert len(volts) == N
    assert "rate 1000 Hz" in done.read_as
    message = refused(text(lines[:-10]), **V)
    assert "40 rows" in message
    assert "30" in message


def test_a_wrong_count_can_be_overridden(bring, tmp_path):
    lines = text(["Points,50", "t,v", *rows()])
    done, _ = bring(lines, **RATED, complete=True)
    assert "50 rows" in done.warnings[0]
    events = read_recording(tmp_path / "back.mcap").events
    assert done.warnings[0] in [event.text for event in events]


@pytest.mark.parametrize("value", ["fast", "40 kpts", "1,234", "--"])
def test_a_known_key_that_is_not_understood_is_shown(bring, value):
    done, _ = bring(text([f"Record Length: {value}", "t,v", *rows()]), **TIMED)
    assert f"not understood: 'Record Length: {value}'" in done.read_as


def clock(form):
    lines = [form(n) for n in range(N)]
    return text(["t;v", *(f"{t};{v:.9f}" for t, v in zip(lines, VALUES, strict=True))])


def over_midnight(n):
    day, time = (3, f"23:59:59.{980 + n}") if n < 20 else (4, f"00:00:00.{n - 20:03}")
    return f"2026-02-0{day}T{time}"


@pytest.mark.parametrize(
    ("form", "dated"),
    [
        (lambda n: f"12:34:56.{n:03}", False),
        (lambda n: f"12:34:{56 + n // 10}.{n % 10}", False),
        (lambda n: f"03.02.2026 04:05:06.{n:03}", False),
        (lambda n: f"3.2.2026  4:05:06,{n:03}", False),
        (lambda n: f"2026-02-03 04:05:06,{n:03}", False),
        (lambda n: f"2026-02-03T04:05:06,{n:03}+01:00", True),
        (over_midnight, False),
    ],
)  # fmt: skip
def test_times_of_the_clock(bring, form, dated):
    done, volts = bring(clock(form), **TIMED, **({"started": None} if dated else {}))
    assert done.rate == pytest.approx(10.0 if ".9" in form(9) and len(form(9)) == 10 else 1000.0)
    np.testing.assert_allclose(volts, VALUES, atol=1e-9)


@pytest.mark.parametrize(
    "form",
    [
        lambda n: f"02/03/2026 04:05:06.{n:03}",
        lambda n: f"12:34:56.{n:03} PM",
        lambda n: f"34:56.{n:03}",
        lambda n: f"12h34m56.{n:03}s",
    ],
)
def test_unclear_times_of_the_clock_say_what_to_give(refused, form):
    message = refused(clock(form), **TIMED)
    assert "column 't'" in message
    assert "ISO 8601" in message
    assert "--rate" in message


@pytest.mark.parametrize("bad", ["2026-13-03 04:05:06.000", "04:05:06.000", ""])
def test_a_wrong_date_is_named(refused, bad):
    lines = clock(lambda n: f"2026-02-03 04:05:06.{n:03}").split("\n")
    lines[5] = f"{bad};0.5"
    assert "line 6" in refused("\n".join(lines), **TIMED)


@pytest.mark.parametrize(("scale", "unit"), [(1, None), (1000, "ms")])
def test_seconds_since_1970_are_a_date(bring, tmp_path, scale, unit):
    begin = datetime.fromisoformat(STARTED).timestamp()
    lines = [f"{scale * (begin + n / 1000):.4f},{v:.9f}" for n, v in enumerate(VALUES)]
    done, _ = bring(text(["t,v", *lines]), **TIMED, started=None, time_unit=unit)
    assert done.rate == pytest.approx(1000.0, rel=1e-5)
    assert (done.first_sample, done.trigger_shift) == (0, 0.0)
    assert "since 1970" in done.read_as
    assert read_recording(tmp_path / "back.mcap").t0_ns == pytest.approx(begin * 1e9, abs=1000)


def test_a_time_axis_belongs_to_its_column(bring, refused, paper, tmp_path):
    lines = ["t1,w,t2,v", *(f"{n / 1000},1,{n / 500},{v:.9f}" for n, v in enumerate(VALUES))]
    message = refused(text(lines), **V, time="t1")
    assert "'t2'" in message
    assert bring(text(lines), **V, time="t2")[0].rate == 500.0


@pytest.mark.parametrize("cells", ["X_Value\tv\tComment", "X_Value\tv\tComment\t", "X_Value\tv"])
@pytest.mark.parametrize("end", ["", "\t"])
def test_names_of_cells_that_are_not_written(bring, cells, end):
    lines = rows("{t:.6f}\t{v:.9f}" + end)
    assert bring(text([cells, *lines]), **V, time="X_Value")[0].rate == 1000.0


@pytest.mark.parametrize("ends", [("", ";"), (";", "")])
def test_a_row_of_units_with_another_number_of_cells(bring, ends):
    lines = [f"t;v{ends[0]}", f"s;V{ends[1]}", *rows("{t:.6f};{v:.9f};")]
    done, _ = bring(text(lines), column={"velocity": "v"}, time="t")
    assert "names in line 1" in done.read_as


@pytest.mark.parametrize("rate", ["10 Hz", "99 Hz", "20 MHz"])
def test_an_unusual_rate_is_warned_of(bring, rate):
    done, _ = bring(text(["v", *rows("{v:.9f}")]), **V, rate=rate)
    assert "unusual rate" in done.warnings[0]


def test_the_guess_is_shown_and_recorded(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = ["Model;X", "Zeit (ms);v", *(row.replace(".", ",") for row in rows("{n};{v:.9f}"))]
    (tmp_path / "a.csv").write_text(text(lines))
    words = "import a.csv --out a.mcap --rig paper --without force --column.velocity v --measured"
    words = [*words.split(), "--unit.velocity", "m/s", "--trigger", "0 s", "--started", STARTED]
    words += ["--time", "Zeit (ms)", "--notes", "old"]
    assert app(words, print_error=False, exit_on_error=False) == 0
    guess = "2 lines before the rows, names in line 2, delimiter ';', decimal comma"
    assert f"read as: {guess}" in " ".join(capsys.readouterr().out.split())
    found = read_recording(tmp_path / "a.mcap")
    assert found.events[-1].text.endswith(f"read as: {guess}")
    assert found.session.notes.startswith("old\nimported from a.csv, sha256 ")


def test_a_format_without_such_an_option(refused):
    assert "--decimal" in refused(b"", "a.wav", decimal=",")


def about(date=datetime(2026, 2, 3, 3, 5, 6), step=1e-3):
    return {"wf_start_time": date, "wf_increment": step, "wf_start_offset": 0.0, "unit_string": "V"}


def tdms(path, *segments):
    with TdmsWriter(path) as writer:
        for channels in segments:
            writer.write_segment([ChannelObject(*channel) for channel in channels])
    return path.read_bytes()


@pytest.mark.parametrize("cut", [1, 8, 100, N * 8, N * 8 + 10, 2 * N * 8 - 1])
@pytest.mark.parametrize("segments", [1, 2])
def test_a_tdms_file_that_is_cut_off(tmp_path, refused, cut, segments):
    both = [("g", "v", VALUES, about()), ("g", "force", VALUES, about())]
    data = tdms(tmp_path / "a.tdms", *[both] * segments)
    message = refused(data[:-cut], "a.tdms", **V)
    assert f"{cut} bytes are missing" in message
    assert f"of {N}" in message


def test_a_tdms_segment_that_was_never_finished(tmp_path, refused):
    data = bytearray(tdms(tmp_path / "a.tdms", [("g", "v", VALUES, about())]))
    data[12:20] = b"\xff" * 8
    assert "never finished" in refused(bytes(data), "a.tdms", **V)


@pytest.mark.parametrize("other", [datetime(2019, 1, 1), datetime(1904, 1, 1)])
def test_a_date_is_that_of_the_channel_that_is_imported(tmp_path, bring, other):
    tdms(tmp_path / "a.tdms", [("g", "v", VALUES, about()), ("old", "c", VALUES, about(other))])
    bring(None, "a.tdms", **V, started=None)
    assert read_recording(tmp_path / "back.mcap").session.started == "2026-02-03T03:05:06+00:00"


def test_labview_s_date_0_is_none(tmp_path, refused):
    tdms(tmp_path / "a.tdms", [("g", "v", VALUES, about(datetime(1904, 1, 1)))])
    assert "--started" in refused(None, "a.tdms", **V, started=None)


def test_channels_of_different_dates(tmp_path, bring, refused):
    later = about(datetime(2026, 2, 3, 3, 5, 7))
    tdms(tmp_path / "a.tdms", [("g", "v", VALUES, about()), ("g", "f", VALUES, later)])
    both = {"column": {"velocity": "v", "force": "f"}, "without": ()}
    assert "03:05:07" in refused(None, "a.tdms", **both, started=None)
    assert "03:05:07" in bring(None, "a.tdms", **both)[0].warnings[0]


@pytest.mark.parametrize("given", [{"rate": "10 kHz"}, {"time": "t"}])
def test_a_wrong_rate_in_the_file_is_replaced(tmp_path, bring, given):
    t = np.arange(N) / 1e4
    tdms(tmp_path / "a.tdms", [("g", "v", VALUES, about(step=1.0)), ("g", "t", t, {})])
    done, _ = bring(None, "a.tdms", **V, **given)
    assert done.rate == pytest.approx(1e4)
    assert "1 Hz" in done.warnings[0]
    assert "10" in done.warnings[0]


def test_times_of_another_length(tmp_path, refused):
    tdms(tmp_path / "a.tdms", [("g", "v", VALUES, {}), ("g", "t", np.arange(N - 1) / 1e4, {})])
    assert f"'t' {N - 1}" in refused(None, "a.tdms", **TIMED)


WAV = {"column": {"velocity": "1"}, "full_scale": {"velocity": "4 V"}}
SAMPLES = np.arange(1, 102, dtype="<i2")
FRAMES = SAMPLES.tobytes()


def wav(data=FRAMES, riff=None, said=None, extra=b"", kind=b"RIFF", order="<", bits=16):
    said = len(data) if said is None else said
    frame = bits // 8
    form = struct.pack(f"{order}IHHIIHH", 16, 1, 1, 48_000, 48_000 * frame, frame, bits)
    body = b"WAVEfmt " + form + b"data" + struct.pack(f"{order}I", said) + data + extra
    return kind + struct.pack(f"{order}I", len(body) if riff is None else riff) + body


@pytest.mark.parametrize(
    "data",
    [
        wav(riff=36 + 100, said=100),
        wav(said=100),
        wav(said=204),
        wav(riff=0, said=0),
        wav(riff=2**32 - 1, said=2**32 - 1),
        wav(said=2**32 - 1),
        wav(riff=4),
        wav(riff=36 + 201, said=201),
        wav(extra=b"abcd"),
        wav(extra=bytes(8)),
        wav(extra=b"data" + struct.pack("<I", 2) + b"ab"),
        wav()[:-1],
        wav() + b"ab",
        wav(said=100, kind=b"RIFX", order=">", riff=36 + 100),
    ],
)
def test_wav_headers_that_differ_from_their_content(refused, data):
    message = refused(data, "a.wav", **WAV)
    assert "header" in message
    assert "Error" not in message


def rf64(samples):
    data, form = samples.tobytes(), struct.pack("<IHHIIHH", 16, 1, 1, 48_000, 96_000, 2, 16)
    body = b"fmt " + form + b"data" + b"\xff" * 4 + data
    sizes = struct.pack("<IQQQI", 28, len(body) + 40, len(data), len(samples), 0)
    return b"RF64" + b"\xff" * 4 + b"WAVEds64" + sizes + body


@pytest.mark.parametrize(
    ("data", "values"),
    [
        (wav(), SAMPLES),
        (wav(extra=b"LIST" + struct.pack("<I", 3) + b"abc\0"), SAMPLES),
        (wav(SAMPLES.astype(">i2").tobytes(), kind=b"RIFX", order=">"), SAMPLES),
        (wav(bytes([129] * 5), bits=8), [256] * 5),
        (wav(bytes([129] * 5), bits=8, said=5, extra=b"\0"), [256] * 5),
        (wav(bytes([129] * 5), bits=8, riff=36 + 5, said=5, extra=b"\0"), [256] * 5),
        (rf64(SAMPLES), SAMPLES),
    ],
)
def test_wav_headers_that_are_right(bring, data, values):
    _, volts = bring(data, "a.wav", **WAV)
    np.testing.assert_array_equal(volts, np.asarray(values) * 4 / 2**15)


def test_rf64_that_lies(refused):
    assert "header" in refused(rf64(SAMPLES)[:-2], "a.wav", **WAV)
    assert "header" in refused(rf64(SAMPLES) + b"ab", "a.wav", **WAV)


def test_a_wav_file_of_scipy(tmp_path, bring):
    wavfile.write(tmp_path / "a.wav", 48_000, SAMPLES)
    assert len(bring(None, "a.wav", **WAV)[1]) == len(SAMPLES)


@pytest.fixture
def hdf5(tmp_path):
    """Return a function that writes a dataset with attributes."""

    def hdf5(data, **attributes):
        with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
            file["v"] = data
            file["v"].attrs.update({"units": "V"} | attributes)

    return hdf5


PACKED = np.arange(1, N + 1, dtype="i2")


@pytest.mark.parametrize(
    ("attributes", "values"),
    [
        slow({}, PACKED),
        slow({"scale_factor": 0.1}, PACKED * 0.1),
        slow({"scale_factor": np.array([0.1])}, PACKED * 0.1),
        ({"scale_factor": 0.1, "add_offset": 2.0}, PACKED * 0.1 + 2),
        slow({"add_offset": -1}, PACKED - 1.0),
        ({"conversion": 0.1, "offset": 2.0}, PACKED * 0.1 + 2),
        ({"_FillValue": np.int16(-1), "long_name": "speed"}, PACKED),
    ],
)
def test_packed_values(hdf5, bring, attributes, values):
    hdf5(PACKED, **attributes)
    _, volts = bring(None, "a.h5", column={"velocity": "v"}, rate="1 kHz")
    np.testing.assert_allclose(volts, values, rtol=1e-12)


@pytest.mark.parametrize(
    ("attributes", "word"),
    [
        ({"_FillValue": np.int16(3)}, "row 3"),
        ({"missing_value": np.array([7, 3], "i2"), "scale_factor": 0.1}, "2 rows"),
        slow({"_Unsigned": "true"}, "_Unsigned"),
        ({"scale_factor": 0.1, "conversion": 0.1}, "conversion, scale_factor"),
        slow({"scale_factor": "0.1"}, "scale_factor"),
        slow({"scale_factor": [0.1, 0.2]}, "scale_factor"),
        slow({"valid_range": [0, 1]}, "valid_range"),
        ({"Gain": 10.0}, "Gain"),
    ],
)
def test_packed_values_that_are_refused(hdf5, refused, attributes, word):
    hdf5(PACKED, **attributes)
    assert word in refused(None, "a.h5", column={"velocity": "v"}, rate="1 kHz")


def test_blocks_that_were_never_written(tmp_path, refused):
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("v", (100,), "f8", chunks=(10,))[:50] = 1.0
    assert "never written" in refused(None, "a.h5", **RATED)
