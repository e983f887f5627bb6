"""A recorded press as a table in SI units, on one time base."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analysis.errors import AnalysisError
from rig.schema import Rig
from trajectory.key import rise_of_angle, rise_slope

if TYPE_CHECKING:
    import pandas as pd

UNITS = {
    "velocity": "m/s",
    "force": "N",
    "angle": "rad",
    "deflection": "m",
    "jack_rise": "m",
    "jack_speed": "m/s",
}
"""Of the columns of a press."""


@dataclass(frozen=True)
class Press:
    """One recorded press."""

    path: Path
    rig: Rig
    simulated: bool
    """Whether a stand-in made it; whatever is made from it has to say so."""
    data: "pd.DataFrame"
    """Columns of `UNITS`, index `time` in s from the trigger; `attrs` holds the units.

    `velocity` is the key's under the laser and `deflection` its integral, downwards;
    `force` is the finger's; `jack_rise` and `jack_speed` follow from the key's angle.
    """
    rate: float
    """Hz, of the rows."""


def load_press(path: str | Path) -> Press:
    """Load a recording: volts to SI, droop undone, every sensor's delay taken back.

    Only instants that every sensor has seen are rows; nothing is filled in.

    Raises:
        daq.errors.RecordingError: The file is not a whole recording.
        AnalysisError: It has no velocity or no force channel.
    """
    import pandas as pd
    from scipy.integrate import cumulative_trapezoid

    from daq.reading import read_recording
    from daq.sensors import correct

    recorded = read_recording(path)
    rig, rate = recorded.rig, recorded.rate
    n = len(next(iter(recorded.volts.values())))
    longest = max(channel.delay for channel in rig.daq.channels)
    rows = n - int(np.ceil(longest * rate))
    if rows < 16:
        raise AnalysisError(
            f"recording {path}: {max(rows, 0)} samples are left once the delay of"
            f" {longest * 1e3:.4g} ms is taken back, too few for a press; record for longer"
        )
    signals = {}
    for quantity in ("velocity", "force"):
        channel = rig.daq.channel(quantity)
        if channel is None:
            raise AnalysisError(
                f"recording {path}: it has no {quantity} channel, and phases need both;"
                f" add a channel with quantity = {quantity!r} to the rig's [[daq.channels]]"
            )
        signals[quantity] = _undelayed(
            correct(recorded.volts[channel.name], channel, rate), channel.delay * rate, rows
        )
    angle = cumulative_trapezoid(signals["velocity"], dx=1 / rate, initial=0) / rig.key.laser_arm
    spin = signals["velocity"] / rig.key.laser_arm
    frame = pd.DataFrame(
        signals
        | {
            "angle": angle,
            "deflection": angle * rig.key.laser_arm,
            "jack_rise": rise_of_angle(rig.key, angle),
            "jack_speed": spin * rise_slope(rig.key, angle),
        },
        index=pd.Index(np.arange(rows) / rate, name="time"),
    )
    frame.attrs = {"units": UNITS, "simulated": recorded.simulated, "path": str(path)}
    return Press(Path(path), rig, recorded.simulated, frame, rate)


def _undelayed(signal: np.ndarray, delay: float, rows: int) -> np.ndarray:
    """Return the first rows of a signal that came ``delay`` samples late, whole or not."""
    whole, part = divmod(delay, 1.0)
    start = int(whole)
    if part < 1e-9:
        return signal[start : start + rows]
    return (1 - part) * signal[start : start + rows] + part * signal[start + 1 : start + 1 + rows]
