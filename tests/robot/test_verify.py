"""`setup verify` on the stand-in: what passes, and each wrong assumption at its step."""

import re

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import Capture
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.contact import NoContact
from sautereau.robot.experiment.setup.steps import trial_torque, verify
from sautereau.robot.experiment.setup.verify.alignment import delay_of, onset, place_at, stroke
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.segments import motion_at, segment_cubics
from tests.budget import slow
from tests.presses import mute_scene


class Operator:
    """An operator who does by hand what is asked, on a stand-in; or is not there."""

    def __init__(self, served, present=True, agrees=True, turns=True, touches=False):
        self.bench, self.present, self.agrees = served.bench, present, agrees
        self.turns, self.touches = turns, touches
        self.undo = None

    def confirm(self, question):
        if "touches the key" in question:
            return self.touches
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
            self.move(lambda plant: plant.lift(joint, 30_000))
        elif instruction.startswith("Push"):
            self.move(lambda plant: plant.lift(1, 40_000))
        elif instruction.startswith("Plug"):
            self.bench.operate(lambda plant: plant.connect_encoder(joint))
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


def run(unit=None, faults=None, finger="ideal", values=None, step=1e-3, paced=False, **operator):
    """Verify a stand-in; return what was found."""
    described = ControllerUnit.model_validate(unit or {})
    scene = mute_scene(finger, faults=faults, controller=described, step=step)
    own = {"controller.timeout": "60 s"}
    if "index_missing" in (faults or {}):
        own["controller.home_index"] = True
    rig = with_values(load_rig(), own)
    with StandIn(rig, scene, paced=paced) as served:
        bench = with_values(served.rig, values or {})
        person = Operator(served, **operator)
        try:
            return verify(bench, person)
        finally:
            assert served.bench.firmware.motors_on == (False, False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "unit",
    [
        {},
        slow({"interface": "ethernet", "control_z": "attached"}),
        slow({"interface": "usb", "odd_pvt": "refuse"}),
    ],
)
def test_a_controller_that_is_as_assumed_is_verified(unit):
    found = run(unit, present=False)
    assert found.values["controller.verified"].endswith("serial number 12345")
    assert "MTA=1" in found.values["controller.verified_settings"]
    odd = "refused" if unit.get("odd_pvt") else "accepted"
    assert any(f"odd velocity and time is {odd}" in line for line in found.lines)


@pytest.mark.slow
def test_in_real_time_the_watchdog_is_measured_on_the_controllers_clock():
    found = run(present=False, paced=True, values={"controller.watchdog_period": "0.5 s"})
    assert 0.4 <= found.figures["watchdog_time"] <= 0.55
    assert any("B2 watchdog: motors off" in r for r in found.values["controller.verified_results"])


@pytest.mark.slow
def test_an_operator_moves_switches_and_joints_and_pushes_the_arm():
    found = run(finger="servo", turns=False)
    assert len([line for line in found.lines if line.startswith("B10")]) == 2


def wrong(said, unit=None, rig=None, finger="ideal", alone=False, more=None, **faults):
    """A wrong assumption: what `setup verify` says, and what is other than assumed."""
    given = {"unit": unit, "faults": faults or None, "values": rig, "finger": finger}
    return said, given | {"present": not alone} | (more or {})


