"""Connection to the DAQmx driver of this machine, or of a machine with NI's gRPC device server.

Such a server keeps the task of a client that was killed, and the device stays reserved for it (see
NI's grpc-device, "Session management"). It would refuse the next task. The name of a session is
therefore that of this machine and the device, so that the next process finds it. A lock on this
machine shows whether its client is still running: the operating system releases it with the
process.
"""

import ipaddress
import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq
from sautereau.rig.disk import need_open_files, read_limited, why_unreadable
from sautereau.rig.lock import held_device

if TYPE_CHECKING:
    import grpc

    from sautereau.daq.source.answers import Answers


CONNECT_DEADLINE = 2.0  # Longest wait for the first answer of the gRPC server, s
ANSWER_DEADLINE = 10.0
"""Longest wait for the gRPC server to answer a call, in addition to the call's own wait, s."""
MAX_MESSAGE = 64 * 2**20
"""Largest answer in bytes; gRPC's default of 4 MiB is too small for a block of many channels."""

_OPTIONS = [
    ("grpc.max_receive_message_length", MAX_MESSAGE),
    ("grpc.max_send_message_length", MAX_MESSAGE),
    ("grpc.enable_http_proxy", 0),
]
_HEALTH = "/grpc.health.v1.Health/Check"


@contextmanager
def connect(daq: Daq, longest_wait: float) -> Iterator[tuple[Any, "Answers | None"]]:
    """Yield the ``grpc_options`` for nidaqmx, and what counts the numbers that its server sends.

    Both are None for the driver of this machine, which writes into the memory of this process.

    Args:
        longest_wait: Longest time for which a call may wait for samples, s.

    Raises:
        DaqError: The address is invalid, or is another machine without TLS, a certificate
            cannot be read, or nothing answers at the address.
    """
    if not daq.address:
        yield None, None
        return
    _must_be_safe(daq)
    need_open_files()
    import grpc
    from nidaqmx import GrpcSessionOptions

    from sautereau.daq.source.answers import Answers

    answers = Answers(longest_wait + ANSWER_DEADLINE)
    with _channel(daq) as channel:
        _must_answer(daq, channel)
        yield GrpcSessionOptions(grpc.intercept_channel(channel, answers), ""), answers


def _must_be_safe(daq: Daq) -> None:
    """Refuse an invalid address, and another machine with neither `tls` nor `insecure`."""
    host, colon, port = daq.address.rpartition(":")
    if not (host and colon and port.isdecimal() and 0 < int(port) < 65536):
        raise DaqError(
            f"daq.address {daq.address!r} is not host:port; write it as 127.0.0.1:31763, or as an"
            ' empty text "" for the driver of this machine'
        )
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        loopback = False
    if not (loopback or daq.tls or daq.insecure):
        raise DaqError(
            f"daq.address {daq.address!r} is another machine, and the connection would be neither"
            " encrypted nor authenticated; set daq.tls.root_certificate, or, on a network that"
            " nobody else uses, daq.insecure = true"
        )


def _channel(daq: Daq) -> "grpc.Channel":
    import grpc

    if daq.tls is None:
        return grpc.insecure_channel(daq.address, _OPTIONS)
    found: list[bytes | None] = []
    faults = []
    for name in ("root_certificate", "client_certificate", "client_key"):
        path = getattr(daq.tls, name)
        try:
            found.append(read_limited(Path(path).expanduser()) if path else None)
        except (OSError, RuntimeError) as error:  # the latter for the home of an unknown user
            faults.append(
                f"daq.tls.{name} {path}: {why_unreadable(error)}; give the path of a readable PEM"
                " file"
            )
    if faults:
        raise DaqError("\n".join(faults))
    root, certificate, key = found
    credentials = grpc.ssl_channel_credentials(root, key, certificate)
    return grpc.secure_channel(daq.address, credentials, _OPTIONS)


def _must_answer(daq: Daq, channel: "grpc.Channel") -> None:
    """Check that a gRPC server answers; any answer counts, even a refusal.

    grpc's own `channel_ready_future` keeps a polling thread that makes closing slow.
    """
    import grpc

    silent = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED)
    try:
        channel.unary_unary(_HEALTH)(b"", timeout=CONNECT_DEADLINE)
    except grpc.RpcError as error:
        if error.code() not in silent:  # pyright: ignore[reportAttributeAccessIssue]
            return
        if daq.tls:
            how_to_fix = (
                "check that it runs with TLS, that daq.tls.root_certificate signed its"
                " certificate, that this names the host of daq.address, and that it accepts"
                " daq.tls.client_certificate if it requires one"
            )
        else:
            how_to_fix = (
                "start NI's gRPC device server there, or set daq.address to its port, or daq.tls"
                " if it uses TLS, or use --sim"
            )
        raise DaqError(
            f"daq.address {daq.address}: no server answered within {CONNECT_DEADLINE:g} s"
            f" ({error.details()}); {how_to_fix}"  # pyright: ignore[reportAttributeAccessIssue]
        ) from error


def create_task(daq: Daq, options: Any, stack: ExitStack) -> Any:
    """Return a new nidaqmx task; the session of a dead client of this machine is cleared first.

    Args:
        options: Options of the gRPC session; None for the driver of this machine, which frees
            the device of a killed process itself.
        stack: Releases the lock on leaving.

    Raises:
        DaqError: Another process of this machine uses the device.
    """
    import grpc
    from nidaqmx import GrpcSessionOptions, Task
    from nidaqmx.errors import RpcError
    from nidaqmx.grpc_session_options import SessionInitializationBehavior as Behavior

    stack.enter_context(hold_card(daq, "an acquisition"))
    if options is None:
        return Task()
    name = f"sautereau {platform.node()} {daq.device}"

    def task(behavior: Behavior) -> Any:
        session = GrpcSessionOptions(options.grpc_channel, name, initialization_behavior=behavior)
        return Task(name, grpc_options=session)

    try:
        return task(Behavior.INITIALIZE_SERVER_SESSION)
    except RpcError as error:
        if error.rpc_code != grpc.StatusCode.ALREADY_EXISTS:
            raise
    task(Behavior.ATTACH_TO_SERVER_SESSION).close()
    return task(Behavior.INITIALIZE_SERVER_SESSION)


@contextmanager
def hold_card(daq: Daq, purpose: str, *, shared: bool = False) -> Iterator[None]:
    """Keep other processes of this machine from the device; see `sautereau.rig.lock.locked`.

    Raises:
        DaqError: Another process or thread uses it; the message names it.
    """
    server = f" of {daq.address}" if daq.address else ""
    with ExitStack() as stack:
        for name in daq.devices:
            who, names = f"DAQ device {name}{server}", ("daq", daq.driver, daq.address, name)
            stack.enter_context(held_device(DaqError, who, purpose, *names, shared=shared))
        yield
