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


def fit_release(
    rig: Rig, duration: float | None = None, v_osc: float | None = None, level: str = "elastica"
) -> Release:
    """Return the rig with the overlap that gives a scalar, or with the Young's modulus for both.

    Args:
        rig: The bench; all other values are kept.
        duration: s, from contact to release.
        v_osc: m/s, initial string velocity, all modes.
        level: Of the plectrum.

    Raises:
        ModelError: Nothing gives them within the level's range.
    """
    _check_positive(duration=duration, v_osc=v_osc)
    plectrum, stiffness = string_map(rig.plectrum, rig.string, level), rig.string.static_stiffness
    height = None if duration is None else duration * rig.press.jack_speed
    lift = None if v_osc is None else v_osc / release_speed(rig.string, 1.0)
    # Parts of the string's lift and of the tip's deflection in the height [m] to be reached.
    if height is not None and lift is not None:
        of_lift, of_drop, target = 0.0, 1.0, height - lift
    elif height is not None:
        of_lift, of_drop, target = 1.0, 1.0, height
    elif lift is not None:
        of_lift, of_drop, target = 1.0, 0.0, lift
    else:
        raise ModelError("release: nothing to fit; give a duration, a speed or both")

    def beyond(load: Floats) -> Floats:
        drop = -plectrum.bend(plectrum.length, load).z
        lifted = load * _at_tip(plectrum, load)[2] / stiffness
        return of_lift * lifted + of_drop * drop - target

    asked = {"a height": height, "a lift": lift}
    what = " and ".join(f"{n} of {v * 1e3:.4g} mm" for n, v in asked.items() if v is not None)
    load = _solve(beyond, float(plectrum.force_limit(plectrum.length)), f"{what} at release")
    x, out, up = map(float, _at_tip(plectrum, load))
    force = load if height is None or lift is None else stiffness * lift / up
    changed = {
        "plectrum.overlap": plectrum.length - x + force * out / stiffness,
        "plectrum.youngs_modulus": rig.plectrum.youngs_modulus * force / load,
    }
    fitted = rig.replaced(changed)
    found = release_as_is(fitted, level)
    height = force * up / stiffness - float(plectrum.bend(plectrum.length, load).z)
    if abs(found.pluck.release_height - height) > SAME * height:
        raise ModelError(
            f"plectrum.overlap: at {found.overlap * 1e3:.6g} mm and a bending stiffness of"
            f" {found.bending_stiffness:.4g} N m^2 the string is released before it"
            " reaches the tip; use a shorter duration or a lower speed"
        )
    return found


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


def _check_positive(**values: float | None) -> None:
    units = {"duration": "s", "v_osc": "m/s"}
    faults = [
        f"{name}: {value:.4g} {units[name]} must be finite and above 0 {units[name]}; change it"
        for name, value in values.items()
        if value is not None and not 0 < value < np.inf
    ]
    if faults:
        raise ModelError("\n".join(faults))
