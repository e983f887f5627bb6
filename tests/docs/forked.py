"""`sautereau` for the shell of a page: each command in a process of its own, begun quickly.

Of the second that a command takes, most is imports. A server that has made them forks for each
command, gives the child its client's folder, environment and streams, and the client ends as the
child does.

python forked.py serve SOCKET       prints a line when it is ready
python forked.py run SOCKET WORDS   runs `sautereau WORDS`
"""

import json
import os
import signal
import socket
import sys
import traceback

SLOW = (
    "matplotlib.backends.backend_agg", "matplotlib.figure", "nidaqmx", "pandas", "pyarrow.parquet",
    "pymunk", "scipy.integrate", "scipy.interpolate", "scipy.ndimage", "scipy.optimize",
    "scipy.signal", "scipy.stats",
)  # fmt: skip


def serve(path: str) -> None:
    """Fork for every client until killed."""
    import importlib

    import sautereau.commands.app  # noqa: F401 (limits the threads of BLAS before it is loaded)

    for name in SLOW:
        importlib.import_module(name)
    from sautereau.rig.load import load_rig

    load_rig()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children are not waited for
    os.write(1, b"ready\n")
    while True:
        client, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            _command(client)
        client.close()


def _command(client: socket.socket) -> None:
    """Be the command of a client, and end."""
    from sautereau.commands.app import main

    request, streams, *_ = socket.recv_fds(client, 1 << 20, 3)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    asked = json.loads(request)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    sys.argv = ["sautereau", *asked["words"]]
    status = 1
    try:
        main()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 (as Python itself ends with any exception)
        traceback.print_exc()
    sys.stdout.flush()
    client.sendall(bytes([status]))
    os._exit(status)


def run(path: str, words: list[str]) -> int:
    """Return the status of a command; 1 where it was killed."""
    request = {"folder": os.getcwd(), "environment": dict(os.environ), "words": words}  # noqa: PTH109
    with socket.socket(socket.AF_UNIX) as server:
        server.connect(path)
        socket.send_fds(server, [json.dumps(request).encode()], [0, 1, 2])
        status = server.recv(1)
    return status[0] if status else 1


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(sys.argv[2])
    sys.exit(run(sys.argv[2], sys.argv[3:]))
