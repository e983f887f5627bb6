"""The string between nut and bridge: as a spring, and as modes propagated exactly in time.

The ideal string on two fixed points has the modes sin(n pi x / L) with omega_n = 2 pi n f and
the modal mass m = mu L / 2. A force F at the plucking point b L drives mode n by F sin(n pi b).
The omitted higher modes contribute the flexibility that the moving modes lack to 1 / K, so that
a slow motion sees exactly the spring of the paper's equation 2. The stiffness of the wire raises
the frequencies, omega_n = 2 pi n f sqrt(1 + B n^2), and leaves the shapes (H. Fletcher, Normal
vibration frequencies of a stiff piano string, JASA 36, 1964: pinned ends).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.instrument import String
from sautereau.rig.progress import tracked


def release_speed(string: String, lift: float) -> float:
    """Return the initial velocity Vosc [m/s] of an ideal string from a static displacement.

    Vosc = c h / (2 L b (1 - b)) with c = 2 L f, of all modes together; the paper's section 2.4
    prints that of the first mode alone, `first_mode_release_speed`.

    Args:
        lift: m, displacement at the plucking point at release.
    """
    b = string.plucking_point / string.length
    wave_speed = 2 * string.length * string.frequency
    return wave_speed * lift / (2 * string.length * b * (1 - b))


def first_mode_release_speed(string: String, lift: float) -> float:
    """Return the first mode's part [m/s] of `release_speed`, at the plucking point.

    The triangle of height h has the modal amplitudes 2 h sin(n pi b) / (pi^2 b (1 - b) n^2);
    the first one's speed where it is plucked is omega_1 sin(pi b) times that, which is
    (4 / pi) sin^2(pi b) of all modes' speed.
    """
    b = string.plucking_point / string.length
    return 4 / math.pi * math.sin(math.pi * b) ** 2 * release_speed(string, lift)


def stretch(string: String, modes: int) -> Floats:
    """Return by how much its stiffness raises a string's lowest frequencies, shape (modes,)."""
    return np.sqrt(1 + string.inharmonicity * np.arange(1, modes + 1) ** 2)


class ModalState(NamedTuple):
    """Modal coordinates; axis 0 is the polarisation, x and z, axis 1 the mode."""

    q: Floats
    """m, shape (2, modes)."""
    v: Floats
    """m/s, shape (2, modes)."""


class Propagator(NamedTuple):
    """The exact transition of every mode over one step, with the force linear in time.

    q1 = qq q + qv v + q_from f0 + q_to f1 and v1 = vq q + vv v + v_from f0 + v_to f1; all
    arrays have the shape (modes,).
    """

    qq: Floats
    qv: Floats
    vq: Floats
    vv: Floats
    q_from: Floats
    """m/N, from the force at the step's start."""
    q_to: Floats
    """m/N, from the force at its end."""
    v_from: Floats
    """m/s/N, from the force at the step's start."""
    v_to: Floats
    """m/s/N, from the force at its end."""


