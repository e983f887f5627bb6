"""Codes of the driver are explained; no number that is none is recorded, whatever the source."""

import math
import re

import numpy as np
import pytest

from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.daq.source.driver_faults import KNOWN
from sautereau.sim_backend.devices.daqmx.card import DaqmxError


def test_any_source_is_held_to_finite_numbers(paper, session, tmp_path):
    """At the first sample too: nothing is recorded."""
    with (
        pytest.raises(DaqError, match="nan V of velocity at sample -3"),
        Recording(tmp_path / "a.mcap", paper, session=session) as recording,
    ):
        recording.write_block(Block(-3, np.array([[math.nan, 1.0], [0.0, 2.0]])))
    with pytest.raises(DaqError, match="no samples"):
        read_recording(recording.part_path)
    with pytest.raises(DaqError, match="nan Hz"):
        Recording(tmp_path / "b.mcap", paper, session=session, rate=math.nan)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (-50405, "plug the device in again"),
        (-200999, "First line of the driver. Second line"),
    ],
)
def test_a_code_of_the_driver_says_what_it_means(bench, monkeypatch, code, said):
    """And a code that is not in the table brings the driver's text, without a cause or advice."""

    def refuse(self):
        raise DaqmxError(code, "First line of the driver.\nSecond line.")

    monkeypatch.setattr("sautereau.sim_backend.devices.daqmx.progress.CardTask.start", refuse)
    _, _, rig = bench()
    with pytest.raises(DaqError) as caught, Acquisition(rig.daq, 0.1) as source:
        source.start()
    message = str(caught.value)
    assert f"Dev1: the driver ended arming with {code}: " in message
    assert said in message
    assert "{" not in message


@pytest.mark.parametrize(
    ("codes", "advice"),
    [
        ((-50405, -200983, -200088, -88709), "press again"),
        ((-50405, -201003), "plug"),
        ((-50152, -88709), "reset"),
        ((-200714, -200279, -200361), "lower daq.sample_rate"),
        ((-201003,), "cannot be accessed"),
    ],
)
def test_advice_is_about_what_the_code_means(codes, advice):
    for code in codes:
        assert advice in "; ".join(KNOWN[code])
        assert "setting" not in "; ".join(KNOWN[code])


def test_the_table_names_codes_of_the_driver():
    from nidaqmx.error_codes import DAQmxErrors

    assert [code for code in KNOWN if code not in {one.value for one in DAQmxErrors}] == []
    assert len(KNOWN) <= 45
    facts = {name for what, _ in KNOWN.values() for name in re.findall(r"{(.*?)}", what)}
    assert facts == {"channels", "terminals", "devices", "block", "rate"}
