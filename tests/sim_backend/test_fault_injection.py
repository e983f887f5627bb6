"""Fault injection over the real parts: pyserial, nidaqmx, and this project's own driver."""

from types import SimpleNamespace

import grpc
import nidaqmx
import numpy as np
import pytest
from nidaqmx import GrpcSessionOptions
from nidaqmx.errors import RpcError
from nidaqmx.system import Device

from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import (
    GarbledAnswer,
    SettingNotTaken,
    SilentController,
)
from sautereau.sim_backend.bench import Bench, StandIn
from sautereau.sim_backend.errors import SceneError
from tests.presses import QUICK, mute_scene, press_on


@pytest.fixture
def injected(tmp_path):
    """Make presses with faults; return the recordings, the error and the final state."""

    def press(finger="ideal", *, n=1, seed=0, rig=QUICK, afterwards=None, **tables):
        scene = mute_scene(finger, faults=tables)
        made, error = [], None
        out = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        with StandIn(with_values(load_rig(), rig), scene, seed) as stand_in:
            try:
                press_on(stand_in, out, n, on_press=lambda item, path: made.append(path))
            except Exception as caught:  # noqa: BLE001 - the tests ask for its kind
                error = caught
            if afterwards:
                afterwards(stand_in)
            on = stand_in.bench.firmware.motors_on
            return SimpleNamespace(made=made, error=error, motors_on=on, truth=stand_in.truth())

    return press


def is_safe(found) -> bool:
    """Whether the motors are off, and the error says that this is confirmed."""
    lines = [str(found.error), *getattr(found.error, "__notes__", ())]
    return found.motors_on == (False, False) and any("confirms it" in line for line in lines)


# The card.


@pytest.mark.parametrize(
    ("name", "said", "later", "code"),
    [
        ("device_gone", "-201003", nidaqmx.DaqError, "-201003"),
        ("server_gone", "no answer while reading", RpcError, "UNAVAILABLE"),
    ],
)
def test_a_card_or_server_that_is_gone_stays_so(injected, name, said, later, code):
    """For this project's driver in the press, and for nidaqmx itself after it."""

    def ask(stand_in):
        with grpc.insecure_channel(stand_in.daq_address) as channel:
            device = Device("Dev1", grpc_options=GrpcSessionOptions(channel, ""))
            with pytest.raises(later, match=code):
                _ = device.product_type

    found = injected(**{name: {"sample": 100}}, afterwards=ask)
    assert not found.made
    assert said in str(found.error)
    assert is_safe(found)


# The serial line.


def test_answers_later_than_the_timeout(injected):
    found = injected(line={"delay": "0.5 s"}, rig={"controller.timeout": "0.1 s"})
    assert isinstance(found.error, SilentController)
    assert found.motors_on == (False, False)


@pytest.mark.slow
def test_answers_within_the_timeout_do_no_harm(injected):
    found = injected(line={"delay": "10 ms", "press": 1})
    assert found.error is None
    assert len(found.made) == 1


def test_the_same_seed_loses_the_same_bytes(injected):
    one, other = (injected(line={"dropped": 1e-3}, seed=1) for _ in range(2))
    assert str(one.error).partition("sent")[2] == str(other.error).partition("sent")[2]
    assert isinstance(one.error, GarbledAnswer | SettingNotTaken)
    assert one.motors_on == (False, False)


# The arm.


@pytest.fixture
def arm():
    """A servo's bench in this process, powered, with faults."""

    def make(**tables):
        bench = Bench(load_rig(), mute_scene("servo", faults=tables))
        for line in (b"EO 0", b"ER 20000,20000", b"OE 0,0", b"SH AB"):
            assert set(bench.receive(line + b"\r").strip(b"EO 0\r")) <= set(b":")
        return bench

    return make


def test_a_stalled_motor_has_its_limit_torque_and_does_not_move(arm):
    """Without OE it stays on: the error grows, the torque rises to its limit."""
    bench = arm(stall={"joint": 1})
    bench.injection.begin_press()
    bench.receive(b"AC 10240000;JG 200000;BG A\r")
    for _ in range(50):
        bench.tick()
    before = bench.plant.encoder_counts()
    for _ in range(200):
        bench.tick()
    after = bench.plant.encoder_counts()
    assert abs(after[0] - before[0]) <= 1
    assert bench.plant.torque_volts()[0] == pytest.approx(9.998)
    assert float(bench.firmware.receive(b"MG _TEA\r").strip(b":\r\n ")) > 20_000
    assert bench.firmware.motors_on == (True, True)


def test_a_slipped_encoder_moves_the_arm_and_not_its_reading(arm):
    bench = arm(slip={"joint": 1, "counts": 500, "at": "10 ms"})
    for _ in range(300):
        bench.tick()
    bench.injection.begin_press()
    counts, joints = bench.plant.encoder_counts(), bench.world.finger.joints()
    home = bench.plant.home_counts()
    for _ in range(2000):
        bench.tick()
    assert np.abs(np.subtract(bench.plant.encoder_counts(), counts)).max() <= 3
    moved = np.subtract(bench.world.finger.joints(), joints) / bench.world.radians_per_count
    np.testing.assert_allclose(moved, [-500, 0], atol=3)
    assert np.subtract(bench.plant.home_counts(), home).tolist() == [500, 0]


# The sensors.


@pytest.mark.slow
def test_faults_of_sensors_are_in_the_recording(injected):
    tables = {
        "speckle": {"rate": "40 Hz", "duration": "1 ms", "spike": "20 mm/s"},
        "drift": {"rate": "0.5 N/s"},
    }
    good, one = (read_recording(injected(**faulty).made[0]).volts for faulty in ({}, tables))
    assert np.any(one["velocity"] != good["velocity"])
    time = np.arange(len(good["force"])) / 51_200
    np.testing.assert_allclose(one["force"] - good["force"], 0.5 * time, atol=1e-9)


# The stand-in itself.


@pytest.mark.slow
def test_a_stand_in_that_fails_reports_it_on_every_channel(tmp_path, monkeypatch):
    """At once, over the card and over the line, and not as a timeout."""

    def press():
        with StandIn(with_values(load_rig(), QUICK), mute_scene()) as stand_in:
            world = stand_in.bench.world
            advance = world.advance

            def diverge(reference, powered):
                if stand_in.bench.card.runs:
                    raise SceneError("diverged")
                return advance(reference, powered)

            monkeypatch.setattr(world, "advance", diverge)
            press_on(stand_in, tmp_path)

    with pytest.raises(DaqError, match="The stand-in has failed: diverged") as caught:
        press()
    notes = caught.value.__notes__
    assert any("NOT confirmed off" in note for note in notes)
    assert notes[-1] == "The stand-in has failed before that: diverged"
