"""The session of a task on a gRPC device server, which is freed if its client was killed.

Such a server keeps the task of a client that was killed, and the device stays reserved for it (see
NI's grpc-device, "Session management"). It would refuse the next task. The name of a session is
therefore that of this machine and the device, so that the next process finds it. A lock on this
machine shows whether its client is still running: the operating system releases it with the
process.
"""

import hashlib
import os
import platform
from contextlib import ExitStack
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq


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

    if options is None:
        return Task()
    _lock(daq, stack)
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


def _lock(daq: Daq, stack: ExitStack) -> None:
    """Hold this machine's lock on a device of a server until the stack is left."""
    from filelock import FileLock, Timeout
    from platformdirs import user_cache_path

    folder = user_cache_path("sautereau", ensure_exists=True)
    key = hashlib.sha256(f"{daq.address} {daq.device}".encode()).hexdigest()[:16]
    path = folder / f"daq-{key}.lock"
    lock = FileLock(path, timeout=0, is_singleton=False)
    try:
        stack.enter_context(lock)
    except Timeout as error:
        raise DaqError(
            f"DAQ device {daq.device} of {daq.address}: another sautereau process on this machine"
            " uses it; end that one and try again"
        ) from error
    if os.name == "posix":  # elsewhere it cannot be removed while it is held
        stack.callback(path.unlink, missing_ok=True)
