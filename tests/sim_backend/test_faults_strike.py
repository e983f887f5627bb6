"""Faults on demand over the real parts: pyserial, nidaqmx, and this project's own driver."""

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
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    LineLost,
    MotionFault,
    SettingNotTaken,
    SilentController,
)
from sautereau.robot.experiment.session import run_session
from sautereau.sim_backend.bench import Bench, StandIn
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

PATIENT = {"controller.timeout": "10 s"}
"""However slow the machine, an answer that is on its way comes."""


@pytest.fixture
def struck(tmp_path):
    """Make presses with faults; tell what was made, what went wrong, and how the arm is left."""

    def press(finger="ideal", *, n=2, seed=0, rig=None, **tables):
        servo = finger == "servo"
        scene = load_scene("paper" if servo else "ideal").model_copy(
            update={
                "plectrum": "none",
                "string": "none",
                "step": 1e-4 if servo else 1e-3,
                "faults": Faults.model_validate(tables) if tables else None,
            }
        )
        made, error = [], None
        out = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        with StandIn(with_values(load_rig(), rig or {}), scene, seed) as stand_in:
            controller = GalilController(stand_in.rig)
            plan = plan_press(stand_in.rig)
            try:
                run_session(stand_in.rig, plan, controller, out, n, on_press=made.append)
            except Exception as caught:  # noqa: BLE001 - the tests ask for its kind
                error = caught
            on = stand_in.bench.firmware.motors_on
            return SimpleNamespace(made=made, error=error, motors_on=on, truth=stand_in.truth())

    return press


def is_safe(found) -> bool:
    """Whether the motors are off, and the error says that this is confirmed."""
    told = [str(found.error), *getattr(found.error, "__notes__", ())]
    return found.motors_on == (False, False) and any("confirms it" in line for line in told)


# The card.


def test_an_edge_that_the_card_does_not_see(struck):
    found = struck(trigger_missing={"press": 2}, rig={"daq.trigger_timeout": "0.4 s"})
    assert len(found.made) == 1
    assert isinstance(found.error, DaqError)
    assert "no edge on /Dev1/PFI0" in str(found.error)
    assert is_safe(found)
    assert len(found.truth) == 1


def test_samples_that_are_overwritten(struck):
    found = struck(overrun={"press": 2, "sample": 5000})
    assert len(found.made) == 1
    assert "-200279" in str(found.error)
    assert is_safe(found)
    (part,) = found.made[0].parent.glob("*.part")
    assert part.stat().st_size > 0


def test_a_server_that_dies(struck):
    found = struck(server_gone={"press": 2, "sample": 5000})
    assert len(found.made) == 1
    assert "no answer while reading" in str(found.error)
    assert is_safe(found)


def test_a_card_that_is_unplugged(struck):
    found = struck(device_gone={"press": 1, "sample": 0})
    assert not found.made
    assert "-201003" in str(found.error)
    assert is_safe(found)


@pytest.mark.parametrize(
    ("name", "error", "said"),
    [
        ("device_gone", nidaqmx.DaqError, "-201003"),
        ("server_gone", RpcError, "UNAVAILABLE"),
    ],
)
def test_what_is_gone_stays_so(tmp_path, name, error, said):
    """Asked by nidaqmx itself, after the press in which it went."""
    faults = Faults.model_validate({name: {"sample": 100}})
    mute = {"plectrum": "none", "string": "none"}
    scene = load_scene("ideal").model_copy(update=mute | {"faults": faults})
    with StandIn(load_rig(), scene) as stand_in:
        rig = stand_in.rig
        with pytest.raises(DaqError):
            run_session(rig, plan_press(rig), GalilController(rig), tmp_path, 1)
        with grpc.insecure_channel(stand_in.daq_address) as channel:
            device = Device("Dev1", grpc_options=GrpcSessionOptions(channel, ""))
            with pytest.raises(error, match=said):
                _ = device.product_type


# The serial line.


def test_a_cable_that_takes_its_port_along(struck):
    """The motion that was begun goes on, and the driver says that it cannot know."""
    found = struck(cable_out={"press": 1, "at": "30 ms", "port_closes": True})
    assert isinstance(found.error, LineLost)
    assert "NOT confirmed off" in str(found.error)
    assert found.motors_on == (True, True)


def test_a_cable_that_falls_out_in_mid_command(struck):
    """In homing: the motors are on, and stay so where no time goes on for the watchdog."""
    found = struck(cable_out={"after_bytes": 1150}, rig={"controller.timeout": "1 s"})
    assert isinstance(found.error, SilentController)
    assert "NOT confirmed off" in str(found.error)
    assert found.motors_on == (True, True)


def test_answers_that_come_too_late(struck):
    found = struck(line={"delay": "0.5 s"}, rig={"controller.timeout": "0.1 s"})
    assert isinstance(found.error, SilentController)
    assert found.motors_on == (False, False)


def test_answers_that_come_late_enough_do_no_harm(struck):
    found = struck(line={"delay": "10 ms", "press": 1}, n=1, rig=PATIENT)
    assert found.error is None
    assert len(found.made) == 1


