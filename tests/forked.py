"""Start commands quickly: a server imports everything once, and forks for each command.

Most of the second that a command takes is imports. Each command is a process with its own
folder, environment and streams; only its start differs from `python -m sautereau`.

python forked.py serve SOCKET       be the server; `bare` instead starts sooner, and imports little
python forked.py run SOCKET WORDS   run `sautereau WORDS`, for the shell of a page
python forked.py start SOCKET FILE WORDS    the same; the command's process id goes to FILE

WORDS may also be `-c PROGRAM`, as of Python itself.
"""

import io
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import tomllib
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

SLOW = (
    "PIL.GifImagePlugin", "PIL.JpegImagePlugin", "PIL.PpmImagePlugin", "contourpy", "filelock",
    "grpc._channel", "grpc._server", "matplotlib.backends.backend_agg", "matplotlib.figure",
    "nidaqmx._grpc_interpreter", "nidaqmx.stream_readers", "pandas", "pyarrow.dataset",
    "pyarrow.pandas_compat", "pyarrow.parquet", "pydantic.dataclasses", "pymunk",
    "scipy.integrate", "scipy.interpolate", "scipy.io.wavfile", "scipy.ndimage", "scipy.optimize",
    "scipy.signal", "scipy.stats", "serial", "tzlocal",
)  # fmt: skip
ROOT = Path(__file__).parents[1]


class CommandServer:
    """Runs commands of `sautereau`; a context manager. `path` is the server's socket."""

    def __init__(self, path: str, imports: bool = True, **environment: str):
        self.path, self._environment = path, environment
        self._what = "serve" if imports else "bare"

    def __enter__(self) -> "CommandServer":
        command = [sys.executable, __file__, self._what, self.path]
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error"}
        environment |= self._environment
        self._process = subprocess.Popen(command, env=environment)
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.terminate()
        self._process.wait()

    def start(self, *words: object, **options: Any) -> "Command":
        """Start a command, with options of `subprocess.Popen`."""
        return Command(self.path, [str(word) for word in words], **options)

    def run(
        self, *words: object, folder: Path, streams: Path | None = None, **more: object
    ) -> subprocess.CompletedProcess[str]:
        """Run a command in a folder, without a terminal; return its status and its output.

        Messages on standard error are one line each, as they were before they were wrapped.

        `streams` is the folder of the files that take its output, by default its own;
        `largest_file` limits the sizes of the files that it writes, in bytes.
        """
        out, error = (streams or folder) / ".out", (streams or folder) / ".error"
        arguments = [str(word) for word in words]
        with open(os.devnull, "rb") as nothing, out.open("wb") as o, error.open("wb") as e:  # noqa: PTH123
            entries = [nothing.fileno(), o.fileno(), e.fileno()]
            status = run(self.path, arguments, entries, folder=str(folder), **more)
        texts = out.read_text(encoding="utf-8"), unwrapped(error.read_text(encoding="utf-8"))
        out.unlink()
        error.unlink()
        return subprocess.CompletedProcess(arguments, status, *texts)


def unwrapped(text: str) -> str:
    """Return a text with its indented lines joined to the line above them."""
    return re.sub(r"\n +", " ", text)


class Command(subprocess.Popen[str]):
    """A running command, which gets the signals that are sent."""

    def __init__(self, path: str, words: list[str], **options: Any):
        read, write = os.pipe()
        start = [sys.executable, "-S", __file__, "start", path, str(write), *words]
        super().__init__(start, pass_fds=[write], text=True, **options)
        os.close(write)
        with os.fdopen(read) as file:
            self.command = int(file.read())

    def send_signal(self, sig: int) -> None:
        """Send a signal to the command."""
        if self.poll() is None:
            os.kill(self.command, sig)


