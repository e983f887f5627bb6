"""Continuous, around the trigger's edge, many channels, and the dry run, over the real nidaqmx."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.sim_backend.device_types import IDEAL
from sautereau.sim_backend.devices.daqmx.card import ENDLESS
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from tests.cards import Card, volts


@pytest.fixture
def card():
    card = Card(16, ready=lambda n: n)
    card.acquired = lambda run: run.setup.before
    return card


@pytest.fixture
def rig(card, paper):
    with DaqmxServer(card) as server:
        values = {"address": server.address, "trigger_timeout": 0.2}
        yield paper.model_copy(update={"daq": paper.daq.model_copy(update=values)})


def changed(rig, **values):
    return rig.model_copy(update={"daq": rig.daq.model_copy(update=values)})


def read(acquisition, n):
    """Read n blocks as one."""
    blocks = acquisition.blocks()
    return np.concatenate([next(blocks).volts for _ in range(n)], axis=1)


def record(acquisition, recording):
    acquisition.start()
    for block in acquisition.blocks():
        recording.write_block(block)


@pytest.mark.parametrize("triggered", [False, True])
def test_a_continuous_acquisition_continues_until_it_is_left(card, rig, triggered):
    with Acquisition(rig.daq, None, triggered=triggered) as acquisition:
        assert acquisition.n_samples is None
        acquisition.start()
        assert np.array_equal(read(acquisition, 40), volts(0, 40 * 1024, 2))
    (run,) = card.runs
    assert run.setup.trigger == ("/Dev1/PFI0" if triggered else None)
    assert run.setup.n_samples == ENDLESS
    assert run.stopped.is_set()


def test_sixteen_channels_in_their_order(card, rig):
    channel = rig.daq.channels[0]
    channels = tuple(
        channel.model_copy(update={"name": f"c{n}", "terminal": f"ai{15 - n}"}) for n in range(16)
    )
    with Acquisition(changed(rig, channels=channels).daq, 0.1, triggered=False) as acquisition:
        acquisition.start()
        assert np.array_equal(read(acquisition, 5), volts(0, 5120, 16))
    assert card.runs[0].setup.terminals == tuple(f"Dev1/ai{n}" for n in range(15, -1, -1))


def test_samples_before_the_edge_are_recorded_below_zero(card, rig, session, tmp_path):
    rig = changed(rig, pre_trigger=0.05)
    with Acquisition(rig.daq, 0.1) as acquisition:
        assert acquisition.n_samples == 7680
        with Recording(tmp_path / "a.mcap", rig, session=session) as recording:
            record(acquisition, recording)
    assert card.runs[0].setup.before == 2560
    assert card.runs[0].setup.n_samples == 7680
    found = read_recording(tmp_path / "a.mcap")
    assert found.first_sample == -2560
    assert np.array_equal(found.volts["force"], volts(0, 7680, 2)[1])


def test_start_returns_when_the_samples_before_the_edge_are_there(card, rig):
    card.acquired = lambda run: 100 * run.asked
    with Acquisition(changed(rig, pre_trigger=0.01).daq, 0.1) as acquisition:
        acquisition.start()
        assert card.runs[0].asked == 6
        card.acquired = lambda run: 0
        acquisition.stop()
        with pytest.raises(DaqError, match=r"0 samples after 0\.21 s.*pre_trigger needs 512"):
            acquisition.start()


def test_no_edge_for_samples_around_it(card, rig):
    card.ready = lambda n: 0
    with Acquisition(changed(rig, pre_trigger=0.01).daq, 0.05) as acquisition:
        acquisition.start()
        with pytest.raises(DaqError, match="no edge on /Dev1/PFI0"):
            next(acquisition.blocks())


def test_a_device_without_a_reference_trigger_says_so(bench):
    card = Card(device=replace(IDEAL, reference_trigger=False))
    _, _, rig = bench(card, daq__pre_trigger="10 ms")
    with pytest.raises(DaqError, match="no reference trigger"), Acquisition(rig.daq, 0.05):
        pass


@pytest.mark.parametrize(
    ("there", "message", "n"),
    [
        (lambda n: n if n <= 4096 else n + 512_001, r"-200279.*raise daq\.block", 4096),
        (lambda n: min(n, 1500), "stopped at 1500:", 1500),
    ],
    ids=["slow reader", "short block"],
)
def test_samples_before_an_error_are_kept(card, rig, session, tmp_path, there, message, n):
    """The file is properly closed with n samples, and gives the reason."""
    card.ready = there
    with (
        pytest.raises(DaqError, match=message) as caught,
        Acquisition(rig.daq, None, triggered=False) as acquisition,
        Recording(tmp_path / "a.mcap", rig, session=session) as recording,
    ):
        record(acquisition, recording)
    assert any(str(recording.part_path) in note for note in caught.value.__notes__)
    found = read_recording(recording.part_path)
    assert np.array_equal(found.volts["velocity"], volts(0, n, 2)[0])
    assert found.events[-1].kind == "aborted"
    assert str(caught.value) in found.events[-1].text


def test_samples_that_the_driver_passes_over(paper, card):
    with DaqmxServer(card) as server:
        daq = paper.daq.model_copy(update={"address": server.address})
        with Acquisition(daq, None, triggered=False) as acquisition:
            acquisition.start()
            blocks = acquisition.blocks()
            next(blocks)
            (task,) = server._servicer._tasks.values()
            task.position += 7
            with pytest.raises(DaqError, match="7 samples were lost before sample 1031"):
                next(blocks)


def test_a_dry_run_returns_what_the_device_has_accepted(card, rig):
    with Acquisition(changed(rig, pre_trigger=0.01).daq, 0.1) as acquisition:
        found = acquisition.settings()
    assert card.runs == []
    assert [channel.terminal for channel in found.channels] == ["Dev1/ai0", "Dev1/ai1"]
    assert (found.channels[0].range, found.channels[0].device_high) == (4.0, 10.0)
    assert found.channels[0].device_low == -10.0
    assert (found.rate, found.block, found.trigger) == (51_200.0, 1024, "/Dev1/PFI0")
    assert (found.n_samples, found.pre_trigger_samples, found.buffer) == (5632, 512, 5632)
    assert found.simulated
    with Acquisition(rig.daq, None, triggered=False) as acquisition:
        found = acquisition.settings()
    assert (found.n_samples, found.buffer, found.trigger) == (None, 512_000, "")


def test_every_fault_of_a_plan_is_reported_at_once(paper):
    daq = paper.daq.model_copy(update={"block": 16, "pre_trigger": 0.1})
    reads = "3200 reads per second, not 10 to 100; set it to a value from 512 to 5120"
    with pytest.raises(DaqError, match=rf"(?s)daq\.pre_trigger: 0\.1 s.*{reads}"):
        Acquisition(daq, None)
    for block, said in ((100, "512 reads"), (10_240, "5 reads")):
        with pytest.raises(DaqError, match=said):
            Acquisition(paper.daq.model_copy(update={"block": block}), 1.0)
