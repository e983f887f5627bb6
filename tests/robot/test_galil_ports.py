"""A press with the driver on the emulated controller, over each of its ports and firmwares."""

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import play
from sautereau.robot.drivers.galil.driver import GalilController
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
