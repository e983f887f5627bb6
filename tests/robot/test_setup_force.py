"""`setup force`: gain, sign and delay of the force channel by a weight; the fixture's mass."""

import json

import numpy as np
import pytest

import sautereau as st
from sautereau.analysis.loading.press import load_press
from sautereau.commands.common import Simulation
from sautereau.commands.output import Output
from sautereau.commands.setup import setup
from sautereau.daq.file.reading import read_recording
from sautereau.daq.signals.calibration import to_volts
from sautereau.rig.errors import UsageError
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.units import GRAVITY
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup import force
from sautereau.robot.experiment.setup.force import proof_of, prove_force
from sautereau.robot.experiment.setup.tap import tap_key
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.parts import Weight
from sautereau.sim_backend.scene import load_scene
from tests.presses import MUTE_TEXT, QUICK, QUICK_TEXT, mute_scene
from tests.recordings import write_recording

MASS = 0.05  # kg
WEIGHT = Weight.model_validate({"mass": "50 g", "cut": "1.0003 s"})
SENSORS = load_scene("paper").sensors
RATE = 51_200


@pytest.fixture(autouse=True)
def _short(monkeypatch):
    """Record for 2 s, which contain all that is used on both sides of a cut at 1 s."""
    monkeypatch.setattr(force, "HANGING", 2.0)


class Operator:
    """An operator who knows the mass of the weight."""

    def confirm(self, question):
        return True

    def act(self, instruction):
        return True

    def number(self, question, unit, expected):
        return MASS if unit == "kg" else None


def proven(truth=None, faults=None):
    """Prove the force on a bench that is in truth another."""
    scene = mute_scene(faults=faults, truth=truth or {}, weight=WEIGHT, sensors=SENSORS)
    with StandIn(with_values(load_rig(), QUICK), scene, seed=1) as served:
        found = prove_force(served.rig, Operator())
        assert served.bench.firmware.motors_on == (False, False)
    return found


@pytest.mark.slow
def test_a_force_chain_as_in_the_rig_is_proven():
    found = proven()
    assert found.warnings == ()
    assert found.figures["gain"] == pytest.approx(1, abs=2 * found.figures["gain_std"])
    assert found.figures["gain_std"] < 2e-3
    assert found.figures["delay"] == pytest.approx(10e-6, abs=20e-6)
    assert abs(found.figures["fixture_mass"]) < 2 * found.figures["fixture_mass_std"]
    assert "arm.fixture_mass" not in found.values


def test_a_gain_off_by_2_and_a_fixture_are_measured():
    found = proven({"daq.channels.1.scale": "2 N/V", "arm.fixture_mass": "5 g"})
    assert found.figures["gain"] == pytest.approx(0.5, rel=1e-3)
    assert "gain is 0.5 times that of the rig" in found.warnings[0]
    assert len(found.warnings) == 1
    corrected = with_values(load_rig(), found.plain)
    assert corrected.daq.channels[1].scale == pytest.approx(2, rel=1e-3)
    assert corrected.arm.fixture_mass == pytest.approx(5e-3, rel=5e-3)


@pytest.mark.slow
def test_a_delay_off_by_1_ms_is_measured():
    found = proven({"daq.channels.1.delay": "1.01 ms"})
    assert found.figures["delay"] == pytest.approx(1.01e-3, abs=20e-6)
    (warning,) = found.warnings
    assert warning.startswith("the delay of the force is 1.0")
    assert "the rig states 0.01 ms" in warning
    assert with_values(load_rig(), found.plain).daq.channels[1].delay_std < 25e-6


@pytest.mark.slow
def test_a_wrong_sign_is_named_and_no_scale_written():
    found = proven({"arm.fixture_mass": "5 g"}, {"sensor_sign": {"quantity": "force"}})
    assert found.figures["gain"] == pytest.approx(-1, rel=1e-3)
    assert "the transducer has the wrong sign" in found.warnings[0]
    assert "invert it at the charge amplifier" in found.warnings[0]
    assert not [key for key in found.values if "scale" in key or "fixture" in key]


@pytest.mark.slow
def test_a_vibrometer_of_the_wrong_sign_is_named():
    found = proven(faults={"sensor_sign": {"quantity": "velocity"}})
    assert len(found.warnings) == 1
    assert "the vibrometer has the wrong sign" in found.warnings[0]


@pytest.mark.slow
def test_a_fixture_changes_no_press(tmp_path):
    """Its inertia is recorded, and subtracted again where a recording is loaded."""
    made = []
    for mass in ("0 g", "10 g"):
        rig = with_values(load_rig(), {"arm.fixture_mass": mass})
        with st.stand_in(rig, scene="return", seed=1) as bench:
            made.append(bench.press(1, out=tmp_path / mass)[0])
    recorded = [read_recording(press.path).volts["force"] for press in made]
    bare, loaded = (load_press(press.path).samples["force"] for press in made)
    raw = np.abs(recorded[1] - recorded[0]).max()  # N/V is 1
    assert raw > 0.05
    assert np.abs(loaded - bare).max() < 0.3 * raw  # noise of the slope included
    release, again = (press.analysed.phases.plucks[0].release for press in made)
    assert again == pytest.approx(release, abs=5e-6)


