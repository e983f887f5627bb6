"""Stiffness and damping of the position loops, from recorded presses."""

from collections.abc import Sequence
from pathlib import Path

from sautereau.analysis.press.loops import position_loops
from sautereau.daq.file.reading import read_recording
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Found


def loops_of_recordings(paths: Sequence[Path]) -> Found:
    """Find the position loops in recordings of presses, for `plan` to predict the speed error.

    Raises:
        RobotError: No press shows them.
    """
    loops = position_loops(map(read_recording, paths))
    if loops is None:
        raise RobotError(
            "setup loops: the presses do not show how far the position loops yield: the controller"
            " has captured no torques, or those of a feed-forward; give presses without one"
        )
    # Two digits, as loops that a few presses show are known to 20 %.
    values = {
        "arm.servo_stiffness": [f"{value:.2g} N m/rad" for value in loops.stiffness],
        "arm.servo_damping": [f"{value:.2g} N m s/rad" for value in loops.damping],
    }
    figures = {
        f"{name}_{joint}": value
        for name, pair in (("stiffness", loops.stiffness), ("damping", loops.damping))
        for joint, value in enumerate(pair, 1)
    }
    return Found((f"loops: {loops}",), values, figures)
