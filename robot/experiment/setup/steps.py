"""The steps of the set-up in order; each can be run alone."""

import logging
from collections.abc import Callable, Iterator

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.contact import find_contact
from sautereau.robot.experiment.setup.dry_run import play_in_air
from sautereau.robot.experiment.setup.joints import check_encoders, find_home
from sautereau.robot.experiment.setup.port import find_port, identify
from sautereau.robot.experiment.setup.step import Ask, Found
from sautereau.robot.experiment.setup.tap import tap_key
from sautereau.robot.experiment.setup.touch import locate_by_touch
from sautereau.robot.experiment.setup.verify.run import verify

_LOG = logging.getLogger(__name__)
STEPS: dict[str, Callable[[Rig, Ask], Found]] = {
    "port": find_port,
    "controller": identify,
    "verify": verify,
    "home": find_home,
    "encoders": check_encoders,
    "contact": find_contact,
    "touch": locate_by_touch,
    "tap": tap_key,
    "dry-run": play_in_air,
}
"""By name."""


def make_steps(rig: Rig, ask: Ask, step: str | None = None) -> Iterator[tuple[str, Found]]:
    """Run one step, or all, each with the values that those before it have found.

    Args:
        step: Its name; None for all.

    Raises:
        SautereauError: A step failed; the arm has been stopped and switched off.
    """
    if step is not None and step not in STEPS:
        raise RobotError(f"setup: there is no step {step!r}; the steps are {', '.join(STEPS)}")
    for name in STEPS if step is None else (step,):
        _LOG.info("setup step %s", name)
        found = STEPS[name](rig, ask)
        yield name, found
        rig = with_values(rig, found.values)
