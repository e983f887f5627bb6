"""Feed-forward torques played by the controller, following errors, and the check of home."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import TorqueTable
from sautereau.robot.drivers.galil.arrays import LEAST_INTERVAL, plan_push
from sautereau.robot.drivers.galil.dmc import PUSH, PUSHES
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.safety import State
from sautereau.robot.errors import MotionFault, SettingNotTaken, UnsafeRequest
from sautereau.sim_backend.bench import StandIn
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import Segments
from tests.budget import slow
from tests.presses import QUICK, mute_scene

PUSHED = 0.4  # N m


def still(start, samples=400):
    """A motion of joint 1 there and back, long enough for a torque."""
    steps = np.array([[200, 0], [-200, 0]])
    each = np.array([samples // 2] * 2)
    return Segments(np.asarray(start), steps, np.zeros((2, 2), int), each)


def pulse(motion, rig, torque=PUSHED, joint=0):
    """A torque on a joint in the middle half of a motion, 0 at both ends."""
    end = motion.total_samples * rig.controller.sample_period
    torques = np.zeros((6, 2))
    torques[2:4, joint] = torque
    return TorqueTable(end * np.array([0, 0.2499, 0.25, 0.75, 0.7501, 1.0]), torques)


@pytest.fixture
def bench():
    """The paper's servo arm without plectrum and string, connected."""
    with contextlib.ExitStack() as stack:

        def make(**faults):
            rig = with_values(load_rig(), QUICK)
            stand_in = stack.enter_context(StandIn(rig, mute_scene("servo", faults=faults)))
            return stand_in, stack.enter_context(GalilController(stand_in.rig))

        yield make


def play(controller, motion, torque=None):
    controller.load(motion, torque)
    controller.arm()
    controller.start()
    controller.wait()
    return controller.capture()


def test_a_torque_is_played_from_the_start_of_motion_to_its_end(bench):
    stand_in, controller = bench()
    with controller.powered():
        motion = still(controller.home())
        bare = play(controller, motion)
        pushed = play(controller, motion, pulse(motion, stand_in.rig))
        offsets = controller.driver.line.read("_OFA", "_OFB")
    assert offsets == [0, 0]
    assert bare.torques.shape == pushed.torques.shape == (len(bare), 2)
    # The moment the torque comes the loop has not answered: all of it shows. So when it goes.
    change = np.diff(pushed.torques[:, 0] - bare.torques[:, 0])
    rise, fall = int(np.argmax(change)), int(np.argmin(change))
    assert change[rise] == pytest.approx(PUSHED, rel=0.25)
    assert change[fall] == pytest.approx(-PUSHED, rel=0.25)
    quarter = motion.total_samples / 4
    assert pushed.samples[rise] == pytest.approx(quarter, abs=LEAST_INTERVAL + 2)
    assert pushed.samples[fall] == pytest.approx(3 * quarter, abs=LEAST_INTERVAL + 2)
    # It moves the joint ahead of its reference: the following error says so.
    assert pushed.following_errors[:, 0].min() < bare.following_errors[:, 0].min() - 100


def test_the_controller_holds_the_planned_torques(bench):
    stand_in, controller = bench()
    with controller.powered():
        motion = still(controller.home())
        table = pulse(motion, stand_in.rig, -PUSHED, joint=1)
        controller.load(motion, table)
        line, rows = controller.driver.line, motion.total_samples // LEAST_INTERVAL
        assert line.read(PUSHES) == [rows]
        first, second = (np.array(line.upload(name, rows)) for name in PUSH)
        controller.load(motion)
        assert line.read(PUSHES) == [0]
    rig = stand_in.rig
    middles = (np.arange(rows) + 0.5) * LEAST_INTERVAL * rig.controller.sample_period
    planned = np.interp(middles, table.time, table.torques[:, 1])
    per_volt = rig.arm.torque_limit / rig.controller.full_torque
    np.testing.assert_allclose(second * per_volt, planned, atol=1e-4)
    assert not first.any()


