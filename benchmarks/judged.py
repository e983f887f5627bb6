"""Presses of the independent simulator as the analysis gets them."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.independent import Pressed, write_rig
from benchmarks.simulated import as_recorded
from sautereau.analysis.loading.press import Press, press_of
from sautereau.daq.file.recorded import Recorded
from sautereau.rig.load import load_rig, with_values


def judged_press(pressed: Pressed, values: Mapping[str, str | float] | None = None) -> Press:
    """Return a press as loaded from its recording; see `judged_recording`."""
    return press_of(judged_recording(pressed, values))


def judged_recording(pressed: Pressed, values: Mapping[str, str | float] | None = None) -> Recorded:
    """Return the recording of a press with the rig of its experimenter.

    Args:
        values: Of the rig by dotted key, which replace those of the experimenter.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        write_rig(pressed, path)
        rig = load_rig(path)
    if values:
        rig = with_values(rig, values)
    names = {channel.quantity: channel.name for channel in rig.daq.channels}
    volts = {names["velocity"]: pressed.velocity_volts, names["force"]: pressed.force_volts}
    first, name = -round(pressed.t0 * pressed.rate), f"independent-{pressed.seed}.mcap"
    return as_recorded(rig, volts, pressed.rate, first, name, pressed.seed)
