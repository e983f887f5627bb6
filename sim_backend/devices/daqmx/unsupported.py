"""What the stand-in would not follow: properties that can be set and read back, and calls."""

from typing import Any

from nidaqmx._stubs import nidaqmx_pb2_grpc

from sautereau.sim_backend.devices.daqmx.attributes import call, number
from sautereau.sim_backend.devices.daqmx.creation import CREATORS
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

_DO_NOT_OVERWRITE, _NONE = 10159, 10230

UNFOLLOWED: dict[str, dict[str, object]] = {
    "TRIGGER": {
        "REF_TRIG_RETRIGGERABLE": False,
        "START_TRIG_DELAY": 0.0,
        "REF_TRIG_DELAY": 0.0,
        "PAUSE_TRIG_TYPE": _NONE,
        "ARM_START_TRIG_TYPE": _NONE,
    },
    "TIMING": {"DELAY_FROM_SAMP_CLK_DELAY": 0.0},
    "READ": {"OVERWRITE": _DO_NOT_OVERWRITE, "LOGGING_SAMPS_PER_FILE": 0},
}
"""Only supported value of properties, by prefix and name."""


def refuse_unsupported(stored: dict[int, Any]) -> None:
    """Refuse a task whose stored properties request what would not be done."""
    for prefix, names in UNFOLLOWED.items():
        for name, default in names.items():
            if (value := stored.get(number(prefix, name), default)) != default:
                raise DaqmxError(
                    -200452,
                    f"The stand-in does not follow property {name}, which is set to {value};"
                    " reset it.",
                )


def _refused(name: str, code: int, what: str) -> Any:
    def refuse(self: Any, request: Any, context: Any) -> None:
        raise DaqmxError(code, f"The stand-in has no {what}.")

    return call(refuse, name)


_TEDS = (-200741, "TEDS sensors")
REFUSED = {
    name: _refused(name, *why)
    for name, why in {
        **{
            name: (-200431, "sensor for this measurement")
            for name in vars(nidaqmx_pb2_grpc.NiDAQmxServicer)
            if name.startswith(("CreateAI", "CreateTEDSAI")) and name not in CREATORS
        },
        **dict.fromkeys(
            ("ConfigureTEDS", "ClearTEDS", "WriteToTEDSFromArray", "WriteToTEDSFromFile"), _TEDS
        ),
    }.items()
}
"""Calls that need what the card does not have, by the call of nidaqmx.proto."""
