"""HDF5, TDMS, WAV and xarray: what their own readers see of a recording, and back."""

import json

import h5py
import numpy as np
import pytest
from nptdms import TdmsFile
from scipy.io import wavfile

from sautereau.daq.convert.export import ENDING, columns_of, export, to_xarray
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Block, Joints
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.samples import Scaling
from sautereau.daq.signals.calibration import to_si, undo_high_pass
from tests.recordings import write_recording

RATE = 51_203.277
FIRST = -700
US = np.timedelta64(1, "us")
COUNTS = np.random.default_rng(3).integers(-12_000, 12_000, (2, 5000)).astype(np.int16)
LINEAR = np.array([[1e-3, 20 / 65536], [-2e-4, -20.1 / 65536]])
CUBIC = np.hstack([LINEAR, [[1e-12, 0.0], [0.0, -1e-17]]])
KINDS = ("volts", "counts", "cubic")


@pytest.fixture
def recording(tmp_path, paper, session, volts, request):
    """A recording of volts, counts, or counts with a polynomial of degree 3."""
    kind = getattr(request, "param", "counts")
    scaling = {"volts": None, "counts": Scaling("int16", LINEAR), "cubic": Scaling("int16", CUBIC)}
    t = np.linspace(0, 0.09, 20)
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, rate=RATE, scaling=scaling[kind]) as made:
        made.write_block(Block(FIRST, volts if kind == "volts" else COUNTS))
        made.event("motion", "started", 1.2e-3, 3e-5)
        made.write_plan(t, t + 1, t + 2, t / 100)
        made.write_joints(Joints(t, t + 4, t + 5))
    return path


@pytest.mark.parametrize("to", ["h5", "tdms", "wav"])
@pytest.mark.parametrize("recording", KINDS, indirect=True)
def test_it_comes_back_bit_for_bit_with_everything(tmp_path, recording, to):
    out = tmp_path / f"press.{to}"
    files = export(recording, to, out)
    assert files == [out, tmp_path / "press.wav.json"][: 1 + (to == "wav")]
    assert not list(tmp_path.glob(f"*{ENDING}"))
    back = tmp_path / "back.mcap"
    import_file(out, back, rig=None, options=ImportOptions())
    was, found = read_recording(recording), read_recording(back)
    for name, volts in was.volts.items():
        assert np.array_equal(found.volts[name].view("u8"), volts.view("u8"))
    for name in ("t0_ns", "rate", "first_sample", "rig"):
        assert getattr(found, name) == getattr(was, name)
    assert set(was.events) < set(found.events)
    for one, other in ((was.plan, found.plan), (was.joints, found.joints)):
        for name, values in vars(one).items():
            assert np.array_equal(getattr(other, name), values)


@pytest.mark.parametrize("recording", KINDS[1:], indirect=True)
def test_h5py_sees_data_with_conversion_rate_and_start(tmp_path, recording, paper, request):
    export(recording, "h5", tmp_path / "press.h5")
    was = read_recording(recording)
    counts = request.node.callspec.params["recording"] == "counts"
    with h5py.File(tmp_path / "press.h5") as file:
        assert json.loads(file["sautereau"].asstr()[()])["session"]["press"] == "3"
        for row, channel in enumerate(paper.daq.channels):
            data = file[f"acquisition/{channel.name}/data"]
            assert data.dtype == (np.int16 if counts else np.float64)
            assert not counts or np.array_equal(data[()], COUNTS[row])
            volts = data[()] * data.attrs["conversion"] + data.attrs["offset"]
            assert data.attrs["unit"] == "V"
            assert np.array_equal(volts, was.volts[channel.name])
            start = file[f"acquisition/{channel.name}/starting_time"]
            assert (start[()], start.attrs["rate"]) == (FIRST / RATE, RATE)
            si = file[f"processing/{channel.name}/data"]
            assert si.attrs["unit"] == channel.unit
            assert 4900 < len(si) < 5000


@pytest.mark.parametrize("recording", KINDS[1:], indirect=True)
def test_nptdms_sees_scaled_waveforms(tmp_path, recording, paper, request):
    export(recording, "tdms", tmp_path / "press.tdms")
    was = read_recording(recording)
    counts = request.node.callspec.params["recording"] == "counts"
    file = TdmsFile.read(tmp_path / "press.tdms")
    for row, channel in enumerate(paper.daq.channels):
        found = file["raw"][f"{channel.name} [V]"]
        assert np.array_equal(found[:], was.volts[channel.name])
        assert not counts or np.array_equal(found.raw_data, COUNTS[row])
        np.testing.assert_allclose(found.time_track(), was.time, atol=1e-12)
        # npTDMS cuts to microseconds both as it writes and as it reads.
        assert abs(found.properties["wf_start_time"] - np.datetime64(was.t0_ns, "ns")) < 2 * US
        si = file["SI"][f"{channel.name} [{channel.unit}]"]
        assert si.properties["unit_string"] == channel.unit


