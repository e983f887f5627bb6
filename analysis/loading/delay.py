"""The delay of a sensor compensated, with the drop-outs of a vibrometer kept apart."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.signals.calibration import restored
from sautereau.daq.signals.quality_flags import QualityFlag
from sautereau.rig.acquisition import Channel
from sautereau.trajectory.motion import Floats


def lost_samples(
    flags: Iterable[QualityFlag], channel: Channel, rate: float, first_sample: int, count: int
) -> NDArray[np.bool_]:
    """Return which raw samples of a channel lie in a drop-out, shape (count,).

    Args:
        channel: With its delay.
        rate: Hz.
        first_sample: Index of the first sample, counted from the trigger.
        count: Number of samples.
    """
    lost = np.zeros(count, bool)
    for flag in flags:
        if flag.kind == "drop-out":
            start, stop = (
                round((instant + channel.lag) * rate) - first_sample
                for instant in (flag.start, flag.stop)
            )
            lost[start:stop] = True
    return lost


def without_delay(
    volts: Floats, lost: NDArray[np.bool_], channel: Channel, rate: float, early: int
) -> Floats:
    """Return a signal in SI units, with AC coupling inverted and delay compensated.

    Each sample contributes to many values between samples. So lost samples are replaced by a line
    for all other values, and only the values beside a lost sample contain it as it was recorded.

    Args:
        volts: Raw, shape (n,), V.
        lost: Which samples are lost, shape (n,).
        channel: With its calibration.
        rate: Hz.
        early: Further delay to compensate, in samples.
    """
    recorded = restored(volts, channel, rate, early)
    if not lost.any() or lost.all():
        return recorded
    place = np.arange(len(volts))
    bridged = np.interp(place, place[~lost], volts[~lost])
    # A value lies between two samples, or on the first of them.
    beside = lost.copy()
    beside[:-1] |= lost[1:]
    beside = beside[int(channel.lag * rate + early) :][: len(recorded)]
    return np.where(beside, recorded, restored(bridged, channel, rate, early))
