"""A host that begins a press that is held for long, says so, and does nothing more.

Run as `python -m tests.robot.pressing_host PORT`; the tests kill it.
"""

import sys
import time

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import play
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.trajectory.press import plan_press


def main(port: str) -> None:
    """Press through a port and say so while the key is held down."""
    values = {"controller.port": port, "press.bottom_hold": "60 s"}
    values["controller.watchdog_period"] = "2 s"  # on a busy machine
    rig = with_values(load_rig(), values)
    plan = plan_press(rig)
    controller = GalilController(rig)
    with controller, controller.powered():
        controller.home()
        controller.move_to(plan.hover, 150_000)
        play(controller, plan.approach)
        controller.load(plan.segments)
        controller.arm()
        controller.start()
        time.sleep(2.2)  # longer than the watchdog's period, which it survives
        print(*controller.positions(), controller.state, flush=True)  # noqa: T201
        time.sleep(60)


if __name__ == "__main__":
    main(sys.argv[1])
