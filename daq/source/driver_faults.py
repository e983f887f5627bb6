"""The driver's exceptions as `DaqError`: what failed, with which value, and how to fix it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq
from sautereau.rig.disk import table_beside

NOT_YET_AVAILABLE = -200284
NOT_DONE = -200560
KNOWN = {int(code): (what, how_to_fix) for code, what, how_to_fix in table_beside(__file__)}
"""What a code of the driver means, by the names of `nidaqmx.error_codes`, and how to fix it. Names
in braces are facts of the acquisition. Other codes are reported with the driver's own text."""
INVALID = (
    ValueError, TypeError, AssertionError, LookupError, ArithmeticError, UnboundLocalError,
)  # fmt: skip
"""What nidaqmx raises about an answer that it cannot convert."""
_NAMED = ("Property:", "Requested Value:", "Possible", "Maximum Value:", "Minimum Value:")
"""Lines of the driver's text on a value that is not supported."""
_REPEATED = ("Status Code:", "Task Name:")
"""Lines that the client's library adds to the driver's text."""


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
    except INVALID as error:  # of the client library, about an answer
        raise DaqError(
            f"DAQ device {daq.device}: an answer while {doing} is invalid: {_first_line(error)};"
            f" check that a DAQmx device server of NI answers at {daq.address or 'this machine'}"
        ) from error


def _driver_fault(daq: Daq, doing: str, error: Any, options: Any) -> str:
    who, code = f"DAQ device {daq.device}: the driver ended {doing} with", error.error_code
    if code not in KNOWN:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        text = " ".join(line for line in lines if not line.startswith(_REPEATED))
        names = any(line.startswith(_NAMED) for line in lines)
        fix = "; correct the setting it names in the rig's daq section" if names else ""
        return f"{who} {code}: {text.rstrip('.')}{fix}"
    what, fix = KNOWN[code]
    facts = {
        "channels": lambda: ", ".join(map(daq.physical, daq.channels)),
        "terminals": lambda: _terminals(daq, options),
        "devices": lambda: _devices(daq, options),
        "block": lambda: str(daq.block),
        "rate": lambda: f"{daq.sample_rate:g}",
    }
    for name, fact in facts.items():
        if f"{{{name}}}" in what:
            what = what.replace(f"{{{name}}}", fact())
    return f"{who} {code}: {what}; {fix}"


def _terminals(daq: Daq, options: Any) -> str:
    from nidaqmx import errors
    from nidaqmx.system import Device

    try:
        names = [
            terminal
            for device in daq.devices
            for terminal in Device(device, grpc_options=options).ai_physical_chans.channel_names
        ]
    except errors.Error as error:
        return f"its terminals could not be read ({_first_line(error)})"
    return f"it has {', '.join(names) or 'no analog input'}"


def _devices(daq: Daq, options: Any) -> str:
    """Say which devices the driver knows, and which key names another one."""
    from nidaqmx import errors
    from nidaqmx.system import System

    try:
        system = System.remote(options) if options else System.local()
        names = list(system.devices.device_names)
    except errors.Error as error:
        return f"the driver's devices could not be read ({_first_line(error)})"
    keys = {"daq.device": daq.device}
    keys |= {f"daq.channels.{one.name}.device": one.device for one in daq.channels if one.device}
    known = {name.lower() for name in names}
    unknown = [f'{key} = "{name}"' for key, name in keys.items() if name.lower() not in known]
    return "; ".join([*unknown, f"the driver knows {', '.join(names) or 'no device'}"])


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0].rstrip(".") if lines else type(error).__name__
