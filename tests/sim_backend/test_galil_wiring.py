"""Faults of the wiring on a simulated arm: encoders, switches, the trigger output."""

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import Bench
from sautereau.sim_backend.devices.daqmx.card import TaskSetup
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.parts import ControllerUnit
from tests.sim_backend.scenes import MUTE, scene_of


def arm(faults=None, finger="servo", **unit):
    """Return a bench without a string, at its first command, with echo off."""
    name = "paper" if finger == "servo" else "ideal"
    scene = scene_of(
        name,
        **MUTE,
        sensors=None,
        faults=None if faults is None else Faults.model_validate(faults),
        controller=ControllerUnit(**unit),
    )
    index = faults is not None and "index_missing" in faults
    bench = Bench(with_values(load_rig(), {"controller.home_index": index}), scene)
    bench.firmware.receive(b"EO 0\r")
    return bench


def send(bench, text):
    return bench.firmware.receive(text.encode() + b"\r").decode()


def number(bench, expression):
    bench.firmware.receive(b"")
    return float(send(bench, f"MG {expression}")[:-3])


def run(bench, samples):
    for _ in range(samples):
        bench.tick()


def lift(bench, joint=1, counts=5000):
    bench.operate(lambda plant: plant.lift(joint, counts))
    return number(bench, "_TPA"), number(bench, "_TPB")


def test_joints_lifted_by_hand_show_how_the_encoders_are_wired():
    assert lift(arm()) == (5000, 0)
    assert lift(arm(), joint=2) == (0, 5000)
    assert lift(arm({"encoder_sign": {"joint": 1}})) == (-5000, 0)
    assert lift(arm({"encoders_swapped": {}})) == (0, 5000)
    bench = arm({"encoder_loss": {"joint": 1}})
    assert lift(bench) == (0, 0)
    bench.operate(lambda plant: plant.connect_encoder(1))
    assert lift(bench) == (5000, 0)


def test_a_lifted_arm_holds_its_place_when_it_is_powered():
    bench = arm()
    lift(bench)
    send(bench, "SH")
    run(bench, 100)
    assert abs(number(bench, "_TEA")) < 20
    assert number(bench, "_TPA") == pytest.approx(5000, abs=20)


def test_the_motors_move_a_lifted_arm_as_far_as_any_other():
    bench = arm(finger="ideal")
    assert lift(bench, 1, 1000) == (1000, 0)
    send(bench, "RS")
    send(bench, "EO 0;SH;PR 2000;BGA")
    run(bench, 300)
    assert number(bench, "_TPA") == 2000
    bench = arm()
    lift(bench)
    assert "?" not in send(bench, "SH;SP 20000;AC 9000000;DC 9000000")
    edges = []
    for _ in range(4):
        send(bench, "FEA;BGA")
        run(bench, 900)
        edges.append(number(bench, "_TPA"))
    assert max(edges) - min(edges) < 200


@pytest.mark.parametrize("inverted", [False, True])
def test_burned_outputs_are_no_edges(inverted):
    bench = arm(burned=("MO", "BW 100", "SB 3", "OP 255"), output_inverted=inverted)
    assert number(bench, "_BWA") == 100
    assert bench.injection.presses == 0


@pytest.mark.parametrize(
    ("faults", "code"),
    [
        (None, 0),
        ({"encoder_sign": {"joint": 1}}, 8),
        ({"encoders_swapped": {}}, 8),
        ({"encoder_loss": {"joint": 1, "at": "100 ms"}}, 8),
    ],
)
def test_a_jog_runs_away_until_the_error_limit_ends_it(faults, code):
    bench = arm(faults)
    assert "?" not in send(bench, "SH;OE 1,1;ER 5000,5000;SP 20000;JG 20000;BGA")
    run(bench, 400)
    assert number(bench, "_SCA") == code
    assert number(bench, "_MOA") == (code == 8)


def test_a_lost_encoder_is_noticed_under_torque_before_the_error_limit():
    bench = arm({"encoder_loss": {"joint": 1, "at": "50 ms"}})
    assert "?" not in send(bench, "SH;OE 1,1;OV 1,1;OT 30,30;OA 1,1;TL 3,3;KI 1,1;JG 40000;BGA")
    run(bench, 500)
    assert number(bench, "_SCA") == 12
    assert bench.firmware.motors_on[0] is False


@pytest.mark.parametrize(
    ("fault", "operand", "normal"),
    [
        ({"switch": "forward", "joint": 2}, "_LFB", 1),
        ({"switch": "reverse", "joint": 1}, "_LRA", 1),
        ({"switch": "home", "joint": 2}, "_HMB", None),
        ({"switch": "abort"}, "_AB", 1),
    ],
)
def test_a_switch_that_closes_changes_one_operand(fault, operand, normal):
    names = ("_LFA", "_LRA", "_LFB", "_LRB", "_HMA", "_HMB", "_AB")
    bench = arm({"switch_closed": {**fault, "at": "10 ms"}})
    lift(bench, 2, 200_000)  # beyond the home switch
    before = {name: number(bench, name) for name in names}
    run(bench, 12)
    after = {name: number(bench, name) for name in names}
    assert [name for name in names if before[name] != after[name]] == [operand]
    assert before[operand] == 1
    bench.operate(lambda plant: plant.open(fault["switch"], fault.get("joint", 1)))
    assert {name: number(bench, name) for name in names} == before


