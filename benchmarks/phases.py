"""Contact and release in randomised presses whose truth is known, and `ruptures` beside it."""

import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
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
from sautereau.sim_backend.physics.events import Truth
from sautereau.trajectory.motion import Floats

CASES = 300
FRACTIONS = (0.60, 0.76), (0.90, 0.99)
"""Limits of the fractions of errors within their intervals of 68 % and of 95 %."""
FILES = 20  # Presses read from files
PEER_CASES, PEER_ROWS = 40, 250
"""Presses for `ruptures`, and rows of each that it is given: its time grows with their square."""
PEER_MARGIN = 8e-3
"""s, excluded after the start and before the bottom, where the force is not piecewise linear."""


@dataclass(frozen=True)
class Judged:
    """One press: the truth, and what was found."""

    truth: Floats
    """s, contact and release of every pluck, shape (plucks, 2)."""
    phases: Phases
    seconds: float
    """Processor time."""

    @property
    def right(self) -> bool:
        """Whether the number of plucks is right."""
        return len(self.truth) == len(self.phases.plucks)

    @property
    def errors(self) -> Floats:
        """s, of contact and release, with their uncertainties; shape (plucks, 4)."""
        if not self.right or not len(self.truth):
            return np.zeros((0, 4))
        held = self.phases.plucks
        found = np.array([(h.contact, h.release, h.contact_std, h.release_std) for h in held])
        return found - np.pad(self.truth, ((0, 0), (0, 2)))


def judged(press: Press, truth: Iterable[tuple[float, float]]) -> Judged:
    """Find the phases of a press whose contacts and releases [s] are known."""
    start = time.process_time()
    found = find_phases(press)
    return Judged(np.reshape([*truth], (-1, 2)), found, time.process_time() - start)


def covered(error: Floats, std: Floats, deviations: float) -> float:
    """Return the fraction of errors within a number of their stated uncertainties."""
    return float(np.mean(np.abs(error) <= deviations * std))


def accuracy(
    name: str,
    presses: Sequence[Judged],
    limits: Mapping[str, tuple[float, float]],
    percentile: int,
    fractions: tuple[tuple[float, float], ...],
) -> list[Figure]:
    """Return errors, the fractions within their 68 % and 95 %, and the time of a press.

    Args:
        name: Start of each figure's name.
        limits: ms, of the median and of the percentile, for contact and release.
        percentile: Of the errors, in per cent.
    """
    errors, figures = np.concatenate([each.errors for each in presses]), []
    for place, (what, (middle, most)) in enumerate(limits.items()):
        error, std = np.abs(errors[:, place]), errors[:, 2 + place]
        for label, value, limit in (
            ("median error", np.median(error), middle),
            (f"{percentile}th percentile", np.percentile(error, percentile), most),
        ):
            figures.append(Figure(f"{name}{what}, {label}", value * 1e3, "ms", "limit", limit))
        figures += [
            Figure(f"{name}{what}, in its {label}", covered(error, std, wide), "", against, limit)
            for label, wide, ends in zip(("68 %", "95 %"), (1.0, 1.96), fractions, strict=True)
            for against, limit in zip(("at least", "limit"), ends, strict=True)
        ]
    seconds = statistics.median(each.seconds for each in presses)
    return [*figures, Figure(f"{name}phases of a press", seconds * 1e3, "ms", "limit", 3.3)]


def study(seeds: range) -> list[Judged]:
    """Find the phases of random cases."""
    cases = (simulated_press(*random_case(seed), seed) for seed in seeds)
    return [judged(press, zip(t.contacts, t.releases, strict=False)) for press, t in cases]


def run() -> list[Figure]:
    """Return the errors, their coverage, the time of a press, and the same of `ruptures`."""
    found = study(range(CASES))
    wrong = [each for each in found if not each.right]
    mute = sum(not len(each.truth) for each in wrong)
    return [
        Figure(f"wrong number of plucks, of {CASES}", len(wrong), "", "limit", 0.005 * CASES),
        Figure("without a string, but a pluck found", mute, "", "limit", 0.5),
        *accuracy("", found, dict.fromkeys(("contact", "release"), (0.1, 0.5)), 99, FRACTIONS),
        Figure("from file to features, one core", from_files(), "presses/s", "at least", 300),
        *_peer(),
    ]


def from_files() -> float:
    """Return the number of presses per second from file to features, on one core.

    From the median processor time of the presses; each has 27,000 samples of two channels, and
    its file was read once before.
    """
    with TemporaryDirectory() as folder:
        paths = write_presses(Path(folder), plectra=1, sessions=1, presses=FILES)
        seconds = []
        for path in [*paths, *paths]:
            start = time.process_time()
            press = load_press(path)
            found = features(press, find_phases(press))
            seconds.append(time.process_time() - start)
            check(found["plucks"] == 1, f"{path}: {found['plucks']} plucks, not 1")
    return 1 / statistics.median(seconds[FILES:])


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
        contact, release = by_ruptures(press, found, 2)
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


def by_ruptures(press: Press, found: Phases, changes: int) -> list[float]:
    """Return the changes of a piecewise line that `ruptures` finds on the way down [s].

    It is given their number and the range of the way down; its search is exact.
    """
    import ruptures

    at, force = press.time, press.samples["force"]
    inside = (at > found.start + PEER_MARGIN) & (at < found.bottom - PEER_MARGIN)
    n = max(1, int(inside.sum()) // PEER_ROWS)
    rows = int(inside.sum()) // n
    at, force = (signal[inside][: rows * n].reshape(rows, n).mean(1) for signal in (at, force))
    signal = np.column_stack([force, np.ones(rows), np.arange(rows)])
    ends = ruptures.Dynp(model="linear", jump=1, min_size=3).fit(signal).predict(changes)
    return at[ends[:-1]].tolist()


def _errors(truth: Truth, contact: float, release: float) -> tuple[float, float]:
    return abs(contact - truth.contacts[0]), abs(release - truth.releases[0])
