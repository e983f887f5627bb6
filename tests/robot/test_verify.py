"""`setup verify` on the stand-in: what passes, and each wrong assumption at its step."""

import re

import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.verify.run import trial_torque, verify
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.controller_part import ControllerUnit
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.scene import load_scene

MUTE = {"plectrum": "none", "string": "none", "step": 1e-3}


class Operator:
    """An operator who does by hand what is asked, on a stand-in; or is not there."""

    def __init__(self, served, present=True, agrees=True, turns=True):
        self.bench, self.present, self.agrees = served.bench, present, agrees
        self.turns = turns
        self.undo = None

    def confirm(self, question):
        return self.agrees or "May it be stopped" not in question

    def number(self, question, unit, expected):
        return None

    def act(self, instruction):
        if not self.present or (instruction.startswith("Turn joint") and not self.turns):
            return False
        joint = int(found[1]) if (found := re.search(r"joint (\d)", instruction)) else 1
        if found := re.search("Change the (forward|reverse|home|abort)", instruction):
            self._switch(found[1], joint)
        elif instruction.startswith("Release"):
            self.undo()
        elif instruction.startswith("Turn joint"):
            self.move(lambda plant: plant.lift(joint, 5000))
        elif instruction.startswith("Push"):
            self.move(lambda plant: plant.lift(1, 40_000))
        else:
            self.bench.operate(lambda plant: plant.lose_encoder(joint))
        return True

    def move(self, change):
        self.bench.operate(lambda plant: (change(plant), plant.sample()))

    def _switch(self, name, joint):
        def change(plant):
            closed = plant.active(name, joint - 1)
            (plant.open if closed else plant.close)(name, joint)

        if name == "home" and joint == 2:  # it stands at the switch: move it across
            self.move(lambda plant: plant.lift(2, 200_000))
            self.undo = lambda: self.move(lambda plant: plant.lift(2, -200_000))
            return
        self.move(change)
        self.undo = lambda: self.move(change)


def run(unit=None, faults=None, finger="ideal", values=None, **operator):
    """Verify a stand-in; return what was found."""
    scene = load_scene("paper" if finger == "servo" else "ideal").model_copy(
        update=MUTE
        | {
            "controller": ControllerUnit.model_validate(unit or {}),
            "faults": None if faults is None else Faults.model_validate(faults),
        }
    )
    rig = with_values(load_rig(), {"controller.timeout": "60 s"})
    with StandIn(rig, scene) as served:
        bench = with_values(served.rig, values or {})
        person = Operator(served, **operator)
        try:
            return verify(bench, person)
        finally:
            assert served.bench.firmware.motors_on == (False, False)


@pytest.mark.parametrize(
    "unit",
    [
        {},
        pytest.param({"interface": "ethernet", "control_z": "attached"}, marks=pytest.mark.slow),
        pytest.param({"interface": "usb", "odd_pvt": "refuse"}, marks=pytest.mark.slow),
    ],
)
def test_a_controller_that_is_as_assumed_is_verified(unit):
    found = run(unit, present=False)
    assert found.values["controller.verified"].endswith("serial number 12345")
    assert "MTA=1" in found.values["controller.verified_settings"]
    odd = "refused" if unit.get("odd_pvt") else "taken"
    assert any(f"odd velocity and time is {odd}" in line for line in found.lines)


@pytest.mark.slow
def test_an_operator_moves_switches_and_joints_and_pushes_the_arm():
    found = run(finger="servo", turns=False)
    assert len([line for line in found.lines if line.startswith("B8")]) == 2


SERVO = {"finger": "servo"}
WRONG = {
    "no PVT mode": ({"unit": {"firmware": "1.3a-FAST"}}, "has no PVT mode"),
    "motors on at power-up": ({"unit": {"burned": []}}, "A1 .*motors were on"),
    "a program that starts itself": (
        {"unit": {"burned_program": "#AUTO\nWT 1000\nJP #AUTO\nEN"}, "agrees": False},
        "A1 .*begins with #AUTO",
    ),
    "short lines": ({"unit": {"line_length": 40}}, "refused"),
    "samples unknown to AT": ({"unit": {"firmware": "1.1a"}, "present": False}, "A8 "),
    "a closed limit switch": (
        {"faults": {"switch_closed": {"switch": "forward", "joint": 2}}},
        "A3 .*forward limit switch of joint 2",
    ),
    "a pressed emergency stop": ({"faults": {"switch_closed": {"switch": "abort"}}}, "A3 .*abort"),
    "limit switches the other way": (
        {"faults": {"switch_polarity": {"switch": "limit"}}},
        "A3 .*correct controller.limit_switches",
    ),
    "an abort input the other way": ({"faults": {"switch_polarity": {"switch": "abort"}}}, "A3 "),
    "an encoder that counts backwards": ({"faults": {"encoder_sign": {"joint": 1}}} | SERVO, "A4 "),
    "swapped encoders": ({"faults": {"encoders_swapped": {}}} | SERVO, "A4 "),
    "an unplugged encoder": ({"faults": {"encoder_loss": {"joint": 2}}} | SERVO, "A4 "),
    "a runaway, with nobody at the joints": (
        {"faults": {"encoder_sign": {"joint": 1}}, "present": False} | SERVO,
        "A9 |B1 |B4 ",
    ),
    "home switches the other way": (
        {"faults": {"switch_polarity": {"switch": "home"}}, "present": False},
        "homing broke off",
    ),
    "an encoder without index": (
        {
            "faults": {"index_missing": {"joint": 2}},
            "present": False,
            "values": {"controller.home_index": True, "controller.home_travel": "0.3 rad"},
        },
        "homing",
    ),
    "software limits that are not heeded": (
        {"unit": {"pvt_soft_limits": False}, "present": False},
        "B7 ",
    ),
}
QUICK = ("motors on at power-up", "a pressed emergency stop")


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in WRONG]
)
def test_a_wrong_assumption_is_found_with_the_arm_safe(name):
    given, said = WRONG[name]
    with pytest.raises(RobotError, match=said):
        run(**given)


@pytest.mark.slow
def test_an_output_that_gives_a_falling_edge_is_noted():
    found = run({"output_inverted": True}, present=False)
    assert found.values["daq.trigger_edge"] == "falling"


@pytest.mark.slow
def test_amplifiers_that_allow_less_are_read_not_demanded():
    found = run({"amplifier": "D3040", "burned": ["MO", "AG 2,2"]}, present=False)
    assert found.figures["torque_limit_volts"] == pytest.approx(7, abs=0.01)


def test_the_torque_of_the_trial_holds_the_arm():
    rig = load_rig()
    assert 0.05 <= trial_torque(rig) < 0.3
    heavy = with_values(rig, {"arm.torque_limit": "0.3 N m"})
    assert trial_torque(heavy) == 1.0
