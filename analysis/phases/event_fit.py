"""The instant of a sudden event in the load, with the modes that it excites.

Around the event the load is a parabola with ringing from before, and from the event on a step, a
bend and damped modes. It is linear but for the instant and the poles. The poles are found one
mode after the other: the one of a table that reduces the residuals most starts a
Levenberg-Marquardt search for all of them and the instant; the linear factors are eliminated
(variable projection: L. Kaufman, BIT 15 (1975) 49).
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.response import BEND_TIME, Columns, Poles, pole
from sautereau.analysis.phases.signals import Rows
from sautereau.trajectory.motion import Floats

FREQUENCIES, DAMPINGS = np.geomspace(150.0, 4000.0, 22), (0.015, 0.05, 0.15, 0.4)
"""Hz and dimensionless, of the table of modes; those above `HIGHEST` rows^-1 are omitted."""
HIGHEST = 0.35
"""Largest frequency of a mode over the rate of the rows."""
HIGHEST_REFINED = 0.45
"""The same for a mode that is refined."""
LOWEST, LEAST_DAMPING, LARGEST_DAMPING = 100.0, 0.003, 0.9
"""Hz and dimensionless, bounds of the modes."""
BEFORE_STD, RING_STD, BEND_STD, CURVE_STD = 0.5, 1.5, 10.0, 30.0
"""Prior standard deviations over the range of the load: ringing from before, modes, bend."""
STEPS, CONVERGED = 12, 0.05
"""Largest number of steps of a search, and change of chi2 at which it ends."""
JUMP, JUMP_SLOPE = 1e-3, 1e-3
"""Relative to the range of the load, and to it over `BEND_TIME`: a continuous load's jumps."""
LEAST_GAIN = 16.0
"""Least reduction of chi2 over the noise by a further mode."""


@dataclass(frozen=True)
class Fitted:
    """A fit with a number of modes."""

    instants: Floats
    """s, after the origin, of the event and of others in the window."""
    poles: Poles
    """1/s, of the modes."""
    chi2: float
    """Sum of squared residuals in units of the noise."""
    left: Floats
    """Residuals in units of the noise, shape (n,)."""
    factors: Floats
    """Of step, bend and modes."""
    variance: float
    """s^2, of the instant, for the assumed noise."""
    continuous: bool
    """Whether the load was not allowed to jump."""

    @property
    def instant(self) -> float:
        """s, after the origin, of the event."""
        return float(self.instants[0])

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        modes, events = len(self.poles), len(self.instants)
        return 3 + 4 * modes + (4 + 2 * modes) * events - self.continuous


