"""The largest force of a press, which is never below that of a release."""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.phases.signals import FORCE_FLOOR, SPIKE, SPREAD, Signals
from sautereau.trajectory.motion import Floats

LASTING = 3  # Samples, least width of a peak at half its force; what is narrower is a spike


def peak_force(force: Floats, signals: Signals, plucks: Sequence[HeldString]) -> float:
    """Return the largest finger force of a complete press [N], those of its releases included.

    Beside a release, the samples show what the correction of the sensor's delay makes of the fall:
    it exceeds the force by up to 13 % of the fall. There, the force is that of `HeldString`.

    Args:
        force: N, as recorded, shape (n,).
        plucks: All plucks of the press.
    """
    counted = force > _spikes(force, signals.force_noise)
    for held in plucks:
        at = signals.sample(held.release)
        counted[max(0, at - SPREAD) : max(0, at + SPREAD)] = False
    releases = [held.release_force for held in plucks]
    return max(0.0, *releases, float(force[counted].max(initial=0.0)))


def _spikes(force: Floats, noise: float) -> Floats:
    """Return the height [N] of the highest spike within `SPREAD` of each sample, shape (n,).

    It is -inf where there is none.
    """
    if not len(force):
        return force
    ends = LASTING - 1
    least = _windows(np.pad(force, ends, mode="edge"), LASTING).min(axis=1)
    lasting = _windows(least, LASTING).max(axis=1)
    high = force - lasting > np.maximum(SPIKE * max(noise, FORCE_FLOOR), force / 2)
    found = np.full(len(force), -np.inf)
    for at in np.flatnonzero(high):
        beside = found[max(0, at - SPREAD) : at + SPREAD + 1]
        np.maximum(beside, force[at], out=beside)
    return found


def _windows(values: Floats, width: int) -> Floats:
    return np.lib.stride_tricks.sliding_window_view(values, width)
