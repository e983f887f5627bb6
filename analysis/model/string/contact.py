"""A moving string on a massless plectrum, solved step by step in time.

At each step the contact's place s and force F solve two equations at the step's end,

    X(s, F) = rest + ux + A F nx    and    h + Z(s, F) = uz + A F nz,

where (ux, uz) is the displacement at the step's end without a force there, h the jack's height,
(nx, nz) = (-sin(theta), cos(theta)) without friction, and A the displacement within the step per
newton at its end: that of the modes, propagated exactly under a linear force, plus that of the
omitted higher modes, which respond at once. With friction the string is assumed to slide
towards the tip from the start.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.surface import StringCentre
from sautereau.analysis.model.plectrum.table import laws_under
from sautereau.analysis.model.string.string import ModalState, ModalString

Bent = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""x [m], z [m], and the force on the string along x and along z over F, friction included;
then the derivatives of these four by s, and by F."""


class PointBend(NamedTuple):
    """A plectrum's map for one point per call."""

    at: Callable[[float, float], Bent]
    """Bend for a position s [m] and a force F [N]."""
    limit: Callable[[float], float]
    """Largest force [N] at a position s [m]."""


def point_bend(plectrum: PlectrumMap) -> PointBend:
    """Return a plectrum's map for single points; that of a uniform elastica from its table."""
    centre = plectrum if isinstance(plectrum, StringCentre) else None
    uniform = centre.mid_line if centre else plectrum
    if isinstance(uniform, Elastica) and uniform.table.uniform:
        return _of_elastica(uniform, centre.half + centre.radius if centre else 0.0)
    return _of_map(plectrum)


def _of_map(plectrum: PlectrumMap) -> PointBend:
    friction = plectrum.friction

    def at(s: float, force: float) -> Bent:
        x, z, theta, x_s, z_s, theta_s, x_f, z_f, theta_f = map(float, plectrum.bend(s, force))
        sine, cosine = math.sin(theta), math.cos(theta)
        out, up = -sine - friction * cosine, cosine - friction * sine
        return (
            x, z, out, up,
            x_s, z_s, -up * theta_s, out * theta_s,
            x_f, z_f, -up * theta_f, out * theta_f,
        )  # fmt: skip

    return PointBend(at, lambda s: float(plectrum.force_limit(s)))


def _of_elastica(plectrum: Elastica, offset: float) -> PointBend:
    table, _ = laws_under(plectrum.table, plectrum.friction)
    # The polynomials of each cell, one tuple of coefficients for each of x, z / q, theta / q.
    cells = table.c[..., 0, 0, :].transpose(1, 2, 0).tolist()
    width, largest = float(table.x[1]), plectrum.table.limit(plectrum.friction)
    last = len(cells) - 1
    stiffness, length, friction = plectrum.bending_stiffness, plectrum.length, plectrum.friction

    def at(s: float, force: float) -> Bent:
        q_f = s * s / stiffness
        q = force * q_f
        cell = min(int(q / width), last)
        t = q - cell * width
        (a5, a4, a3, a2, a1, a0), (b5, b4, b3, b2, b1, b0), (c5, c4, c3, c2, c1, c0) = cells[cell]
        x = ((((a5 * t + a4) * t + a3) * t + a2) * t + a1) * t + a0
        x_q = (((5 * a5 * t + 4 * a4) * t + 3 * a3) * t + 2 * a2) * t + a1
        z = ((((b5 * t + b4) * t + b3) * t + b2) * t + b1) * t + b0
        z_q = z + q * ((((5 * b5 * t + 4 * b4) * t + 3 * b3) * t + 2 * b2) * t + b1)
        theta = ((((c5 * t + c4) * t + c3) * t + c2) * t + c1) * t + c0
        theta_q = theta + q * ((((5 * c5 * t + 4 * c4) * t + 3 * c3) * t + 2 * c2) * t + c1)
        z *= q
        sine, cosine = math.sin(q * theta), math.cos(q * theta)
        out, up = -sine - friction * cosine, cosine - friction * sine
        q_s = 2 * force * s / stiffness
        out_q, up_q = -up * theta_q, out * theta_q
        # Of the string's centre, at the offset from the mid-line.
        x_q, z_q = s * x_q - offset * cosine * theta_q, s * z_q - offset * sine * theta_q
        return (
            s * x - offset * sine, s * z + offset * (cosine - 1), out, up,
            x + x_q * q_s, z + z_q * q_s, out_q * q_s, up_q * q_s,
            x_q * q_f, z_q * q_f, out_q * q_f, up_q * q_f,
        )  # fmt: skip

    def limit(s: float) -> float:
        return largest * stiffness / min(s, length) ** 2

    return PointBend(at, limit)


