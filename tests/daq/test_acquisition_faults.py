"""Every fault of the stand-in's card, survived: what came before is in a well closed recording."""

import numpy as np
import pytest
from mcap.reader import make_reader

from sautereau.daq.errors import DaqError, RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import StandIn
from tests.presses import mute_scene

AT = 3000
WHOLE = 2048
"""Samples, of the complete blocks before that."""

FAULTS = [
    ("overrun", {"sample": AT}, WHOLE, "-200279", "raise daq.block"),
    ("server_gone", {"sample": AT}, WHOLE, "no answer while reading", "check that the server runs"),
    ("device_gone", {"sample": AT}, WHOLE, "no such device (-201003)", "plugged in"),
    ("trigger_missing", {}, 0, "no edge on /Dev1/PFI0", "cable"),
]


@pytest.mark.parametrize("duration", [0.1, None], ids=["finite", "continuous"])
@pytest.mark.parametrize(("name", "fault", "n", "what", "how_to_fix"), FAULTS)
def test_a_fault_of_the_card(tmp_path, session, duration, name, fault, n, what, how_to_fix):
    rig = with_values(load_rig(), {"daq.trigger_timeout": "0.4 s"})
    with StandIn(rig, mute_scene(faults={name: fault})) as stand_in:
        rig = stand_in.rig
        recording = Recording(tmp_path / "a.mcap", rig, session=session)
        with (
            pytest.raises(DaqError) as caught,
            Acquisition(rig.daq, duration) as acquisition,
            recording,
        ):
            _record(stand_in, acquisition, recording)
    assert what in str(caught.value)
    assert how_to_fix in str(caught.value)
    assert not (tmp_path / "a.mcap").exists()
    if n == 0:
        with pytest.raises(RecordingError, match="holds no samples"):
            read_recording(recording.part_path)
        assert what.encode() in b"".join(_events(recording.part_path))
        return
    found = read_recording(recording.part_path)
    assert sum(np.size(volts) for volts in found.volts.values()) == 2 * n
    assert found.events[-1].kind == "aborted"
    assert what in found.events[-1].text


def _record(stand_in, acquisition, recording):
    acquisition.start()
    stand_in.bench.receive(f"SB {stand_in.rig.controller.trigger_output}\r".encode())
    for block in acquisition.blocks():
        recording.write_block(block)


def _events(path):
    with path.open("rb") as file:
        for _, _, message in make_reader(file, validate_crcs=True).iter_messages("/events"):
            yield message.data
