"""Contact and release in presses of the independent simulator, by condition."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.figures import Figure
from benchmarks.independent import ONE_FACTOR, Conditions, press, random_conditions
from benchmarks.phases import Judged, accuracy, by_ruptures, covered, judged
from benchmarks.simulated import judged_press
from sautereau.analysis.campaign.workers import run_over
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.errors import RigError
from sautereau.trajectory.motion import Floats

RANDOM, EACH = 1000, 6  # Random presses, and presses of each condition of `ONE_FACTOR`
PEER = 100  # Random presses that `ruptures` gets as well
FAST = 0.12  # m/s, speed of the jack that divides random presses into slow and fast ones
FAR = 5e-3  # s, error from which on a press without a warning counts as silent
FRACTIONS = (0.55, 0.85), (0.88, 1.0)
"""Limits of the fractions of errors within their intervals of 68 % and of 95 %."""
LIMITS = {"contact": (0.1, 1.0), "release": (0.05, 0.5)}
"""ms, limits of the errors' median and 95th percentile."""
STEEP = 0.8e-3, 4.0
"""s, of the smoothed derivative of the force in the plain threshold beside; and the threshold in
standard deviations of its calm part."""


@dataclass(frozen=True)
class Pressed(Judged):
    """One press: the truth, what was found, and what two other methods find."""

    speed: float
    """m/s, planned speed of the jack."""
    threshold: int
    """Number of releases by the threshold."""
    peer: Floats
    """s, errors of contacts and releases of `ruptures`, shape (plucks, 2); or (0, 2)."""


def judge(conditions: Conditions, seed: int, with_peer: bool = False) -> Pressed:
    """Return what the analysis finds in a press, beside the truth.

    Raises:
        ValueError: The conditions cannot be simulated.
        ArithmeticError: The integration diverged.
    """
    pressed = press(conditions, seed)
    recorded = judged_press(pressed)
    found = judged(recorded, [(pluck.contact, pluck.release) for pluck in pressed.truth.plucks])
    return Pressed(
        **vars(found),
        speed=conditions.speed,
        threshold=_by_threshold(recorded, found.phases),
        peer=_of_ruptures(recorded, found) if with_peer else np.zeros((0, 2)),
    )


def random_press(seed: int, with_peer: bool = False) -> Pressed:
    """Return a random press; conditions that cannot be simulated or planned are drawn again."""
    random = np.random.default_rng([15, seed])
    while True:
        try:
            return judge(random_conditions(random), seed, with_peer)
        except (ValueError, ArithmeticError, RigError):
            continue


def _random_with_peer(seed: int) -> Pressed:
    return random_press(seed, seed < PEER)


def _each_condition(name: str) -> list[Pressed]:
    return [judge(ONE_FACTOR[name], seed, with_peer=True) for seed in range(EACH)]


def _by_threshold(recorded: Press, found: Phases) -> int:
    """Return the number of releases by a threshold on the smoothed derivative of the force."""
    at, force = recorded.time, recorded.samples["force"]
    inside = (at > found.start) & (at < found.bottom)
    width = max(1, round(STEEP[0] * recorded.rate))
    if np.count_nonzero(inside) < 4 * width:
        return 0
    smooth = np.convolve(force[inside], np.full(width, 1 / width), "valid")
    slope = smooth[width:] - smooth[:-width]
    calm = 1.4826 * float(np.median(np.abs(slope - np.median(slope))))
    steep = slope < -STEEP[1] * calm
    return int(np.count_nonzero(steep[1:] & ~steep[:-1]))


def _of_ruptures(recorded: Press, found: Judged) -> Floats:
    """Return the errors [s] of the changes that `ruptures` finds, given their number and order."""
    truth = found.truth.ravel()
    errors = np.zeros(len(truth))
    if len(truth):
        order = np.argsort(truth)
        errors[order] = by_ruptures(recorded, found.phases, len(truth)) - truth[order]
    return errors.reshape(-1, 2)


