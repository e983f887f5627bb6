"""The session of a task on a gRPC device server, which is freed if its client was killed.

Such a server keeps the task of a client that was killed, and the device stays reserved for it (see
NI's grpc-device, "Session management"). It would refuse the next task. The name of a session is
therefore that of this machine and the device, so that the next process finds it. A lock on this
machine shows whether its client is still running: the operating system releases it with the
process.
"""

import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq
from sautereau.rig.lock import Taken, device_lock, locked


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
    device = f"DAQ device {daq.device}{f' of {daq.address}' if daq.address else ''}"
    with ExitStack() as stack:
        try:
            path = device_lock("daq", daq.driver, daq.address, daq.device)
            stack.enter_context(locked(path, purpose, shared=shared))
        except Taken as error:
            raise DaqError(
                f"{device}: another sautereau process on this machine uses it: {error}; wait until"
                " that one has ended, or end it, and try again"
            ) from error
        except OSError as error:
            raise DaqError(
                f"{device}: {error.filename}: {error.strerror}; give this user a folder for its"
                " cache (XDG_CACHE_HOME) that can be written"
            ) from error
        yield