@pytest.mark.parametrize("seed", [0, 2])
def test_bits_that_flip(struck, seed):
    """They are refused, make no sense, or are seen when the program is read back."""
    found = struck(line={"flipped": 0.002}, seed=seed, rig=PATIENT)
    assert isinstance(found.error, CommandRefused | GarbledAnswer | SettingNotTaken)
    assert found.motors_on == (False, False)


def test_the_same_seed_loses_the_same_bytes(struck):
    tables = {"line": {"dropped": 1e-3}, "rig": PATIENT}
    one, other = (struck(seed=0, **tables) for _ in range(2))
    assert str(one.error).partition("sent")[2] == str(other.error).partition("sent")[2]
    assert isinstance(one.error, GarbledAnswer)
    assert is_safe(one)


def test_a_digit_that_flips_towards_the_controller_is_never_played(struck):
    """What the controller has heard is held against what was sent, segment by segment."""
    for seed in range(4):
        found = struck(line={"flipped": 3e-4, "towards": "controller"}, seed=seed, n=1, rig=PATIENT)
        assert isinstance(found.error, GarbledAnswer | CommandRefused | SettingNotTaken)
        assert not found.made
        assert found.motors_on == (False, False)


# The arm.


def test_a_stalled_motor_is_switched_off_by_its_following_error(struck):
    for joint in (1, 2):
        found = struck("servo", stall={"press": 2, "joint": joint, "at": "30 ms"})
        assert len(found.made) == 1
        assert isinstance(found.error, MotionFault)
        assert f"joint {joint} switched off by a following error" in str(found.error)
        assert is_safe(found)


def test_an_encoder_that_slips_far_is_a_following_error(struck):
    found = struck("servo", slip={"joint": 2, "counts": -30_000, "at": "30 ms"})
    assert "joint 2 switched off by a following error" in str(found.error)
    assert is_safe(found)


@pytest.fixture
def arm():
    """A servo's bench in process, powered, with its faults counted from the first motion."""

    def make(**tables):
        scene = load_scene("paper").model_copy(
            update={
                "plectrum": "none",
                "string": "none",
                "faults": Faults.model_validate(tables),
            }
        )
        bench = Bench(load_rig(), scene)
        for line in (b"EO 0", b"ER 20000,20000", b"OE 0,0", b"SH AB"):
            assert set(bench.receive(line + b"\r").strip(b"EO 0\r")) <= set(b":")
        return bench

    return make


def test_a_stalled_motor_pushes_with_all_it_has_and_does_not_move(arm):
    """Without OE it stays on: the error grows, the torque goes to the limit."""
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


def test_a_stalled_motor_goes_off_where_oe_says_so(arm):
    bench = arm(stall={"joint": 1})
    bench.injection.begin_press()
    bench.receive(b"OE 1,1;AC 10240000;JG 200000;BG A\r")
    for _ in range(300):
        bench.tick()
    assert bench.firmware.motors_on == (False, True)
    assert bench.receive(b"MG _SCA\r").split() == [b"8.0000", b":"]


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


def test_faults_of_sensors_are_in_the_recording_and_of_the_seed(struck):
    tables = {
        "speckle": {"rate": "40 Hz", "duration": "1 ms", "spike": "20 mm/s"},
        "drift": {"rate": "0.5 N/s"},
        "n": 1,
    }
    good, one, other, third = (
        read_recording(struck(seed=seed, **faulty).made[0]).volts
        for seed, faulty in ((1, {"n": 1}), (1, tables), (1, tables), (2, tables))
    )
    for name in ("velocity", "force"):
        np.testing.assert_array_equal(one[name], other[name])
        assert np.any(one[name] != good[name])
    assert np.any(one["velocity"] != third["velocity"])
    time = np.arange(len(good["force"])) / 51_200
    np.testing.assert_allclose(one["force"] - good["force"], 0.5 * time, atol=1e-9)


# The stand-in itself.


def test_a_stand_in_that_fails_says_so_wherever_it_is_asked(tmp_path, monkeypatch):
    """At once, over the card and over the line, and not as a timeout."""
    mute = {"plectrum": "none", "string": "none", "step": 1e-3}

    def press():
        with StandIn(load_rig(), load_scene("ideal").model_copy(update=mute)) as stand_in:
            world, rig = stand_in.bench.world, stand_in.rig
            advance = world.advance

            def lose(reference, powered):
                if stand_in.bench.card.runs:
                    raise SceneError("lost its numbers")
                return advance(reference, powered)

            monkeypatch.setattr(world, "advance", lose)
            run_session(rig, plan_press(rig), GalilController(rig), tmp_path, 1)

    with pytest.raises(DaqError, match="The stand-in has failed: lost its numbers") as caught:
        press()
    notes = caught.value.__notes__
    assert any("NOT confirmed off" in note for note in notes)
    assert notes[-1] == "The stand-in has failed before that: lost its numbers"
