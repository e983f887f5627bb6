"""What the rig's model expects of the strings: where they are, and the shape of their forces."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of
from sautereau.analysis.phases.settings import SETTINGS, PhaseSettings
from sautereau.rig.instrument import Choir, Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats

TYPICAL = -0.23, -0.19, 0.6e-3, 1.0
"""Values for a plectrum for which the model has no solution: quadratic and cubic term of the force;
height of the jack above contact at release [m]; force at release [N]."""
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
    settings: PhaseSettings
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
        of_contact = (contacts[..., None] - self.contacts) / self.settings.contact_std
        climbed = np.maximum(climbs, LEAST_CLIMB)[..., None]
        return np.stack([of_contact, np.log(climbed / self.climbs) / self.settings.climb_std], -1)

    def deviations(self, contacts: Floats, releases: Floats) -> Floats:
        """Return the deviations of a press's plucks from the strings, in standard deviations.

        They are those of contacts, and of rises from contact to release. Each has a bound
        (`limited`), which is also the deviation of a pluck for which the rig has no string.

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
        far = self.limited(self.place_deviations(contact, release - contact))
        each, string = _assignments(count, len(self.contacts))
        chosen = np.full((len(number), len(each), count, 2), self.settings.most_deviation)
        chosen[:, np.arange(len(each))[:, None], each] = far[:, each, string]
        best = np.argmin((chosen**2).sum((2, 3)), 1)
        return chosen[number, best].reshape(*contacts.shape[:-1], 2 * count)

    def force_deviations(self, force: float) -> Floats:
        """Return how far a force [N] is from that of each string, in standard deviations."""
        return np.log(max(force, LEAST_FORCE) / self.forces) / self.settings.force_std

    def limited(self, deviations: Floats) -> Floats:
        """Return deviations limited smoothly to `PhaseSettings.most_deviation`."""
        return deviations / np.sqrt(1 + (deviations / self.settings.most_deviation) ** 2)


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


def expected(rig: Rig, settings: PhaseSettings = SETTINGS) -> Expected:
    """Return what the rig's model expects; typical shapes where the model has no solution."""
    every = choirs(rig)
    levers = tuple(key_of(rig, choir) for choir in every)
    return _expected(rig.key, levers, every, settings)  # pyright: ignore[reportArgumentType]


@lru_cache(maxsize=128)
def _expected(
    key: Key, levers: tuple[Key, ...], every: tuple[Choir, ...], settings: PhaseSettings
) -> Expected:
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
    damper = 0.0, 0.0
    if (of_first := every[0].jack.damper) is not None:
        load = of_first.stiffness * of_first.lift * key.jack_arm / key.press_arm
        damper = of_first.lift, load
    order = np.argsort(contacts)
    bends = terms[:, :2].mean(0)
    return Expected(
        np.array(contacts)[order],
        np.array(climbs)[order],
        np.array(forces)[order],
        (float(bends[0]), float(bends[1])),
        tuple((order + 1).tolist()),
        np.stack([_own_variation(every[k]) for k in order]),  # pyright: ignore[reportArgumentType]
        settings,
        damper,
    )


def _own_variation(choir: Choir) -> Floats:
    """Return the covariance of a string's contact [m], and of the logarithms of climb and force."""
    known = np.log(_terms(choir)[2:])
    slopes = np.zeros((3, 3))
    slopes[0, 0] = 0.1e-3  # m, standard deviation of the clearance
    for column, name in enumerate(("overlap", "youngs_modulus"), 1):
        moved = np.log(_terms(choir, **{name: 1.25 * getattr(choir.plectrum, name)})[2:])
        slopes[1:, column] = 0.15 * (moved - known) / math.log(1.25)  # of 15 % of either
    return slopes @ slopes.T + np.diag([0.0, 0.08, 0.08]) ** 2  # and 8 % of rise and force


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
    u = np.linspace(0.0, 1.0, 40)
    force = pluck.force_on_jack(u * pluck.release_height)
    columns = np.stack([u * (u - 1), u * (u - 1) * (u - 0.5)], 1)
    terms = np.linalg.lstsq(columns, force / force[-1] - u, rcond=None)[0]
    return float(terms[0]), float(terms[1]), pluck.release_height, float(force[-1])
