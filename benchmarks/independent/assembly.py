"""Parameters of the compiled functions, assembled from the conditions; and the model of the key.

The key is a free-free beam that rotates on its pin, heaves on its felt and bends. Coordinates are
[heave,] rotation and the bending modes. With a rigid pin the heave is eliminated: the displacement
of the beam at the pin is zero, so a mode's shape is measured from its value there.
"""

from dataclasses import dataclass

import numpy as np

from .conditions import Choir, Conditions
from .elastica import inner_place, static_pluck, table
from .kernel import GRAVITY
from .parameters import Body, Choirs

ROOTS = (4.730040744862704, 7.853204624095838)
"""Of cos b cosh b = 1, the free-free beam (Blevins, Formulas for Natural Frequency, table 8-1)."""


@dataclass(frozen=True)
class KeyModel:
    """Linear model M p'' + C p' + K p = sum w(x) f(x) of the key; all shapes (n, n)."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    front: float
    back: float
    heaves: bool
    modes: int

    def at(self, x: float) -> np.ndarray:
        """Return the displacement at x (m, from the pin to the back) per coordinate; shape (n,)."""
        pin = np.array([mode_shape(k, 0.0, self.front, self.back) for k in range(self.modes)])
        here = np.array([mode_shape(k, x, self.front, self.back) for k in range(self.modes)])
        if self.heaves:
            return np.concatenate(([1.0, x], here))
        return np.concatenate(([x], here - pin))

    @property
    def rotation(self) -> int:
        """Index of the rotation among the coordinates."""
        return int(self.heaves)

    def frequencies(self) -> np.ndarray:
        """Return the undamped natural frequencies, Hz, ascending; shape (n,)."""
        values = np.linalg.eigvals(np.linalg.solve(self.mass, self.stiffness)).real
        return np.sqrt(np.sort(np.clip(values, 0, None))) / (2 * np.pi)


def mode_shape(k: int, x: float, front: float, back: float) -> float:
    """Return bending mode k of a uniform free-free beam from -front to back, of rms 1."""
    beta = ROOTS[k]
    u = (x + front) / (front + back)
    sigma = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    even = np.cosh(beta * u) + np.cos(beta * u)
    return float(even - sigma * (np.sinh(beta * u) + np.sin(beta * u)))


def key_model(c: Conditions) -> KeyModel:
    """Return the key's matrices; an infinite heave frequency is a rigid pin."""
    mass, front, back = c.key_mass, c.front_arm, c.back_arm
    bending = _bending_modes(c)
    n = len(bending)
    full = np.diag([mass, c.inertia] + [mass] * n).astype(float)
    full[0, 1] = full[1, 0] = -c.gravity_moment / GRAVITY
    stiffness = np.zeros((n + 2, n + 2))
    damping = np.zeros((n + 2, n + 2))
    for k, (frequency, ratio) in enumerate(bending):
        omega = 2 * np.pi * frequency
        stiffness[k + 2, k + 2] = mass * omega**2
        damping[k + 2, k + 2] = 2 * ratio * mass * omega
    pin = np.array([mode_shape(k, 0.0, front, back) for k in range(n)])
    if np.isfinite(c.heave_frequency):
        omega = 2 * np.pi * c.heave_frequency
        at_pin = np.concatenate(([1.0, 0.0], pin))
        stiffness += mass * omega**2 * np.outer(at_pin, at_pin)
        damping += 2 * c.heave_damping * mass * omega * np.outer(at_pin, at_pin)
        return KeyModel(full, damping, stiffness, front, back, True, n)
    kept = np.vstack([np.concatenate(([0.0], -pin)), np.eye(n + 1)])
    mass_matrix, damping, stiffness = (kept.T @ each @ kept for each in (full, damping, stiffness))
    return KeyModel(mass_matrix, damping, stiffness, front, back, False, n)


def _bending_modes(c: Conditions) -> tuple[tuple[float, float], ...]:
    """Return frequency (Hz) of the free-free key and damping of each mode, at most two."""
    if not np.isfinite(c.bending_frequency):
        return ()
    ratio = (ROOTS[1] / ROOTS[0]) ** 2
    first = ((c.bending_frequency, c.bending_damping),)
    return first + ((c.bending_frequency * ratio, c.bending_damping),) * c.second_mode


