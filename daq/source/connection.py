"""Reach the DAQmx driver: of this machine, or behind NI's gRPC device server, here or elsewhere."""

import ipaddress
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq, Tls

if TYPE_CHECKING:
    import grpc

CONNECT_DEADLINE = 2.0
"""s, wait for the gRPC server to give its first answer."""
ANSWER_DEADLINE = 10.0
"""s, wait for the gRPC server to answer a call, beyond what the call itself may wait."""
MAX_MESSAGE = 64 * 2**20
"""Bytes of the largest answer; gRPC's own 4 MiB refuse a block of many channels."""

_OPTIONS = [
    ("grpc.max_receive_message_length", MAX_MESSAGE),
    ("grpc.max_send_message_length", MAX_MESSAGE),
    ("grpc.enable_http_proxy", 0),
]
_HEALTH = "/grpc.health.v1.Health/Check"


@contextmanager
def connect(daq: Daq, longest_wait: float) -> Iterator[Any]:
    """Give what nidaqmx takes as ``grpc_options``: None for the driver of this machine.

    Args:
        daq: Whose address and certificates are taken.
        longest_wait: s, for which a call may wait for samples.

    Raises:
        DaqError: The address is not one, or is off this machine without TLS, a certificate
            cannot be read, or nothing answers there.
    """
    if not daq.address:
        yield None
        return
    _must_be_safe(daq)
    import grpc
    from nidaqmx import GrpcSessionOptions

    with _channel(daq) as channel:
        _must_answer(daq, channel)
        limit = longest_wait + ANSWER_DEADLINE
        bounded = grpc.intercept_channel(channel, _deadline(limit))
        yield GrpcSessionOptions(bounded, "")


def _must_be_safe(daq: Daq) -> None:
    """Refuse an address that is none, and one off this machine without a word on its safety."""
    host, colon, port = daq.address.rpartition(":")
    if not (host and colon and port.isdecimal() and 0 < int(port) < 65536):
        raise DaqError(
            f"daq.address {daq.address!r} is not host:port; write it as 127.0.0.1:31763, or leave"
            " it empty for the driver of this machine"
        )
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        loopback = False
    if not (loopback or daq.tls or daq.insecure):
        raise DaqError(
            f"daq.address {daq.address!r} is another machine, and the connection would be neither"
            " encrypted nor authenticated; give daq.tls its root_certificate, or, on a network"
            " that nobody else is on, set daq.insecure = true"
        )


def _channel(daq: Daq) -> "grpc.Channel":
    import grpc

    if daq.tls is None:
        return grpc.insecure_channel(daq.address, _OPTIONS)
    root, certificate, key = _certificates(daq.tls)
    credentials = grpc.ssl_channel_credentials(root, key, certificate)
    return grpc.secure_channel(daq.address, credentials, _OPTIONS)


def _certificates(tls: Tls) -> list[bytes | None]:
    """Return root certificate, client's certificate and its key; what is not given is None."""
    found: list[bytes | None] = []
    faults = []
    for name in ("root_certificate", "client_certificate", "client_key"):
        path = getattr(tls, name)
        try:
            found.append(Path(path).expanduser().read_bytes() if path else None)
        except OSError as error:
            faults.append(
                f"daq.tls.{name} {path}: {error.strerror}; give the path of a PEM file that you"
                " may read"
            )
    if faults:
        raise DaqError("\n".join(faults))
    return found


def _must_answer(daq: Daq, channel: "grpc.Channel") -> None:
    """Ask whether a gRPC server is there; whatever it answers, even a refusal, says so.

    grpc's own future of readiness keeps a polling thread that makes closing slow.
    """
    import grpc

    silent = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED)
    try:
        channel.unary_unary(_HEALTH)(b"", timeout=CONNECT_DEADLINE)
    except grpc.RpcError as error:
        if error.code() not in silent:  # pyright: ignore[reportAttributeAccessIssue]
            return
        if daq.tls:
            remedy = (
                "see that it runs and speaks TLS, that daq.tls.root_certificate signed its"
                " certificate, that this names the host of daq.address, and that it knows"
                " daq.tls.client_certificate if it asks for one"
            )
        else:
            remedy = (
                "start NI's gRPC device server there, or set daq.address to its port, or daq.tls"
                " if it speaks TLS, or use --sim"
            )
        raise DaqError(
            f"daq.address {daq.address}: no server answered within {CONNECT_DEADLINE:g} s"
            f" ({error.details()}); {remedy}"  # pyright: ignore[reportAttributeAccessIssue]
        ) from error


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
