"""A free key, and a string that it meets at some instant, held against the load on the key.

Free, the load is that of weight and friction: a constant, a little of rise and speed, what the
rig's inertia is wrong by, the damper while it rests on its string, and mains hum. From contact on
the string adds a force that depends on the rise above contact alone, a line and its bends, and
that the fall at release takes away again. All of that is linear but for the instant of contact.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.stroke import Rows
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

INERTIA_STD = 0.25
"""1, standard deviation of key and jack's inertia about the rig's."""
CERTAIN = 1e-3
"""1, standard deviation of it where it is at the end of that."""
INERTIA_RANGE = -0.5, 1.0
"""1, within which it is in any case."""
SMOOTH = 1.2e-3
"""s, over which the acceleration is averaged, twice, to be a column of the fit."""
DRIFT_STD = 0.03
"""N, of what the load changes by over the full rise, and at full speed."""
HUM_STD = 5e-3
"""N, of mains hum at either frequency, sine and cosine."""
HUM = (50.0, 60.0)
"""Hz."""
LEVEL_STD = 10.0
"""N, of the load's level."""
BENDS = 3
"""Columns of the string: of rise, and of its square and cube besides."""
BEND_STD = 0.3, 0.15
"""1, of the string's force in its square and cube, to that at release."""
DAMPER_STD = 2.0
"""1, of the damper's stiffness, to the rig's."""
BLOCKS = 30
"""Stretches of a fit over which what it leaves is summed: noise that holds together shows."""
FALL_STD = 0.03
"""1, of the fall at release to the string's force just before it."""
RIDGE = 1e-9
"""1, that keeps a string of nothing solvable."""
INERTIA = 4
"""Column of the inertia."""


@dataclass(frozen=True)
class Misfits:
    """Of a string met at several instants, each with the best of all else; arrays (n,)."""

    misfit: Floats
    """1, sum of squares in units of the noise."""
    at_release: Floats
    """N at the finger, of the string at the end of the rows."""
    noise: float
    """1, variance of what the best of them leaves, to the noise that was supposed."""


class KeyAndString:
    """A free key and a string that it meets at an instant, held against the load.

    The normal equations of the key's columns are made once; those of the string are added for
    each instant.

    Args:
        rig: The bench.
        rest: Of the key at rest before the press; may be empty.
        held: Of the way to a release.
        release: The release.
        before: Time [s] and rise [m] of the jack before which contact cannot be.
    """

    def __init__(
        self, rig: Rig, rest: Rows, held: Rows, release: Release, before: tuple[float, float]
    ):
        self._path = np.append(before[0], held.time), np.append(before[1], held.rise)
        self._held, n = held, len(rest.time)
        base, self._prior = _base(rig, rest, held)
        self._white = held.whitener()
        self._key, load = self._white(base[n:]), self._white(held.load)
        self._load = load
        self._gram, self._right = self._key.T @ self._key, self._key.T @ load
        self._square = float(load @ load)
        if n:
            white = rest.whitener()
            key, load = white(base[:n]), white(rest.load)
            self._gram, self._right = self._gram + key.T @ key, self._right + key.T @ load
            self._square += float(load @ load)
        # Over the release the string's force is lost, and the wrong inertia's share of a change.
        self._fall_std = math.hypot(release.fall_std, FALL_STD * release.fall)
        self._fall, self._slowed = release.fall / self._fall_std, release.slowed / self._fall_std
        self._bend_std = np.array(BEND_STD) * max(1e-3, float(np.ptp(held.load)))

    def free(self, noise: float) -> float:
        """Return the misfit of a key that meets nothing; the noise as in `at`."""
        gram, right, square = self._known(noise, None, False)
        bound = _beyond(np.linalg.solve(gram, right)[INERTIA])
        if bound is not None:
            gram, right, square = self._known(noise, bound, False)
        return square - float(right @ np.linalg.solve(gram, right))

    def at(self, times: Floats, noise: float) -> Misfits:
        """Return the misfits of instants of contact [s].

        Args:
            times: s, shape (n,).
            noise: 1, variance of the noise to what the rows tell of it.
        """
        string = self._string(times)
        found, inertia = self._met(string, noise, None)
        bound = _beyond(inertia)
        return found if bound is None else self._met(string, noise, bound)[0]

    def _known(
        self, noise: float, inertia: float | None, falls: bool
    ) -> tuple[Floats, Floats, float]:
        """Return the normal equations of the key: matrix, right side and square of the load.

        Args:
            noise: As in `at`.
            inertia: 1, by which it is known to be more than the rig's; None for `INERTIA_STD`.
            falls: Whether the fall at release is among what they hold.
        """
        mean, std = (0.0, INERTIA_STD) if inertia is None else (inertia, CERTAIN)
        # The noise is the unit, so what is known beforehand is weighed in it.
        weights = noise / self._prior**2
        weights[INERTIA] = noise / std**2
        gram, right = self._gram + np.diag(weights), self._right.copy()
        right[INERTIA] += mean * weights[INERTIA]
        square = self._square + mean**2 * weights[INERTIA]
        if falls:
            gram[INERTIA, INERTIA] += noise * self._slowed**2
            right[INERTIA] += noise * self._slowed * self._fall
            square += noise * self._fall**2
        return gram, right, float(square)

    def _string(self, times: Floats) -> Floats:
        """Return the string's columns in units of the noise, shape (instants, BENDS, rows)."""
        held, n = self._held, len(times)
        at = np.interp(times, *self._path)
        columns = np.empty((n, BENDS, len(held.time)))
        line, square, cube = columns[:, 0], columns[:, 1], columns[:, 2]
        np.maximum(held.rise - at[:, None], 0.0, out=line)
        # A row's mean over a bend is above the bend, which is in the two rows beside it.
        above = np.interp(times, held.time, held.speed) * held.step / 6
        place = (times - held.time[0]) / held.step
        row = np.clip(np.floor(place).astype(int), 0, len(held.time) - 2)
        for beside in (row, row + 1):
            line[np.arange(n), beside] += above * np.maximum(1 - np.abs(place - beside), 0.0) ** 3
        line /= np.maximum(held.rise[-1] - at, 1e-9)[:, None]
        np.multiply(line, line - 1, out=square)
        np.multiply(square, line - 0.5, out=cube)
        white = self._white(columns.reshape(-1, len(held.time)).T)
        return white.T.reshape(columns.shape)

    def _met(self, string: Floats, noise: float, inertia: float | None) -> tuple[Misfits, float]:
        """Return the misfits, and by how much the best one's inertia is more than the rig's."""
        gram, right, square = self._known(noise, inertia, True)
        mixed = string @ self._key  # (instants, BENDS, key)
        own = string @ string.transpose(0, 2, 1)
        load = string @ self._load
        own[:, range(BENDS), range(BENDS)] += [RIDGE, *(noise / self._bend_std**2)]
        # The row that tells the fall: the string's whole force, and the inertia's share.
        own[:, 0, 0] += noise / self._fall_std**2
        mixed[:, 0, INERTIA] += noise * self._slowed / self._fall_std
        load[:, 0] += noise * self._fall / self._fall_std
        of_all = np.concatenate([right[None], mixed.reshape(-1, len(gram))])
        by_key = np.linalg.solve(gram, of_all.T).T
        alone, mixed_by_key = by_key[0], by_key[1:].reshape(mixed.shape)
        own = own - mixed_by_key @ mixed.transpose(0, 2, 1)
        load = load - mixed @ alone
        factors = np.linalg.solve(own, load[..., None])[..., 0]
        misfit = square - float(right @ alone) - (factors * load).sum(1)
        best = int(np.argmin(misfit))
        of_key = alone - factors[best] @ mixed_by_key[best]
        left = self._load - self._key @ of_key - factors[best] @ string[best]
        inflation = _inflation(left, len(self._prior) + BENDS)
        found = Misfits(misfit, np.asarray(factors[:, 0], dtype=float), inflation)
        return found, float(of_key[INERTIA])


