"""Frequencies of the strings of a rig, free and held by their plectra."""

import numpy as np
from scipy.optimize import brentq

from sautereau.rig.instrument import Choir
from sautereau.trajectory.motion import Floats

GRID = 40  # Intervals per free partial in which roots are searched


def free_frequencies(choir: Choir, highest: float) -> Floats:
    """Return the partials of the ideal string up to a frequency [Hz], shape (n,)."""
    fundamental = choir.string.frequency
    return fundamental * np.arange(1, int(highest / fundamental) + 1, dtype=float)


def held_frequencies(choir: Choir, highest: float) -> Floats:
    """Return the frequencies [Hz] of the string on its plectrum, up to a frequency; shape (n,).

    An ideal string with a spring k at the plucking point a: the slope changes there by k / T times
    the displacement, so T p sin(p L) + k sin(p a) sin(p (L - a)) = 0 with p = w / c (P. Morse,
    Vibration and Sound, 1948, section 9). k = 3 EI / s^3 is the tip stiffness of a uniform
    plectrum that touches the string at s, its length minus the overlap.
    """
    string, plectrum = choir.string, choir.plectrum
    section = plectrum.width * plectrum.thickness**3 / 12
    length = plectrum.length - plectrum.overlap
    stiffness = 3 * plectrum.youngs_modulus * section / length**3
    whole, part = string.length, string.plucking_point

    def condition(frequency: float) -> float:
        p = np.pi * frequency / (string.frequency * whole)
        return float(
            string.tension * p * np.sin(p * whole)
            + stiffness * np.sin(p * part) * np.sin(p * (whole - part))
        )

    count = max(2, int(GRID * highest / string.frequency))
    grid = np.linspace(0.3 * string.frequency, highest, count)
    values = np.array([condition(f) for f in grid])
    places = np.flatnonzero(values[1:] * values[:-1] < 0)
    return np.array([brentq(condition, grid[i], grid[i + 1]) for i in places], dtype=float)
