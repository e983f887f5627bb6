"""A recording as an xarray Dataset."""

from typing import Any

from sautereau.daq.convert.columns import si_values
from sautereau.daq.file.recorded import Recorded
from sautereau.rig.acquisition import MEASURED
from sautereau.rig.errors import require

JOINT_UNITS = {"jack_rise": "m", "m1": "N m", "m2": "N m"}
"""Units of the joints' variables, where they are not rad."""


def to_xarray(recorded: Recorded, *, raw: bool = False) -> Any:
    """Return a recording as an xarray Dataset, each variable with its ``units``.

    The channels are variables over ``time``, in s after the trigger: calibrated, AC coupling
    inverted, sensor delays compensated, so that the last rows, which not all sensors show, are
    omitted; neither offset nor drift is removed. Encoders, following errors and torques are
    variables over ``joints_time``, the planned motion over ``plan_time``, both in s after the
    trigger on the controller's clock. The attributes describe the press.

    Args:
        raw: Whether the channels are raw volts, of all rows.

    Raises:
        MissingExtraError: xarray is not installed.
    """
    require("xarray", "to_xarray", "xarray")
    import xarray as xr  # pyright: ignore[reportMissingImports]

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"time": ("time", recorded.time, {"units": "s"})}
    if raw:
        for name, volts in recorded.volts.items():
            variables[name] = ("time", volts, {"units": "V"})
    else:
        found = {
            channel: si_values(channel, recorded.volts[channel.name], recorded.rate)
            for channel in recorded.rig.daq.channels
        }
        first = max(column.start for column in found.values())
        stop = min(column.start + len(column.values) for column in found.values())
        coordinates["time"] = ("time", recorded.time[first:stop], {"units": "s"})
        for channel, column in found.items():
            values = column.values[first - column.start : max(first, stop) - column.start]
            about = {"units": column.unit, "long_name": MEASURED.get(channel.quantity).meaning}
            variables[channel.name] = ("time", values, about | {"what": column.what})
    for kind, series in (("joints", recorded.joints), ("plan", recorded.plan)):
        if series is not None:
            coordinates[f"{kind}_time"] = (f"{kind}_time", series.t, {"units": "s"})
            for name, values in vars(series).items():
                if name != "t" and len(values):
                    units = {"units": JOINT_UNITS.get(name, "rad")}
                    variables[f"{kind}_{name}"] = (f"{kind}_time", values, units)
    about = {key: text for key, text in recorded.session.to_metadata().items() if text}
    about |= {"rig": recorded.rig.name, "rate_Hz": recorded.rate, "t0_ns": recorded.t0_ns}
    return xr.Dataset(variables, coordinates, about)
