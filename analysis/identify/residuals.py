"""Inverse-dynamics residuals of presses: force at every instant, rise at every release."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sautereau.analysis.identify.elastic import Bending, modes_of, noise_gain, shortest_record
from sautereau.analysis.identify.observed import Observed
from sautereau.analysis.identify.parameters import (
    CHOIR,
    DAMPER,
    DAMPER_LIFT,
    FINGERTIP,
    FOOT,
    FORCE_GAIN,
    LATE_SLIDING,
    RELEASE,
    SLIDING,
    TIME,
    VELOCITY_GAIN,
    Parameter,
    with_parameters,
)
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.rig.instrument import Choir, Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats, Motion

MODEL_STD = 5e-4
"""Dimensionless, accuracy of the model over the largest force. Without noise, smaller errors of the
model would be taken for those of the calibrations."""
BESIDE_STRINGS = {
    *(SLIDING, LATE_SLIDING, RELEASE, FINGERTIP, "key.gravity_moment", "jack.register_friction"),
    *("key.pivot_coulomb_friction", "key.pivot_viscous_friction"),
}
"""Parameters that change neither the strings' forces nor the bending of the key."""
BESIDE_RIGID = {FORCE_GAIN, "key.inertia", "jack.mass"}
"""Those that do not where the key is rigid."""
KEPT = 3
"""Number of points whose strings are kept: most derivatives leave them as they are."""


class InverseDynamics:
    """The inverse dynamics of recorded presses as a function of the parameters.

    The equation of motion is evaluated for the measured motion, without integrating it; a string
    is held until its measured release.

    Args:
        rig: The bench; parameters that are not free keep its values.
        free: The free parameters.
        presses: The recordings.
        level: Of the plectrum model.
    """

    def __init__(
        self, rig: Rig, free: Sequence[Parameter], presses: Sequence[Observed], level: str
    ):
        self.rig, self.free, self.presses, self.level = rig, tuple(free), tuple(presses), level
        self._held: dict[tuple[float, ...], list[_Held]] = {}
        self._nominal, self._record = _inertia_over_arm(rig), shortest_record(presses)

    def with_free(self, free: Sequence[Parameter]) -> "InverseDynamics":
        """Return the same dynamics with other free parameters."""
        return InverseDynamics(self.rig, free, self.presses, self.level)

    @cached_property
    def floor(self) -> float:
        """N, smallest scale of the force residuals: the accuracy of the model, not of the data."""
        return MODEL_STD * max(float(np.abs(p.force()[p.used]).max()) for p in self.presses)

    @property
    def noise(self) -> float | None:
        """N, RMS of the load on the key at rest, with the rig's inertia; None without a rest."""
        noises = [p.noise.of_load(self._nominal) for p in self.presses if p.noise is not None]
        return float(np.sqrt(np.mean(np.square(noises)))) if noises else None

    @property
    def rise_stds(self) -> Floats:
        """m, uncertainty of the rise at each release of the model; shape (releases,)."""
        count = len(choirs(self.rig))
        return np.concatenate([press.release_stds[:count] for press in self.presses])

    def residuals(self, point: Floats) -> tuple[list[Floats], Floats]:
        """Return measured minus modelled values.

        Args:
            point: Values of the parameters [SI].

        Returns:
            Forces [N] at the fitted instants of each press, of a compliant key scaled so that
            their noise is that of the rig's rigid one; and the rises at all releases in units of
            their standard uncertainties.

        Raises:
            ModelError: The model has no solution there.
        """
        values = dict(zip((p.name for p in self.free), point.tolist(), strict=True))
        rig, lag = with_parameters(self.rig, values), values.get(TIME, 0.0)
        force_gain, gain = values.get(FORCE_GAIN, 1.0), values.get(VELOCITY_GAIN, 1.0)
        sliding = values.get(SLIDING, 0.0), values.get(LATE_SLIDING, 0.0)
        strings = _strings(
            rig, self.level, values, rig.plectrum.friction - self.rig.plectrum.friction
        )
        modes = modes_of(values)
        inertia, amplified = _inertia_over_arm(rig), noise_gain(modes, self._record)
        modelled = rise_of_angle(rig.key, np.array([string.release for string in strings]))
        forces, rises = [], []
        for press, held in zip(self.presses, self._all_held(rig, strings, values), strict=True):
            count = min(len(strings), len(press.release_angles))
            measured = rise_of_angle(rig.key, gain * press.release_angles[:count])
            measured = measured - press.release_speeds[:count] * lag + held.yielded[:count]
            motion = Motion(
                *(gain * m - bent for m, bent in zip(press.motion, held.bent, strict=True))
            )
            # In units of the measured force, whose noise is the same for every gain.
            force, seen = finger_force(rig, motion, held.forces), held.seen
            slid = seen * (sliding[0] * seen + sliding[1] * press.late_force)
            residual = (seen + slid - force / force_gain)[press.used]
            if modes and press.noise is not None:
                # Otherwise the parameters that hide the noise fit best: a small inertia.
                noises = press.noise.of_load(self._nominal), press.noise.of_load(inertia, amplified)
                stated, own = np.hypot(noises, self.floor)
                residual *= stated / own
            forces.append(residual)
            rises.append((measured - modelled[:count]) / press.release_stds[:count])
        return forces, np.concatenate(rises)

    def _all_held(
        self, rig: Rig, strings: "Sequence[_String]", values: Mapping[str, float]
    ) -> "list[_Held]":
        """Return the strings of all presses, computed once for all points that share them."""
        modes = modes_of(values)
        beside = BESIDE_STRINGS if modes else BESIDE_STRINGS | BESIDE_RIGID
        own = tuple(value for name, value in values.items() if name not in beside)
        found = self._held.pop(own, None)
        if found is None:
            found = [_held(rig, strings, press, values) for press in self.presses]
        self._held[own] = found
        if len(self._held) > KEPT:
            self._held.pop(next(iter(self._held)))
        return found


