"""The instant of contact with the string, and its uncertainty.

Each candidate instant has the probability exp(-chi2 / 2 noise); the mean and the standard deviation
over the candidates are the estimate and its uncertainty. The noise is the variance of the residuals
of the best fit, including their correlation.

The load of a key without a string is that of weight and friction: a constant, small terms in rise
and speed, the error of the rig's inertia, the damper while it rests on its string, and mains hum.
From contact on the string adds a force that depends on the rise above contact alone, a line with
curvature, which ends with the fall at release. The model is linear except for the contact.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.rows import Rows
from sautereau.trajectory.motion import Floats

PEAK = 0.8e-3  # s, standard deviation of this peak, a normal curve
CHOLESKY, INVERSE = get_lapack_funcs(("potrf", "trtri"))
"""LAPACK's Cholesky factorisation, and the inverse of a triangular matrix."""
INERTIA = 4  # Index of the column of the inertia


@dataclass(frozen=True)
class ContactFits:
    """Best fits for contact at each of several instants; arrays of shape (n,)."""

    chi2: Floats
    """Sum of squared residuals in units of the noise."""
    at_release: Floats
    """N at the finger, force of the string at release."""
    noise: float
    """Variance of the residuals of the best fit over the assumed noise."""
    residual: float
    """N, rms of the residuals of the best fit."""
    inertia: float
    """Relative error of the rig's inertia in the best fit."""


