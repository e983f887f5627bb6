"""What the rig's model expects of the strings: where they are, and the shape of their forces."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats

TYPICAL = -0.23, -0.19, 0.6e-3
"""Quadratic and cubic term of the force, and m, height of the jack above contact at release, of a
plectrum that has no solution in the model."""
POINTS = 40
"""Points of a pluck to which its terms are fitted."""


@dataclass(frozen=True)
class Expected:
    """The strings of a rig."""

    contacts: Floats
    """m, rise of the first jack at contact with each string, increasing; shape (strings,)."""
    climbs: Floats
    """m, rise of the first jack from contact to release, in the same order."""
    bends: tuple[float, float]
    """Dimensionless, mean over the strings: a string's force over that at release is
    u + q u(u - 1) + c u(u - 1)(u - 1/2) with u the rise since contact, 1 at release; q and c."""


def expected(rig: Rig) -> Expected:
    """Return what the rig's model expects; typical shapes where the model has no solution."""
    key, every = rig.key, choirs(rig)
    terms = np.array([_terms(choir) for choir in every])  # pyright: ignore[reportArgumentType]
    contacts, climbs = [], []
    for choir, height in zip(every, terms[:, 2], strict=True):
        lever, clearance = key_of(rig, choir), choir.jack.string_clearance
        angles = angle_of_rise(lever, np.array([clearance, clearance + height]))
        contact, release = rise_of_angle(key, angles)
        contacts.append(contact)
        climbs.append(release - contact)
    order = np.argsort(contacts)
    bends = terms[:, :2].mean(0)
    return Expected(
        np.array(contacts)[order], np.array(climbs)[order], (float(bends[0]), float(bends[1]))
    )


@lru_cache(maxsize=256)
def _terms(choir: Choir) -> tuple[float, float, float]:
    """Return the quadratic and cubic term of a choir's force, and the height [m] of its pluck."""
    try:
        pluck = choir_pluck(choir)
    except ModelError:
        return TYPICAL
    u = np.linspace(0.0, 1.0, POINTS)
    force = pluck.force_on_jack(u * pluck.release_height)
    columns = np.stack([u * (u - 1), u * (u - 1) * (u - 0.5)], 1)
    terms = np.linalg.lstsq(columns, force / force[-1] - u, rcond=None)[0]
    return float(terms[0]), float(terms[1]), pluck.release_height