def _inertia_over_arm(rig: Rig) -> float:
    """Return the inertia [kg m] of the key with its jacks over the lever arm of the finger."""
    jacks = sum(choir.jack.mass * choir.jack_arm**2 for choir in choirs(rig))
    return (rig.key.inertia + jacks) / rig.key.press_arm


@dataclass(frozen=True)
class _String:
    """A choir's string with the values of the parameters."""

    number: int
    """Of the choir."""
    choir: Choir
    key: Key
    """With the lever arm of the choir's jack."""
    pluck: Pluck
    release: float
    """rad, angle of the key at its release."""


@dataclass(frozen=True)
class _Held:
    """What strings and modes do in one press; arrays at its n instants."""

    seen: Floats
    """N, measured force, shape (n,)."""
    forces: Floats
    """N, of the strings on the jacks, smoothed, shape (choirs, n)."""
    bent: Floats
    """rad, what modes add to the key's angle, with its derivatives, smoothed; shape (3, n)."""
    yielded: Floats
    """m, what the first jack rises more at each release than it would on a rigid key."""


def _strings(rig: Rig, level: str, values: Mapping[str, float], friction: float) -> list[_String]:
    """Return the strings in the order of their release.

    Args:
        rig: With the values of the parameters.
        level: Of the plectrum model.
        values: Of the parameters, by name.
        friction: By which the fitted friction of the first plectrum exceeds that of the rig.
    """
    found = []
    for number, stated in enumerate(choirs(rig)):
        choir = _further(stated, number, values, friction) if number else stated
        key, pluck = key_of(rig, choir), choir_pluck(choir, level)
        late = 1 + values.get(RELEASE, 0.0)
        height = choir.jack.string_clearance + late * pluck.release_height
        found.append(_String(number, choir, key, pluck, float(angle_of_rise(key, height))))
    return sorted(found, key=lambda string: string.release)


def _further(choir: Choir, number: int, values: Mapping[str, float], friction: float) -> Choir:
    """Return a further choir with the values of its parameters; it rubs like the first."""
    names = [name.format(number) for name in CHOIR]
    if names[0] not in values:
        return choir
    stiffness, overlap, clearance = (values[name] for name in names)
    plectrum, jack = choir.plectrum, choir.jack
    changed = {
        "youngs_modulus": stiffness * plectrum.youngs_modulus,
        "overlap": min(overlap * plectrum.overlap, 0.9 * plectrum.length),
        "friction": max(0.0, plectrum.friction + friction),
    }
    higher = {"string_clearance": jack.string_clearance + clearance}
    return choir.model_copy(
        update={
            "plectrum": plectrum.model_copy(update=changed),
            "jack": jack.model_copy(update=higher),
        }
    )


def _held(
    rig: Rig, strings: Sequence[_String], press: Observed, values: Mapping[str, float]
) -> _Held:
    """Return what strings and modes do in one press; a string is held until it is released."""
    lag, foot, modes = values.get(TIME, 0.0), values.get(FOOT, 0.0), modes_of(values)
    angle = values.get(VELOCITY_GAIN, 1.0) * press.part_angle
    releases, key, damped = press.releases - lag, rig.key, values.get(DAMPER, 0.0)
    higher = values[DAMPER_LIFT] - rig.jack.damper.lift if rig.jack.damper and damped else 0.0

    def forces(rigid: Floats, rise: Floats | float, pushed: Floats) -> Floats:
        """Return the forces [N] of strings and dampers on the jacks; shape (choirs, n).

        A string that is held beyond the modelled release keeps its force: so the residual is
        smooth in the parameters, and the release enters by its rise.
        """
        found = np.zeros_like(pushed)
        for at, string in enumerate(strings):
            choir, own = string.choir, found[string.number]
            height = rise_of_angle(string.key, rigid) + choir.jack_arm * rise
            height = height - foot * pushed[string.number]
            if at < len(releases):
                last = int(np.searchsorted(press.part_time, releases[at]))
                bent = height[:last] - choir.jack.string_clearance
                bent = np.minimum(bent, string.pluck.release_height)
                own[:last] = string.pluck.force_on_jack(bent)
            if damped and (damper := choir.jack.damper) is not None:
                lift = damper.lift + higher
                own -= damped * damper.stiffness * np.maximum(lift - height, 0.0)
        return found

    pushing = forces(angle, 0.0, np.zeros((len(strings), len(angle))))
    if not modes:
        smooth = np.stack([press.smoothed(force) for force in pushing])
        still = np.zeros((3, len(press.time))), np.zeros(len(releases))
        return _Held(press.force(lag), smooth, *still)
    every = choirs(rig)
    arms = np.array([choir.jack_arm for choir in every])
    inertia = _inertia_over_arm(rig) * key.press_arm
    gain = values.get(FORCE_GAIN, 1.0)
    bending = Bending(modes, press, lag, gain, key.press_arm, inertia)
    # The strings' forces hardly depend on the bending.
    bent, rise = bending.by(arms @ (pushing - pushing[:, :1]))
    before = forces(angle - bent[0], rise, pushing)
    bent, rise = bending.by(arms @ (before - before[:, :1]))
    pushing = forces(angle - bent[0], rise, before)
    return _Held(
        press.force(lag),
        np.stack([press.smoothed(force) for force in pushing]),
        np.stack([press.smoothed(row) for row in bent]),
        np.interp(releases, press.part_time, key.jack_arm * (rise - bent[0]) - foot * before[0]),
    )
