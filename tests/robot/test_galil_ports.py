"""A press with the driver on the emulated controller, over each of its ports and firmwares."""

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.controller_part import ControllerUnit
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

SLOW = pytest.mark.slow
MUTE = {"plectrum": "none", "string": "none", "step": 1e-3}


def stand_in(unit, **values):
    unit = ControllerUnit.model_validate(unit)
    scene = load_scene("ideal").model_copy(update=MUTE | {"controller": unit})
    rig = with_values(load_rig(), {"controller.timeout": "60 s"} | values)
    return StandIn(rig, scene, 1)


@pytest.mark.parametrize(
    ("unit", "values"),
    [
        ({"interface": "ethernet", "control_z": "attached", "odd_pvt": "refuse"}, {}),
        pytest.param({"interface": "usb", "usb_echo": False}, {}, marks=SLOW),
        pytest.param({"baud_rate": 115_200, "at_jitter": 2}, {}, marks=SLOW),
        pytest.param(
            {"amplifier": "D3040", "burned": ["MO", "AG 2,2"]}, {}, marks=pytest.mark.slow
        ),
        pytest.param({}, {"controller.home_index": True}, marks=SLOW),
        pytest.param({}, {"controller.home_approach": "backward"}, marks=SLOW),
    ],
)
def test_a_press_over_every_port(unit, values):
    with stand_in(unit, **values) as served, GalilController(served.rig) as controller:
        plan = plan_press(served.rig)
        with controller.powered():
            np.testing.assert_array_equal(controller.home(), plan.home)
            controller.move_to(plan.hover, 100_000)
            for motion in (plan.approach, plan.segments):
                controller.load(motion)
                controller.arm()
                controller.start()
                controller.wait()
            capture = controller.capture()
    start = plan.segments.start
    np.testing.assert_allclose(capture.counts[0], start, atol=100)
    np.testing.assert_allclose(capture.counts[-1], plan.segments.end, atol=100)
