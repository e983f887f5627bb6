"""A moving string on a plectrum that has no mass, one time step after the other.

At each step the contact's place s and force F solve two equations at the step's end,

    X(s, F) = rest + ux + A F nx    and    h + Z(s, F) = uz + A F nz,

where (ux, uz) is where the step would lead without a force at its end, h the jack's height,
(nx, nz) = (-sin(theta), cos(theta)) without friction, and A how far one newton at the step's
end moves the string within the step: that of the modes, carried exactly under a linear force,
and that of the left-out modes, which answer at once. With friction the string is taken to
slide towards the tip from the start.
"""

import math

import numpy as np

from analysis.errors import ModelError
from analysis.model.plectrum.base import Floats, PlectrumMap
from analysis.model.string import ModalString, Propagator, StringState
from rig.schema import Rig

NEWTON_STEPS = 40
"""Of one time step at most; 2 or 3 are usual."""
CLOSE = 1e-12
"""1, of the plectrum's length: what is left when a contact is solved."""


class Contact:
    """String and plectrum while they meet."""

    def __init__(self, rig: Rig, plectrum: PlectrumMap, string: ModalString):
        self.plectrum, self.string, self.length = plectrum, string, plectrum.length
        self.speed = rig.press.jack_speed
        self.rest = self.length - rig.plectrum.overlap
        self.newton_steps = 0

    def run(self, step: float, end: float) -> tuple[Floats, StringState]:
        """Advance until the string leaves.

        Args:
            step: s.
            end: s, when it must have left.

        Returns:
            Rows of time [s], s [m], F [N], theta [rad], displacement along x and z [m] and
            velocity along x and z [m/s]; the moving modes at release.

        Raises:
            ModelError: No place on the plectrum balances the string, or it does not leave.
        """
        string, state, force = self.string, self.string.at_rest(), np.zeros(2)
        time, found = 0.0, np.array([self.rest, 0.0, 0.0])
        rows = [(time, *found, *force, *force)]
        transition, last = string.propagator(step), found
        while time < end:
            guess = 2 * found - last
            ahead, after = self._meet(transition, state, force, time + step, guess)
            if not ahead[0] < self.length:
                step = self._last_step(state, force, time, step, found[1])
                transition = string.propagator(step)
                _, ahead, after = self._tip(transition, state, force, time + step, found[1])
                end = time
            state = transition.advance(state, force, after)
            place = string.displacement(state.q) + string.residual * after
            rate = string.displacement(state.v) + string.residual * (after - force) / step
            time, force = time + step, after
            last, found = found, ahead
            rows.append((time, *found, *place, *rate))
            if end < time:
                return np.array(rows), state
        raise ModelError(
            f"the string has not left the plectrum in {end * 1e3:.4g} ms;"
            " lower plectrum.overlap or press.jack_speed"
        )

    def _meet(self, transition: Propagator, state: StringState, force: Floats, time, guess):
        """Return (s, F, theta) at a step's end, and the force along x and z; NaN if none is."""
        x, z, give = self._without_force(transition, state, time, force)
        if z >= 0:  # the string is off the plectrum
            return np.array([x, 0.0, 0.0]), np.zeros(2)
        s, f = map(float, guess[:2])
        for _ in range(NEWTON_STEPS):
            self.newton_steps += 1
            s = min(max(s, 0.5 * self.rest), 1.01 * self.length)
            f = min(max(f, 0.0), float(self.plectrum.force_limit(s)))
            bend = self.plectrum.bend(s, f)
            bx, bz, theta, bx_s, bz_s, theta_s, bx_f, bz_f, theta_f = map(float, bend)
            out, up = self._direction(theta)
            across, along = bx - x - give * f * out, z + give * f * up - bz
            x_s, x_f = bx_s + give * f * up * theta_s, bx_f - give * (out - f * up * theta_f)
            z_s, z_f = give * f * out * theta_s - bz_s, give * (up + f * out * theta_f) - bz_f
            det = x_s * z_f - x_f * z_s
            ds, df = (across * z_f - along * x_f) / det, (along * x_s - across * z_s) / det
            s, f = s - ds, f - df
            if abs(ds) + abs(df * z_f) <= CLOSE * self.length and f >= 0:
                theta -= theta_s * ds + theta_f * df
                return np.array([s, f, theta]), f * np.array(self._direction(theta))
        return np.full(3, np.nan), force

    def _tip(self, transition: Propagator, state: StringState, force: Floats, time, guess):
        """Return how far [m] beyond the tip the string would be, held there; then as `_meet`."""
        x, z, give = self._without_force(transition, state, time, force)
        f = float(guess)
        for _ in range(NEWTON_STEPS):
            f = min(max(f, 0.0), float(self.plectrum.force_limit(self.length)))
            bend = self.plectrum.bend(self.length, f)
            out, up = self._direction(float(bend.theta))
            slope = give * (up + f * out * float(bend.theta_f)) - float(bend.z_f)
            df = (z + give * f * up - float(bend.z)) / slope
            f -= df
            if abs(df * slope) <= CLOSE * self.length:
                found = np.array([self.length, f, float(bend.theta)])
                return x + give * f * out - float(bend.x), found, f * np.array([out, up])
        raise self._lost(time)

    def _without_force(self, transition: Propagator, state: StringState, time, force: Floats):
        """Return where a step leads that ends without force, x and z from the jack [m], and A."""
        free = transition.advance(state, force, np.zeros(2))
        x, z = self.string.displacement(free.q) + np.array([self.rest, -self.speed * time])
        return float(x), float(z), self.string.residual + float(self.string.shape @ transition.q_to)

    def _direction(self, theta):
        """Return the part of F that pushes the string along x and z, friction included."""
        sine, cosine, friction = math.sin(theta), math.cos(theta), self.plectrum.friction
        return -sine - friction * cosine, cosine - friction * sine

    def _last_step(self, state: StringState, force: Floats, time, step, guess) -> float:
        """Return the part [s] of a step after which the string is at the tip."""
        from scipy.optimize import root_scalar

        def beyond(part: float) -> float:
            transition = self.string.propagator(part)
            return self._tip(transition, state, force, time + part, guess)[0]

        least = 1e-6 * step
        if beyond(least) >= 0:
            return least
        if beyond(step) < 0:
            raise self._lost(time + step)
        return root_scalar(beyond, bracket=(least, step), xtol=1e-9 * step, rtol=1e-14).root

    def _lost(self, time: float) -> ModelError:
        return ModelError(
            "the string's contact with the plectrum was lost at a jack height of"
            f" {self.speed * time * 1e3:.4g} mm: no place on it balances the string within this"
            " level's range; lower plectrum.overlap or press.jack_speed, or take a shorter step"
        )
