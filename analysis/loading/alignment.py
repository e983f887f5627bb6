"""Find the start of a motion in the samples of an acquisition that no edge has started.

The encoders, on the controller's clock, and the vibrometer, on the acquisition's, show the same
motion: the finger takes the key along from its first contact until it returns. The planned motion
gives the rise r of the jack at each reading of the encoders, and the vibrometer gives R(t). The
start s minimises the sum of squares of

    r_k - (a R(t_k + s) + b + c t_k)

over the readings. The factor a absorbs errors of calibration and geometry, b a gap between finger
and key, and c the drift of the integrated speed. Force and speed are samples of one clock, so
that this aligns the force as well.
"""

from collections.abc import Callable
from math import ceil
from typing import Any

import numpy as np
from scipy.optimize import fminbound

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import columns_of
from sautereau.daq.file.recorded import Plan
from sautereau.daq.signals.calibration import correct, undelayed
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

STEP = 1e-3
"""s, between the starts tried first."""
BLOCKS = 10
"""Parts of the motion that are omitted in turn to estimate the uncertainty."""
MOST_UNEXPLAINED = 0.1
"""Dimensionless, RMS residual relative to the RMS of the rise, above which the two do not show the
same motion."""


def find_start(
    rig: Rig,
    velocity: Floats,
    first: float,
    rate: float,
    plan: Plan,
    times: Floats,
    joints: Floats,
    latest: float,
) -> tuple[float, float]:
    """Return the start of a motion on the acquisition's clock, and its standard uncertainty.

    The uncertainty is the jackknife's over blocks of readings, which contains the jitter of the
    readings' times and the resolution of the encoders.

    Args:
        rig: The bench.
        velocity: V, of the velocity channel; shape (n,).
        first: s, time of the first sample.
        rate: Hz.
        plan: The motion, on the controller's clock.
        times: s, of the encoders' readings on that clock; shape (k,).
        joints: rad, the readings; shape (k, 2).
        latest: s, largest magnitude of the start.

    Returns:
        Both in s.

    Raises:
        AnalysisError: The rig has no velocity channel, or the samples do not show the motion.
    """
    channel = rig.daq.channel("velocity")
    if channel is None:
        raise AnalysisError("alignment: the rig has no velocity channel")
    lag = channel.lag * rate
    early = ceil(max(0.0, -lag))
    speed = undelayed(correct(velocity, channel, rate), lag + early)
    rise = columns_of(rig.key, speed, np.zeros_like(speed), rate)[4]
    clock = first + early / rate + np.arange(len(rise)) / rate
    wanted = _rise_of_joints(plan, joints)
    kept = (times - latest >= clock[0]) & (times + latest <= clock[-1])

    def misfit(readings: np.ndarray) -> Callable[[float], float]:
        t, r = times[readings], wanted[readings]

        def of(start: float) -> float:
            basis = np.stack([np.interp(t + start, clock, rise), np.ones_like(t), t], -1)
            found, *_ = np.linalg.lstsq(basis, r, rcond=None)
            return float(np.mean((r - basis @ found) ** 2))

        return of

    readings = np.flatnonzero(kept)
    starts = np.arange(-latest, latest + STEP, STEP)
    if len(readings) < 4 * BLOCKS or np.ptp(wanted) == 0:
        raise AnalysisError(f"alignment: {len(readings)} readings of the encoders are too few")
    whole = misfit(readings)
    near = float(starts[np.argmin([whole(start) for start in starts])])

    def best(of: Callable[[float], float]) -> float:
        found: Any = fminbound(of, near - 2 * STEP, near + 2 * STEP, xtol=1e-7)
        return float(found)

    start = best(whole)
    unexplained = np.sqrt(whole(start)) / np.std(wanted[readings])
    if not unexplained <= MOST_UNEXPLAINED:
        raise AnalysisError(
            "alignment: encoders and vibrometer do not show the same motion (residual"
            f" {unexplained:.0%} of it)"
        )
    without = [
        best(misfit(np.setdiff1d(readings, block))) for block in np.array_split(readings, BLOCKS)
    ]
    std = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((np.array(without) - np.mean(without)) ** 2))
    return start, max(float(std), 0.5 / rate)


def _rise_of_joints(plan: Plan, joints: Floats) -> Floats:
    """Return the jack's rise [m] at joint angles (rad, (k, 2)), by the joint that turns further."""
    paths = plan.q1, plan.q2
    joint = int(np.argmax([np.ptp(path) for path in paths]))
    path = paths[joint]
    order = np.argsort(path)
    return np.interp(joints[:, joint], path[order], plan.jack_rise[order])
