"""Young's modulus and overlap of the plectrum from two scalars: pluck duration and Vosc.

Vosc gives the string's lift at release and the duration the jack's height, so the tip's
deflection is known: Z(length, F) = lift - height. Every level's map depends on the force by
F / E alone (linear material), so the load F / E at release follows from the map as it is, F
from the lift, F cos(theta) = K lift without friction, and E from both; the overlap
follows from X and the string's position at rest. One unknown at a time, no iteration over plucks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.predict import rig_pluck
from sautereau.analysis.model.string.string import release_speed
from sautereau.rig.schema import Rig

SAME = 1e-6
"""Dimensionless tolerance on the height of a release."""


@dataclass(frozen=True)
class Release:
    """A rig and its pluck."""

    rig: Rig
    pluck: Pluck

    @property
    def overlap(self) -> float:
        """Overlap [m]."""
        return self.rig.plectrum.overlap

    @property
    def bending_stiffness(self) -> float:
        """Bending stiffness of the plectrum's main section [N m^2]."""
        return self.rig.plectrum.bending_stiffness

    @property
    def duration(self) -> float:
        """Pluck duration [s] at the rig's jack speed."""
        return self.pluck.release_height / self.rig.press.jack_speed

    @property
    def lift(self) -> float:
        """Displacement of the string at release [m], upwards."""
        return float(self.pluck.lift[-1])

    @property
    def v_osc(self) -> float:
        """Initial string velocity Vosc [m/s], all modes."""
        return release_speed(self.rig.string, self.lift)


def release_as_is(rig: Rig, level: str = "elastica") -> Release:
    """Return the release of the unchanged rig."""
    return Release(rig, rig_pluck(rig, level))


def fit_release(rig: Rig, duration: float, v_osc: float, level: str = "elastica") -> Release:
    """Return the rig with the Young's modulus and overlap that give both scalars.

    Args:
        rig: The bench; all other values are kept.
        duration: s, from contact to release.
        v_osc: m/s, initial string velocity, all modes.
        level: Of the plectrum.

    Raises:
        ModelError: No modulus and overlap give both within the level's range.
    """
    _check_positive(duration=duration, v_osc=v_osc)
    plectrum, stiffness = string_map(rig.plectrum, rig.string, level), rig.string.static_stiffness
    lift = v_osc / release_speed(rig.string, 1.0)
    drop = duration * rig.press.jack_speed - lift
    load = _solve(
        lambda force: -plectrum.bend(plectrum.length, force).z - drop,
        float(plectrum.force_limit(plectrum.length)),
        f"a height of {(drop + lift) * 1e3:.4g} mm and a lift of {lift * 1e3:.4g} mm at release"
        f" require a tip deflection of {drop * 1e3:.4g} mm",
    )
    x, out, up = _at_tip(plectrum, load)
    force = float(stiffness * lift / up)
    overlap = float(plectrum.length - x + force * out / stiffness)
    modulus = rig.plectrum.youngs_modulus * force / load
    return _checked(
        _with_plectrum(rig, overlap=overlap, youngs_modulus=modulus), level, drop + lift
    )


def overlap_for_duration(rig: Rig, duration: float, level: str = "elastica") -> Release:
    """Return the rig with the overlap that gives a pluck duration [s].

    Raises:
        ModelError: No overlap gives it within the level's range.
    """
    _check_positive(duration=duration)
    height = duration * rig.press.jack_speed
    return _at_release(rig, level, height, f"a height of {height * 1e3:.4g} mm at release", 1.0)


def overlap_for_speed(rig: Rig, v_osc: float, level: str = "elastica") -> Release:
    """Return the rig with the overlap that gives a Vosc [m/s, all modes].

    Raises:
        ModelError: No overlap gives it within the level's range.
    """
    _check_positive(v_osc=v_osc)
    lift = v_osc / release_speed(rig.string, 1.0)
    return _at_release(rig, level, lift, f"a lift of {lift * 1e3:.4g} mm at release", 0.0)


def _at_release(rig: Rig, level: str, target: float, what: str, part: float) -> Release:
    """Find the force at the tip for which lift - part * Z equals a target [m], and its overlap."""
    plectrum, stiffness = string_map(rig.plectrum, rig.string, level), rig.string.static_stiffness

    def beyond(force: Floats) -> Floats:
        _, _, up = _at_tip(plectrum, force)
        drop = -plectrum.bend(plectrum.length, force).z
        return force * up / stiffness + part * drop - target

    force = _solve(beyond, float(plectrum.force_limit(plectrum.length)), what)
    x, out, up = _at_tip(plectrum, force)
    height = float(force * up / stiffness - plectrum.bend(plectrum.length, force).z)
    overlap = float(plectrum.length - x + force * out / stiffness)
    return _checked(_with_plectrum(rig, overlap=overlap), level, height)


def _at_tip(plectrum: PlectrumMap, force: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return X [m] of the loaded tip, and the fractions of F on the string outwards and upwards."""
    bend = plectrum.bend(plectrum.length, force)
    sine, cosine = np.sin(bend.theta), np.cos(bend.theta)
    friction = plectrum.friction
    return bend.x, -sine - friction * cosine, cosine - friction * sine


def _solve(beyond, limit: float, what: str) -> float:
    """Return the smallest force [N] at which a function changes to positive values."""
    from scipy.optimize import root_scalar

    forces = np.linspace(0.0, limit, 200)
    above = beyond(forces) >= 0
    if above[0] or not above.any():
        raise ModelError(
            f"{what}: no force up to {limit:.4g} N, where this level's range ends, gives it;"
            " change the duration, the speed or the plectrum"
        )
    first = int(np.argmax(above))
    return float(root_scalar(beyond, bracket=(forces[first - 1], forces[first])).root)


def _checked(rig: Rig, level: str, height: float) -> Release:
    """Return the release of a rig, which must be at the tip and at a height [m]."""
    found = release_as_is(rig, level)
    if abs(found.pluck.release_height - height) > SAME * height:
        raise ModelError(
            f"plectrum.overlap: at {rig.plectrum.overlap * 1e3:.6g} mm and a bending stiffness of"
            f" {rig.plectrum.bending_stiffness:.4g} N m^2 the string is released before it"
            " reaches the tip; use a shorter duration or a lower speed"
        )
    return found


def _with_plectrum(rig: Rig, **changes: float) -> Rig:
    return rig.model_copy(update={"plectrum": rig.plectrum.model_copy(update=changes)})


def _check_positive(**values: float) -> None:
    units = {"duration": "s", "v_osc": "m/s"}
    faults = [
        f"{name}: {value:.4g} {units[name]} must be finite and above 0 {units[name]}; change it"
        for name, value in values.items()
        if not 0 < value < np.inf
    ]
    if faults:
        raise ModelError("\n".join(faults))
