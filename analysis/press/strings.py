"""The vibration of the strings in a press: held by their plectra, free, stopped by their dampers.

A rig file does not state the decay rates of the modes. They follow from the drag of the air and
one quality factor: sigma_n = R_n / (2 mu) + pi f_n / Q, with the drag
R = 2 pi eta + 2 pi d sqrt(pi eta rho f) of a wire of diameter d (C. Valette, "The mechanics of
vibrating strings", in Mechanics of Musical Instruments, Springer 1995). Q stands for the losses in
metal, bridge and soundboard.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.modal_pluck import MODES, ModalPluck, modal_pluck
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.analysis.model.string.string import FreeString, ModalString, stretch
from sautereau.rig.instrument import Choir, String
from sautereau.rig.schema import Rig

AIR_VISCOSITY = 1.8e-5  # Viscosity of air at 20 degrees Celsius (Pa s)
AIR_DENSITY = 1.2  # Density of air at 20 degrees Celsius (kg/m^3)
QUALITY = 1500.0
"""Dimensionless quality factor of all losses except those to the air; assumed: with it the
string of `rig/paper.toml` decays by 60 dB in 6 s."""


@dataclass(frozen=True)
class VibratingString:
    """The string of one choir in one press; times in s after the jack leaves rest."""

    choir: Choir
    pluck: ModalPluck
    contact: float
    """s, of contact with the plectrum."""
    release: float
    """s, of release."""
    stilled: float = np.inf
    """s, at which the damper touches the string; infinite without a damper."""

    @property
    def string(self) -> ModalString:
        """The string's modes."""
        return self.pluck.string

    def displacement(self, time: ArrayLike, places: ArrayLike) -> Floats:
        """Return the displacement of the string along x and z [m], shape (2, n, m).

        It is zero before contact; while held, the string has the shape of a static force at the
        plucking point.

        Args:
            time: s, increasing, shape (n,).
            places: m, from the nut, shape (m,).
        """
        time, places = np.atleast_1d(np.asarray(time, float)), np.asarray(places, float)
        length, plucked = self.choir.string.length, self.choir.string.plucking_point
        corner = np.minimum(places / plucked, (length - places) / (length - plucked))
        found = self._held(time).T[:, :, None] * corner
        shapes = np.sin(np.outer(self.string.order, places) * np.pi / length)
        found[:, time >= self.release] = self._coordinates(time[time >= self.release]) @ shapes
        return found

    def bridge_force(self, time: ArrayLike) -> Floats:
        """Return the string's force [N] on the bridge along x and z, shape (n, 2).

        Args:
            time: s, increasing, shape (n,).
        """
        time = np.atleast_1d(np.asarray(time, float))
        string = self.choir.string
        found = self._held(time) * string.tension / (string.length - string.plucking_point)
        for free, start, end in self._free:
            during = (time >= start) & (time < end)
            found[during] = free.bridge_force(time[during] - start)
        return found

    def _held(self, time: Floats) -> Floats:
        """Return the displacement [m] of the plucking point while held, else 0; shape (n, 2)."""
        known = self.contact + self.pluck.time * (self.release - self.contact) / self.pluck.release
        return np.stack(
            [
                np.interp(time, known, moved, left=0.0, right=0.0)
                for moved in self.pluck.displacement.T
            ],
            -1,
        )

    def _coordinates(self, time: Floats) -> Floats:
        """Return the modal coordinates [m] at times after release, shape (2, n, modes)."""
        parts = [np.zeros((2, 0, len(self.string.order)))]
        for free, start, end in self._free:
            during = time[(time >= start) & (time < end)] - start
            parts.append(free.string.free(free.state, during).q)
        return np.concatenate(parts, axis=1)

    @cached_property
    def _free(self) -> list[tuple[FreeString, float, float]]:
        """Free vibrations, each with the times [s] of its start and its end."""
        parts = [(FreeString(self.string, self.pluck.state), self.release, self.stilled)]
        damper = self.choir.jack.damper
        if damper is None or not np.isfinite(self.stilled):
            return parts
        q, v = self.string.free(self.pluck.state, self.stilled - self.release)
        decay = self.string.decay + damper.decay
        width = self.choir.plectrum.width
        damped = ModalString(self.choir.string, len(self.string.order), decay, width)
        state = type(self.pluck.state)(q[:, 0], v[:, 0])
        return [*parts, (FreeString(damped, state), self.stilled, np.inf)]


def string_decay(string: String, modes: int, quality: float = QUALITY) -> Floats:
    """Return the decay rates [1/s] of the amplitudes of the lowest modes, shape (modes,).

    Args:
        quality: Dimensionless quality factor of all losses except those to the air.

    Raises:
        ModelError: The quality factor is not above 1.
    """
    if not quality > 1:
        raise ModelError(
            f"quality: {quality:.4g} must be above 1, and is about {QUALITY:g} for a metal string;"
            " raise it"
        )
    frequency = string.frequency * np.arange(1, modes + 1) * stretch(string, modes)
    layer = np.sqrt(np.pi * AIR_VISCOSITY * AIR_DENSITY * frequency)
    drag = 2 * np.pi * (AIR_VISCOSITY + string.diameter * layer)
    return drag / (2 * string.linear_density) + np.pi * frequency / quality


def vibrating_strings(
    rig: Rig, level: str = "auto", *, quality: float = QUALITY, highest: float | None = None
) -> tuple[VibratingString, ...]:
    """Return the vibration of every choir's string after its pluck, in the order of the choirs.

    Args:
        rig: The bench; its jack has a constant speed and leaves rest at time 0.
        quality: Dimensionless, see `string_decay`.
        highest: Hz, of the highest mode; None for the lowest 30 modes.

    Raises:
        ModelError: A choir has no pluck, or no mode below `highest`.
    """
    found = []
    for choir, plucked in zip(choirs(rig), predict(rig, level).choirs, strict=True):
        parts = {"jack": choir.jack, "plectrum": choir.plectrum, "string": choir.string}
        alone = rig.model_copy(update={**parts, "more_choirs": ()})
        speed = rig_pluck(alone, level).release_height / plucked.pluck_duration
        alone = alone.replaced({"press.jack_speed": speed})
        modes = MODES
        if highest is not None:
            modes = int(highest / choir.string.frequency)
            order = np.arange(1, modes + 1) * stretch(choir.string, modes)
            modes = int(np.sum(order <= highest / choir.string.frequency))
        decay = string_decay(choir.string, modes, quality)
        pluck = modal_pluck(alone, level, modes=modes, decay=decay, width=choir.plectrum.width)
        found.append(
            VibratingString(choir, pluck, plucked.contact, plucked.contact + pluck.release)
        )
    return tuple(found)


def stilled(string: VibratingString, time: float) -> VibratingString:
    """Return the string with a damper that touches it at a time [s].

    Raises:
        ModelError: The jack has no damper, or the damper would touch the string before release.
    """
    if string.choir.jack.damper is None:
        raise ModelError(
            "jack.damper: the rig has no damper, so the string keeps vibrating; add one to the rig,"
            " or omit the time of the damper"
        )
    if not time >= string.release:
        raise ModelError(
            f"the damper would touch the string at {time * 1e3:.4g} ms, before the release at"
            f" {string.release * 1e3:.4g} ms; choose a later time"
        )
    return replace(string, stilled=time)
