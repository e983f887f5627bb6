"""The calls that read samples, and the properties of reading and of its buffer."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from numpy.typing import NDArray

from sautereau.sim_backend.devices.daqmx.attributes import (
    Attribute,
    call,
    field,
    given,
    kept,
    table,
)
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, invalid
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import REFERENCES, UNFOLLOWED

NOT_YET_AVAILABLE = -200284
_BY_CHANNEL, _BY_SCAN = 0, 1
_WITH_TIMING, _WITH_NAMES = 1, 2


def _requested(task: CardTask, request: Any) -> int:
    """Return how many samples of each channel are read."""
    n = request.num_samps_per_chan
    n = task.remaining() if n < 0 else n
    if n * len(task.channels) > 8_000_000:  # Of all channels: what a message may hold
        raise DaqmxError(
            -50352, f"Memory for {n} samples of {len(task.channels)} channels was refused."
        )
    return n


def _fits(n: int, room: int, task: CardTask) -> None:
    if room < n * len(task.channels):
        raise DaqmxError(
            -200229,
            f"Buffer of {room} samples is too small to hold {n} of {len(task.channels)} channels.",
        )


class Reading:
    """The part of the servicer that reads."""

    _task: Callable[[Any], CardTask]
    _holding: Callable[[CardTask], AbstractContextManager[None]]

    def _read(
        self, task: CardTask, n: int, timeout: float, context: grpc.ServicerContext
    ) -> tuple[NDArray[np.float64], bool]:
        try:
            return task.read(n, timeout, context.is_active, self._holding(task))
        except DaqmxError as error:
            error.samples_read = 0
            raise

    def _samples(self, request: Any, context: Any, convert: Callable[..., Any]) -> dict[str, Any]:
        """Return the fields of an answer; ``convert`` is given a channel and its volts."""
        task = self._task(request)
        fill = given(request, "fill_mode")
        if fill not in (_BY_CHANNEL, _BY_SCAN):
            raise invalid("fill mode", fill, f"{_BY_CHANNEL}, {_BY_SCAN}")
        n = _requested(task, request)
        _fits(n, request.array_size_in_samps, task)
        volts, complete = self._read(task, n, request.timeout, context)
        channels = zip(task.channels.values(), volts, strict=True)
        converted = [convert(channel, row) for channel, row in channels]
        # As with the driver, a partial read is at the beginning of the array, without gaps between
        # the channels.
        rows = np.array(converted)
        padded = np.zeros(len(converted) * n, rows.dtype)
        padded[: rows.size] = (rows if fill == _BY_CHANNEL else rows.T).ravel()
        return {
            "status": 0 if complete else NOT_YET_AVAILABLE,
            "read_array": padded.tolist(),
            "samps_per_chan_read": volts.shape[1],
        }

    @call
    def ReadAnalogF64(self, request, context):  # noqa: N802
        return self._samples(request, context, lambda channel, volts: channel.scaled(volts))

    @call
    def ReadAnalogScalarF64(self, request, context):  # noqa: N802
        task = self._task(request)
        if len(task.channels) != 1:
            raise DaqmxError(-200428, "A scalar read needs a task of one channel.")
        volts, complete = self._read(task, 1, request.timeout, context)
        if not complete:
            raise DaqmxError(NOT_YET_AVAILABLE, "The sample has not yet been acquired.")
        (channel,) = task.channels.values()
        return {"value": channel.scaled(volts[0])[0]}

    @call
    def ReadRaw(self, request, context):  # noqa: N802
        task = self._task(request)
        size = task.device.raw_bits // 8
        n = _requested(task, request)
        _fits(n, request.array_size_in_bytes // size, task)
        volts, complete = self._read(task, n, request.timeout, context)
        rows = zip(task.channels.values(), volts, strict=True)
        counts = np.stack([channel.counts(row) for channel, row in rows])
        # Raw samples are in the order of acquisition: scan by scan.
        return {
            "status": 0 if complete else NOT_YET_AVAILABLE,
            "read_array": counts.T.astype(f"<i{size}").tobytes(),
            "samps_read": volts.shape[1],
            "num_bytes_per_samp": size,
        }

    @call
    def ReadAnalogWaveforms(self, request, context):  # noqa: N802
        task = self._task(request)
        n = _requested(task, request)
        volts, complete = self._read(task, n, request.timeout, context)
        mode = given(request, "waveform_attribute_mode")
        interval = 0.0 if task.rate is None or not mode & _WITH_TIMING else 1 / task.rate
        first = task.started + (task.position - volts.shape[1]) * interval
        response = pb.ReadAnalogWaveformsResponse(
            status=0 if complete else NOT_YET_AVAILABLE, samps_per_chan_read=volts.shape[1]
        )
        for (name, channel), row in zip(task.channels.items(), volts, strict=True):
            waveform = response.waveforms.add(dt=interval, y_data=channel.scaled(row))
            if mode & _WITH_TIMING:
                waveform.t0.seconds = int(first) + 2_082_844_800  # s, from 1904 to 1970
                waveform.t0.fractional_seconds = int(first % 1 * 2**64)
            if mode & _WITH_NAMES:
                waveform.attributes["NI_ChannelName"].string_value = name
                waveform.attributes["NI_UnitDescription"].string_value = "Volts"
        return response


def _binary(bits: int, signed: bool) -> Callable[..., Any]:
    def convert(channel: Any, volts: NDArray[np.float64]) -> NDArray[np.int64]:
        counts = channel.counts(volts)
        return counts if signed else counts % 2**bits

    def read(self: Reading, request: Any, context: Any) -> Any:
        task = self._task(request)
        if task.device.raw_bits > bits:
            raise DaqmxError(-200452, f"Its counts have {task.device.raw_bits} bits, not {bits}.")
        return self._samples(request, context, convert)

    return call(read, f"ReadBinary{'I' if signed else 'U'}{bits}")


for _bits in (16, 32):
    for _signed in (True, False):
        _name = f"ReadBinary{'I' if _signed else 'U'}{_bits}"
        setattr(Reading, _name, _binary(_bits, _signed))


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
