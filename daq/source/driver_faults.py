"""The driver's exceptions as `DaqError`: what failed, with which value, and how to fix it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq

NO_SUCH_CHANNEL = -200170
NO_SUCH_DEVICE = (-200220, -200324, -88705, -201003)
NOT_YET_AVAILABLE = -200284
NOT_DONE = -200560
OVERRUN = (-200279, -200361, -200222)
RESERVED = -50103
_NAMED = ("Property:", "Requested Value:", "Possible", "Maximum Value:", "Minimum Value:")
"""Lines of the driver's text on a value that is not supported."""


@contextmanager
def driver_errors(daq: Daq, doing: str, options: Any = None) -> Iterator[None]:
    """Turn the driver's exceptions into `DaqError`; ``doing`` completes "while ..."."""
    from nidaqmx import errors

    try:
        yield
    except errors.DaqNotFoundError as error:
        raise DaqError(
            "the NI-DAQmx driver is not installed on this machine and daq.address is empty;"
            " install the driver, or set daq.address to the host:port of a gRPC device"
            " server, or use --sim"
        ) from error
    except errors.DaqNotSupportedError as error:
        raise DaqError(
            f"the NI-DAQmx driver does not run on this machine: {_first_line(error)}; set"
            " daq.address to the host:port of a gRPC device server, or use --sim"
        ) from error
    except errors.DaqError as error:
        raise DaqError(_driver_fault(daq, doing, error, options)) from error
    except errors.RpcError as error:
        raise DaqError(
            f"DAQ server at {daq.address}: no answer while {doing} ({_first_line(error)});"
            " check that the server runs and press again"
        ) from error
    except errors.Error as error:
        raise DaqError(
            f"DAQ device {daq.device}: {_first_line(error)}, while {doing}; update the"
            " NI-DAQmx driver"
        ) from error
    except ValueError as error:  # of the client library, about numbers in an answer
        raise DaqError(
            f"DAQ device {daq.device}: an answer while {doing} is invalid: {_first_line(error)};"
            f" check that a DAQmx device server of NI answers at {daq.address or 'this machine'}"
        ) from error


def _driver_fault(daq: Daq, doing: str, error: Any, options: Any) -> str:
    code = error.error_code
    if code == NO_SUCH_CHANNEL:
        terminals = ", ".join(f"{daq.device}/{channel.terminal}" for channel in daq.channels)
        return (
            f"DAQ device {daq.device}: one of the channels {terminals} does not exist on it"
            f" ({code}); {_terminals(daq, options)}; set daq.channels.*.terminal to the wired ones"
        )
    if code in NO_SUCH_DEVICE:
        return (
            f"DAQ device {daq.device}: there is no such device ({code});"
            f" {_devices(options)}; set daq.device to its name in NI MAX, or check that it is"
            " plugged in"
        )
    if code in OVERRUN:
        return (
            f"DAQ device {daq.device}: samples were lost ({code}) because {daq.block} samples per"
            f" read at {daq.sample_rate:g} Hz are not read fast enough; raise daq.block,"
            " lower daq.sample_rate, or free the machine, and record again"
        )
    if code == RESERVED:
        return (
            f"DAQ device {daq.device}: another task or program holds it ({code}); end that one"
            " and press again"
        )
    return (
        f"DAQ device {daq.device}: the driver refused {doing} with {code}: {_named(error)};"
        " correct the setting it names in the rig's daq section"
    )


def _terminals(daq: Daq, options: Any) -> str:
    from nidaqmx import errors
    from nidaqmx.system import Device

    try:
        names = Device(daq.device, grpc_options=options).ai_physical_chans.channel_names
    except errors.Error as error:
        return f"its terminals could not be read ({_first_line(error)})"
    return f"it has {', '.join(names) or 'no analog input'}"


def _devices(options: Any) -> str:
    from nidaqmx import errors
    from nidaqmx.system import System

    try:
        system = System.remote(options) if options else System.local()
        names = list(system.devices.device_names)
    except errors.Error as error:
        return f"the driver's devices could not be read ({_first_line(error)})"
    return f"the driver knows {', '.join(names) or 'no device'}"


def _named(error: Exception) -> str:
    """Return the first line, and those that name the property and its possible values."""
    named = [line.strip() for line in str(error).splitlines() if line.strip().startswith(_NAMED)]
    return ", ".join([_first_line(error), *named])


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0].rstrip(".") if lines else type(error).__name__