class ModalString:
    """A string on two fixed points, by its lowest modes in two polarisations."""

    def __init__(self, string: String, modes: int = 30, decay: ArrayLike = 0.0, width: float = 0.0):
        """Compute the modes.

        Args:
            modes: Number of moving modes; the higher ones act as a spring.
            decay: 1/s, of the amplitudes; one for all modes, or shape (modes,).
            width: m, along the string, over which the plectrum's force is spread.

        Raises:
            ModelError: There is no mode, or one is overdamped.
        """
        if modes < 1:
            raise ModelError(f"string: the number of modes is {modes}; it must be at least 1")
        n = np.arange(1, modes + 1)
        self.string = string
        self.order = n
        self.stretch = stretch(string, modes)
        """Frequencies over those of a string without stiffness, shape (modes,)."""
        self.omega = 2 * np.pi * string.frequency * n * self.stretch
        self.decay = np.broadcast_to(np.asarray(decay, float), n.shape)
        if not np.all((self.decay >= 0) & (self.decay < self.omega)):
            raise ModelError(
                f"string: a decay of {np.max(self.decay):.4g} 1/s must lie between 0 and 2 pi"
                f" times the mode's frequency, {self.omega[0]:.4g} 1/s for the first; lower it"
            )
        self.mass = string.linear_density * string.length / 2
        self.shape = np.sin(n * np.pi * string.plucking_point / string.length)
        self.shape = self.shape * np.sinc(n * width / (2 * string.length))
        """Mode shapes at the plucking point, dimensionless, shape (modes,)."""
        moving = np.sum(self.shape**2 / (self.mass * self.omega**2))
        self.residual = 1 / string.static_stiffness - float(moving)
        """m/N, flexibility of the omitted modes at the plucking point."""

    def propagator(self, step: float) -> Propagator:
        """Return the transition over a step [s]."""
        damped = np.sqrt(self.omega**2 - self.decay**2)
        fall = np.exp(-self.decay * step)
        cosine, sine = fall * np.cos(damped * step), fall * np.sin(damped * step) / damped
        qq, qv = cosine + self.decay * sine, sine
        vq, vv = -(self.omega**2) * sine, cosine - self.decay * sine
        # Under f = t / step the steady part of q is offset + slope t.
        slope = self.shape / (step * self.mass * self.omega**2)
        offset = -2 * self.decay * slope / self.omega**2
        q_to = offset + slope * step - qq * offset - qv * slope
        v_to = slope - vq * offset - vv * slope
        # A constant force is the sum of a rising and a falling one.
        held = self.shape / (self.mass * self.omega**2)
        return Propagator(qq, qv, vq, vv, held * (1 - qq) - q_to, q_to, -held * vq - v_to, v_to)

    def free(self, state: ModalState, time: ArrayLike) -> ModalState:
        """Return the coordinates after free times [s], each of shape (2, n, modes)."""
        time = np.atleast_1d(np.asarray(time, float))[:, None]
        damped = np.sqrt(self.omega**2 - self.decay**2)
        fall = np.exp(-self.decay * time)
        cosine, sine = fall * np.cos(damped * time), fall * np.sin(damped * time) / damped
        q, v = state.q[:, None], state.v[:, None]
        return ModalState(
            (cosine + self.decay * sine) * q + sine * v,
            -(self.omega**2) * sine * q + (cosine - self.decay * sine) * v,
        )

    def displacement(self, q: Floats, place: float | None = None) -> Floats:
        """Return the displacement [m] of coordinates (..., modes), or their speed.

        Args:
            q: m, or m/s, of the modes.
            place: m, from the nut; None for the plucking point.
        """
        if place is None:
            return q @ self.shape
        return q @ np.sin(self.order * np.pi * place / self.string.length)

    def bridge_force(self, q: Floats) -> Floats:
        """Return the force [N] on the bridge of coordinates (..., modes).

        It is -T du/dx at x = L, positive along the displacement.
        """
        length = self.string.length
        slope = self.order * np.pi / length * np.cos(self.order * np.pi)
        # With the shear force of a stiff string, E I u''', at its pinned end.
        return -self.string.tension * (q @ (slope * self.stretch**2))

    def energy(self, state: ModalState) -> Floats:
        """Return the energy [J] of the moving modes, of a state with axes (2, ..., modes)."""
        kinetic, strain = state.v**2, (self.omega * state.q) ** 2
        return self.mass / 2 * (kinetic + strain).sum(axis=(0, -1))


PART = 10_000  # Instants that are computed together, to limit memory


@dataclass(frozen=True)
class FreeString:
    """A freely vibrating string; times in s from its release."""

    string: ModalString
    state: ModalState
    """State of the moving modes at time 0."""

    def motion(self, time: ArrayLike, place: float | None = None) -> tuple[Floats, Floats]:
        """Return displacement [m] and velocity [m/s] along x and z, shapes (n, 2).

        Args:
            time: s, shape (n,).
            place: m, from the nut; None for the plucking point.
        """
        parts = [
            [self.string.displacement(coordinates, place).T for coordinates in part]
            for part in self._parts(time)
        ]
        q, v = zip(*parts, strict=True)
        return np.concatenate(q), np.concatenate(v)

    def bridge_force(self, time: ArrayLike) -> Floats:
        """Return the string's force [N] on the bridge along x and z, shape (n, 2).

        Args:
            time: s, shape (n,).
        """
        return np.concatenate([self.string.bridge_force(p.q).T for p in self._parts(time)])

    def _parts(self, time: ArrayLike) -> Iterator[ModalState]:
        """Yield the coordinates in parts of `PART` instants."""
        time = np.atleast_1d(np.asarray(time, float))
        for part in tracked(np.split(time, range(PART, len(time), PART))):
            yield self.string.free(self.state, part)
