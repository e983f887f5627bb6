"""Pre-trigger and continuous acquisitions on the complete stand-in."""

import time

import numpy as np
import pytest

from sautereau.daq.file.reading import read_recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press
from tests.presses import QUICK

RIG = with_values(load_rig(), QUICK)


def changed(rig, **values):
    return rig.model_copy(update={"daq": rig.daq.model_copy(update=values)})


def edge(stand_in):
    stand_in.bench.receive(f"SB {stand_in.rig.controller.trigger_output}\r".encode())


@pytest.fixture
def reader():
    """A continuous acquisition that has been started, and its stand-in."""
    with (
        StandIn(load_rig(), load_scene("ideal")) as stand_in,
        Acquisition(stand_in.rig.daq, None, triggered=False) as acquisition,
    ):
        acquisition.start()
        yield acquisition.blocks(), stand_in


@pytest.mark.slow
def test_a_press_is_the_same_with_and_without_a_pretrigger(tmp_path):
    found = []
    scene = load_scene("ideal").model_copy(update={"sensors": load_scene("paper").sensors})
    for before in (0.0, 0.03):
        with StandIn(RIG, scene) as stand_in:
            rig = changed(stand_in.rig, pre_trigger=before)
            presses = [Item(rig, plan_press(rig))]
            (path,) = make_presses(GalilController(rig), tmp_path / str(before), presses)
            assert len(stand_in.truth()) == 1
        found.append(read_recording(path))
    start, around = found
    n = 1536
    assert (start.first_sample, around.first_sample) == (0, -n)
    for name in ("velocity", "force"):
        a, b = start.volts[name], around.volts[name]
        assert len(b) == len(a) + n
        far = np.abs(b[n:] - a) > 0.1 * np.ptp(a)
        assert np.mean(far) < 1e-3  # a jump may be one sample apart


def test_an_edge_before_there_are_enough_samples_is_ignored():
    with StandIn(load_rig(), load_scene("ideal")) as stand_in:
        daq = changed(stand_in.rig, pre_trigger=0.03, trigger_timeout=0.3).daq
        with Acquisition(daq, 0.05) as acquisition:
            acquisition.start()
            edge(stand_in)
            first = next(acquisition.blocks())
            assert first.first_sample == -1536


@pytest.mark.parametrize("before", [0.0, 0.03])
@pytest.mark.parametrize("trigger_edge", ["rising", "falling"])
def test_only_the_edge_of_the_rig_is_one(before, trigger_edge):
    with StandIn(load_rig(), load_scene("ideal")) as stand_in:
        values = {"pre_trigger": before, "trigger_timeout": 5.0, "trigger_edge": trigger_edge}
        daq, output = changed(stand_in.rig, **values).daq, stand_in.rig.controller.trigger_output
        card, receive = stand_in.bench.card, stand_in.bench.receive
        first, then = ("CB", "SB") if trigger_edge == "rising" else ("SB", "CB")
        receive(f"{then} {output}\r".encode())
        with Acquisition(daq, 0.02) as acquisition:
            acquisition.start()
            receive(f"{first} {output}\r".encode())
            assert not card.starts
            receive(f"{then} {output}\r".encode())
            assert next(acquisition.blocks()).first_sample == -round(before * daq.sample_rate)
            assert len(card.starts) == 1


def test_time_does_not_run_far_ahead_of_a_continuous_reader(reader):
    blocks, stand_in = reader
    for _ in range(5):
        next(blocks)
    assert stand_in.bench.world.time < 1


def test_a_reader_that_returns_restarts_the_clock(reader):
    blocks, stand_in = reader
    for _ in range(2):
        while stand_in.bench.busy:  # until simulated time is as far ahead as allowed
            next(blocks, None)
            time.sleep(0.05)
        got = [next(blocks).first_sample for _ in range(15)]
        assert np.diff(got).tolist() == [stand_in.rig.daq.block] * 14
