"""Run NI's own analog-input tests and examples against the stand-in's server, and count.

``python -m benchmarks.ni_tests CHECKOUT`` with a checkout of github.com/ni/nidaqmx-python. None of
its files is kept. The card behind the server is like NI-DAQmx's simulated devices: every input
shows a sine between the limits of its channel. Tests that need other devices, or outputs, are
skipped by NI's own fixtures.
"""

import argparse
import contextlib
import math
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from sautereau.sim_backend.device_types import DEVICE_TYPES
from sautereau.sim_backend.devices.daqmx.card import Module, TaskSetup
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer

TESTS = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").split()
"""Files of NI's tests, in the folder `tests`."""
PERIOD = 0.1  # s, of the sine
PLUGIN = """
import os
import grpc
import nidaqmx
import nidaqmx.system
import pytest

channel = grpc.insecure_channel("127.0.0.1:" + os.environ["STAND_IN_PORT"])
options = nidaqmx.GrpcSessionOptions(channel, "")
nidaqmx.system.System.local = staticmethod(lambda: nidaqmx.system.System.remote(options))

for name, slope in (("double_gain_scale", 2), ("no_scaling_scale", 1)):  # of NI's configuration
    nidaqmx.Scale.create_lin_scale(name, slope, grpc_options=options)

class Server:
    server_port = int(os.environ["STAND_IN_PORT"])
    def __enter__(self): return self
    def __exit__(self, *exception): pass

@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    from tests import conftest
    conftest.GrpcServerProcess = Server
    def found(kind, system, *arguments, **named):
        return system.devices["Dev1"]
    conftest._x_series_device = found
    kept = [item for item in items if "library_init_kwargs" not in item.name]
    dropped = [item for item in items if "library_init_kwargs" in item.name]
    config.hook.pytest_deselected(items=dropped)
    items[:] = kept
"""
EXAMPLE = """
import _thread, builtins, functools, pathlib, re, sys, threading
import grpc, nidaqmx
path, port = sys.argv[1:]
options = nidaqmx.GrpcSessionOptions(grpc.insecure_channel("127.0.0.1:" + port), "")
nidaqmx.Task = functools.partial(nidaqmx.Task, grpc_options=options)
nidaqmx.system.System.local = staticmethod(lambda: nidaqmx.system.System.remote(options))
builtins.input = lambda *prompt: threading.Event().wait(3) or ""
timer = threading.Timer(5, _thread.interrupt_main)
timer.daemon = True
timer.start()
source = pathlib.Path(path).read_text(encoding="utf-8-sig")
source = re.sub(r"\\b(cDAQ\\d+Mod\\d+|PXI\\d+Slot\\d+|TS\\d+Mod\\d+)\\b", "Dev1", source)
exec(compile(source, path, "exec"), {"__name__": "__main__"})
timer.cancel()
"""
NO_SUCH_CHANNELS = re.compile(
    r"IndexError: (list index|Cannot choose)|Sample larger than population|empty range for rand"
)
"""Of tests that take any output, line or counter of the device."""
REFUSED = re.compile(r"not supported by the NI gRPC Device Server|The stand-in has no")


class SineRun:
    """An acquisition in real time."""

    def __init__(self, setup: TaskSetup):
        self._setup, self._start = setup, time.monotonic()
        self._stopped = threading.Event()

    @property
    def acquired(self) -> int:
        """Samples of each channel."""
        elapsed = time.monotonic() - self._start
        return min(self._setup.n_samples, int(elapsed * self._setup.rate))

    def wait_for(self, n: int, timeout: float) -> int:
        """Return the samples there are, after waiting for ``n`` or ``timeout`` [s]."""
        missing = (min(n, self._setup.n_samples) - self.acquired) / self._setup.rate
        if missing > 0:
            self._stopped.wait(min(missing + 1e-3, timeout))
        return self.acquired

    def read(self, first: int, n: int) -> np.ndarray:
        """Return samples [V], shape (n_channels, n)."""
        times = np.arange(first, first + n) / self._setup.rate
        sine = np.sin(2 * math.pi * times / PERIOD)
        limits = self._setup.limits or ((-1.0, 1.0),) * len(self._setup.terminals)
        return np.stack([(low + high) / 2 + 0.49 * (high - low) * sine for low, high in limits])

    def stop(self) -> None:
        """End it."""
        self._stopped.set()