class KeyAndString:
    """Least-squares fits of a free key, with a string from an instant on, to the load.

    The normal equations of the key's columns are set up once; those of the string for each instant.

    Args:
        rest: Of the key at rest before the press; may be empty.
        free: Of the way to the contact with an earlier string; may be empty.
        held: Of the way to a release.
        before: Time [s] and rise [m] of the jack before which contact is impossible.
        struck: Whether the string has the column of a peak at contact.
    """

    def __init__(
        self,
        strings: Expected,
        rest: Rows,
        free: Rows,
        held: Rows,
        release: Release,
        before: tuple[float, float],
        struck: bool = False,
    ):
        self._expected, self._struck, self._release = strings, struck, release.time
        self._path = np.append(before[0], held.time), np.append(before[1], held.rise)
        self._held, window = held, strings.settings.acceleration
        bases, self._prior = _bases(strings, rest, free, held)
        self._white = held.whitener()
        self._key, self._load = self._white(bases[-1]), self._white(held.load)
        count = len(self._prior)
        self._gram, self._right, self._square = np.zeros((count, count)), np.zeros(count), 0.0
        for rows, base in zip((rest, free, held), bases, strict=True):
            if len(rows.time):
                white = rows.whitener()
                key, load = white(base), white(rows.load)
                self._gram, self._right = self._gram + key.T @ key, self._right + key.T @ load
                self._square += float(load @ load)
                if rows is not rest:
                    self._right[INERTIA] += _common_noise(rows, window)
        # At release the force of the string ends, and the error of the inertia adds its part.
        self._fall_std = math.hypot(release.fall_std, strings.settings.fall_std * release.fall)
        self._fall, self._slowed = release.fall / self._fall_std, release.slowed / self._fall_std
        bend_std = np.array(strings.settings.shape_std) * max(1e-3, float(np.ptp(held.load)))
        stds = np.array([self._fall_std, *bend_std, *[0.1] * struck])
        self._string_prior = np.diag(1 / stds**2)
        self._keys: dict[tuple[float, float | None, bool], tuple[Floats, Floats, float]] = {}

    def free(self, noise: float) -> float:
        """Return chi2 of a key without a string; the noise as in `at`."""
        inverse, along, left = self._key_alone(noise, None, False)
        bound = _beyond(float(inverse[INERTIA] @ along))
        return left if bound is None else self._key_alone(noise, bound, False)[2]

    def without_string(self) -> tuple[float, Floats]:
        """Return a free key's variance of residuals over the noise, and the residuals [N]."""
        inverse, along, _ = self._key_alone(1.0, None, False)
        left = self._load - self._key @ (inverse @ along)
        return float(left @ left) / len(left), self._white.undone(left)

    def at(self, times: Floats, noise: float) -> ContactFits:
        """Return the fits for instants of contact [s].

        Args:
            times: s, shape (n,).
            noise: Variance of the noise over that of the rows.
        """
        # There is no string in the rows before the first instant, apart from half of its peak.
        start = times[0] - self._held.time[0] - self._struck * 4 * PEAK
        first = max(0, int(start / self._held.step) - 1)
        string = self._white(self._bare(times, first).T, first).T
        string = string.reshape(len(self._string_prior), len(times), -1).swapaxes(0, 1)
        found = self._fits(string, noise, None)
        bound = _beyond(found.inertia)
        return found if bound is None else self._fits(string, noise, bound)

    def force_std(self, time: float, noise: float) -> float:
        """Return the standard uncertainty [N] of the string's force at release.

        The string's columns are smoothed as that of the inertia is: under a constant force any
        factor of both explains the load, but what the smoothing leaves of one of them alone would
        seem to determine it.

        Args:
            time: s, of contact.
            noise: As in `at`.
        """
        sudden = np.vstack([self._held.inertia, self._bare(np.array([time]), 0)])
        rows = _window(self._held, self._expected.settings.acceleration)
        smooth, known = self._white(_smooth(sudden, rows).T), len(self._prior)
        columns = np.column_stack([self._key, smooth[:, 1:]])
        columns[:, INERTIA] = smooth[:, 0]
        normal = columns.T @ columns
        normal[:known, :known] += noise * np.diag(self._prior**-2.0)
        normal[known:, known:] += noise * self._string_prior
        # The row of the fall at release.
        normal[INERTIA, INERTIA] += noise * self._slowed**2
        both = (INERTIA, known), (known, INERTIA)
        normal[both] += noise * self._slowed / self._fall_std
        return math.sqrt(noise * float(np.linalg.inv(normal)[known, known]))

    def _key_alone(
        self, noise: float, inertia: float | None, falls: bool
    ) -> tuple[Floats, Floats, float]:
        """Return the fit of a key without a string.

        Args:
            noise: As in `at`.
            inertia: Known relative error of the rig's inertia; None for its prior.
            falls: Whether it contains the fall at release.

        Returns:
            What the key's columns must be multiplied by in order to be orthonormal, the products
            of the load with these, and the sum of squared residuals.
        """
        if found := self._keys.get((noise, inertia, falls)):
            return found
        # At an end of its range the inertia is known.
        mean, std = (
            (0.0, self._expected.settings.inertia_std) if inertia is None else (inertia, 1e-3)
        )
        # The prior is weighted in units of the noise.
        weights = noise / self._prior**2
        weights[INERTIA] = noise / std**2
        gram, right = self._gram + np.diag(weights), self._right.copy()
        right[INERTIA] += mean * weights[INERTIA]
        square = self._square + mean**2 * weights[INERTIA]
        if falls:
            gram[INERTIA, INERTIA] += noise * self._slowed**2
            right[INERTIA] += noise * self._slowed * self._fall
            square += noise * self._fall**2
        factor, failed = CHOLESKY(gram, lower=1)
        if failed:
            raise np.linalg.LinAlgError("the equations of the key have no solution")
        inverse = INVERSE(factor, lower=1)[0].T
        along = right @ inverse
        found = self._keys[noise, inertia, falls] = inverse, along, float(square - along @ along)
        return found

    def _bare(self, times: Floats, first: int) -> Floats:
        """Return the string's columns from a row on, shape (columns instants, rows)."""
        held = self._held
        at = np.interp(times, *self._path)[:, None]
        line = np.maximum(held.rise[first:] - at, 0.0)
        # The mean of a row over the bend is larger than the bend; it affects the two adjacent rows.
        moved = np.interp(times, held.time, held.speed)[:, None] * held.step
        place = (times[:, None] - held.time[0]) / held.step
        near = np.maximum(1 - np.abs(np.arange(first, len(held.time)) - place), 0.0)
        line += moved / 6 * near * near * near
        # The last row is some samples before the release.
        top = held.rise[-1] + held.speed[-1] * (self._release - held.time[-1])
        line /= np.maximum(top - at, np.maximum(moved, 1e-6))
        square = line * (line - 1)
        cube = square * (line - 0.5)
        quadratic, cubic = self._expected.bends
        columns = [line + quadratic * square + cubic * cube, square, cube]
        if self._struck:
            columns.append(np.exp(-0.5 * ((held.time[first:] - times[:, None]) / PEAK) ** 2))
        return np.concatenate(columns)

    def _fits(self, string: Floats, noise: float, inertia: float | None) -> ContactFits:
        """Return the fits.

        Args:
            string: The string's columns in the last rows, in units of the noise, shape
                (instants, columns, last rows).
            noise: As in `at`.
            inertia: As in `_key_alone`.
        """
        inverse, along, square = self._key_alone(noise, inertia, True)
        last = slice(-string.shape[-1], None)
        mixed, load = string @ self._key[last], string @ self._load[last]
        # The row of the fall at release: the complete force of the string, and the inertia's part.
        mixed[:, 0, INERTIA] += noise * self._slowed / self._fall_std
        load[:, 0] += noise * self._fall / self._fall_std
        by_key = mixed @ inverse
        own = string @ string.transpose(0, 2, 1) - by_key @ by_key.transpose(0, 2, 1)
        own += noise * self._string_prior
        own[:, 0, 0] += 1e-9  # for a string without force
        load -= by_key @ along
        factors = np.linalg.solve(own, load[..., None])[..., 0]
        chi2 = square - (factors * load).sum(1)
        best = int(np.argmin(chi2))
        of_key = inverse @ (along - factors[best] @ by_key[best])
        left = self._load - self._key @ of_key
        left[last] -= factors[best] @ string[best]
        # The peak counts also where it is not needed, since it is looked for.
        inflation = _inflation(left, len(self._prior) + 4)
        unexplained = self._white.undone(left)
        rms = math.sqrt(float(unexplained @ unexplained) / len(unexplained))
        forces = np.asarray(factors[:, 0], dtype=float)
        return ContactFits(chi2, forces, inflation, rms, float(of_key[INERTIA]))


