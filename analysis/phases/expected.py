"""What the rig's model expects of the strings: where they are, and the shape of their forces."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of
from sautereau.rig.instrument import Choir, Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats

TYPICAL = -0.23, -0.19, 0.6e-3, 1.0
"""Values for a plectrum for which the model has no solution: quadratic and cubic term of the force;
height of the jack above contact at release [m]; force at release [N]."""
POINTS = 40  # Points of a pluck to which the terms of its force are fitted
SHAPE_STD = 0.12, 0.4
"""Standard deviations of the quadratic and cubic term of a string's force (`Expected.bends`) from
those of the rig: wide enough for a friction of the plectrum of up to 0.4, of which the rig says
nothing, so that the data determine the shape."""
OVERLAP = 1.25  # Overlap and modulus over those of the rig, for derivatives by them
CONTACT_STD = 0.5e-3  # m, standard deviation of a contact from that of the rig
CLIMB_STD = 0.4
"""Standard deviation of the logarithm of the rise from contact to release from that of the rig."""
FORCE_STD = 0.5  # Standard deviation of the logarithm of a force from that of the rig
MOST_DEVIATION = 4.0
"""Bound of a deviation in standard deviations, as a rig may be of another instrument."""
CLEARANCE_STD, OVERLAP_STD, MODULUS_STD = 0.1e-3, 0.15, 0.15
"""m and relative, standard deviations of each string's own errors in the rig."""
LEAST_OWN_STD = 0.08  # Least standard deviation of the logarithms of a string's rise and force
LEAST_CLIMB, LEAST_FORCE = 1e-5, 1e-9
"""m and N, smallest rise and force of which the logarithm is taken."""


@dataclass(frozen=True)
class Expected:
    """The strings of a rig."""

    contacts: Floats
    """m, rise of the first jack at contact with each string, increasing; shape (strings,)."""
    climbs: Floats
    """m, rise of the first jack from contact to release, in the same order."""
    forces: Floats
    """N at the finger, at release, in the same order."""
    bends: tuple[float, float]
    """Dimensionless, mean over the strings: a string's force over that at release is
    u + q u(u - 1) + c u(u - 1)(u - 1/2) with u the rise since contact, 1 at release; q and c."""
    numbers: tuple[int, ...]
    """Numbers of the strings in the rig, from 1, in the same order."""
    variations: Floats
    """Covariances of contact [m] and the logarithms of climb and force by each string's own errors,
    in the same order; shape (strings, 3, 3)."""
    damper: tuple[float, float]
    """m, rise of the jack at which the damper leaves the string, and N at the finger, by which it
    carries the jack at rest; both 0 without a damper."""

    def place_deviations(self, contacts: Floats, climbs: Floats) -> Floats:
        """Return how far plucks are from each string, in standard deviations.

        Args:
            contacts: m, rise of the first jack at contact, shape (...).
            climbs: m, its rise from contact to release, shape (...).

        Returns:
            Deviations of contact and climb, shape (..., strings, 2).
        """
        of_contact = (contacts[..., None] - self.contacts) / CONTACT_STD
        climbed = np.maximum(climbs, LEAST_CLIMB)[..., None]
        return np.stack([of_contact, np.log(climbed / self.climbs) / CLIMB_STD], -1)

    def deviations(self, contacts: Floats, releases: Floats) -> Floats:
        """Return the deviations of a press's plucks from the strings, in standard deviations.

        They are those of contacts, and of rises from contact to release. Each is bounded by
        `MOST_DEVIATION`, which is also the deviation of a pluck for which the rig has no string.

        Args:
            contacts: m, rise of the first jack at contact, shape (..., plucks).
            releases: m, its rise at release, in the same order.

        Returns:
            Shape (..., 2 plucks).
        """
        count = contacts.shape[-1]
        order = np.argsort(contacts.reshape(math.prod(contacts.shape[:-1]), count), axis=1)
        number = np.arange(len(order))
        contact, release = (
            rises.reshape(order.shape)[number[:, None], order] for rises in (contacts, releases)
        )
        far = limited(self.place_deviations(contact, release - contact))
        each, string = _assignments(count, len(self.contacts))
        chosen = np.full((len(number), len(each), count, 2), MOST_DEVIATION)
        chosen[:, np.arange(len(each))[:, None], each] = far[:, each, string]
        best = np.argmin((chosen**2).sum((2, 3)), 1)
        return chosen[number, best].reshape(*contacts.shape[:-1], 2 * count)

    def force_deviations(self, force: float) -> Floats:
        """Return how far a force [N] is from that of each string, in standard deviations."""
        return np.log(max(force, LEAST_FORCE) / self.forces) / FORCE_STD