@pytest.mark.parametrize(
    ("group", "operand"), [("limit", "_LFA"), ("home", "_HMA"), ("abort", "_AB")]
)
def test_inverted_switches(group, operand):
    assert number(arm(), operand) != number(arm({"switch_polarity": {"switch": group}}), operand)


def test_limit_switches_at_the_joints_limits():
    bench = arm(finger="ideal", limit_switches=True)
    assert number(bench, "_LFA") == 1
    assert "?" not in send(bench, "SH;SDA=9000000;ACA=9000000;JGA=400000;BGA")
    run(bench, 3000)
    assert number(bench, "_SCA") == 2
    rig = load_rig()
    radians = bench.world.start[0] + bench.plant.encoder_counts()[0] * rig.arm.radians_per_count
    assert radians == pytest.approx(rig.arm.upper_limits[0], abs=0.05)


def test_homing_to_switch_and_index_and_one_without_index():
    line = "SH;SP*=80000;HV*=80000;AC*=9000000;DC*=9000000;HM;BG"
    bench = arm(finger="ideal")
    home = bench.plant.home_counts()
    turn = 2 * np.pi / load_rig().arm.radians_per_count
    assert "?" not in send(bench, line)
    run(bench, 900)
    assert send(bench, "SC;TP") == " 10, 10\r\n: 0, 0\r\n:"
    index = np.array(home) + 0.1 / (2 * np.pi) * turn
    assert bench.plant.encoder_counts() == pytest.approx(index, abs=1)
    bench = arm({"index_missing": {"joint": 2}}, finger="ideal")
    send(bench, line)
    run(bench, 900)
    assert number(bench, "_BGB") == 1


def leads(program, threads, **unit):
    """Return the times [samples] by which the card's edge precedes the motion, for some starts."""
    found = []
    for wait in range(2, 14, 2):
        bench = arm(finger="ideal", **unit)
        assert isinstance(bench.firmware, GalilFirmware)
        bench.firmware.host_waits = False
        send(bench, f"DL\r#P\rWT {wait}\r{program}\rEN\r#X\rn=n+1\rJP #X\r\\")
        send(bench, "n=0;SH;PVA=2000,0,40;PVA=,,0")
        setup = TaskSetup(("Dev1/ai0", "Dev1/ai1"), 51_200.0, 10, bench.rig.daq.trigger_source)
        bench.card.start(setup)
        send(bench, "".join(f"XQ #X,{n + 1};" for n in range(threads)) + "XQ #P")
        path, times = [], []
        for _ in range(60):
            times.append(bench.time)
            bench.tick()
            path.append(bench.firmware.reference(np.array([1.0]))[0][0, 0])
        start = times[int(np.argmax(np.diff(path, prepend=path[0]) > 0))]
        (edge,) = bench.card.starts
        found.append((start - edge) / bench.rig.controller.sample_period)
    return np.array(found)


def test_the_trigger_edge_precedes_the_motion_by_up_to_a_sample():
    """SB acts when its line runs, BT with the next sample."""
    alone = leads("SB 1;BT A;AM;CB 1", 0)
    assert alone.min() > 0.7
    assert alone.max() <= 1 + 1e-9
    assert np.ptp(alone) > 0.1
    crowded = leads("SB 1;BT A;AM;CB 1", 3)
    assert 0 <= crowded.min() < 0.3
    assert 0.7 < crowded.max() <= 1 + 1e-9
    assert leads("SB 1\rBT A;AM;CB 1", 3).max() > 1.5  # other threads' lines between the two
    late = leads("SB 1;BT A;AM;CB 1", 0, output_delay="2 ms")
    np.testing.assert_allclose(alone - late, 2e-3 / load_rig().controller.sample_period)
    assert leads("SB 1;BT A;AM;CB 1", 0, output_inverted=True).max() < -38  # CB is the rising edge


def test_an_ideal_finger_has_no_encoders_to_lose():
    with pytest.raises(SceneError, match=r'encoder_sign: .*finger = "servo"'):
        arm({"encoder_sign": {"joint": 1}}, finger="ideal")


def test_an_amplifier_fault_of_a_press():
    bench = arm({"amplifier_fault": {"joint": 1, "press": 1}})
    setup = TaskSetup(("Dev1/ai0", "Dev1/ai1"), 51_200.0, 10, bench.rig.daq.trigger_source)
    bench.card.start(setup)
    send(bench, "SH;OE 1,1;TA 0")
    run(bench, 5)
    assert bench.firmware.motors_on == (True, True)
    send(bench, f"SB {bench.rig.controller.trigger_output}")
    run(bench, 3)
    assert bench.firmware.motors_on == (False, False)