def _beyond(inertia: float) -> float | None:
    """Return the end of the range of the inertia's relative error that it exceeds, if any."""
    return -0.5 if inertia < -0.5 else 1.0 if inertia > 1.0 else None


def _inflation(left: Floats, parameters: int) -> float:
    """Return the variance of residuals, or of sums of 30 blocks if larger, over the noise."""
    white = float(left @ left) / max(1, len(left) - parameters)
    width = len(left) // 30
    if width < 2:
        return white
    sums = left[: width * 30].reshape(30, width).sum(1)
    correlated = float(sums @ sums) / width / (30 - parameters)
    # The variance of so few sums is uncertain: the larger of both would exceed that of white noise.
    return max(white, correlated / (1 + math.sqrt(2 / (30 - parameters))))


def _bases(strings: Expected, rest: Rows, *ways: Rows) -> tuple[list[Floats], Floats]:
    """Return the columns of a key without a string at rest and on the ways, and their priors.

    The priors are standard deviations.
    """
    settings, parts = strings.settings, (rest, *ways)
    lift, damped = strings.damper
    fastest = max(1e-6, max(float(way.speed.max(initial=0.0)) for way in ways))
    bases = [np.zeros((len(rows.time), 6)) for rows in parts]
    bases[0][:, 0] = 1
    for base, way in zip(bases[1:], ways, strict=True):
        base[:, 1] = 1
        base[:, 2] = way.rise / 10e-3
        base[:, 3] = way.speed / fastest
        if len(way.time):
            base[:, 4] = _smooth(way.inertia, _window(way, settings.acceleration))
        if lift:
            base[:, 5] = np.maximum(lift - way.rise, 0.0) / lift
    hums = [hum_at(rows.time) for rows in parts]
    stds = settings.rise_std, settings.drift_std, settings.inertia_std
    # The level is free; the rig's stiffness of the damper may be half or three times the true one.
    known = 10.0, 10.0, *stds, max(1e-6, 2 * damped), *[settings.hum_std] * hums[0].shape[1]
    return [np.column_stack(both) for both in zip(bases, hums, strict=True)], np.array(known)