def limited(deviations: Floats) -> Floats:
    """Return deviations limited smoothly to `MOST_DEVIATION`."""
    return deviations / np.sqrt(1 + deviations**2 / MOST_DEVIATION**2)


@lru_cache
def _assignments(plucks: int, strings: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the ways to assign plucks to strings in order: indices, each (ways, pairs)."""
    pairs = min(plucks, strings)
    ways = [
        (each, string)
        for each in combinations(range(plucks), pairs)
        for string in combinations(range(strings), pairs)
    ]
    each, string = np.array(ways, np.intp).reshape(len(ways), 2, pairs).transpose(1, 0, 2)
    return each, string


def expected(rig: Rig) -> Expected:
    """Return what the rig's model expects; typical shapes where the model has no solution."""
    every = choirs(rig)
    levers = tuple(key_of(rig, choir) for choir in every)
    return _expected(rig.key, levers, every)  # pyright: ignore[reportArgumentType]


@lru_cache(maxsize=128)
def _expected(key: Key, levers: tuple[Key, ...], every: tuple[Choir, ...]) -> Expected:
    """Return what is expected of a key, its levers with the jacks of all choirs, and these."""
    terms = np.array([_terms(choir) for choir in every])
    contacts, climbs, forces = [], [], []
    for lever, choir, (_, _, height, force) in zip(levers, every, terms, strict=True):
        clearance = choir.jack.string_clearance
        angles = angle_of_rise(lever, np.array([clearance, clearance + height]))
        contact, release = rise_of_angle(key, angles)
        contacts.append(contact)
        climbs.append(release - contact)
        forces.append(float(force) * lever.jack_arm / lever.press_arm)
    order = np.argsort(contacts)
    bends = terms[:, :2].mean(0)
    return Expected(
        np.array(contacts)[order],
        np.array(climbs)[order],
        np.array(forces)[order],
        (float(bends[0]), float(bends[1])),
        tuple((order + 1).tolist()),
        np.stack([_own_variation(every[k]) for k in order]),  # pyright: ignore[reportArgumentType]
        _damper(key, every[0]),
    )


def _own_variation(choir: Choir) -> Floats:
    """Return the covariance of a string's contact [m], and of the logarithms of climb and force."""
    known = np.log(_terms(choir)[2:])
    slopes = np.zeros((3, 3))
    slopes[0, 0] = CLEARANCE_STD
    values = {"overlap": OVERLAP_STD, "youngs_modulus": MODULUS_STD}
    for column, (name, std) in enumerate(values.items(), 1):
        moved = np.log(_terms(choir, **{name: OVERLAP * getattr(choir.plectrum, name)})[2:])
        slopes[1:, column] = std * (moved - known) / math.log(OVERLAP)
    return slopes @ slopes.T + np.diag([0.0, LEAST_OWN_STD, LEAST_OWN_STD]) ** 2


def _damper(key: Key, choir: Choir) -> tuple[float, float]:
    """Return `Expected.damper`, for the choir of the key's first jack."""
    damper = choir.jack.damper
    if damper is None:
        return 0.0, 0.0
    return damper.lift, damper.stiffness * damper.lift * key.jack_arm / key.press_arm


def _terms(choir: Choir, **other: object) -> tuple[float, float, float, float]:
    """Return quadratic and cubic term of a choir's force; height [m] and force [N] at release.

    Args:
        other: Values of its plectrum to replace.
    """
    plectrum = choir.plectrum.model_copy(update=other)
    choir = choir.model_copy(update={"plectrum": plectrum})
    return _solved(choir)  # pyright: ignore[reportArgumentType]


@lru_cache(maxsize=256)
def _solved(choir: Choir) -> tuple[float, float, float, float]:
    """Return the terms of a choir."""
    try:
        pluck = choir_pluck(choir)
    except ModelError:
        return TYPICAL
    u = np.linspace(0.0, 1.0, POINTS)
    force = pluck.force_on_jack(u * pluck.release_height)
    columns = np.stack([u * (u - 1), u * (u - 1) * (u - 0.5)], 1)
    terms = np.linalg.lstsq(columns, force / force[-1] - u, rcond=None)[0]
    return float(terms[0]), float(terms[1]), pluck.release_height, float(force[-1])
