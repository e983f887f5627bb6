"""Reach the DAQmx driver, of this machine or behind NI's gRPC server, and tell its faults."""

import ipaddress
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from daq.errors import DaqError
from rig.schema import Daq

CONNECT_DEADLINE = 2.0
"""s, wait for the gRPC server to take the connection."""
ANSWER_DEADLINE = 10.0
"""s, wait for the gRPC server to answer a call, beyond what the call itself may wait."""
MAX_MESSAGE = 64 * 2**20
"""Bytes of the largest answer; gRPC's own 4 MiB refuse a block of many channels."""

NO_SUCH_CHANNEL = -200170
NO_SUCH_DEVICE = (-200220, -200324, -88705)
NOT_YET_AVAILABLE = -200284
OVERRUN = (-200279, -200361, -200222)
RESERVED = -50103


@contextmanager
def connect(daq: Daq) -> Iterator[Any]:
    """Give what nidaqmx takes as ``grpc_options``: None for the driver of this machine.

    Raises:
        DaqError: The address is not one, is off this machine, or nothing answers there.
    """
    if not daq.address:
        yield None
        return
    _must_be_loopback(daq.address)
    import grpc
    from nidaqmx import GrpcSessionOptions

    options = [
        ("grpc.max_receive_message_length", MAX_MESSAGE),
        ("grpc.max_send_message_length", MAX_MESSAGE),
        ("grpc.enable_http_proxy", 0),
    ]
    with grpc.insecure_channel(daq.address, options) as channel:
        ready = grpc.channel_ready_future(channel)
        try:
            ready.result(timeout=CONNECT_DEADLINE)
        except grpc.FutureTimeoutError as error:
            raise DaqError(
                f"daq.address {daq.address}: no server took the connection within"
                f" {CONNECT_DEADLINE:g} s; start NI's gRPC device server there, or set"
                " daq.address to its port, or use --sim"
            ) from error
        finally:
            ready.cancel()
        limit = daq.trigger_timeout + ANSWER_DEADLINE
        bounded = grpc.intercept_channel(channel, _deadline(limit))
        yield GrpcSessionOptions(bounded, "")


@contextmanager
def told(daq: Daq, doing: str, options: Any = None) -> Iterator[None]:
    """Turn the driver's exceptions into one `DaqError`; ``doing`` ends "while ..."."""
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
            " see that the server runs and press again"
        ) from error
    except errors.Error as error:
        raise DaqError(
            f"DAQ device {daq.device}: {_first_line(error)}, while {doing}; update the"
            " NI-DAQmx driver"
        ) from error


def _must_be_loopback(address: str) -> None:
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isdecimal() and 0 < int(port) < 65536):
        raise DaqError(
            f"daq.address {address!r} is not host:port; write it as 127.0.0.1:31763, or leave"
            " it empty for the driver of this machine"
        )
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise DaqError(
            f"daq.address {address!r} is another machine: the connection would be neither"
            " encrypted nor authenticated, and TLS is not built yet; run sautereau on the"
            " machine with the DAQ device and use its loopback address, 127.0.0.1:port"
        )


def _deadline(seconds: float) -> Any:
    """Return an interceptor that bounds every call, so that a hung server is a fault."""
    import grpc

    class Deadline(grpc.UnaryUnaryClientInterceptor):
        def intercept_unary_unary(self, continuation: Any, client_call_details: Any, request: Any):
            return continuation(_Details(client_call_details, seconds), request)

    return Deadline()


class _Details:
    """A gRPC call's details with another timeout (s)."""

    def __init__(self, call: Any, timeout: float):
        self.method = call.method
        self.metadata = call.metadata
        self.credentials = call.credentials
        self.wait_for_ready = call.wait_for_ready
        self.compression = call.compression
        self.timeout = timeout


def _driver_fault(daq: Daq, doing: str, error: Any, options: Any) -> str:
    code = error.error_code
    if code == NO_SUCH_CHANNEL:
        wanted = ", ".join(f"{daq.device}/{channel.terminal}" for channel in daq.channels)
        return (
            f"DAQ device {daq.device}: one of the channels {wanted} does not exist on it"
            f" ({code}); {_terminals(daq, options)}; set daq.channels.*.terminal to those wired"
        )
    if code in NO_SUCH_DEVICE:
        return (
            f"DAQ device {daq.device}: there is no such device ({code});"
            f" {_devices(options)}; set daq.device to its name in NI MAX, or see that it is"
            " plugged in"
        )
    if code in OVERRUN:
        return (
            f"DAQ device {daq.device}: samples were lost ({code}) because {daq.block} samples a"
            f" read at {daq.sample_rate:g} Hz are not fetched fast enough; raise daq.block,"
            " lower daq.sample_rate, or free the machine, and press again"
        )
    if code == RESERVED:
        return (
            f"DAQ device {daq.device}: another task or program holds it ({code}); end that one"
            " and press again"
        )
    return (
        f"DAQ device {daq.device}: the driver refused {doing} with {code}: {_first_line(error)};"
        " mend the setting it names in the rig's daq section"
    )


def _terminals(daq: Daq, options: Any) -> str:
    from nidaqmx import errors
    from nidaqmx.system import Device

    try:
        names = Device(daq.device, grpc_options=options).ai_physical_chans.channel_names
    except errors.Error as error:
        return f"what it has could not be asked ({_first_line(error)})"
    return f"it has {', '.join(names) or 'no analog input'}"


def _devices(options: Any) -> str:
    from nidaqmx import errors
    from nidaqmx.system import System

    try:
        system = System.remote(options) if options else System.local()
        names = list(system.devices.device_names)
    except errors.Error as error:
        return f"which there are could not be asked ({_first_line(error)})"
    return f"the driver knows {', '.join(names) or 'no device'}"


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0].rstrip(".") if lines else type(error).__name__
