"""The properties of reading and of its buffer."""

from typing import Any

from sautereau.sim_backend.devices.daqmx.attributes import Attribute, field, kept, table
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError
from sautereau.sim_backend.devices.daqmx.inputs import invalid
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import REFERENCES
from sautereau.sim_backend.devices.daqmx.unsupported import UNFOLLOWED


def _read_from(task: CardTask, relative: int) -> None:
    if relative not in REFERENCES:
        raise invalid("Read.RelativeTo", relative, f"one of {REFERENCES}")
    task.requested_relative = relative


def _set_offset(task: CardTask, offset: int) -> None:
    task.offset = offset


def _read_channels(task: CardTask, names: str) -> None:
    if task.named(names) != list(task.channels):
        raise DaqmxError(-200452, "The stand-in reads all channels of a task at a time.")


def _default_relative(task: CardTask) -> None:
    task.requested_relative = None


_FAULTS = (
    "OVERLOADED",
    "OVERCURRENT",
    "OPEN_CURRENT_LOOP",
    "OPEN_THRMCPL",
    "COMMON_MODE_RANGE_ERROR",
    "OPEN",
    "EXCIT_FAULT",
    "INPUT_LIMITS_FAULT",
    "POWER_SUPPLY_FAULT",
    "OVERTEMPERATURE",
)
_NO_FAULTS: dict[str, Any] = {
    **{f"{name}_CHANS_EXIST": False for name in _FAULTS},
    **{f"{name}_CHANS": "" for name in _FAULTS},
}
READ = {
    **table(
        "READ",
        {
            "RELATIVE_TO": Attribute(lambda task: task.relative, _read_from, _default_relative),
            "OFFSET": Attribute(
                lambda task: task.offset, _set_offset, lambda task: _set_offset(task, 0)
            ),
            "CHANNELS_TO_READ": Attribute(
                lambda task: ", ".join(task.channels), _read_channels, lambda task: None
            ),
            "NUM_CHANS": lambda task: len(task.channels),
            "AVAIL_SAMP_PER_CHAN": lambda task: task.available(),
            "RAW_DATA_WIDTH": lambda task: task.device.raw_bits // 8,
            "CURR_READ_POS": lambda task: task.position,
            "TOTAL_SAMP_PER_CHAN_ACQUIRED": lambda task: task.acquired(),
            **_NO_FAULTS,
        },
    ),
    **kept(
        "READ",
        {
            "READ_ALL_AVAIL_SAMP": False,
            "AUTO_START": True,
            "WAIT_MODE": 12524,
            "SLEEP_TIME": 0.001,
            "LOGGING_MODE": 10231,
            "LOGGING_FILE_PATH": "",
            "LOGGING_TDMS_GROUP_NAME": "",
            "LOGGING_TDMS_OPERATION": 15846,
            "LOGGING_PAUSE": False,
            "LOGGING_FILE_WRITE_SIZE": 4294967295,
            "LOGGING_FILE_PREALLOCATION_SIZE": 0,
            **UNFOLLOWED["READ"],
        },
    ),
}
READ[0x31E8] = Attribute(lambda task: task.remaining())  # asked for by `Task.read`
BUFFER = table(
    "BUFFER",
    {
        "INPUT_BUF_SIZE": Attribute(
            lambda task: task.buffer_size, CardTask.set_buffer, field("buffer", None).clear
        ),
        "INPUT_ONBRD_BUF_SIZE": 4095,
    },
)