WRONG = {
    # A1, A2: another controller, another memory, another rig.
    "no PVT mode": wrong("A1 .*has no PVT mode", {"firmware": "1.3a-FAST"}),
    "a controller without an abort per axis": wrong("A[12] ", {"model": "DMC2123"}),
    "motors on at power-up": wrong("A1 .*motors were on", {"burned": []}),
    "a program that starts itself": wrong(
        "A1 .*begins with #AUTO",
        {"burned_program": "#AUTO\nWT 1000\nJP #AUTO\nEN"},
        more={"agrees": False},
    ),
    "a program that switches the motors on": wrong(
        "A1 .*motors were on", {"burned_program": "#AUTO\nSH AB\nEN"}
    ),
    "a locked program": wrong(
        "A1 .*106", {"burned": ["MO", "PW key,key", "\x0c\x0bkey,1"], "burned_program": "#A\nEN"}
    ),
    "an output used as a brake": wrong("A2 .*brake of joint 1", {"burned": ["MO", "BW 100,0"]}),
    "the other output used as a brake": wrong(
        "A2 .*brake of joint 2", {"burned": ["MO", "BW 0,100"]}, {"controller.trigger_output": 2}
    ),
    "another sample period": wrong("A2 .*TM 1000", rig={"controller.sample_period": "0.9 ms"}),
    "a limit of the error beyond the range": wrong(
        "A2 .*half of the smaller", rig={"controller.position_error_limit": 500_000}
    ),
    "a longer FIFO": wrong("A2 .*FIFO", alone=True, rig={"controller.segment_limit": 511}),
    "short lines": wrong("A1 .*refused .*5 Input buffer full", {"line_length": 40}),
    "a noisy line": wrong(
        "A[0-9]+ .*(echoed|answer|holds|refused|settings)", line={"flipped": 1e-3}
    ),
    # A3: switches.
    "a closed limit switch": wrong(
        "A3 .*forward limit switch of joint 2", switch_closed={"switch": "forward", "joint": 2}
    ),
    "a pressed emergency stop": wrong("A3 .*abort", switch_closed={"switch": "abort"}),
    "limit switches the other way": wrong(
        "A3 .*correct controller.limit_switches", switch_polarity={"switch": "limit"}
    ),
    "limit switches that open, in the rig only": wrong(
        "A3 .*correct controller.limit_switches", rig={"controller.limit_switches": "active_high"}
    ),
    "an abort input the other way": wrong("A3 .*abort", switch_polarity={"switch": "abort"}),
    "an emergency stop that is not wired": wrong(
        "A3 .*abort input.*sees nothing", switch_cut={"switch": "abort"}
    ),
    "a limit switch that is not wired": wrong(
        "A3 .*reverse limit switch of joint 2.*sees nothing",
        {"limit_switches": True},
        switch_cut={"switch": "reverse", "joint": 2},
    ),
    "a home switch that is not wired": wrong(
        "A3 .*home switch of joint 1.*sees", switch_cut={"switch": "home"}
    ),
    "limit switches exchanged": wrong(
        "A3 .*forward limit switch of joint 1 was changed.*sees the reverse limit switch",
        {"limit_switches": True},
        switches_swapped={"switch": "limit"},
    ),
    "home switches exchanged": wrong(
        "A3 .*home switch of joint 1 was changed.*sees", switches_swapped={"switch": "home"}
    ),
    # A4: encoders.
    "an encoder that counts backwards": wrong("A4 ", finger="servo", encoder_sign={"joint": 1}),
    "swapped encoders": wrong("A4 ", finger="servo", encoders_swapped={}),
    "an unplugged encoder": wrong("A4 ", finger="servo", encoder_loss={"joint": 2}),
    "an encoder of another resolution": wrong(
        "A4 .*counts_per_revolution", rig={"arm.counts_per_revolution": 500_000}
    ),
    # A6 to A10: line, program, torque, trigger.
    "a slow line": wrong("A6 .*too long for the watchdog", {"baud_rate": 19_200}, alone=True),
    "an error that ends every thread": wrong("A7 ", {"error_routine": False}, alone=True),
    "samples unknown to AT": wrong("A8 ", {"firmware": "1.1a"}, alone=True),
    "late samples of AT": wrong("A8 .*AT", {"at_jitter": 16}, alone=True),
    "torques recorded in volts": wrong(
        "A9 .*recorded as", {"recorded_torque": "volts"}, finger="servo", alone=True
    ),
    "an output wired to another terminal": wrong(
        "A10 .*by no edge", rig={"daq.trigger_source": "PFI1"}, alone=True
    ),
    "another output wired": wrong(
        "A10 .*output 3 .*by no edge", rig={"controller.trigger_output": 3}, alone=True
    ),
    # B: with power.
    "an amplifier that fails": wrong(
        "B1 .*amplifiers", alone=True, amplifier_fault={"joint": 1, "press": 1}
    ),
    "a runaway, with nobody at the joints": wrong(
        "(A9|B1|B4) ", finger="servo", alone=True, encoder_sign={"joint": 1}
    ),
    "an encoder that is lost": wrong(
        "B[1-4] ", finger="servo", alone=True, encoder_loss={"joint": 2, "press": 1}
    ),
    "a joint that is blocked": wrong(
        "B4 .*joint 1 stopped by an encoder failure", finger="servo", alone=True, stall={"joint": 1}
    ),
    "a limit switch that closes with the power": wrong(
        "B1 .*active: forward limit", alone=True, switch_closed={"switch": "forward", "press": 1}
    ),
    "home switches the other way": wrong(
        "B4 .*homing broke off", alone=True, switch_polarity={"switch": "home"}
    ),
    "a home beyond its travel": wrong(
        "B4 .*homing broke off", alone=True, rig={"controller.home_travel": "0.01 rad"}
    ),
    "an encoder without index": wrong(
        "B4 .*homing",
        alone=True,
        index_missing={"joint": 2},
        rig={"controller.home_index": True, "controller.home_travel": "0.3 rad"},
    ),
    "a coupling that slips": wrong(
        # 1.9 s after the trigger edge of A10, the repeated searches for home are under way.
        "B4 .*counts",
        finger="servo",
        alone=True,
        slip={"joint": 1, "counts": 500, "at": "1.9 s"},
    ),
    "software limits that are not heeded": wrong("B7 ", {"pvt_soft_limits": False}, alone=True),
    "a following error that is not heeded": wrong(
        "B8 .*twice ER", {"pvt_error_limit": False}, finger="servo", alone=True
    ),
}
QUICK = (
    "motors on at power-up",
    "an output used as a brake",
    "a slow line",
    "limit switches exchanged",
    "swapped encoders",
    "an emergency stop that is not wired",
)


