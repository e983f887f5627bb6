"""Recordings read back as presses: scale, droop, delay."""

import numpy as np
import pytest

from analysis.errors import AnalysisError
from analysis.press import UNITS, load_press
from daq.block import Block
from daq.errors import RecordingError
from daq.recording import Recording
from daq.session_info import SessionInfo
from rig.load import with_values

RATE = 51_200.0


@pytest.fixture
def record(tmp_path):
    def write(rig, volts, simulated=True):
        session = SessionInfo(1, "2026-02-03T04:05:06+01:00", simulated, "DMC", "card")
        path = tmp_path / "press-0001.mcap"
        with Recording(path, rig, session=session, clock=lambda: 10**18) as recording:
            recording.write_block(Block(0, np.asarray(volts)))
        return path

    return write


def ideal(paper, **values):
    plain = {
        f"daq.channels.{i}.{name}": zero
        for i in (0, 1)
        for name, zero in (("delay", "0 s"), ("high_pass", "0 Hz"), ("low_pass", "0 Hz"))
    }
    return with_values(paper, plain | values)


def test_columns_units_and_origin(paper, record):
    path = record(ideal(paper), np.ones((2, 2000)))
    press = load_press(path)
    assert list(press.data.columns) == list(UNITS)
    assert press.data.attrs["units"] == UNITS
    assert press.data.attrs["simulated"] is True
    assert press.simulated
    assert press.rate == RATE
    assert press.path == path
    assert press.data.index.name == "time"
    np.testing.assert_allclose(press.data.index, np.arange(2000) / RATE, rtol=1e-12)


def test_constant_speed_through_the_lever(paper, record):
    """1 V is 25 mm/s under the laser; the angle is its integral over the laser's arm."""
    press = load_press(record(ideal(paper), np.stack([np.ones(2000), np.full(2000, 0.5)]), False))
    assert not press.simulated
    time, key = press.data.index.to_numpy(), paper.key
    np.testing.assert_allclose(press.data["velocity"], 0.025, rtol=1e-12)
    np.testing.assert_allclose(press.data["force"], 0.5, rtol=1e-12)
    np.testing.assert_allclose(press.data["deflection"], 0.025 * time, rtol=1e-9, atol=1e-15)
    angle = 0.025 * time / key.laser_arm
    rise = key.jack_arm * np.tan(angle) + key.jack_surface_height * (1 / np.cos(angle) - 1)
    np.testing.assert_allclose(press.data["jack_rise"], rise, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(
        press.data["jack_speed"], np.gradient(rise, time, edge_order=2), rtol=1e-6
    )


@pytest.mark.parametrize("delay", ["0 s", "10 us", "19.53125 us", "1.1 ms"])
def test_every_delay_is_taken_back(paper, record, delay):
    """A sine that the chart says came late is back in its place, whole samples or not."""
    rig = ideal(paper, **{"daq.channels.0.delay": delay})
    late, f = rig.daq.channels[0].delay, 200.0
    time = np.arange(4000) / RATE
    volts = np.stack([np.sin(2 * np.pi * f * (time - late)), np.sin(2 * np.pi * f * time)])
    press = load_press(record(rig, volts))
    expected = np.sin(2 * np.pi * f * press.data.index.to_numpy())
    np.testing.assert_allclose(press.data["velocity"] / 0.025, expected, atol=8e-5)
    np.testing.assert_allclose(press.data["force"], expected, atol=1e-12)
    assert len(press.data) == 4000 - int(np.ceil(late * RATE - 1e-9))


def test_droop_is_undone(paper, record):
    """A step of force through AC coupling of 0.1 Hz comes back as a step."""
    rig = ideal(paper, **{"daq.channels.1.high_pass": "0.1 Hz"})
    time = np.arange(25_600) / RATE
    volts = np.stack([np.zeros_like(time), np.exp(-2 * np.pi * 0.1 * time)])
    press = load_press(record(rig, volts))
    np.testing.assert_allclose(press.data["force"], 1.0, atol=1e-9)


def test_nothing_is_filled_in(paper, record):
    press = load_press(record(paper, np.random.default_rng(0).standard_normal((2, 3000))))
    assert np.isfinite(press.data.to_numpy()).all()


@pytest.mark.parametrize(("n", "left"), [(70, 13), (57, 0), (56, 0), (20, 0), (1, 0)])
def test_too_short_for_its_delay(paper, record, n, left):
    """1.1 ms are 56.3 samples."""
    with pytest.raises(AnalysisError, match=rf"0001\.mcap: {left} samples are left once the delay"):
        load_press(record(paper, np.ones((2, n))))


@pytest.mark.parametrize("kept", ["velocity", "force"])
def test_both_quantities_are_needed(paper, record, kept):
    channel = paper.daq.channel(kept)
    daq = paper.daq.model_copy(update={"channels": (channel,)})
    missing = {"velocity": "force", "force": "velocity"}[kept]
    with pytest.raises(
        AnalysisError, match=f"it has no {missing} channel, .* quantity = '{missing}'"
    ):
        load_press(record(paper.model_copy(update={"daq": daq}), np.ones((1, 3000))))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        load_press(tmp_path / "none.mcap")
