"""Taps on the key of the independent simulator."""

import numpy as np
from scipy.signal import cont2discrete, dlsim

from benchmarks.independent.assembly import key_model

RATE, TAPS = 20e3, 6


def tapped(conditions, seed, noise=5e-5):
    """Return force and velocity of a tapped key on its rail, and its eigenvalues [1/s]."""
    key, random = key_model(conditions), np.random.default_rng(seed)
    rail, press, laser = (key.at(x) for x in (conditions.back_arm, -0.171, -0.082))
    stiffness = key.stiffness + 2e5 * np.outer(rail, rail)
    damping = key.damping + 20.0 * np.outer(rail, rail)
    n, inverse = len(rail), np.linalg.inv(key.mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.concatenate([np.zeros(n), -inverse @ press])[:, None]
    c = np.concatenate([np.zeros(n), -laser])[None]
    time = np.arange(round(TAPS * 0.4 * RATE)) / RATE
    force = np.zeros(len(time))
    for k in range(TAPS):
        since = (time - 0.05 - 0.4 * k) / random.uniform(0.6e-3, 1.2e-3)
        force += random.uniform(0.3, 1.0) * np.sin(np.pi * since) * ((since > 0) & (since < 1))
    discrete = cont2discrete((a, b, c, np.zeros((1, 1))), 1 / RATE, method="foh")
    velocity = dlsim(discrete, force)[1][:, 0]
    force = force + 2e-3 * random.standard_normal(len(time))
    return (force, velocity + noise * random.standard_normal(len(time))), np.linalg.eigvals(a)
