"""Presses on the stand-in, over the real pyserial and nidaqmx, and what makes them quick."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

from sautereau.rig.edit import edited_text
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

QUICK = {
    "controller.timeout": "20 s",
    "arm.approach_speed": "5 rad/s",
    "press.approach_speed": "0.3 m/s",
}
"""Values of a rig: a timeout for a busy machine, and a short way to the key."""
QUICK_TEXT = edited_text(
    resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8"),
    *("paper", Path(), QUICK),
)
"""The packaged rig's file with these values."""
MUTE_TEXT = """
finger = "ideal"
plectrum = "none"
string = "none"
friction = false
felt = false
step = "1 ms"
"""
"""A scene file: a key without strings, for sessions that need no pluck."""


def with_data(press, frame, **changes):
    """Return a press with the samples of a table as `Press.data` has it, and other changes."""
    samples = {name: frame[name].to_numpy() for name in frame}
    return replace(press, time=frame.index.to_numpy(), samples=samples, **changes)


def mute_scene(finger="ideal", *, faults=None, **changes):
    """Return a scene without a string, with tables of faults; `changes` are in SI."""
    name, step = ("paper", 5e-4) if finger == "servo" else ("ideal", 1e-3)
    tables = Faults.model_validate(faults) if faults else None
    mute = {"plectrum": "none", "string": "none", "step": step, "faults": tables}
    return load_scene(name).model_copy(update=mute | changes)


def press_on(stand_in, out, n=1, controller=GalilController, **options):
    """Make n presses with the rig of a stand-in; return the recordings."""
    rig = stand_in.rig
    return make_presses(controller(rig), out, [Item(rig, plan_press(rig))] * n, **options)