def run() -> list[Figure]:
    """Return the figures of all random presses together, of parts of them, of each condition."""
    cores = os.cpu_count() or 1
    every = [found for _, found in run_over(_random_with_peer, range(RANDOM), cores)]
    figures = [*_figures("random", every), *_against_peer("random", every)]
    parts: dict[str, Callable[[Pressed], bool]] = {
        "random, one string": lambda each: len(each.truth) == 1,
        "random, two strings": lambda each: len(each.truth) == 2,
        f"random, below {FAST} m/s": lambda each: each.speed < FAST,
        f"random, above {FAST} m/s": lambda each: each.speed >= FAST,
    }
    for name, belongs in parts.items():
        figures += _part(name, [each for each in every if belongs(each)], every)
    conditions = list(ONE_FACTOR)
    found = dict(run_over(_each_condition, conditions, cores))
    for place, name in enumerate(conditions):
        figures += [*_row(name, found[place]), *_against_peer(name, found[place])]
    return figures


def _figures(name: str, presses: list[Pressed]) -> list[Figure]:
    wrong = [each for each in presses if not each.right]
    silent = [each for each in wrong if not each.phases.warnings]
    far = [
        each
        for each in presses
        if not each.phases.warnings and np.abs(each.errors[:, :2]).max(initial=0.0) > FAR
    ]
    return [
        Figure(f"{name}: number of plucks right", _share(presses), "", "at least", 0.98),
        _against_threshold(name, presses),
        Figure(f"{name}: wrong without a warning", len(silent), "", "limit", 0.5),
        Figure(f"{name}: off by 5 ms without a warning", len(far), "", "limit", 0.5),
        *accuracy(f"{name}: ", presses, LIMITS, 95, FRACTIONS),
    ]


def _share(presses: list[Pressed]) -> float:
    return float(np.mean([each.right for each in presses]))


def _against_threshold(name: str, presses: list[Pressed]) -> Figure:
    by_threshold = np.mean([len(each.truth) == each.threshold for each in presses])
    what = f"{name}: number of plucks right"
    return Figure(what, _share(presses), "", "threshold", float(by_threshold))


def _against_peer(name: str, presses: list[Pressed]) -> list[Figure]:
    """Return the median errors beside those of `ruptures`, of the presses that it got as well."""
    both = [each for each in presses if each.right and len(each.peer)]
    if not both:
        return []
    ours, theirs = (
        np.median(np.abs(np.concatenate(errors))[:, :2], axis=0) * 1e3
        for errors in ([each.errors for each in both], [each.peer for each in both])
    )
    return [
        Figure(f"{name}: {what}, median error", float(mine), "ms", "ruptures", float(peer))
        for what, mine, peer in zip(LIMITS, ours, theirs, strict=True)
    ]


def _part(name: str, presses: list[Pressed], all_presses: list[Pressed]) -> list[Figure]:
    """Return the errors in a part of the random presses, beside those in all of them."""
    part, whole = (np.concatenate([each.errors for each in of]) for of in (presses, all_presses))
    share = _share(presses), _share(all_presses)
    figures = [Figure(f"{name}: number of plucks right", share[0], "", "all", share[1])]
    for place, what in enumerate(LIMITS):
        here, there = (1e3 * float(np.median(np.abs(of[:, place]))) for of in (part, whole))
        figures.append(Figure(f"{name}: {what}, median error", here, "ms", "all", there))
        here, there = (covered(of[:, place], of[:, 2 + place], 1.96) for of in (part, whole))
        figures.append(Figure(f"{name}: {what}, in its 95 %", here, "", "all", there))
    return figures


def _row(name: str, presses: list[Pressed]) -> list[Figure]:
    errors = np.abs(np.concatenate([each.errors for each in presses]))
    figures = [
        Figure(f"{name}: number of plucks right", _share(presses), "", "at least", 1.0),
        _against_threshold(name, presses),
    ]
    if len(errors):
        contact, release = np.median(errors[:, :2], axis=0) * 1e3
        figures += [
            Figure(f"{name}: contact, median error", float(contact), "ms", "limit", 0.1),
            Figure(f"{name}: release, median error", float(release), "ms", "limit", 0.05),
        ]
    return figures


if __name__ == "__main__":
    for figure in _figures("random", [random_press(s) for s in range(*map(int, sys.argv[1:3]))]):
        print(figure)
