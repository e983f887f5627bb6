"""A recording of format 1 is read and recovered as before format 2."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_parts, read_recording, read_window, stream
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe
from tests.daq.damage import chunks, corrupt

RATE = 51_203.277
PATH = Path(__file__).parents[1] / "data" / "format_1.mcap"
INDEX = np.arange(24_000)
VOLTS = {"velocity": (INDEX % 7 - 3.0) / 8, "force": (INDEX // 100) / 64}
BEGIN, CHUNK = -1000, 11_000


def is_true(part):
    at = part.first_sample - BEGIN
    return all(
        np.array_equal(part.volts[name], volts[at : at + part.n_samples])
        for name, volts in VOLTS.items()
    )


def test_it_is_read_with_everything_in_it():
    found, t = read_recording(PATH), np.linspace(0, 0.14, 8)
    assert (found.rate, found.first_sample, found.n_samples) == (RATE, BEGIN, 24_000)
    assert found.t0_ns == 1_700_000_000_000_019_530
    assert is_true(found)
    assert found.complete
    assert found.session.notes == "north window open; é"
    assert [(e.time, e.kind, e.text) for e in found.events] == [(0.0, "trigger", "PFI0 rose")]
    assert np.array_equal(found.plan.jack_rise, t + 3)
    assert np.array_equal(found.joints.e2, t)
    assert describe(PATH)["messages"] == {
        "/daq/velocity": 24,
        "/daq/force": 24,
        "/preview/velocity": 449,
        "/preview/force": 449,
        "/plan": 1,
        "/joints": 1,
        "/events": 1,
    }


def test_stretches_and_windows_of_it():
    assert all(map(is_true, stream(PATH, 0.1)))
    window = read_window(PATH, 0.2, 0.3)
    assert (window.first_sample, window.n_samples) == (10_241, 5_120)
    assert is_true(window)


def test_what_is_intact_is_recovered(tmp_path):
    path = Path(shutil.copy(PATH, tmp_path / "press.mcap"))
    corrupt(path, chunks(path)[1][0] + 500)
    with pytest.raises(RecordingError, match="corrupted"):
        read_recording(path)
    found = recover(path)
    assert {(g.first_sample, g.stop_sample) for g in found.gaps} == {(10_000, 21_000)}
    assert all(map(is_true, read_parts(found.path)))
    assert describe(found.path)["events"] == describe(PATH)["events"]
