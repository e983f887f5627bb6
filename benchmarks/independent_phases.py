"""Contact and release in presses of the independent simulator, by condition."""

import sys
from dataclasses import dataclass

import numpy as np

from benchmarks.figures import Figure
from benchmarks.independent import ONE_FACTOR, Conditions, press, random_conditions
from benchmarks.judged import judged_press
from benchmarks.phases import Judged, accuracy, judged
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.errors import RigError

RANDOM, EACH = 200, 6
"""Random presses, and presses of each condition of `ONE_FACTOR`."""
FAR = 5e-3
"""s, error from which on a press without a warning counts as silent."""
FRACTIONS = (0.55, 0.85), (0.88, 1.0)
"""Limits of the fractions of errors within their intervals of 68 % and of 95 %."""
LIMITS = {"contact": (0.1, 1.0), "release": (0.05, 0.5)}
"""ms, limits of the errors' median and 95th percentile."""
STEEP = 0.8e-3, 4.0
"""s, of the smoothed derivative of the force in the plain threshold beside; and the threshold in
standard deviations of its calm part."""


@dataclass(frozen=True)
class Pressed(Judged):
    """One press: the truth, what was found, and what a plain threshold finds."""

    threshold: int
    """Number of releases by the threshold."""


def judge(conditions: Conditions, seed: int) -> Pressed:
    """Return what the analysis finds in a press, beside the truth.

    Raises:
        ValueError: The conditions cannot be simulated.
        ArithmeticError: The integration diverged.
    """
    pressed = press(conditions, seed)
    recorded = judged_press(pressed)
    found = judged(recorded, [(pluck.contact, pluck.release) for pluck in pressed.truth.plucks])
    return Pressed(**vars(found), threshold=_by_threshold(recorded, found.phases))


def random_presses(seeds: range) -> list[Pressed]:
    """Return random presses; conditions that cannot be simulated or planned are drawn again."""
    found = []
    for seed in seeds:
        random = np.random.default_rng([15, seed])
        while True:
            try:
                found.append(judge(random_conditions(random), seed))
            except (ValueError, ArithmeticError, RigError):
                continue
            break
    return found


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


def run() -> list[Figure]:
    """Return the figures of all conditions together, and of each."""
    every = random_presses(range(RANDOM))
    figures = _figures("random", every)
    for name, conditions in ONE_FACTOR.items():
        figures += _row(name, [judge(conditions, seed) for seed in range(EACH)])
    return figures


def _figures(name: str, presses: list[Pressed]) -> list[Figure]:
    wrong = [each for each in presses if not each.right]
    silent = [each for each in wrong if not each.phases.warnings]
    far = [
        each
        for each in presses
        if not each.phases.warnings and np.abs(each.errors[:, :2]).max(initial=0.0) > FAR
    ]
    share = 1 - len(wrong) / len(presses)
    by_threshold = np.mean([len(each.truth) == each.threshold for each in presses])
    return [
        Figure(f"{name}: number of plucks right", share, "", "at least", 0.98),
        Figure(f"{name}: number of plucks right", share, "", "threshold", float(by_threshold)),
        Figure(f"{name}: wrong without a warning", len(silent), "", "limit", 0.5),
        Figure(f"{name}: off by 5 ms without a warning", len(far), "", "limit", 0.5),
        *accuracy(f"{name}: ", presses, LIMITS, 95, FRACTIONS),
    ]


def _row(name: str, presses: list[Pressed]) -> list[Figure]:
    errors = np.abs(np.concatenate([each.errors for each in presses]))
    right = sum(each.right for each in presses) / len(presses)
    figures = [Figure(f"{name}: number of plucks right", right, "", "at least", 1.0)]
    if len(errors):
        contact, release = np.median(errors[:, :2], axis=0) * 1e3
        figures += [
            Figure(f"{name}: contact, median error", float(contact), "ms", "limit", 0.1),
            Figure(f"{name}: release, median error", float(release), "ms", "limit", 0.05),
        ]
    return figures


if __name__ == "__main__":
    for figure in _figures("random", random_presses(range(*map(int, sys.argv[1:3])))):
        print(figure)
