"""Serve a simulated card as NI's gRPC device server would, on loopback.

The servicer derives from the one that ships in nidaqmx, so that the real client runs
unmodified. Calls that are not implemented answer UNIMPLEMENTED by the base class. A failing call
answers as the real server: a status, with the driver's code in the trailing metadata ``ni-error``.
"""

from concurrent.futures import ThreadPoolExecutor

import grpc
from nidaqmx._stubs import nidaqmx_pb2_grpc

from sautereau.sim_backend.devices.daqmx.calls import Servicer
from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError, Run, TaskSetup

__all__ = ["Card", "DaqmxError", "DaqmxServer", "Run", "TaskSetup", "serve"]

_OPTIONS = (("grpc.so_reuseport", 0), ("grpc.max_send_message_length", -1))
_WORKERS = 8


class DaqmxServer:
    """A server for one card; a context manager that serves while it is entered."""

    def __init__(self, card: Card):
        self._servicer = Servicer(card)  # pyright: ignore[reportAbstractUsage]
        self._server: grpc.Server | None = None
        self._workers: ThreadPoolExecutor | None = None
        self._address = ""

    @property
    def address(self) -> str:
        """``127.0.0.1:port``, the port chosen by the operating system; empty when not served."""
        return self._address

    def __enter__(self) -> "DaqmxServer":
        self._workers = ThreadPoolExecutor(_WORKERS, thread_name_prefix="daqmx stand-in")
        self._server = grpc.server(self._workers, options=_OPTIONS)
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(self._servicer, self._server)
        port = self._server.add_insecure_port("127.0.0.1:0")
        self._server.start()
        self._address = f"127.0.0.1:{port}"
        return self

    def __exit__(self, *_: object) -> None:
        self._address = ""
        self._servicer.stop_all()
        if self._server is not None:
            self._server.stop(grace=0).wait()
        if self._workers is not None:
            self._workers.shutdown(wait=True)


def serve(card: Card) -> DaqmxServer:
    """Return the server of a card: ``with serve(card) as server: ... server.address``."""
    return DaqmxServer(card)
