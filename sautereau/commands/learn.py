"""Correct the trajectory from the measured speed of the jack, press after press."""

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from sautereau.analysis.results.result import part_of
from sautereau.commands import common
from sautereau.commands.output import FileOutput

if TYPE_CHECKING:
    from sautereau.entrance.devices import Connected


def learn(
    rig: common.RigName = "paper",
    *,
    n: common.Number = 6,
    feed_forward: common.FeedForward = None,
    out: common.OutFolder,
    notes: common.Notes = "",
    simulation: common.Simulation = common.Simulation(),
    output: FileOutput = FileOutput(),
) -> int:
    """Press up to n times, correcting the trajectory from the measured speed of the jack.

    To continue after an interruption, run the same command again.

    Parameters
    ----------
    n
        Maximum number of presses; learning stops when the speed error no longer improves.
    out
        Folder for the recordings and for learned.json, the correction for `press --learned`.
    """
    from sautereau.entrance.learning import LEARNED, Learning

    def begin(bench: "Connected") -> None:
        output.say(f"rig {bench.rig.name} on {bench.where}\n{'press':<18} RMS speed error")

    def pressed(path: Path, error: float) -> None:
        output.say(f"{path.name:<18} {100 * error:>8.2f} %")
        show(next(presses) / n)

    with output.replacing(out / LEARNED), output.progress("learning") as show:
        presses = count(1)
        learning = Learning(common.bench(rig, simulation), n, out, notes, feed_forward)
        output.warn(*learning.warnings)
        found = learning.run(begin, pressed)
    lines = [f"learning stopped: {found.stopped}"] if found.stopped else []
    lines.append(
        f"learned:    {found.path}; use it with press --learned"
        if found.path
        else "no correction reduced the speed error"
    )
    result = {
        "rms_speed_error": found.errors,
        "learned": found.path,
        "recordings": [press.path for press in found.session],
        **part_of(found, "stopped", "simulated", "seed", "warnings"),
    }
    lines += [f"recording:  {press.path}" for press in found.session]
    return output.answer(result, lines)
