"""Properties that can be set and read back, and that the stand-in would not follow."""

from sautereau.sim_backend.devices.daqmx.attributes import Storing, number
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

_DO_NOT_OVERWRITE, _LOGGING_OFF, _NONE = 10159, 10231, 10230

_DEFAULTS: dict[str, dict[str, object]] = {
    "TRIGGER": {
        "START_TRIG_RETRIGGERABLE": False,
        "REF_TRIG_RETRIGGERABLE": False,
        "START_TRIG_DELAY": 0.0,
        "REF_TRIG_DELAY": 0.0,
        "PAUSE_TRIG_TYPE": _NONE,
        "ARM_START_TRIG_TYPE": _NONE,
    },
    "TIMING": {"DELAY_FROM_SAMP_CLK_DELAY": 0.0},
    "READ": {"OVERWRITE": _DO_NOT_OVERWRITE, "LOGGING_MODE": _LOGGING_OFF},
}
UNSUPPORTED = {
    number(prefix, name): (name, default)
    for prefix, names in _DEFAULTS.items()
    for name, default in names.items()
}
"""Name and only supported value, by number."""


def refuse_unsupported(subject: Storing) -> None:
    """Refuse a task that requests what would not be done."""
    for key, (name, default) in UNSUPPORTED.items():
        if subject.stored.get(key, default) != default:
            raise DaqmxError(
                -200452,
                f"The stand-in does not follow property {name}, which is set to"
                f" {subject.stored[key]}; reset it.",
            )