def fallen(cut=1.5, late=0.0, gain=1.0, pulls=1.0, speed=1.0, duration=3.0, rise=0.0):
    """Return volts of a hung weight in closed form, and the acquisition of the sensors."""
    ideal = {"high_pass": "0 Hz", "delay": "0 s"}
    values = {f"daq.channels.{i}.{key}": value for i in (0, 1) for key, value in ideal.items()}
    daq = with_values(load_rig(), values).daq
    time, random = np.arange(round(duration * RATE)) / RATE, np.random.default_rng(1)
    share = np.clip((time - late - cut) / rise, 0, 1) if rise else 1.0 * (time - late > cut)
    since = np.clip(time - cut, 0, None)
    fall = since if not rise else np.where(since < rise, since**2 / (2 * rise), since - rise / 2)
    force = gain * pulls * MASS * GRAVITY * (share - 1) + random.normal(0, 5e-3, len(time))
    velocity = speed * GRAVITY * fall + random.normal(0, 5e-5, len(time))
    volts = {"force": to_volts(force, daq.channels[1])}
    volts["velocity"] = np.clip(to_volts(velocity, daq.channels[0]), -4, 4)
    return daq, volts


@pytest.mark.parametrize("rise", [0.0, 3e-3])
@pytest.mark.parametrize("late", [-0.7e-3, 0.0, 2e-3])
def test_gain_and_delay_in_closed_form(late, rise):
    """Also of a thread that burns through in 3 ms."""
    proof = proof_of(*fallen(late=late, gain=1.2, rise=rise), MASS)
    assert proof.gain == pytest.approx(1.2, rel=2e-3)
    assert proof.late == pytest.approx(late, abs=3 * proof.late_std)
    assert proof.late_std < 10e-6
    assert proof.speed_gain == pytest.approx(1, abs=3 * proof.speed_gain_std)


def test_a_weight_that_presses_has_the_other_sign():
    assert proof_of(*fallen(pulls=-1.0), -MASS).gain == pytest.approx(1, rel=2e-3)


def test_the_scale_of_the_vibrometer_is_seen():
    proof = proof_of(*fallen(speed=1.1), MASS)
    assert proof.speed_gain == pytest.approx(1.1, rel=2e-3)
    assert proof_of(*fallen(speed=0.0), MASS).speed_gain == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize(
    ("options", "said"),
    [({"gain": 0.0}, "the largest step of the force"), ({"cut": 0.05}, "from its ends")],
)
def test_a_weight_that_was_not_taken_off(options, said):
    with pytest.raises(RobotError, match=said):
        proof_of(*fallen(**options), MASS)


@pytest.mark.slow
def test_the_command_writes_the_values_with_their_source(tmp_path, capsys):
    file, scene = tmp_path / "rig.toml", tmp_path / "scene.toml"
    file.write_text(QUICK_TEXT, encoding="utf-8")
    truth = 'truth = { "daq.channels.1.scale" = "2 N/V", "arm.fixture_mass" = "4 g" }'
    scene.write_text(f'{MUTE_TEXT}{truth}\n[weight]\nmass = "50 g"\n', encoding="utf-8")
    words = {"yes": True, "save": True, "simulation": Simulation(scene=str(scene))}
    assert setup(str(file), "force", weight=MASS, output=Output(json=True), **words) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["saved"]
    rig = load_rig(file)
    assert rig.daq.channels[1].scale == pytest.approx(2, rel=1e-3)
    assert rig.arm.fixture_mass == pytest.approx(4e-3, rel=5e-3)
    for key in ("daq.channels.1.scale", "daq.channels.1.delay", "arm.fixture_mass"):
        assert rig.sources[key].startswith("sautereau setup, 20")


def test_the_command_reads_a_recording(tmp_path, capsys):
    path, (daq, volts) = tmp_path / "weight.mcap", fallen(gain=1.5)
    rig = load_rig().model_copy(update={"daq": daq})
    write_recording(path, rig, [volts[channel.name] for channel in daq.channels])
    assert setup("paper", "force", recording=[path], weight=MASS, output=Output(json=True)) == 0
    found = json.loads(capsys.readouterr().out)["steps"]["force"]
    assert "gain is 1.5 times that of the rig" in found["warnings"][0]
    with pytest.raises(UsageError, match="force with one recording and --weight"):
        setup("paper", "force", recording=[path])
    assert setup("paper", "tap", recording=[path], weight=MASS) == 2


@pytest.mark.slow
def test_taps_of_a_finger_with_a_fixture_are_doubted():
    rig = with_values(load_rig(), QUICK | {"arm.fixture_mass": "5 g"})
    with StandIn(rig, mute_scene(), seed=1) as served:
        found = tap_key(served.rig, Operator())
    assert "contains the inertia of the fixture, 5 g" in found.warnings[-1]
    assert "tap with a hammer" in found.warnings[-1]


@pytest.mark.slow
def test_taps_of_a_rigid_key_show_no_mode():
    """Its fall after the taps was one at 64 Hz."""
    with StandIn(with_values(load_rig(), QUICK), load_scene("ideal"), seed=1) as served:
        found = tap_key(served.rig, Operator())
    assert any("left its rest for up to" in line for line in found.lines)
    assert "these taps show no mode of 40 to 2500 Hz" in found.warnings[-1]
    assert not found.values