def _beyond(inertia: float) -> float | None:
    """Return the end of `INERTIA_RANGE` beyond which an inertia lies, if it does."""
    low, high = INERTIA_RANGE
    return low if inertia < low else high if inertia > high else None


def _inflation(left: Floats, parameters: int) -> float:
    """Return the variance of what a fit leaves, by itself or held together, to that of noise."""
    white = float(left @ left) / max(1, len(left) - parameters)
    width = len(left) // BLOCKS
    if width < 2:
        return white
    sums = left[: width * BLOCKS].reshape(BLOCKS, width).sum(1)
    return max(white, float(sums @ sums) / width / (BLOCKS - parameters))


def _base(rig: Rig, rest: Rows, held: Rows) -> tuple[Floats, Floats]:
    """Return the columns of a key that meets nothing, and the standard deviation of each."""
    n_rest, n_held = len(rest.time), len(held.time)
    moving = np.zeros((n_rest + n_held, 6))
    moving[:n_rest, 0] = 1
    inside = slice(n_rest, None)
    moving[inside, 1] = 1
    moving[inside, 2] = held.rise / 10e-3
    moving[inside, 3] = held.speed / max(1e-6, float(held.speed.max(initial=0.0)))
    moving[inside, 4] = _smooth(held.inertia, held.step)
    damper, damped = rig.jack.damper, 0.0
    if damper is not None:
        moving[inside, 5] = np.maximum(damper.lift - held.rise, 0.0) / damper.lift
        damped = damper.stiffness * damper.lift * rig.key.jack_arm / rig.key.press_arm
    time = np.concatenate([rest.time, held.time])
    waves = [wave(2 * np.pi * hertz * time) for hertz in HUM for wave in (np.sin, np.cos)]
    of_key = [LEVEL_STD, LEVEL_STD, DRIFT_STD, DRIFT_STD, INERTIA_STD]
    prior = np.array([*of_key, max(1e-6, DAMPER_STD * damped), *[HUM_STD] * len(waves)])
    return np.column_stack([moving, *waves]), prior


def _smooth(signal: Floats, step: float) -> Floats:
    """Return a column without its noise, which is that of the load and would explain it."""
    from scipy.ndimage import uniform_filter1d

    width = max(3, round(SMOOTH / step))
    return uniform_filter1d(uniform_filter1d(signal, width, mode="nearest"), width, mode="nearest")
