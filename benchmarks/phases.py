"""Contact and release in randomised presses whose truth is known, and `ruptures` beside it."""

import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.campaign import write_presses
from benchmarks.figures import Figure, check
from benchmarks.simulated import random_case, simulated_press
from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.press.features import features
from sautereau.sim_backend.truth import Truth
from sautereau.trajectory.motion import Floats

CASES = 300
FRACTIONS = (0.60, 0.76), (0.90, 0.99)
"""Limits of the fractions of errors within their intervals of 68 % and of 95 %."""
PEER_CASES, PEER_ROWS = 40, 250
"""Presses for `ruptures`, and rows of each that it is given: its time grows with their square."""
PEER_MARGIN = 8e-3
"""s, excluded after the start and before the bottom, where the force is not piecewise linear."""


@dataclass(frozen=True)
class Study:
    """Numbers of correct and wrong presses, and the errors of all instants of the correct ones."""

    cases: int
    wrong: tuple[int, ...]
    """Seeds of cases with a wrong number of plucks."""
    mute_plucked: int
    """Presses without a string in which a pluck was found."""
    contact: Floats
    """s, errors; shape (plucks,)."""
    contact_std: Floats
    """s, stated standard uncertainty."""
    release: Floats
    """s."""
    release_std: Floats
    """s."""
    seconds: Floats
    """s, processor time of each press."""


def _percentile_99(error: Floats) -> float:
    return float(np.quantile(np.abs(error), 0.99))


def covered(error: Floats, std: Floats, deviations: float) -> float:
    """Return the fraction of errors within a number of their stated uncertainties."""
    return float(np.mean(np.abs(error) <= deviations * std))


def coverage(
    name: str, error: Floats, std: Floats, fractions: tuple[tuple[float, float], ...] = FRACTIONS
) -> list[Figure]:
    """Return the fractions of errors within their 68 % and 95 %, each beside both its limits."""
    return [
        Figure(f"{name}, in its {label}", covered(error, std, deviations), "", against, limit)
        for label, deviations, limits in zip(("68 %", "95 %"), (1.0, 1.96), fractions, strict=True)
        for against, limit in zip(("at least", "limit"), limits, strict=True)
    ]


def study(seeds: range) -> Study:
    """Find the phases of random cases and compare them with the truth."""
    wrong, rows, seconds, mute = [], [], [], 0
    for seed in seeds:
        press, truth = simulated_press(*random_case(seed), seed)
        start = time.process_time()
        found = find_phases(press)
        seconds.append(time.process_time() - start)
        if len(found.plucks) != len(truth.releases):
            wrong.append(seed)
            mute += not truth.contacts
            continue
        for h, contact, release in zip(found.plucks, truth.contacts, truth.releases, strict=False):
            rows.append((h.contact - contact, h.contact_std, h.release - release, h.release_std))
    errors = np.array(rows).reshape(-1, 4).T
    return Study(len(seeds), tuple(wrong), mute, *errors, np.array(seconds))


def run() -> list[Figure]:
    """Return the errors, their coverage, the time of a press, and the same of `ruptures`."""
    found = study(range(CASES))
    figures = [
        Figure(f"wrong number of plucks, of {CASES}", len(found.wrong), "", "limit", 0.005 * CASES),
        Figure("without a string, but a pluck found", found.mute_plucked, "", "limit", 0.5),
    ]
    for name in ("contact", "release"):
        error, std = getattr(found, name), getattr(found, f"{name}_std")
        figures += [
            Figure(f"{name}, median error", np.median(np.abs(error)) * 1e3, "ms", "limit", 0.1),
            Figure(f"{name}, 99th percentile", _percentile_99(error) * 1e3, "ms", "limit", 0.5),
            *coverage(name, error, std),
        ]
    median = statistics.median(found.seconds.tolist())
    figures += [
        Figure("phases of a press", median * 1e3, "ms", "limit", 3.3),
        Figure("from file to features, one core", from_files(), "presses/s", "at least", 300),
    ]
    return [*figures, *_peer()]


def from_files(presses: int = 20) -> float:
    """Return the number of presses per second from file to features, on one core.

    From the median processor time of the presses; each has 27,000 samples of two channels, and
    its file was read once before.
    """
    with TemporaryDirectory() as folder:
        paths = write_presses(Path(folder), plectra=1, sessions=1, presses=presses)
        seconds = []
        for path in [*paths, *paths]:
            start = time.process_time()
            press = load_press(path)
            found = features(press, find_phases(press))
            seconds.append(time.process_time() - start)
            check(found["plucks"] == 1, f"{path}: {found['plucks']} plucks, not 1")
    return 1 / statistics.median(seconds[presses:])


def _peer() -> list[Figure]:
    """Return errors and times of this analysis and of `ruptures` for the same presses."""
    ours: list[tuple[float, float]] = []
    theirs: list[tuple[float, float]] = []
    seconds = [0.0, 0.0]
    for seed in range(CASES):
        rig, scene = random_case(seed)
        if scene.push is not None:  # the force shows no pluck, and `ruptures` gets the force alone
            continue
        press, truth = simulated_press(rig, scene, seed)
        if len(truth.releases) != 1:
            continue
        start = time.process_time()
        found = find_phases(press)
        then = time.process_time()
        contact, release = _by_ruptures(press, found)
        seconds = [seconds[0] + then - start, seconds[1] + time.process_time() - then]
        held = found.plucks[0]
        ours.append(_errors(truth, held.contact, held.release))
        theirs.append(_errors(truth, contact, release))
        if len(ours) == PEER_CASES:
            break
    figures = []
    for place, name in enumerate(("contact", "release")):
        mine, peer = (statistics.median(e[place] for e in errors) for errors in (ours, theirs))
        figures.append(Figure(f"{name}, median error", mine * 1e3, "ms", "ruptures", peer * 1e3))
    mine, peer = (total / len(ours) * 1e3 for total in seconds)
    return [*figures, Figure("phases of a press", mine, "ms", "ruptures", peer)]


def _by_ruptures(press: Press, found: Phases) -> tuple[float, float]:
    """Return the two changes of a piecewise line that `ruptures` finds on the way down [s].

    It is given their number and the range of the way down; its search is exact.
    """
    import ruptures

    at, force = press.time, press.samples["force"]
    inside = (at > found.start + PEER_MARGIN) & (at < found.bottom - PEER_MARGIN)
    n = max(1, int(inside.sum()) // PEER_ROWS)
    rows = int(inside.sum()) // n
    at, force = (signal[inside][: rows * n].reshape(rows, n).mean(1) for signal in (at, force))
    signal = np.column_stack([force, np.ones(rows), np.arange(rows)])
    first, second, _ = ruptures.Dynp(model="linear", jump=1, min_size=3).fit(signal).predict(2)
    return float(at[first]), float(at[second])


def _errors(truth: Truth, contact: float, release: float) -> tuple[float, float]:
    return abs(contact - truth.contacts[0]), abs(release - truth.releases[0])


if __name__ == "__main__":
    print(study(range(*map(int, sys.argv[1:3]))))
