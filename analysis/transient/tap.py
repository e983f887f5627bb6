"""The modes of a resting key from taps: its frequency response, and a sum of modes fitted to it.

The mobility H = v / F of taps with force F and velocity v is estimated with the least error in v
(H1, the cross-spectrum over the spectrum of the force), with its coherence g^2 over the taps. Its
standard uncertainty is |H| sqrt((1 - g^2) / (2 n g^2)) for n taps (J. Bendat and A. Piersol, Random
Data, ch. 9). The fitted modes w_k, d_k are those of

    H = i w (sum over modes of (A + i w A') / (w_k^2 - w^2 + 2 i d_k w_k w) + B) + C / (i w),

where A' describes damping that couples modes, B the modes above the band and C the rotation below
it. Modes are added one by one; the linear A, A', B and C are eliminated (variable projection). If a
tap lifts the key off its rest, its decelerations up to the highest place and from there to the
landing, which dry friction makes different, are two more linear terms.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.daq.signals.calibration import robust_std
from sautereau.trajectory.motion import Floats

LENGTH = 0.2  # Length of the record of a tap (s)
APART = 0.25  # Smallest time between two taps (s)
LEAST_TAPS = 3  # Smallest number of taps
LEAST_PEAK = 0.02  # Smallest peak force of a tap (N)
OVER_NOISE = 8.0  # Smallest peak force of a tap, divided by the noise of the force
BAND = (40.0, 2500.0)  # Frequencies between which modes are searched (Hz)
MOST_DAMPING = 0.5  # Above it 3 % of the amplitude remain after a period: no ring
LEAST_GAIN = 0.7  # A mode is kept if it reduces the sum of squares below this fraction


@dataclass(frozen=True)
class TapMode:
    """A mode of the resting key."""

    frequency: float
    """Hz, undamped."""
    frequency_std: float
    """Hz, standard uncertainty."""
    damping: float
    """Damping ratio."""
    damping_std: float
    """Standard uncertainty of the damping ratio."""
    coherence: float
    """Coherence of force and velocity at its frequency."""


@dataclass(frozen=True)
class TapResponse:
    """The modes in the frequency response of a tapped key."""

    taps: int
    """Number of taps."""
    cut: int
    """Number of taps that the start or the end of a recording cuts off; they are not used."""
    highest: float
    """Highest frequency at which modes were searched (Hz)."""
    flight: float
    """Longest time for which the key is off its rest after a tap (s); 0 if it is not."""
    modes: tuple[TapMode, ...]
    """Ordered by frequency."""


def tap_response(recordings: Sequence[tuple[Floats, Floats]], rate: float) -> TapResponse:
    """Return the frequency response and the modes of a tapped key.

    Args:
        recordings: Force [N] and velocity [m/s], corrected for the sensors' delays; shape (n,)
            each.
        rate: Hz, sampling rate of all recordings.

    Raises:
        AnalysisError: There are too few taps.
    """
    from scipy.signal import csd, welch

    count = round(LENGTH * rate)
    found = [tap for force, velocity in recordings for tap in _taps(force, velocity, rate)]
    records = [tap for tap in found if len(tap[0]) == count]
    cut = len(found) - len(records)
    if len(records) < LEAST_TAPS:
        more = f" and {cut} cut off by the ends of a recording" if cut else ""
        raise AnalysisError(
            f"setup tap: {len(records)} taps found{more}, and {LEAST_TAPS} are needed: tap the key"
            f" {APART:g} s apart, with more than {LEAST_PEAK:g} N at the force transducer"
        )
    force, velocity = (np.concatenate(part) for part in zip(*records, strict=True))
    options = {"fs": rate, "window": "boxcar", "nperseg": count, "noverlap": 0, "detrend": False}
    falls = [_fall(*record, rate) for record in records]
    frequency, cross = csd(force, np.vstack([velocity, np.concatenate(falls, axis=1)]), **options)
    part = (frequency >= BAND[0]) & (frequency <= min(BAND[1], 0.4 * rate))
    frequency, cross = frequency[part], cross[:, part]
    # A frequency without any force, or without any velocity, has no response and no coherence.
    power, moved = (np.maximum(welch(x, **options)[1][part], 1e-300) for x in (force, velocity))
    responses = cast("NDArray[np.complex128]", cross / power)
    coherent = np.minimum(np.abs(cross[0]) ** 2 / power / moved, 1.0)  # Exceeds 1 by rounding.
    lifted, modes = _modes(frequency, responses, coherent, len(records))
    flight = max(np.count_nonzero(fall.any(axis=0)) for fall in falls) / rate * lifted
    return TapResponse(len(records), cut, float(frequency[-1]), flight, modes)


def _taps(force: Floats, velocity: Floats, rate: float) -> list[tuple[Floats, Floats]]:
    """Return force and velocity of each tap; their values before the tap are subtracted.

    Those of a tap that the start or the end of the recording cuts off are shorter.
    """
    from scipy.signal import find_peaks

    before, count = round(5e-3 * rate), round(LENGTH * rate)  # 5 ms before the largest force
    level = force - np.median(force)
    noise = robust_std(force)
    peaks, _ = find_peaks(
        level, height=max(LEAST_PEAK, OVER_NOISE * noise), distance=round(APART * rate)
    )
    # Noise where nothing touches the key would lower the response.
    near = np.ones(2 * round(0.3e-3 * rate) + 1)  # 0.3 ms on either side
    touching = np.convolve(np.abs(level) > OVER_NOISE / 2 * noise, near, "same") > 0.5
    level = np.where(touching, level, 0.0)
    records = []
    for start in (peaks - before).tolist():
        every = slice(max(0, start), start + count)
        part = velocity[every]
        records.append((level[every], part - part[: before // 2].mean()))
    return records


def _fall(force: Floats, velocity: Floats, rate: float) -> Floats:
    """Return velocities [m/s] of a lifted key that slows down or falls at 1 m/s^2, shape (2, n).

    The first one is that before its highest place. They are zero if the key does not come back to
    its rest later than after half a period of any mode.
    """
    falls = np.zeros((2, len(force)))
    start, period = int(np.argmax(force)), round(rate / BAND[0])
    way = np.cumsum(velocity - velocity[-period:].mean())[start:]
    highest = int(np.argmax(way))
    rest = 0.02 * way[highest]
    landing = highest + int(np.argmax(way[highest:] <= rest))
    if landing > period / 2 and abs(way[-1]) <= rest:
        around = slice(start + highest, start + landing + period // 2)
        landing = 1 + highest + int(np.argmax(np.diff(velocity[around])))  # where it is stopped
        since = np.arange(start + landing) - start - highest
        falls[:, : start + landing] = np.minimum(since, 0), np.maximum(since, 0)
        falls *= np.cumsum(force) / np.sum(force)  # The key gets its speed by the tap's impulse
    return falls / rate


def _modes(
    frequency: Floats, responses: NDArray[np.complex128], coherent: Floats, taps: int
) -> tuple[bool, tuple[TapMode, ...]]:
    """Return whether the key was lifted, and its modes.

    Args:
        responses: Mobility and the responses of `_fall` at each frequency, shape (3, n).
    """
    from scipy.optimize import least_squares

    good = coherent > 0.5
    if np.count_nonzero(good) < 20:
        return False, ()
    f, g, (h, *falls) = frequency[good], coherent[good], responses[:, good]
    # The response is accurate to 1 %, apart from its noise.
    spread = np.abs(h) * np.hypot(np.sqrt((1 - g) / (2 * taps * g)), 0.01)
    turn, found = 2 * np.pi * f, np.zeros((0, 2))
    others = [1j * turn, 1 / (1j * turn)]
    cost = float(np.sum(_residuals(turn, h, spread, others, found) ** 2))
    lifted = bool(np.any(falls))
    if lifted:
        less = float(np.sum(_residuals(turn, h, spread, [*others, *falls], found) ** 2))
        if lifted := less <= LEAST_GAIN * cost:
            others, cost = [*others, *falls], less
    jacobian = np.zeros((2 * len(f), 0))
    # Five modes at most; below 2 n nothing is left but noise.
    while len(found) < 5 and cost > 2 * len(f):
        table = [
            np.vstack([found, np.array([[at, damping]])])
            for at in np.geomspace(f[0], f[-1], 40)
            for damping in (0.01, 0.08)  # Damping ratios
        ]
        start = min(
            table,
            key=lambda modes: float(np.sum(_residuals(turn, h, spread, others, modes) ** 2)),
        )
        fitted = least_squares(
            lambda p: _residuals(turn, h, spread, others, p.reshape(-1, 2)),
            start.ravel(),
            bounds=(
                np.tile([f[0] / 2, 1e-4], len(start)),
                np.tile([f[-1] * 2, 1.01 * MOST_DAMPING], len(start)),
            ),
            x_scale=np.maximum(start.ravel(), 1e-3),
        )
        if 2 * fitted.cost > LEAST_GAIN * cost:
            break
        found, cost, jacobian = fitted.x.reshape(-1, 2), 2 * float(fitted.cost), fitted.jac
    if not len(found):
        return lifted, ()
    scatter = cost / max(1, 2 * len(f) - jacobian.shape[1])
    stds = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)) * scatter).reshape(-1, 2)
    modes = [
        TapMode(*map(float, (at, at_std, d, d_std, np.interp(at, frequency, coherent))))
        for (at, d), (at_std, d_std) in zip(found, stds, strict=True)
    ]
    return lifted, tuple(
        sorted(
            (
                m
                for m in modes
                if f[0] < m.frequency < f[-1] and m.damping < MOST_DAMPING and m.coherence > 0.8
            ),
            key=lambda mode: mode.frequency,
        )
    )


def _residuals(
    turn: Floats,
    mobility: NDArray[np.complex128],
    spread: Floats,
    others: Sequence[NDArray[Any]],
    modes: Floats,
) -> Floats:
    """Return real and imaginary parts of the residuals, divided by their uncertainty; (2 n,).

    Args:
        others: Linear terms beside the modes, shape (n,) each.
    """
    columns = [*others]
    for frequency, damping in modes:
        own = 2 * np.pi * frequency
        shape = 1j * turn / (own**2 - turn**2 + 2j * damping * own * turn)
        columns += [shape, shape * 1j * turn / own]
    rows = np.stack(columns, 1) / spread[:, None]
    rows /= np.linalg.norm(rows, axis=0)
    rows, target = (np.concatenate([x.real, x.imag]) for x in (rows, mobility / spread))
    return target - rows @ np.linalg.lstsq(rows, target, rcond=None)[0]