STEP_FRACTION = 0.3  # Default time step, divided by the shortest mode's period
STEP_FRACTION_MAX = 0.35
"""Largest time step, divided by that period. From 0.4 on, the moving modes respond within a step
more than the omitted ones. Force and modes of a stiff plectrum then excite each other from step to
step."""
NEWTON_STEPS = 40  # Maximum per time step; 2 are usual


class Carry(NamedTuple):
    """The matrices of a `Propagator`, arranged for few multiplications per step."""

    own: Floats
    """q by q and v by v, shape (2, modes)."""
    other: Floats
    """q by v and v by q, shape (2, modes)."""
    pushed: Floats
    """All q and v by the forces at the start and at the end, shape (2, 2 modes)."""
    seen: Floats
    """The end's displacement at the plucking point by all q and v, shape (2 modes,)."""
    give_before: float
    """m/N, the same by the force at the start."""
    give: float
    """m/N, the same by the force at the end, omitted modes included: A."""


class Found(NamedTuple):
    """Position and force of the string on the plectrum."""

    s: float
    """m, from the clamp."""
    force: float
    """N, normal to the plectrum's surface."""
    out: float
    """N, of the plectrum on the string along x."""
    up: float
    """N, along z; the force on the jack is opposite and equal."""


class ModalContact:
    """The contact of a moving string and a plectrum, until the string slides off.

    Args:
        overlap: m, from the string at rest to the tip.
        string: The string, at rest; it may be replaced by one with the same modes between two
            steps, for instance when a damper comes down.
    """

    def __init__(self, plectrum: PlectrumMap, overlap: float, string: ModalString):
        self.bend, self.length = point_bend(plectrum), plectrum.length
        self.string = string
        self.rest = self.length - overlap
        self.found = self._last = Found(self.rest, 0.0, 0.0, 0.0)
        """At the last step's end; without force if the string is off the plectrum."""
        self._modes = np.zeros((2, 2, len(string.order)))
        self._lean = math.atan(plectrum.friction)
        self._carry: Callable[[ModalString, float], Carry] = lru_cache(maxsize=32)(_carry)

    @property
    def state(self) -> ModalState:
        """The moving modes."""
        return ModalState(self._modes[:, 0], self._modes[:, 1])

    @property
    def theta(self) -> float:
        """rad, of the plectrum's tangent under the string."""
        _, _, out, up = self.found
        return math.atan2(-out, up) - self._lean if up else 0.0

    @property
    def lift(self) -> float:
        """m, of the string at the plucking point."""
        omitted = self.string.residual * self.found.up
        return float(self._modes[1, 0] @ self.string.shape) + omitted

    @property
    def reach(self) -> float:
        """m, upper bound on the displacement of the free string."""
        q, v = self._modes[1]
        string = self.string
        damped = np.sqrt(string.omega**2 - string.decay**2)
        amplitudes = np.hypot(q, (v + string.decay * q) / damped)
        return float(np.abs(string.shape) @ amplitudes)

    def leave(self) -> None:
        """Remove the plectrum: the string vibrates freely from its present state."""
        self.found = self._last = Found(self.rest, 0.0, 0.0, 0.0)

    def swing(self, time: float) -> None:
        """Advance the free string by a time [s] without the plectrum."""
        self.leave()
        free = self.string.free(self.state, time)
        self._modes = np.stack([free.q[:, 0], free.v[:, 0]], axis=1)

    def advance(self, step: float, before: float, after: float) -> float:
        """Advance by a step, and return the time [s] until the string slid off.

        This is the step if the string did not slide off; otherwise the contact is at the tip,
        as it is just before release.

        Args:
            step: s.
            before: m, height of the jack above first contact, at the step's start.
            after: m, at its end; in between it is linear.

        Raises:
            ModelError: No place on the plectrum balances the string, or the height is NaN.
        """
        if not math.isfinite(after):
            raise ModelError(
                f"the jack's height is {after} m, which is not finite; use a shorter step, or look"
                " for the cause of the divergence"
            )
        carry, taken = self._carry(self.string, step), step
        found = self._meet(carry, after)
        if not found.s < self.length:
            taken = self._slid_off(step, before, after)
            carry = _carry(self.string, taken)
            _, found = self._tip(carry, before + (after - before) * (taken / step))
        pushes = np.array(((self.found.out, found.out), (self.found.up, found.up)))
        modes = self._modes
        self._modes = carry.own * modes + carry.other * modes[:, ::-1]
        self._modes += (pushes @ carry.pushed).reshape(modes.shape)
        self._last, self.found = self.found, found
        return taken

    def _meet(self, carry: Carry, height: float) -> Found:
        """Return the contact at a step's end; NaN if there is none."""
        x, z = self._without_force(carry, height)
        if z >= 0:  # the string is off the plectrum
            return Found(self.rest, 0.0, 0.0, 0.0)
        give, bend, (s, f, _, _), last = carry.give, self.bend, self.found, self._last
        s, f = 2 * s - last.s, 2 * f - last.force
        for _ in range(NEWTON_STEPS):
            s = min(max(s, 0.5 * self.rest), 1.01 * self.length)
            f = min(max(f, 0.0), bend.limit(s))
            bx, bz, out, up, bx_s, bz_s, out_s, up_s, bx_f, bz_f, out_f, up_f = bend.at(s, f)
            across, along = bx - x - give * f * out, z + give * f * up - bz
            x_s, x_f = bx_s - give * f * out_s, bx_f - give * (out + f * out_f)
            z_s, z_f = give * f * up_s - bz_s, give * (up + f * up_f) - bz_f
            det = x_s * z_f - x_f * z_s
            ds, df = (across * z_f - along * x_f) / det, (along * x_s - across * z_s) / det
            s, f = s - ds, f - df
            # In lengths; the error is about the square of the last step.
            if abs(ds) + abs(df * z_f) <= 1e-9 * self.length and f >= 0:
                out, up = out - out_s * ds - out_f * df, up - up_s * ds - up_f * df
                return Found(s, f, f * out, f * up)
        return Found(math.nan, 0.0, 0.0, 0.0)

    def _tip(self, carry: Carry, height: float) -> tuple[float, Found]:
        """Return how far [m] the string, held at the tip, would lie beyond it, and the contact."""
        x, z = self._without_force(carry, height)
        give, bend, f = carry.give, self.bend, self.found.force
        for _ in range(NEWTON_STEPS):
            f = min(max(f, 0.0), bend.limit(self.length))
            bx, bz, out, up, _, _, _, _, _, bz_f, _, up_f = bend.at(self.length, f)
            slope = give * (up + f * up_f) - bz_f
            df = (z + give * f * up - bz) / slope
            if abs(df * slope) <= 1e-12 * self.length:  # In plectrum lengths
                return x + give * f * out - bx, Found(self.length, f, f * out, f * up)
            f -= df
        raise self._lost(height)

    def _without_force(self, carry: Carry, height: float) -> tuple[float, float]:
        """Return x from the clamp and z from h [m] after a step that ends without force."""
        x, z = (self._modes.reshape(2, -1) @ carry.seen).tolist()
        before, (_, _, out, up) = carry.give_before, self.found
        return self.rest + x + before * out, z + before * up - height

    def _slid_off(self, step: float, before: float, after: float) -> float:
        """Return the part [s] of a step after which the string is at the tip."""
        from scipy.optimize import root_scalar

        def beyond(part: float) -> float:
            height = before + (after - before) * (part / step)
            return self._tip(_carry(self.string, part), height)[0]

        least = 1e-6 * step
        if beyond(least) >= 0:
            return least
        if beyond(step) < 0:
            raise self._lost(after)
        return root_scalar(beyond, bracket=(least, step), xtol=1e-9 * step, rtol=1e-14).root

    def _lost(self, height: float) -> ModelError:
        return ModelError(
            "the string's contact with the plectrum was lost at a jack height of"
            f" {height * 1e3:.4g} mm: no place on it balances the string within this level's"
            " range; lower plectrum.overlap or the jack speed, or use a shorter step"
        )


def _carry(string: ModalString, step: float) -> Carry:
    p = string.propagator(step)
    at_end = string.shape @ np.stack([p.q_from, p.q_to], axis=1)
    return Carry(
        own=np.stack([p.qq, p.vv]),
        other=np.stack([p.qv, p.vq]),
        pushed=np.stack([np.concatenate([p.q_from, p.v_from]), np.concatenate([p.q_to, p.v_to])]),
        seen=np.concatenate([string.shape * p.qq, string.shape * p.qv]),
        give_before=float(at_end[0]),
        give=float(at_end[1]) + string.residual,
    )