def _common_noise(held: Rows, window: float) -> float:
    """Return the expected product of the inertia's column with the load, negative, by their noise.

    Both contain that of the velocity. In units of the noise it is the sum over all frequencies of
    the smoothing's response times the velocity's part of the load's spectrum.
    """
    n, rows = len(held.time), _window(held, window)
    variance, shared = float(np.median(held.variance)), float(np.median(held.covariance))
    turn = np.pi * (np.arange(n) + 0.5) / n  # per row
    wave = np.cos(turn)
    # Adjacent rows share a sixth of the force's variance; what the velocity adds is differenced.
    of_force = (variance + 2 * shared) * (2 + wave) / 3
    response = (np.sin(rows * turn / 2) / (rows * np.sin(turn / 2))) ** 2
    return float(response @ (1 - of_force / (variance + 2 * shared * wave)))


def hum_at(time: Floats) -> Floats:
    """Return sine and cosine of mains hum of 50 and of 60 Hz, shape (n, 4)."""
    return np.stack(
        [wave(2 * np.pi * f * time) for f in (50.0, 60.0) for wave in (np.sin, np.cos)], 1
    )


def _window(held: Rows, window: float) -> int:
    """Return the rows of a window [s]."""
    return max(3, round(window / held.step))


def _smooth(signal: Floats, rows: int) -> Floats:
    """Return columns, shape (..., n), without their noise, which would fit that of the load."""
    # Reflected at the ends, where one row would otherwise count for half a window with its noise.
    return uniform_filter1d(uniform_filter1d(signal, rows), rows)


@dataclass(frozen=True)
class Contact:
    """The contact of a plectrum with its string."""

    time: float
    """s after the trigger."""
    std: float
    """s, standard uncertainty."""
    gain: float
    """Dimensionless, reduction of chi2 compared with a key without a string."""
    at_release: float
    """N at the finger, force of the string at release."""
    noise: float
    """Dimensionless, variance of the residuals over the assumed noise, at least 1."""
    residual: float = 0.0
    """N, rms of the load that a rigid key and its string leave until the release."""
    exchange_std: float = 0.0
    """s, part of `std`: the contact may belong to the release of another string held at once."""
    exchange_force: float = 0.0
    """N, half the difference of the force drops of this pluck if it does."""
    exchange_odds: float = 0.0
    """Logarithm of the likelihood of the load if it does, over that if it does not."""
    inertia: float = 0.0
    """Relative error of the rig's inertia."""
    force_std: float = 0.0
    """N, standard uncertainty of `at_release`, with that of the inertia."""


