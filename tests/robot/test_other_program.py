"""Another program at the same controller: what it has changed is found before the next motion."""

import re

import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.driver import refuse_changes
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import MotionFault, SettingChanged
from sautereau.robot.experiment.monitor import Stage
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.parts import ControllerUnit
from tests.budget import slow
from tests.presses import QUICK, mute_scene, press_on
from tests.robot.motions import OFF, fails

CHANGES = {
    "KP 300,300": "KP of axis A (joint 1) is 300, set to 6; KP of axis B (joint 2) is 300, set to",
    "KI ,9": "KI of axis B (joint 2) is 9, set to 0.5",
    "KD 3200,64": "KD of axis A (joint 1) is 3200, set to 64",
    "FV 50,0": "FV of axis A (joint 1) is 50, set to 0",
    "IL 1,9.9982": "IL of axis A (joint 1) is 1, set to 9.9982",
    "OE 0,0": "OE of axis A (joint 1) is 0, set to 3; OE of axis B",
    "ER 1000000,20000": "ER of axis A (joint 1) is 1000000, set to 20000",
    "TL 5,5": "TL of axis A (joint 1) is 5, set to 9.99",
    "OV 9,9;OT 5000,5000;OA 0,0": "OA of axis B (joint 2) is 0, set to 1",
    "FL 22222200;BL -22222200": "FL of axis A (joint 1) is 22222200, set to 444444",
    "LD 3,3": "LD of axis B (joint 2) is 3, set to 0",
    "CN 1,1,,0,1": "CN0 is 1, set to -1",
    "TM 2000": "TM is 2000, set to 1000",
    "OF 0.1,0": "OF of axis A (joint 1) is 0.1",
}


@pytest.fixture(scope="module")
def stand_in():
    scene = mute_scene(controller=ControllerUnit(interface="ethernet"))
    with StandIn(with_values(load_rig(), QUICK), scene) as served:
        served.letter = served.bench.connect(2000)
        yield served


@pytest.fixture
def send(stand_in):
    """Send lines from a second connection to the controller, which takes them."""

    def sent(text):
        answer = stand_in.bench.receive(f"{text}\r".encode(), stand_in.letter)
        assert set(answer) == {ord(":")}

    yield sent
    sent("KP 6,6;KI 0.5,0.5;KD 64,64;FV 0,0;IL 9.9982,9.9982")


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_setting_is_named_with_axis_and_values_and_nothing_moves(stand_in, send, change):
    controller = GalilController(stand_in.rig)
    with fails(controller, SettingChanged, re.escape(CHANGES[change]), OFF):
        at = controller.positions()
        send(change)
        controller.home()
    assert stand_in.bench.firmware.motors_on == (False, False)
    with GalilController(stand_in.rig) as controller:
        assert (controller.positions() == at).all()


@pytest.mark.parametrize(
    ("stage", "press", "recorded"),
    [slow("going to the start", None, 0), ("loading", 2, 1), slow("going home", None, 2)],
)
def test_settings_are_read_before_each_motion_of_a_session(
    stand_in, send, tmp_path, stage, press, recorded
):
    def watch(seen):
        if isinstance(seen, Stage) and (seen.arm, seen.press) == (stage, press):
            send("OE 0,0;ER 1000000,1000000;KP 300,300")

    with pytest.raises(SettingChanged, match=r"ER of axis A .*1000000, set to 20000") as caught:
        press_on(stand_in, tmp_path, 2, watch=watch)
    assert OFF in str(caught.value)
    assert [path.suffix for path in tmp_path.iterdir()] == [".mcap"] * recorded


def test_settings_changed_before_the_move_to_the_key(stand_in, send):
    controller = GalilController(stand_in.rig)
    with fails(controller, SettingChanged, "BL of axis B"):
        home = controller.home()
        controller.move_to(home, 10_000)
        send("BL -444444,-41666650")
        controller.move_to(home + 100, 10_000)


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ("1 1 1 s 9000 31 31 -1 0 0", "not started: the controller's watchdog has switched the mo"),
        ("1 1 1 0 9000 7 7 -1 6 0", "not started: .* program was ended with 6 of 10 counts"),
        ("1 1 0 s 9000 31 31 8 9 0", "the motors are off: the abort input is active; remove"),
        ("1 1 1 s 9000 8 31 8 0 0", "watchdog has switched the motors off"),  # an old code
        ("1 1 1 s 9000 8 31 8 9 0", "off: joint 1 switched off by a following error over ER"),
        ("0 1 1 s 9000 31 31 8 9 0", "off: no reason in the stop codes 31 and 31"),
        ("1 1 1 s 9000 31 31 8 9 20", r"refused a command of its program, with code 20 \(TC\)"),
        ("0 0 1 77 5001 31 31 8 9 0", "its watchdog was stopped or its program was replaced"),
    ],
)
def test_motors_that_went_off_since_the_last_motion_are_reported_as_seen(bench, lines, state, said):
    sign = lines.ready[0][1].split()[3]
    answer = " ".join(f"{float(sign if word == 's' else word):.4f}" for word in state.split())
    asked = (lines.ready[0][0], f" {answer}\r\n:")
    controller, _ = bench(lines.homed, [asked], lines.abort)
    with fails(controller, MotionFault, said, OFF):
        controller.home()
        controller.move_to([1000, -501000], 100_000)


def test_a_difference_that_a_second_reading_does_not_find_is_a_warning(caplog):
    readings = [["KP of axis A is 300, set to 6"], []]
    refuse_changes("COM3", lambda: readings.pop(0))
    (record,) = caplog.records
    assert "COM3: KP of axis A is 300, set to 6 when read once" in record.getMessage()
    assert readings == []


def test_a_difference_that_two_readings_find_is_refused():
    readings = [["KP of axis A is 300, set to 6"], ["KP of axis A is 301, set to 6"]]
    with pytest.raises(SettingChanged, match="301, set to 6"):
        refuse_changes("COM3", lambda: readings.pop(0))
