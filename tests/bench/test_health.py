"""Sessions stop between presses where the instrument is no longer as it was."""

import json
from dataclasses import replace

import pytest

import sautereau as st
from sautereau.rig.load import with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.health import Health, health_of
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow

SOFT = {"step": 5e-4}
HANGING = {"jack.register_friction": "40 mN"}


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """Make one press on a bench that is in truth another: pressed(truth, **scene)."""
    made = {}

    def press(truth=None, **scene):
        key = repr((truth, scene))
        if key not in made:
            folder = tmp_path_factory.mktemp("press")
            changed = load_scene("paper").model_copy(update=SOFT | scene)
            changed = changed.model_copy(update={"truth": truth or {}})
            with st.stand_in(scene=changed, seed=1) as bench:
                made[key] = bench.press(1, out=folder, warm_up=0)[0].analysed
        return made[key]

    return press


def test_an_instrument_in_order_is_fit_for_the_next_press(pressed):
    assert health_of(pressed()).reason == health_of(pressed(), pressed()).reason == ""
    silent = pressed(plectrum="none", string="none")  # from the first press on
    assert health_of(silent, silent).reason == ""


def test_a_hanging_jack_is_named_and_its_press_counts(pressed):
    health = health_of(pressed(HANGING), pressed())
    assert health.reason.startswith("the jack did not return: 9.98 mm of 9.98 mm remain")
    assert "free the jack in its register" in health.reason
    assert health.valid


def test_a_broken_plectrum_is_named_and_its_press_is_made_again(pressed):
    health = health_of(pressed(plectrum="none", string="none"), pressed())
    assert "no pluck, and 1 in the first press: the plectrum" in health.reason
    assert "the string may be broken" in health.reason
    assert not health.valid


def test_a_key_that_sinks_is_named(pressed):
    """The finger starts 0.8 mm above the key, as if the key had sunk by as much."""
    higher = with_values(st.Rig().values, {}).arm.base_z + 0.8e-3
    sunk = pressed({"arm.base_z": f"{higher!r} m"})
    assert health_of(sunk).reason == ""  # without a first press there is nothing to compare with
    health = health_of(sunk, pressed())
    assert health.reason.startswith("the key has sunk: the jack rose by 8.9")
    assert "mm less are permitted" in health.reason
    assert health.valid


@pytest.mark.parametrize(
    ("quantity", "said"),
    [
        ("force", "the force transducer has the wrong sign; invert it at its amplifier"),
        slow("velocity", "check the vibrometer's aim, sign and input"),
    ],
)
def test_a_sensor_of_the_wrong_sign_is_named_after_the_first_press(pressed, quantity, said):
    faults = Faults.model_validate({"sensor_sign": {"quantity": quantity}})
    with pytest.raises(RobotError, match=rf"press-0001\.mcap: .*{said}"):
        pressed(faults=faults)


def test_a_key_that_stays_down_and_a_drifting_force_are_named(pressed):
    press = pressed()

    def changed(**found):
        return replace(press, features=press.features | found)

    down = health_of(changed(full_rise=1e-7, plucks=0, peak_force=0.2), press)
    assert not down.valid
    assert "the jack rose by 0.0001 mm of 10 mm, with at most 0.2 N" in down.reason
    assert "free the jack" in down.reason
    assert "vibrometer's aim, sign and input" in down.reason
    assert "drifted from" in health_of(changed(rest_force=0.5, peak_force=0.7), press).reason
    assert health_of(changed(rest_force=None, full_rise=None, end_rise=None)).reason == ""


@pytest.mark.slow
def test_a_session_with_a_hanging_jack_stops_and_continues(sautereau, servo, tmp_path):
    """Before, presses 2 to 5 pressed air, and ISO 9283 was evaluated over all five."""
    scene = tmp_path / "hanging.toml"
    scene.write_text(servo.read_text() + '\n[truth]\n"jack.register_friction" = "40 mN"\n')
    words = ("press", "--scene", scene, "-n", 3, "--seed", 1, "--warm-up", 0, "--out", "out")
    done = sautereau(*words)
    assert done.returncode == 1
    message = " ".join(done.stderr.split())
    assert "press-0001.mcap: the jack did not return" in message
    assert "run the same command or plan again to continue" in message
    assert "press-0001.mcap" in done.stdout
    assert "press-0002.mcap" not in done.stdout
    lifted = pytest.raises(RobotError, match=r"warm-up-01\.mcap: the jack did not return")
    with st.stand_in(scene=scene, seed=1) as bench, lifted:
        bench.press(2, out=tmp_path / "python")
    again = sautereau(*words, "--ignore-health", "--json")
    assert not again.stderr
    result = json.loads(again.stdout)
    assert (again.returncode, result["left"], result["halted"]) == (0, 0, "")
    assert [len(press["plucks"]) for press in result["presses"]] == [1, 1, 0]
    assert "repeatability" not in result  # of the two valid presses
    assert result["features"]["full_rise"]["presses"] == 2


def test_an_invalid_press_is_kept_and_made_again(tmp_path, monkeypatch):
    broken = Health("the plectrum is broken", valid=False)
    found = [Health(), broken, Health(), Health(), Health()]  # of a warm-up press before each
    monkeypatch.setattr(st.PressFile, "health", lambda self, first=None: found.pop(0))

    def press():
        with st.stand_in(scene="ideal", seed=1) as bench:
            return bench.press(2, out=tmp_path)

    with pytest.raises(RobotError, match="the plectrum is broken"):
        press()
    made = press()
    assert [each.path.name for each in made] == ["press-0002.mcap", "press-0003.mcap"]
    assert [each.info.item for each in made] == [1, 2]
    assert (tmp_path / "press-0001.mcap").is_file()
    assert json.loads((tmp_path / "session.json").read_text())["invalid"] == ["press-0001.mcap"]
