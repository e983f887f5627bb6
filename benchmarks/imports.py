"""Imports: the processor time of each package."""

import statistics
import subprocess
import sys
from dataclasses import dataclass

from benchmarks.figures import Figure, check

RUNS = 7  # Fresh processes per module
PROBE = """
import sys, time
start = time.process_time()
import {module}
print(time.process_time() - start, *(name for name in {heavy!r} if name in sys.modules))
"""
HEAVY = (
    "numpy", "pydantic", "scipy", "pandas", "matplotlib", "PIL", "pyarrow", "nidaqmx", "grpc",
    "pymunk", "skfem", "numba", "plotly", "jinja2", "dask", "distributed", "websockets",
)  # fmt: skip


@dataclass(frozen=True)
class Front:
    """A module that other code imports first of its package."""

    module: str
    brings: tuple[str, ...]
    """Which of `HEAVY` it may import; the others are imported when they are used."""
    limit: float
    """Processor time, s."""


PLAIN = ("numpy", "pydantic")
FITTING = (*PLAIN, "scipy")
FRONTS = (
    Front("sautereau", (), 0.15),
    Front("sautereau.rig.load", ("pydantic",), 0.4),
    Front("sautereau.trajectory.press", PLAIN, 0.6),
    Front("sautereau.daq.file.reading", PLAIN, 0.6),
    Front("sautereau.daq.source.acquisition", PLAIN, 0.6),
    Front("sautereau.analysis.model.predict", PLAIN, 0.6),
    Front("sautereau.analysis.loading.press", FITTING, 1.2),
    Front("sautereau.analysis.press.replay", FITTING, 1.2),
    Front("sautereau.robot.drivers.galil.driver", PLAIN, 0.6),
    Front("sautereau.robot.experiment.session", FITTING, 1.2),
    Front("sautereau.entrance.bench", FITTING, 1.5),
    Front("sautereau.sim_backend.scene", ("pydantic",), 0.5),
    Front("sautereau.sim_backend.physics.observation", PLAIN, 0.8),
    Front("sautereau.sim_backend.bench", (*FITTING, "nidaqmx", "grpc", "pymunk"), 2.5),
)


def run() -> list[Figure]:
    """Return the processor time of each import, measured in fresh processes."""
    figures = []
    for front in FRONTS:
        times, brought = zip(*(imported(front.module) for _ in range(RUNS)), strict=True)
        more = set().union(*brought) - set(front.brings)
        check(not more, f"{front.module} imports {', '.join(sorted(more))}")
        what, spent = f"import {front.module}", statistics.median(times)
        figures.append(Figure(what, spent * 1e3, "ms", "limit", front.limit * 1e3))
    return figures


def imported(module: str) -> tuple[float, set[str]]:
    """Import a module in a fresh process; return the processor time [s] and its heavy imports."""
    program = PROBE.format(module=module, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    spent, *brought = done.stdout.split()
    return float(spent), set(brought)
