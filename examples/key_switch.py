"""A force curve of a computer key, replayed as a press, and what the phases say of it.

Others have measured thousands of key switches and rubber domes as force over travel; their peak
and the fall behind it resemble a pluck. Nothing of these collections is in this repository, since
their terms differ; get a file from one of them:

- github.com/ThereminGoat/force-curves, `*HighResolutionRaw.csv`: columns 2 (mm) and 1 (gf); the
  author asks to be named.
- github.com/BuddyOG/topre-force-curves, `DataLog_*.csv`: columns `Travel (mm)` and
  `Scale (grams)`; all rights reserved, plots and files may be passed on unchanged.
- github.com/bluepylons/Open-Switch-Curve-Meter, curves under CC BY 4.0, as spreadsheets.

They were measured within a minute. Friction and damping aside, the force depends on the travel
alone, so the stroke is replayed at the speed of a press, after a rest.

python -m examples.key_switch FILE TRAVEL_COLUMN FORCE_COLUMN
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import Phases, find_phases
from sautereau.daq.convert.formats import open_source
from sautereau.daq.convert.importing import Imported, import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.rig.load import load_rig

SPEED = 0.05
"""m/s, of the replayed stroke."""
RATE = 20_000.0
"""Hz, of the replayed stroke."""
REST, RUN_UP = 0.2, 0.005
"""s, before and after the stroke, and until it has its speed."""
STROKE = 0.95
"""1, fraction of the travel in which the force falls; then the machine turns round."""
GRAM_FORCE = 9.80665e-3
"""N."""


@dataclass(frozen=True)
class Switch:
    """A force curve and its phases."""

    peak: float
    """N, largest force before the largest fall."""
    fall: float
    """N, largest fall of the force over the stroke."""
    imported: Imported
    phases: Phases


def study(path: Path, travel: str, force: str, folder: Path) -> Switch:
    """Replay a force curve as a press, import it, and find its phases.

    Args:
        path: File with travel in mm and force in gf.
        travel: Name of the column of travel.
        force: Name of the column of force.
        folder: Gets the replayed press and its recording.
    """
    columns = open_source(path).read([travel, force])
    x, f = 1e-3 * columns[travel], GRAM_FORCE * columns[force]
    x, first = np.unique(np.maximum.accumulate(x[: int(np.argmax(x)) + 1]), return_index=True)
    f = f[first]
    falls = np.maximum.accumulate(f) - f
    bottom = int(np.argmax(np.where(x < x[0] + STROKE * (x[-1] - x[0]), falls, 0.0)))
    peak = float(f[: bottom + 1].max())
    stop = bottom + int(np.argmax(np.append(f[bottom:] > peak, True)))  # where it hits its stop
    x, f = x[:stop], f[:stop]
    time = np.arange(round((2 * REST + RUN_UP + (x[-1] - x[0]) / SPEED) * RATE)) / RATE
    # Speed up and slow down at constant acceleration, over RUN_UP each.
    cruise = (x[-1] - x[0]) / SPEED - RUN_UP
    at = REST + np.array([0, RUN_UP, RUN_UP + cruise, 2 * RUN_UP + cruise])
    speed = np.interp(time, at, [0, SPEED, SPEED, 0])
    stroke = cumulative_trapezoid(speed, time, initial=0.0)
    table = folder / f"{path.stem}-replayed.csv"
    rows = np.column_stack([1e3 * time, 1e3 * stroke, np.interp(x[0] + stroke, x, f)])
    np.savetxt(table, rows, "%.6f", ",", header="time (ms),travel (mm),force (N)", comments="")
    imported = import_file(
        table,
        table.with_suffix(".mcap"),
        rig=load_rig(),
        options=ImportOptions(
            column={"velocity": "travel (mm)", "force": "force (N)"},
            time="time (ms)",
            trigger="0 s",
            started="modified",
            simulated=False,
        ),
        notes=f"replayed from {path.name}",
    )
    return Switch(
        peak,
        float(falls[bottom]),
        imported,
        find_phases(load_press(imported.path)),
    )


def lines(found: Switch) -> list[str]:
    """Return the study as text."""
    plucks = [
        f"phases: contact {1e3 * p.contact:.1f} ms, release {1e3 * p.release:.1f} ms, release"
        f" force {p.release_force:.3f} N, force drop {p.force_drop:.3f} N"
        for p in found.phases.plucks
    ]
    return [
        f"force curve: peak {found.peak:.3f} N, then a fall of {found.fall:.3f} N",
        *(plucks or ["phases: no pluck"]),
        *(f"warning: {text}" for text in (*found.imported.warnings, *found.phases.warnings)),
    ]


if __name__ == "__main__":
    _, file, travel, force = sys.argv
    with tempfile.TemporaryDirectory() as name:
        print("\n".join(lines(study(Path(file), travel, force, Path(name)))))
