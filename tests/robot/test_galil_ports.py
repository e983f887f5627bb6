"""A press with the driver on the emulated controller, over each of its ports and firmwares."""

import contextlib
import socket

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import play
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import LineLost, RobotError
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.trajectory.press import plan_press
from tests.presses import mute_scene

SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("unit", "values"),
    [
        ({"interface": "ethernet", "control_z": "attached", "odd_pvt": "refuse"}, {}),
        pytest.param({"interface": "usb", "usb_echo": False}, {}, marks=SLOW),
        pytest.param({"baud_rate": 115_200, "at_jitter": 2}, {}, marks=SLOW),
        pytest.param({"amplifier": "D3040", "burned": ["MO", "AG 2,2"]}, {}, marks=SLOW),
        pytest.param({}, {"controller.home_index": True}, marks=SLOW),
        pytest.param({}, {"controller.home_approach": "backward"}, marks=SLOW),
    ],
)
def test_a_press_over_every_port(unit, values):
    scene = mute_scene(controller=ControllerUnit.model_validate(unit))
    rig = with_values(load_rig(), {"controller.timeout": "60 s"} | values)
    with StandIn(rig, scene, 1) as served, GalilController(served.rig) as controller:
        plan = plan_press(served.rig)
        with controller.powered():
            np.testing.assert_array_equal(controller.home(), plan.home)
            controller.move_to(plan.hover, 100_000)
            for motion in (plan.approach, plan.segments):
                play(controller, motion)
            capture = controller.capture()
    start = plan.segments.start
    np.testing.assert_allclose(capture.counts[0], start, atol=100)
    np.testing.assert_allclose(capture.counts[-1], plan.segments.end, atol=100)


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ({"model": "DMC30010"}, r"DMC30010 Rev .* has one axis, .*use a DMC-40x0, .*two axes"),
        ({"model": "DMC2123"}, r"DMC2123 .*has no PVT mode \(PV\) and .*\(OA\); use a DMC-40x0"),
        ({"model": "DMC52020"}, r"DMC52020 .*has no limit of its torque \(TL\)"),
        ({"firmware": "1.3a-FAST"}, r"has no PVT mode \(PV\).*firmware without -FAST"),
    ],
)
def test_a_model_that_cannot_press_is_refused_with_what_it_lacks(unit, said):
    scene = mute_scene(controller=ControllerUnit.model_validate(unit))
    with StandIn(load_rig(), scene, 1) as served, pytest.raises(RobotError, match=said):
        GalilController(served.rig).connect()


@pytest.mark.parametrize("model", ["DMC4183", "DMC4220", "DMC50040"])
def test_other_models_connect(model):
    """A DMC-42x0 has no amplifiers, so that AG is not asked for."""
    scene = mute_scene(controller=ControllerUnit(model=model))
    with StandIn(load_rig(), scene, 1) as served, GalilController(served.rig) as controller:
        assert controller.identity.startswith(model)


def test_all_handles_in_use():
    scene = mute_scene(controller=ControllerUnit(interface="ethernet"))
    with StandIn(load_rig(), scene, 1) as served, contextlib.ExitStack() as stack:
        port = int(served.rig.controller.port.rpartition(":")[2])
        for _ in range(8):
            taken = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            taken.sendall(b"EO 0\r")
            taken.recv(16)
        with pytest.raises(LineLost, match="eight Ethernet handles"):
            GalilController(served.rig).connect()