@pytest.mark.parametrize("way", ["stop", slow("abort"), slow("exception"), "poserr"])
def test_no_torque_is_left_on_any_way_out(bench, way):
    faults = {"stall": {"press": 1, "joint": 1}} if way == "poserr" else {}
    stand_in, controller = bench(**faults)
    raised = MotionFault if way == "poserr" else ZeroDivisionError
    with pytest.raises(raised), controller.powered():  # noqa: PT012
        motion = still(controller.home(), samples=1200)
        controller.load(motion, pulse(motion, stand_in.rig))
        controller.arm()
        if way == "poserr":
            stand_in.bench.injection.begin_press()
            controller.driver.line.ask("ER 5,5")
        controller.start()
        if way == "stop":
            controller.stop()
            assert controller.state is State.STOPPED
            assert controller.driver.line.read("_OFA", "_XQ2", "@OUT[1]") == [0, -1, 0]
        elif way == "abort":
            controller.abort()
        elif way == "poserr":
            controller.wait()
        raise ZeroDivisionError
    line = controller.driver.line
    assert line.read("_MOA", "_MOB", "_OFA", "_OFB", "@OUT[1]", "_XQ2") == [1, 1, 0, 0, 0, -1]


FULL = 9.998  # V, the torque limit of the rig


@pytest.fixture(scope="module")
def rig():
    return load_rig()


def test_every_fault_of_a_table_is_listed(rig):
    motion = still([0, 0])
    good = pulse(motion, rig)
    assert plan_push(rig, good, motion, FULL).volts.max() == pytest.approx(0.2 * 9.998, rel=1e-3)
    late = replace(good, time=good.time[::-1] + 1.0, torques=good.torques * 6)
    said = r"do not increase.*it lasts 1 s, longer than the.*joint 1 gets 2\.4 N m, above"
    with pytest.raises(UnsafeRequest, match=said):
        plan_push(rig, late, motion, FULL)
    for bad in (
        replace(good, torques=good.torques * np.nan),
        replace(good, time=good.time[1:]),
        replace(good, torques=good.torques[:, :1]),
        TorqueTable(np.zeros(0), np.zeros((0, 2))),
    ):
        with pytest.raises(UnsafeRequest, match="torque table"):
            plan_push(rig, bad, motion, FULL)


@pytest.mark.parametrize("samples", [2, 10, 1000, 1024, 1026, 100_000])
def test_rows_cover_the_motion_and_are_few(rig, samples):
    motion = still([0, 0], samples)
    push = plan_push(rig, pulse(motion, rig, 2.0), motion, FULL)
    assert len(push.volts) <= 256
    assert len(push.volts) * push.interval >= motion.total_samples
    assert (len(push.volts) - 1) * push.interval < motion.total_samples
    assert np.abs(push.volts).max() <= 9.998
    assert push.interval % 2 == 0


def test_amplifiers_that_allow_less_than_the_rig(rig):
    motion = still([0, 0])
    with pytest.raises(UnsafeRequest, match=r"above 1\.4 N m, .* the limit of the amplifiers"):
        plan_push(rig, pulse(motion, rig, 1.5), motion, 0.7 * FULL)


def test_a_torque_that_the_controller_reads_back_differently(bench):
    stand_in, controller = bench()
    with controller.powered():
        motion = still(controller.home())
        line, upload = controller.driver.line, controller.driver.line.upload
        line.upload = lambda *asked: [value + 0.01 for value in upload(*asked)]
        with pytest.raises(SettingNotTaken, match=r"differs by 0\.01 V"):
            controller.load(motion, pulse(motion, stand_in.rig))
        assert controller.state is State.HOMED


@pytest.mark.parametrize(("joint", "counts"), [(1, 300), *(slow(2, n) for n in (-300, 3000))])
def test_an_encoder_that_has_slipped_is_found_at_the_home_switch(bench, joint, counts):
    stand_in, controller = bench(slip={"press": 1, "joint": joint, "counts": counts})
    with pytest.raises(MotionFault, match=f"home switch of joint {joint} is not") as caught:  # noqa: PT012, SIM117
        with controller.powered():
            controller.home()
            controller.check_home()
            plan = plan_press(stand_in.rig)
            controller.move_to(plan.hover, 100_000)
            stand_in.bench.injection.begin_press()
            play(controller, plan.approach)
            controller.check_home()
    assert "confirms it" in str(caught.value)
    assert controller.state is State.OFF


def test_a_torque_limit_in_the_controller_limits_the_motors(bench):
    stand_in, controller = bench()
    with controller.powered():
        motion = still(controller.home())
        controller.driver.settings.limit_torque(2.5 / 9.998)
        capture = play(controller, motion, pulse(motion, stand_in.rig))
    assert capture.torques.max() == pytest.approx(2.5 / 9.998 * 2.0, rel=1e-4)