class SineCard:
    """A simulated device."""

    paced = True

    def __init__(self, product: str):
        device = DEVICE_TYPES[product]
        inputs = tuple(f"ai{n}" for n in range(device.inputs or 2))
        self.modules = (Module("Dev1", device, inputs),)

    def check(self) -> None:
        """It stays connected."""

    def start(self, setup: TaskSetup) -> SineRun:
        """Start at once, also where a trigger is set, as a simulated device."""
        return SineRun(setup)


def run_tests(checkout: Path, port: str, options: list[str]) -> Counter:
    """Run NI's tests; return how many of each outcome."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "stand_in_plugin.py").write_text(PLUGIN, encoding="utf-8")
        report = Path(folder, "report.xml")
        command = [sys.executable, "-m", "pytest", "-q", "-p", "stand_in_plugin", "-rfE"]
        command += ["--continue-on-collection-errors"]
        command += [f"--junitxml={report}", "-p", "no:cacheprovider", "--override-ini=addopts="]
        files = [
            str(Path("tests", name)) for name in TESTS if Path(checkout, "tests", name).exists()
        ]
        environment = {**os.environ, "STAND_IN_PORT": port, "PYTHONPATH": f"{folder}:{checkout}"}
        subprocess.run([*command, *options, *files], cwd=checkout, env=environment, check=False)
        return outcomes(report)


def outcomes(report: Path) -> Counter:
    """Count the outcomes of a JUnit report."""
    found: Counter = Counter()
    for case in ElementTree.parse(report).iter("testcase"):
        children = {child.tag: child for child in case}
        if "skipped" in children:
            found["skipped"] += 1
        elif failed := [children[tag] for tag in ("failure", "error") if tag in children]:
            text = f"{failed[0].get('message')} {failed[0].text}"
            if NO_SUCH_CHANNELS.search(text):
                found["skipped"] += 1
            else:
                found["refused" if REFUSED.search(text) else "fail"] += 1
        else:
            found["pass"] += 1
    return found


def run_examples(checkout: Path, port: str) -> Counter:
    """Run NI's analog-input examples, those that run until they are stopped for a few seconds."""
    found: Counter = Counter()
    # Relative names of logs are those of the server's folder.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for path in sorted(Path(checkout, "examples", "analog_in").glob("*.py")):
            done = subprocess.run(
                [sys.executable, "-c", EXAMPLE, str(path), port],
                cwd=folder,
                env={**os.environ, "MPLBACKEND": "Agg"},
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            missing = REFUSED.search(done.stderr)
            outcome = "refused" if missing else "fail" if done.returncode else "pass"
            found[outcome] += 1
            if outcome != "pass":
                print(path.name, outcome, done.stderr.strip().splitlines()[-1:], sep="\t")
    return found


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=lambda name: Path(name).resolve())
    parser.add_argument("--card", default="PCIe-6363", choices=sorted(DEVICE_TYPES))
    parser.add_argument("options", nargs="*", help="further options of pytest")
    given = parser.parse_args()
    with DaqmxServer(SineCard(given.card)) as server:
        port = server.address.rpartition(":")[2]
        tests = run_tests(given.checkout, port, given.options)
        examples = run_examples(given.checkout, port)
    for name, found in (("tests", tests), ("examples", examples)):
        print(name, *(f"{outcome} {n}" for outcome, n in sorted(found.items())), sep="\t")


if __name__ == "__main__":
    main()