def find_contact(
    strings: Expected,
    rest: Rows,
    free: Rows,
    held: Rows,
    release: Release,
    common_std: float,
    before: tuple[float, float],
    struck: bool = False,
) -> Contact | None:
    """Find the contact before a release.

    Args:
        rest: Of the key at rest before the press, where the only signal is hum.
        free: Of the way to the contact with an earlier string; may be empty.
        held: Of the way down until shortly before the release, from the start of the motion or
            from the previous release.
        release: At which the load falls by the force of the string.
        common_std: s, uncertainty that the rows do not contain: sampling and delay of the sensors.
        before: Time [s] and rise [m] of the jack before which contact is impossible.
        struck: Whether the load has a peak at contact.

    Returns:
        The contact; None where there are too few rows.
    """
    if not len(held.time):
        return None
    fit = KeyAndString(strings, rest, free, held, release, before, struck)
    low, high = before[0], float(held.time[-2])
    # So many resolve the bend at the contact.
    times, noise = np.linspace(low, high, 21), 1.0
    found = fit.at(times, noise)
    chi2 = np.pad(found.chi2, 1, constant_values=np.inf)
    # The narrow well of the contact may lie between two instants, and that of the run-up be wider:
    # where both are explained, it was up to twice as high there; where not, others are 5 times.
    lowest = (chi2[1:-1] < chi2[:-2]) & (chi2[1:-1] <= chi2[2:])
    wells = np.flatnonzero(lowest & (chi2[1:-1] < 4 * chi2.min()))
    around, deepest = np.array([_beside(times, well) for well in wells.tolist() or [0]]), 0
    if len(around) > 1:
        depths = fit.at(around.ravel(), noise).chi2.reshape(around.shape)
        finer = np.array(list(map(_beside, around, np.argmin(depths, 1).tolist())))
        depths = fit.at(finer.ravel(), noise).chi2.reshape(around.shape)
        deepest = int(np.argmin(depths.min(1)))
    near = around[deepest]
    ends, middle, std = (near[0], near[-1]), float(near[5]), 0.0
    for _ in range(8):
        times = np.linspace(*ends, 11)
        found = fit.at(times, noise)
        assumed, noise = noise, max(1.0, found.noise)
        score = found.chi2 / noise
        chance = np.exp((score.min() - score) / 2)
        middle = float(times @ chance / chance.sum())
        std = math.sqrt(float((times - middle) ** 2 @ chance / chance.sum()))
        # To each side as far as an instant is possible: before the release of another string the
        # load may say little of the contact.
        likely = np.flatnonzero(chance > 1e-4)
        width = times[-1] - times[0]
        wider = (chance[[0, -1]] > 0.01) & (times[[0, -1]] != (low, high))
        first, last = times[max(likely[0] - 1, 0)], times[min(likely[-1] + 1, 10)]
        ends = (
            max(low, times[0] - width) if wider[0] else first,
            min(high, times[-1] + width) if wider[1] else last,
        )
        if wider.any():
            continue
        if std < 0.65 * float(times[1] - times[0]):  # the grid is too coarse
            # To the noise of 30 sums a wrong contact adds its chi2.
            noise = max(1.0, noise * (1 - (float(score.min()) - _lowest(score)) / 23))
        elif abs(noise / assumed - 1) < 0.1:
            break
    best = int(np.argmin(found.chi2))
    gain = (fit.free(noise) - float(found.chi2[best])) / noise
    # A common delay of both channels shifts the contact as well; where it lies before the first
    # row, the shape of the string's force is extrapolated.
    std = math.hypot(std, common_std, max(0.0, held.time[0] - middle) / math.sqrt(12))
    force = float(found.at_release[best])
    # Of the fit, and of the load that it does not explain.
    force_std = math.hypot(
        strings.settings.contact_larger * fit.force_std(middle, noise),
        found.residual * math.sqrt(1 - 1 / noise),
    )
    return Contact(
        middle, std, gain, force, noise, found.residual, inertia=found.inertia, force_std=force_std
    )


def _beside(times: Floats, i: int) -> Floats:
    """Return 11 instants from the one before the i-th to the one after it."""
    return np.linspace(times[max(i - 1, 0)], times[min(i + 1, len(times) - 1)], 11)


def _lowest(score: Floats) -> float:
    """Return the least of the parabola around the smallest of equidistant values."""
    inner = min(max(int(np.argmin(score)), 1), len(score) - 2)
    before, at, after = score[inner - 1 : inner + 2].tolist()
    curvature = max(before - 2 * at + after, 1e-12)
    return min(float(score.min()), at - (before - after) ** 2 / (8 * curvature))