@pytest.mark.parametrize("name", [n if n in QUICK else slow(n) for n in WRONG])
def test_a_wrong_assumption_is_found_with_the_arm_safe(name):
    said, given = WRONG[name]
    with pytest.raises(RobotError, match=f"setup verify, step {said}"):
        run(**given)


@pytest.mark.slow
def test_the_trigger_is_measured_whatever_its_edge_and_its_delay():
    """With an engine fine enough to locate the contact; the delay is within a sample without it."""
    found = run(
        {"output_inverted": True, "output_delay": "2 ms"}, present=False, touches=True, step=5e-5
    )
    assert found.values["daq.trigger_edge"] == "falling"
    delay, std = found.figures["trigger_delay"], found.figures["trigger_delay_std"]
    assert -2.2e-3 < delay < -1.0e-3
    assert 10e-6 < std < 0.3e-3
    assert found.values["controller.trigger_delay"] == f"{delay * 1e3:.3f} ms"
    rig = with_values(load_rig(), found.values)
    assert rig.controller.trigger_delay_std == pytest.approx(std, abs=1e-6)
    assert any(line.startswith("B9 trigger delay") for line in rig.controller.verified_results)


@pytest.mark.parametrize("delay", [-2e-3, 0.4e-3])
def test_two_speeds_separate_the_delay_from_the_place_of_the_contact(delay):
    """A force that rises linearly with the depth, seen a delay after the encoders' record."""
    rig = load_rig()
    period, rate, surface = rig.controller.sample_period, 51_200.0, 0.1e-3
    found = []
    for speed in (0.003, 0.003, 0.03, 0.03):
        motion = stroke(rig, 0.0, speed)
        assert not (motion.velocities % 2).any()
        cubics = segment_cubics(motion, 1 / rig.arm.radians_per_count, period)

        def joints(time, motion=motion, cubics=cubics):
            ticks = np.clip(time / period, 0, motion.total_samples)
            return motion_at(motion, cubics, ticks).position

        rows = np.arange(0, motion.total_samples, 2)
        counts = np.rint(joints(rows * period) / rig.arm.radians_per_count)
        capture = Capture(rows, counts.astype(np.int64), period)
        time = np.arange(0, capture.times[-1], 1 / rate)
        tip = fingertip_place(rig.arm, joints(time - delay))[:, 1]
        depth = rig.key.surface_height + rig.arm.fingertip_radius + surface - tip
        force = 2e3 * np.maximum(0, depth)
        found.append(place_at(capture, rig, onset(force, rate)))
    slow, fast = np.array(found[:2]), np.array(found[2:])
    assert delay_of(slow, fast)[0] == pytest.approx(delay, abs=20e-6)
    with pytest.raises(NoContact):
        onset(np.zeros(4000), rate)


@pytest.mark.slow
def test_amplifiers_that_allow_less_are_read_not_demanded():
    found = run({"amplifier": "D3040", "burned": ["MO", "AG 2,2"]}, present=False)
    assert found.figures["torque_limit_volts"] == pytest.approx(7, abs=0.01)


def test_the_torque_of_the_trial_holds_the_arm():
    rig = load_rig()
    assert 0.05 <= trial_torque(rig) < 0.3
    heavy = with_values(rig, {"arm.torque_limit": "0.3 N m"})
    assert trial_torque(heavy) == 1.0
