"""The strings of a press as they sound: held by their plectra, swinging, stilled by their dampers.

What a mode loses a second is not in a rig. It is taken from the air and one quality factor:
sigma_n = R_n / (2 mu) + pi f_n / Q, with the drag R = 2 pi eta + 2 pi d sqrt(pi eta rho f) of a
wire of diameter d (C. Valette, "The mechanics of vibrating strings", in Mechanics of Musical
Instruments, Springer 1995). Q stands for all that metal, bridge and soundboard take.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.analysis.model.string.free import FreeString
from sautereau.analysis.model.string.modal import MODES, ModalPluck, modal_pluck
from sautereau.analysis.model.string.string import ModalString
from sautereau.rig.instrument import Choir, String
from sautereau.rig.schema import Rig

AIR_VISCOSITY, AIR_DENSITY = 1.8e-5, 1.2
"""Pa s and kg/m^3, at 20 degrees."""
QUALITY = 1500.0
"""1, quality factor of what a string loses to all but the air; assumed: with it the string of
`rig/paper.toml` falls by 60 dB in 6 s."""


@dataclass(frozen=True)
class Sounding:
    """One choir's string in one press; times in s on the press's own clock."""

    choir: Choir
    pluck: ModalPluck
    contact: float
    """s, when the plectrum meets the string."""
    release: float
    """s, when the string is let go."""
    stilled: float = np.inf
    """s, when the damper comes down on it; infinite where it does not."""

    @property
    def string(self) -> ModalString:
        """The string's modes."""
        return self.pluck.string

    def displacement(self, time: ArrayLike, places: ArrayLike) -> Floats:
        """Return where the string is along x and z [m], shape (2, n, m); at rest till contact.

        The held string is bent as by a steady force at the plucking point.

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
        for swing, begin, end in self._swings:
            during = (time >= begin) & (time < end)
            found[during] = swing.bridge_force(time[during] - begin)
        return found

    def _held(self, time: Floats) -> Floats:
        """Return the displacement [m] of the plucking point while it is held, else 0; (n, 2)."""
        known = self.contact + self.pluck.time * (self.release - self.contact) / self.pluck.release
        return np.stack(
            [
                np.interp(time, known, moved, left=0.0, right=0.0)
                for moved in self.pluck.displacement.T
            ],
            -1,
        )

    def _coordinates(self, time: Floats) -> Floats:
        """Return the modes' coordinates [m] at times after release, shape (2, n, modes)."""
        parts = [np.zeros((2, 0, len(self.string.order)))]
        for swing, begin, end in self._swings:
            during = time[(time >= begin) & (time < end)] - begin
            parts.append(swing.string.free(swing.state, during).q)
        return np.concatenate(parts, axis=1)

    @cached_property
    def _swings(self) -> list[tuple[FreeString, float, float]]:
        """Free strings with the times [s] from and to which each of them swings."""
        swings = [(FreeString(self.string, self.pluck.state), self.release, self.stilled)]
        damper = self.choir.jack.damper
        if damper is None or not np.isfinite(self.stilled):
            return swings
        q, v = self.string.free(self.pluck.state, self.stilled - self.release)
        decay = self.string.decay + damper.decay
        damped = ModalString(self.choir.string, len(self.string.order), decay)
        state = type(self.pluck.state)(q[:, 0], v[:, 0])
        return [*swings, (FreeString(damped, state), self.stilled, np.inf)]


def string_decay(string: String, modes: int, quality: float = QUALITY) -> Floats:
    """Return at what rates [1/s] the amplitudes of the lowest modes fall, shape (modes,).

    Args:
        string: The string.
        modes: Their number.
        quality: 1, quality factor of all losses but the air's.

    Raises:
        ModelError: The quality factor is not above 1, with which nothing would sound.
    """
    if not quality > 1:
        raise ModelError(
            f"quality: {quality:.4g} must be above 1, and is some {QUALITY:g} for a metal string;"
            " raise it"
        )
    frequency = string.frequency * np.arange(1, modes + 1)
    layer = np.sqrt(np.pi * AIR_VISCOSITY * AIR_DENSITY * frequency)
    drag = 2 * np.pi * (AIR_VISCOSITY + string.diameter * layer)
    return drag / (2 * string.linear_density) + np.pi * frequency / quality


def soundings(
    rig: Rig,
    level: str = "elastica",
    *,
    quality: float = QUALITY,
    highest: float | None = None,
) -> tuple[Sounding, ...]:
    """Pluck every choir of a rig at its own jack's speed, in the order of the choirs.

    Args:
        rig: The bench; the press is at its constant speed, with time 0 where the jack rises.
        level: Of the plectra.
        quality: 1, see `string_decay`.
        highest: Hz, up to which modes move; None for the lowest 30.

    Raises:
        ModelError: A choir has no pluck, or no mode is as low as that.
    """
    found = []
    for choir, plucked in zip(choirs(rig), predict(rig, level).choirs, strict=True):
        parts = {"jack": choir.jack, "plectrum": choir.plectrum, "string": choir.string}
        alone = rig.model_copy(update={**parts, "more_choirs": ()})
        speed = rig_pluck(alone, level).release_height / plucked.pluck_duration
        press = rig.press.model_copy(update={"jack_speed": speed})
        alone = alone.model_copy(update={"press": press})
        modes = MODES if highest is None else int(highest / choir.string.frequency)
        decay = string_decay(choir.string, modes, quality)
        pluck = modal_pluck(alone, level, modes=modes, decay=decay)
        found.append(Sounding(choir, pluck, plucked.contact, plucked.contact + pluck.release))
    return tuple(found)


def stilled(sounding: Sounding, time: float) -> Sounding:
    """Return the string with its damper coming down on it at a time [s].

    Raises:
        ModelError: The jack has no damper, or it would come down before the string is let go.
    """
    if sounding.choir.jack.damper is None:
        raise ModelError(
            "jack.damper: the rig describes none, so the string swings on; add one, or let it swing"
        )
    if not time >= sounding.release:
        raise ModelError(
            f"the damper comes down at {time * 1e3:.4g} ms, before the string is let go at"
            f" {sounding.release * 1e3:.4g} ms; let it come later"
        )
    return replace(sounding, stilled=time)