def project_modules() -> list[str]:
    """Return the names of all modules of the project that need none of its extras."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    mapped = settings["setuptools"]["package-dir"]
    found = []
    for package in settings["setuptools"]["packages"]:
        top = ".".join(package.split(".")[:2])
        folder = ROOT / package.replace(top, mapped.get(top, top), 1).replace(".", "/")
        names = [path.stem for path in folder.glob("*.py") if not path.stem.startswith("__")]
        found += [package, *(f"{package}.{name}" for name in names)]
    return found


def serve(path: str, imports: bool = True) -> None:
    """Fork for every client until SIGTERM, or until the process that has started it ends."""
    import ctypes
    import gc
    import importlib

    import sautereau.commands.app  # noqa: F401 (limits the threads of BLAS before it is loaded)
    from sautereau.rig.load import load_rig

    load_rig()
    if imports:
        for name in (*SLOW, *project_modules()):
            importlib.import_module(name)
        _use()
    gc.freeze()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen()
    signal.signal(signal.SIGTERM, lambda *_: (listener.close(), sys.exit()))
    running = 0
    while True:
        client, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            for number in (signal.SIGTERM, signal.SIGHUP):  # which `nohup` ignores
                signal.signal(number, signal.SIG_DFL)
            _command(client)
        client.close()
        running += 1
        while running and os.waitpid(-1, os.WNOHANG)[0]:
            running -= 1


def _use() -> None:
    """Use what takes long the first time: fonts, registries, the records, the compiled engine."""
    from matplotlib.figure import Figure

    from sautereau.daq.file.provenance import check_recordable
    from sautereau.rig.load import load_rig
    from sautereau.sim_backend.physics.observation import observe
    from sautereau.sim_backend.scene import load_scene

    rig = load_rig()
    check_recordable(rig, "")
    observe(rig, load_scene("pluck"))
    figure = Figure(figsize=(1, 1), layout="constrained")
    figure.subplots().set_title("x")
    figure.savefig(io.BytesIO(), format="png")


def _command(client: socket.socket) -> None:
    """Run the command of a client in this process, and end."""
    from sautereau.commands.app import main

    request, streams, *_ = socket.recv_fds(client, 1 << 20, 3)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    client.sendall(struct.pack("i", os.getpid()))
    asked = json.loads(request)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    words = asked["words"]
    sys.argv = ["-c", *words[2:]] if words[:1] == ["-c"] else ["sautereau", *words]
    if "largest_file" in asked:
        import resource

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, [asked["largest_file"]] * 2)
    status = 1
    try:
        if words[:1] == ["-c"]:
            exec(words[1], {"__name__": "__main__"})
        else:
            main()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 (as Python itself ends with any exception)
        traceback.print_exc()
    sys.stdout.flush()
    client.sendall(bytes([status]))
    os._exit(status)


def run(
    path: str,
    words: list[str],
    streams: list[int],
    started: Callable[[int], object] = lambda process: None,
    **more: object,
) -> int:
    """Return the status of a command; 1 if it was killed."""
    request = {"folder": str(Path.cwd()), "environment": dict(os.environ), "words": words} | more
    with socket.socket(socket.AF_UNIX) as server:
        _connect(server, path)
        socket.send_fds(server, [json.dumps(request).encode()], streams)
        started(*struct.unpack("i", server.recv(4, socket.MSG_WAITALL)))
        status = server.recv(1)
    return status[0] if status else 1


def _connect(client: socket.socket, path: str) -> None:
    """Connect to the server as soon as it has imported everything."""
    for _ in range(6000):
        try:
            return client.connect(path)
        except (FileNotFoundError, ConnectionRefusedError):
            time.sleep(0.05)
    raise TimeoutError(f"{path}: the server of commands did not start")


def _main(what: str, path: str, *words: str) -> int:
    if what in ("serve", "bare"):
        serve(path, what == "serve")
    if what == "run":
        return run(path, list(words), [0, 1, 2])

    def started(process: int) -> None:
        with open(int(words[0]), "w", encoding="utf-8") as file:  # noqa: PTH123
            file.write(str(process))

    return run(path, list(words[1:]), [0, 1, 2], started)


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