def body_of(c: Conditions, key: KeyModel) -> Body:
    every = max(round(c.servo_period / c.step), 1)
    stiffness = c.servo_stiffness if np.isfinite(c.servo_stiffness) else 0.0
    damping = 2 * c.servo_damping * np.sqrt(stiffness * c.arm_mass)
    gains = [
        stiffness,
        stiffness * c.servo_integral,
        damping,
        c.encoder,
        every * c.step,
        c.servo_lag,
    ]
    transducer = c.tip_mass * (2 * np.pi * c.transducer_frequency) ** 2
    lossy = 2 * c.transducer_damping * np.sqrt(transducer * c.tip_mass)
    pad = c.pad_stiffness * (c.pad_stiffness / 0.5) ** (c.pad_exponent - 1)
    loss = 2 * c.pad_loss * np.sqrt(c.pad_stiffness * c.tip_mass)
    return Body(
        c.arm_mass,
        c.arm_mass + c.tip_mass + c.inertia / c.inertia_factor / c.press_arm**2,
        every,
        np.array(gains),
        np.array([transducer, lossy, c.tip_mass]),
        np.array([pad, c.pad_exponent, loss, c.finger_friction, c.surface_height]),
        np.ascontiguousarray(key.mass),
        np.linalg.inv(key.mass),
        np.ascontiguousarray(key.stiffness),
        np.ascontiguousarray(key.damping),
        key.rotation,
        c.gravity_moment,
        np.array([c.pivot_coulomb, c.pivot_viscous]),
        key.at(-c.press_arm),
        key.at(c.back_arm),
        key.at(-c.laser_arm),
        np.array([c.rail_stiffness, c.rail_damping]),
        np.array([c.felt_stiffness, c.felt_damping, c.dip]),
    )


def string_modes(choir: Choir, step: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return shapes with inverse modal masses, exact propagators, and the residual compliance."""
    count = max(choir.modes, 1)
    k = np.arange(1, count + 1)
    at = np.sin(k * np.pi * choir.plucking_point / choir.string_length)
    density = choir.tension / (2 * choir.string_length * choir.frequency) ** 2
    mass = density * choir.string_length / 2
    omega = 2 * np.pi * choir.frequency * k
    residual = 1 / choir.string_stiffness - float(np.sum(at**2 / (mass * omega**2)))
    propagators = []
    for extra in (0.0, choir.damper_decay):
        decay = choir.decay * (1 + 0.02 * k**2) + extra
        damped = np.sqrt(omega**2 - decay**2)
        e, c, s = np.exp(-decay * step), np.cos(damped * step), np.sin(damped * step) / damped
        rows = [e * (c + decay * s), e * s, -e * omega**2 * s, e * (c - decay * s)]
        propagators.append(np.stack(rows, axis=-1))
    modal = np.stack([at, np.full(count, 1 / mass)], axis=-1)
    return modal, np.array(propagators), residual


def choirs_of(c: Conditions, key: KeyModel) -> Choirs:
    modal = [string_modes(each, c.step) for each in c.choirs]
    count = max(len(each[0]) for each in modal)
    if min(len(each[0]) for each in modal) < count:
        raise ValueError("choirs: the strings have different numbers of modes; give all the same")
    static = [static_pluck(each) for each in c.choirs]
    each_table = [table(each) for each in c.choirs]
    tables = np.zeros((len(each_table), *np.max([each.shape for each in each_table], axis=0)))
    for wider, powers in zip(tables, each_table, strict=True):
        wider[: powers.shape[0], : powers.shape[1]] = powers
    points = 400
    heights = [np.linspace(0, each.release_height, points) for each in static]
    return Choirs(
        np.array([key.at(each.arm) for each in c.choirs]),
        np.array(
            [
                [
                    each.arm,
                    c.jack_surface_height,
                    each.mass,
                    each.cloth_stiffness,
                    2 * each.cloth_damping * np.sqrt(each.cloth_stiffness * each.mass),
                    each.register_friction,
                    each.clearance,
                ]
                for each in c.choirs
            ]
        ),
        np.array(
            [
                [
                    p.equivalent_stiffness,
                    p.length,
                    p.length - p.overlap,
                    p.offset,
                    p.friction,
                    inner_place(p),
                ]
                for p in c.choirs
            ]
        ),
        tables,
        np.array([[m[2], float(each.modes == 0)] for m, each in zip(modal, c.choirs, strict=True)]),
        np.array([each[0] for each in modal]),
        np.array([each[1] for each in modal]),
        np.array(heights),
        np.array([np.interp(h, s.height, s.load) for h, s in zip(heights, static, strict=True)]),
        np.array([[each.damper_stiffness, each.damper_lift] for each in c.choirs]),
        np.array([[0.015, 0.15e-3] for _ in c.choirs]),
    )