def test_scipy_sees_doubles_of_a_stated_full_scale(tmp_path, recording, paper):
    export(recording, "wav", tmp_path / "press.wav")
    rate, frames = wavfile.read(tmp_path / "press.wav")
    about = json.loads((tmp_path / "press.wav.json").read_text())
    assert rate == 51_203
    assert about["rate"] == RATE
    assert np.abs(frames).max() <= 1
    for k, (name, volts) in enumerate(read_recording(recording).volts.items()):
        assert paper.daq.channels[k].range <= about["full_scale"][name] < 20
        assert np.array_equal(frames[:, k] * about["full_scale"][name], volts)


def test_a_voltage_keeps_its_raw_volts(tmp_path, paper, volts):
    channel = paper.daq.channels[0].model_copy(update={"quantity": "voltage", "scale": 3.0})
    rig = paper.replaced({"daq.channels": (channel,)})
    path = write_recording(tmp_path / "press.mcap", rig, volts[:1])
    for to in ("parquet", "tdms"):
        export(path, to, tmp_path / f"table.{to}")
        back = tmp_path / f"{to}.mcap"
        import_file(tmp_path / f"table.{to}", back, rig=None, options=ImportOptions())
        assert np.array_equal(read_recording(back).volts["velocity"], volts[0])


def test_an_nwb_file_of_another_program_needs_neither_rate_nor_unit(tmp_path, paper):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["acquisition/velocity/data"] = COUNTS[0]
        file["acquisition/velocity/data"].attrs.update(unit="volts", conversion=1e-4, offset=0.5)
        file["acquisition/velocity/starting_time"] = -0.25
        file["acquisition/velocity/starting_time"].attrs["rate"] = 1000.0
    options = ImportOptions(
        column={"velocity": "acquisition/velocity/data"},
        without=("force",),
        trigger="0 s",
        started="2026-02-03T04:05:06+01:00",
        simulated=False,
    )
    done = import_file(path, tmp_path / "back.mcap", rig=paper, options=options)
    assert (done.rate, done.first_sample) == (1000.0, -250)
    found = read_recording(tmp_path / "back.mcap").volts["velocity"]
    assert np.array_equal(found, COUNTS[0] * 1e-4 + 0.5)


@pytest.mark.parametrize("to", ["h5", "tdms"])
def test_an_export_that_lacks_a_channel_is_refused(tmp_path, recording, paper, to, monkeypatch):
    monkeypatch.setattr(
        "sautereau.daq.convert.export.columns_of",
        lambda recorded, raw: [c for c in columns_of(recorded, raw) if c.channel != "force"],
    )
    export(recording, to, tmp_path / f"press.{to}")
    with pytest.raises(RecordingError, match=r"it lacks the columns force \[V\]"):
        import_file(
            tmp_path / f"press.{to}", tmp_path / "x.mcap", rig=None, options=ImportOptions()
        )


def test_xarray_has_si_values_motion_and_units(recording, paper):
    pytest.importorskip("xarray")
    was = read_recording(recording)
    found, raw = to_xarray(was), to_xarray(was, raw=True)
    velocity = paper.daq.channels[0]
    assert found["velocity"].attrs["units"] == "m/s"
    assert found["joints_q2"].dims == ("joints_time",)
    assert found["plan_jack_rise"].attrs["units"] == "m"
    assert found.attrs["press"] == "3"
    assert np.isfinite(found["velocity"]).all()
    assert len(found["time"]) == len(found["force"]) == 5000 - int(np.ceil(velocity.lag * RATE))
    assert np.array_equal(raw["force"], was.volts["force"])
    assert np.array_equal(raw["time"], was.time)
    # The delay is compensated: the value at t is what the sensor gave a delay later.
    seen = undo_high_pass(to_si(was.volts["velocity"], velocity), velocity.high_pass, RATE)
    t, smooth = found["time"].to_numpy()[500:900], np.ones(200) / 200
    late = np.interp(t + velocity.lag, was.time, np.convolve(seen, smooth, "same"))
    averaged = np.convolve(found["velocity"], smooth, "same")[500:900]
    assert np.abs(averaged - late).max() < 0.1 * np.abs(late).max()