class EventFit:
    """Fits of an event to the load around it.

    Args:
        rows: Of the load.
        near: s after the trigger, approximate instant of the event.
        samples: Of a row's blocks, see `Columns`.
    """

    def __init__(self, rows: Rows, near: float, samples: int):
        self.columns, self.near = Columns(rows, near, samples), near
        self._step = rows.step
        self._white = rows.whitener()
        self._time = self.columns.time
        u = self._time / BEND_TIME
        self._parabola = self._white(np.stack([np.ones_like(u), u, u * u], 1))
        self.load = self._white(rows.load)
        self._range = max(1e-3, float(np.ptp(rows.load)))

    def scan(self, instants: Floats, others: Floats, poles: Poles) -> tuple[Floats, Floats]:
        """Return chi2 and the step [N] for an event at each instant [s], beside others."""
        base = self._base(others, poles)
        prior, own = self._prior(len(others), len(poles)), self._prior(1, len(poles))
        q, _ = np.linalg.qr(np.concatenate([base, np.diag(1 / prior)]))
        q = q[: len(self.load)]
        columns = self.columns.event(instants, poles)
        n, k, _ = columns.shape
        white = self._white(columns.reshape(n * k, -1).T).T
        left = (white - (white @ q) @ q.T).reshape(n, k, -1)
        gram = left @ white.reshape(n, k, -1).transpose(0, 2, 1)
        gram[:, range(k), range(k)] += 1 / own[-k:] ** 2
        right = left @ self.load
        factors = np.asarray(np.linalg.solve(gram, right[..., None])[..., 0], dtype=float)
        free = self.load - q @ (q.T @ self.load)
        return float(free @ self.load) - (factors * right).sum(1), factors[:, 0]

    def refine(self, instants: Floats, poles: Poles, continuous: bool = False) -> Fitted:
        """Return the best fit near the instants [s] of events and poles [1/s]."""
        events, modes = len(instants), len(poles)
        self._events = events
        state = _joined(instants, poles)
        longest = np.concatenate([[1e-3] * events, [0.3] * modes, [0.7] * modes])
        found = self._eliminated(state, continuous)
        stiff, normal = 1e-2, np.eye(len(state))
        for _ in range(STEPS):
            slopes = self._slopes(state, found, continuous)
            normal, right = slopes.T @ slopes, slopes.T @ found[0]
            better = None
            for _ in range(4):
                damped = normal + stiff * np.diag(np.diag(normal) + 1e-12)
                off = -np.linalg.solve(damped, right)
                trial = self._bounded(state + np.clip(off, -longest, longest))
                tried = self._eliminated(trial, continuous)
                if tried[2] < found[2]:
                    better = trial, tried
                    break
                stiff *= 6
            if better is None:
                break
            gained = found[2] - better[1][2]
            state, found = better
            stiff = max(stiff / 6, 1e-7)
            if gained < CONVERGED:
                break
        instants, poles = self._split(state)
        left, factors, chi2, _, _ = found
        inverse = np.linalg.inv(normal + np.diag(1e-9 * np.diag(normal) + 1e-12))
        first = 3 + 2 * modes
        own = factors[first : first + 3 + 2 * modes]
        return Fitted(
            instants,
            poles,
            chi2,
            left[: len(self.load)],
            own,
            float(inverse[0, 0]),
            continuous,
        )

    def another(self, fitted: Fitted) -> tuple[complex, float]:
        """Return the pole of the table that reduces chi2 of a fit most, and by how much."""
        table: Poles = self._table()
        self._events = len(fitted.instants)
        left, _, _, q, _ = self._eliminated(_joined(fitted.instants, fitted.poles), False)
        n = len(self.load)
        since = self._time - fitted.instant
        waves: Poles = np.exp(np.maximum(since, 0.0)[:, None] * table)
        waves = waves * (since > 0)[:, None]
        white = self._white(np.concatenate([waves.real, waves.imag], 1))
        white = white - q[:n] @ (q[:n].T @ white)
        a, b = white[:, : len(table)], white[:, len(table) :]
        of_a, of_b = left[:n] @ a, left[:n] @ b
        aa, bb, ab = (a * a).sum(0) + 1e-9, (b * b).sum(0) + 1e-9, (a * b).sum(0)
        gain = (bb * of_a**2 - 2 * ab * of_a * of_b + aa * of_b**2) / np.maximum(
            aa * bb - ab**2, 1e-6 * aa * bb
        )
        best = int(np.argmax(gain))
        return complex(table[best]), float(gain[best])

    def _table(self) -> Poles:
        return np.array(
            [pole(f, d) for f in FREQUENCIES if f < HIGHEST / self._step for d in DAMPINGS]
        )

    def _base(self, instants: Floats, poles: Poles) -> Floats:
        """Return parabola, ringing from before and events, in units of the noise."""
        parts = [self._parabola]
        if len(poles):
            waves = np.exp((self._time - self._time[0])[:, None] * poles)
            parts.append(self._white(np.concatenate([waves.real, waves.imag], 1)))
        if len(instants):
            events = self.columns.event(instants, poles)
            parts.append(self._white(events.reshape(-1, events.shape[-1]).T))
        return np.concatenate(parts, 1)

    def _prior(self, events: int, modes: int) -> Floats:
        """Return the prior standard deviations of the columns of `_base`."""
        each = [1e3, BEND_STD, CURVE_STD, *[RING_STD] * (2 * modes)]
        before = [BEFORE_STD] * (2 * modes)
        return self._range * np.array([*[1e3] * 3, *before, *each * events])

    def _eliminated(
        self, state: Floats, continuous: bool
    ) -> tuple[Floats, Floats, float, Floats, Floats]:
        """Return residuals with priors, factors, chi2 and the decomposition of the columns."""
        instants, poles = self._split(state)
        prior = self._prior(len(instants), len(poles))
        rows = [self._base(instants, poles), np.diag(1 / prior)]
        if continuous:
            rows.append(self._jumps(poles, len(prior)))
        matrix = np.concatenate(rows)
        target = np.zeros(len(matrix))
        target[: len(self.load)] = self.load
        q, r = np.linalg.qr(matrix)
        of = q.T @ target
        factors = np.asarray(np.linalg.solve(r, of), dtype=float)
        left = target - q @ of
        return left, factors, float(left @ left), q, r

    def _jumps(self, poles: Poles, columns: int) -> Floats:
        """Return the condition that the load of the first event is continuous."""
        row, first = np.zeros((1, columns)), 3 + 2 * len(poles)
        row[0, first] = 1
        row[0, first + 3 : first + 3 + 2 * len(poles) : 2] = 1
        return row / (JUMP * self._range)

    def _slopes(
        self,
        state: Floats,
        found: tuple[Floats, Floats, float, Floats, Floats],
        continuous: bool,
    ) -> Floats:
        """Return the derivatives of the residuals by the state (Kaufman's approximation)."""
        _, factors, _, q, _ = found
        columns = np.empty((len(state), len(q)))
        at = self._model(state, factors, continuous)
        for place, small in enumerate(
            [*[1e-6] * self._events, *[1e-4] * (len(state) - self._events)]
        ):
            other = state.copy()
            other[place] += small
            columns[place] = (self._model(other, factors, continuous) - at) / small
        columns = columns.T
        return q @ (q.T @ columns) - columns

    def _model(self, state: Floats, factors: Floats, continuous: bool) -> Floats:
        instants, poles = self._split(state)
        m = len(poles)
        k = 3 + 2 * m
        events = self.columns.event(instants, poles)
        raw = factors[k:] @ events.reshape(-1, events.shape[-1])
        if m:
            waves = np.exp((self._time - self._time[0])[:, None] * poles)
            raw = raw + waves.real @ factors[3 : 3 + m] + waves.imag @ factors[3 + m : k]
        parts = [self._white(raw) + self._parabola @ factors[:3], np.zeros(len(factors))]
        if continuous:
            parts.append(self._jumps(poles, len(factors)) @ factors)
        return np.concatenate(parts)

    def _split(self, state: Floats) -> tuple[Floats, Poles]:
        modes = (len(state) - self._events) // 2
        instants, turn, damping = np.split(state, [self._events, self._events + modes])
        turn, damping = np.exp(turn), np.exp(damping)
        return instants, turn * (-damping + 1j * np.sqrt(1 - damping**2))

    def _bounded(self, state: Floats) -> Floats:
        modes = (len(state) - self._events) // 2
        instants, turn, damping = np.split(state, [self._events, self._events + modes])
        turn = np.clip(
            turn, math.log(2 * math.pi * LOWEST), math.log(2 * math.pi * 0.45 / self._step)
        )
        damping = np.clip(damping, math.log(LEAST_DAMPING), math.log(LARGEST_DAMPING))
        return np.concatenate([instants, turn, damping])


def _joined(instants: Floats, poles: Poles) -> Floats:
    """Return the state of a search: instants, logarithms of angular frequency and of damping."""
    turn = np.abs(poles)
    return np.concatenate([instants, np.log(turn), np.log(-poles.real / turn)])
