"""Inverse-dynamics residuals of presses: force at every instant, rise at every release."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify import elastic, parameters
from sautereau.analysis.identify.observed import Observed, Stacked
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of, solve_together
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.plectrum.levels import level_of
from sautereau.rig.instrument import Choir, Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, moving_inertia, rise_of_angle
from sautereau.trajectory.motion import Floats, Motion


class InverseDynamics:
    """The inverse dynamics of recorded presses as a function of the parameters.

    The equation of motion is evaluated for the measured motion and not integrated. A string is held
    until its measured release.

    Args:
        rig: The bench; all other values are those of this rig.
        unusable: Why other presses are not among them, a text each.
    """

    def __init__(
        self,
        rig: Rig,
        free: Sequence[parameters.Parameter],
        presses: Sequence[Observed],
        level: str,
        unusable: Sequence[str] = (),
    ):
        self.rig, self.free, self.presses, self.level = rig, tuple(free), tuple(presses), level
        self.unusable = tuple(unusable)
        self._known_slopes: tuple[Floats, Floats] | None = None
        self._nominal = moving_inertia(rig) / _finger_arm(rig)
        self._record, self._rows = elastic.shortest_record(presses), Stacked(presses)
        rows = [np.stack([*p.motion, p.lagged_force, p.slide])[:, p.used] for p in self.presses]
        *motion, self._lagged, self._slide = np.concatenate(rows, axis=1)
        self._motion = Motion(*motion)
        released = [
            np.stack([p.release_angles, p.release_speeds, p.release_stds]) for p in self.presses
        ]
        self._starts = np.cumsum([p.used.sum() for p in self.presses])[:-1]
        self._angles, self._speeds, self.rise_stds = np.concatenate(released, axis=1)
        """`rise_stds`: m, standard uncertainty of the rise at each modelled release."""
        self._released = np.concatenate([p.strings[: len(p.release_angles)] for p in self.presses])

    def with_free(self, free: Sequence[parameters.Parameter]) -> "InverseDynamics":
        """Return the same dynamics with other fitted parameters."""
        return InverseDynamics(self.rig, free, self.presses, self.level, self.unusable)

    def on(self, rig: Rig) -> "InverseDynamics":
        """Return the same dynamics with other values of the rig."""
        return InverseDynamics(rig, self.free, self.presses, self.level, self.unusable)

    @cached_property
    def floor(self) -> float:
        """N, smallest scale of the force residuals: the accuracy of the model."""
        # The model is accurate to 5e-4 of the largest force. Without this, small errors of the
        # model would be attributed to the calibrations if the recordings have no noise.
        return 5e-4 * max(float(np.abs(p.force()).max()) for p in self.presses)

    @property
    def noise(self) -> float | None:
        """N, RMS residual caused by noise at rest, for the rig's inertia; None without a rest."""
        noises = [p.noise for p in self.presses if p.noise is not None]
        parts = [(n.slow_force, n.fast_of_load(self._nominal)) for n in noises]
        return float(np.linalg.norm(parts) / len(parts) ** 0.5) if parts else None

    def residuals(self, point: Floats) -> tuple[list[Floats], Floats]:
        """Return measured minus modelled values.

        Args:
            point: Values of the parameters [SI].

        Returns:
            Forces [N] at the fitted instants of each press; and the rises at all releases,
            divided by their standard uncertainties. The forces are scaled so that they have the
            noise of the rig's rigid key.

        Raises:
            ModelError: The model has no solution there.
        """
        values, rig, strung = self._bench(point)
        # The angle follows from the measured velocity and this lever arm.
        turned = self.presses[0].laser_arm / rig.key.laser_arm
        values[parameters.VELOCITY_GAIN] = gain = turned * values.get(parameters.VELOCITY_GAIN, 1.0)
        lag, force_gain = values.get(parameters.TIME, 0.0), values.get(parameters.FORCE_GAIN, 1.0)
        sliding = values.get(parameters.SLIDING, 0.0), values.get(parameters.LATE_SLIDING, 0.0)
        strings, modes = _strings(rig, strung, self.level, values), elastic.modes_of(values)
        # Of the measured acceleration on the measured force. Without modes, the residuals have only
        # half of the noise at rest, and weights that fall with a friction would make it too small.
        arm = _finger_arm(rig) if modes else rig.key.press_arm
        inertia = moving_inertia(rig) / arm * gain / force_gain
        amplified = elastic.noise_gain(modes, self._record)
        force, held, bending, extra_rise = _state(rig, strings, self._rows, values)
        modelled = rise_of_angle(rig.key, np.array([string.release for string in strings]))
        measured = rise_of_angle(rig.key, gain * self._angles) - self._speeds * lag
        rises = (measured + extra_rise - modelled[self._released]) / self.rise_stds
        motion = Motion(*(gain * np.stack(self._motion) - bending))
        # Compare in units of the measured force: its noise does not depend on the gain.
        required = finger_force(rig, motion, held)
        slid = sliding[0] * force + sliding[1] * self._lagged - self._slide / rig.key.press_arm
        residual = force * (1 + slid) - required / force_gain
        forces = np.split(residual, self._starts)
        for press, own in zip(self.presses, forces, strict=True):
            if press.noise is not None:
                # The measured acceleration is noisy: a small inertia would fit best because it
                # hides the noise. What else is in the residuals hardly depends on the inertia.
                stated = press.noise.fast_of_load(self._nominal)
                changed = press.noise.fast_of_load(inertia, amplified)
                rest = math.sqrt(max(0.0, self.floor**2 - stated**2))
                own *= math.hypot(stated, rest) / math.hypot(changed, rest)
        return forces, rises

    def _bench(self, point: Floats) -> tuple[dict[str, float], Rig, list[Choir]]:
        """Return the values of the parameters by name, the rig with them, and its choirs."""
        values = dict(zip((p.name for p in self.free), point.tolist(), strict=True))
        # The felt is excluded, but a gain may move a key onto it: the residual would have a kink.
        felt = {"key.felt_stiffness": 0.0, "key.felt_damping": 0.0}
        rig = parameters.with_parameters(self.rig, values | felt)
        friction = rig.plectrum.friction - self.rig.plectrum.friction
        first, *others = choirs(rig)
        further = [_further(c, k, values, friction) for k, c in enumerate(others, 2)]
        return values, rig, [first, *further]

    def solve_together(self, points: Iterable[Floats]) -> None:
        """Solve the plucks at several points, which takes less time than one by one."""
        held = [choir for point in points for choir in self._bench(point)[2]]
        solve_together((c.plectrum, c.string, level_of(c.plectrum, self.level)) for c in held)

    def joined(self, point: Floats) -> Floats:
        """Return all `residuals` in one array, those of the rises last; shape (n,)."""
        forces, rises = self.residuals(point)
        return np.concatenate([*forces, rises])

    def slopes(self, point: Floats, scales: Floats) -> Floats:
        """Return derivatives of `joined` by one-sided differences, by number of the parameter.

        Those of a last point that is closer than a step are kept: differences with other steps
        differ from each other as much.

        Args:
            point: Values of the parameters [SI], shape (parameters,).
            scales: SI, of the parameters, of which the steps are fractions.

        Returns:
            Shape (n, parameters). A column is 0 where the model has no solution after the step,
            so that the solver leaves this parameter as it is.
        """
        steps = scales * [p.difference for p in self.free]
        high = np.array([p.high for p in self.free])
        if self._known_slopes is not None:
            at, known = self._known_slopes
            if np.all(np.abs(point - at) <= steps):
                return known
        steps = np.where(point + steps <= high, steps, -steps)
        before, columns = self.joined(point), []
        self.solve_together(point + step for step in np.diag(steps))
        for step in np.diag(steps):
            try:
                columns.append((self.joined(point + step) - before) / step.sum())
            except ModelError:
                columns.append(np.zeros_like(before))
        self._known_slopes = point, np.stack(columns, axis=1)
        return self._known_slopes[1]


def _finger_arm(rig: Rig) -> float:
    """Return the finger's lever arm on the way down [m], with the friction of its tip."""
    return rig.key.press_arm + rig.arm.fingertip_friction * rig.key.surface_height


@dataclass(frozen=True)
class _String:
    """A string for given values of the parameters."""

    choir: Choir
    key: Key  # Key with the lever arm of the choir's jack
    held: elastic.HeldString
    release: float  # rad, key angle at release


def _strings(
    rig: Rig, held: Sequence[Choir], level: str, values: Mapping[str, float]
) -> list[_String]:
    """Return the strings of choirs.

    Args:
        rig: Rig with the values of the parameters.
        values: Values of the parameters, by name.
    """
    late, found = 1 + values.get(parameters.RELEASE, 0.0), []
    for choir in held:
        key, pluck = key_of(rig, choir), choir_pluck(choir, level)
        height = choir.jack.string_clearance + late * pluck.release_height
        string = elastic.HeldString(choir.string, pluck, values.get(parameters.VIBRATION, 0.0))
        found.append(_String(choir, key, string, float(angle_of_rise(key, height))))
    return found


def _further(choir: Choir, number: int, values: Mapping[str, float], friction: float) -> Choir:
    """Return a further string with the values of its hidden parameters.

    Its friction changes by the same amount as that of the first string, unless it is fitted itself.
    """
    stiffness, overlap, clearance = (
        values.get(name.format(number), nothing)
        for name, nothing in zip(parameters.OF_STRING, (1.0, 1.0, 0.0), strict=True)
    )
    plectrum, jack = choir.plectrum, choir.jack
    friction *= f"string{number}.{parameters.FRICTION}" not in values
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


def _state(
    rig: Rig, strings: Sequence[_String], rows: Stacked, values: Mapping[str, float]
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the effects of strings and modes at the n fitted instants, smoothed.

    A string is held until its measured release. If it is still held after its modelled release, it
    keeps the force of that instant. The residual is then a smooth function of the parameters; the
    release is compared by its rise.

    Returns:
        Measured force [N], shape (n,); forces of the strings on the jacks [N], shape (choirs, n);
        contribution of the modes to the key angle [rad], with its derivatives, shape (3, n); that
        of modes and cloth to the first jack's rise at each modelled release [m].
    """
    lag, cloth, modes = (
        values.get(parameters.TIME, 0.0),
        values.get(parameters.CLOTH, 0.0),
        elastic.modes_of(values),
    )
    key, damped = rig.key, values.get(parameters.DAMPER, 0.0)
    higher = (
        values[parameters.DAMPER_LIFT] - rig.jack.damper.lift if rig.jack.damper and damped else 0.0
    )
    lasts = np.zeros((len(strings), len(rows.presses), 1), int)
    for press, time, own in zip(rows.presses, rows.substep_time, lasts.T[0], strict=True):
        own[press.strings] = np.searchsorted(time, press.releases - lag)
    # Of a rigid key without dampers nothing else acts after the last release.
    count = None if modes or damped else int(lasts.max()) + 1
    angle = values.get(parameters.VELOCITY_GAIN, 1.0) * rows.substep_angle[:, :count]
    held = np.arange(angle.shape[1]) < lasts
    risen = [rise_of_angle(string.key, angle) for string in strings]
    arms = np.array([choir.jack_arm for choir in choirs(rig)])
    inertia, gain = moving_inertia(rig), values.get(parameters.FORCE_GAIN, 1.0)
    fingers = elastic.driven(modes, rows, lag, gain, _finger_arm(rig))
    bent, rise = np.zeros((3, *angle.shape)), np.zeros(angle.shape)
    before = pushing = np.zeros((len(strings), *angle.shape))
    # Iterations of the strings' forces; 2 leave 1 standard uncertainty at 96 Hz.
    for iteration in range(1 + 3 * bool(modes or cloth)):
        if modes and iteration:
            moment = np.tensordot(arms, pushing - pushing[..., :1], 1)
            bent, rise = elastic.bending(modes, inertia, fingers, moment, rows.step)
            risen = [
                rise_of_angle(string.key, angle - bent[0]) + string.choir.jack_arm * rise
                for string in strings
            ]
        heights = [height - cloth * push for height, push in zip(risen, pushing, strict=True)]
        before, pushing = pushing, np.zeros_like(pushing)
        for push, string, height, within in zip(pushing, strings, heights, held, strict=True):
            above = np.where(within, height - string.choir.jack.string_clearance, 0.0)
            push += within * string.held.force(above, string.held.behind(above, rows.step))
            if damped and (damper := string.choir.jack.damper) is not None:
                lowered = np.maximum(damper.lift + higher - height, 0.0)
                push -= damped * damper.stiffness * lowered
    extra = key.jack_arm * (rise - bent[0]) - cloth * before[0]
    rises = [
        np.interp((p.releases - lag)[: len(p.release_angles)], time[:count], own)
        for p, time, own in zip(rows.presses, rows.substep_time, extra, strict=True)
    ]
    measured = np.concatenate([p.force(lag) for p in rows.presses])
    bent = rows.smoothed(bent) if modes else np.zeros((3, len(measured)))
    return measured, rows.smoothed(pushing), bent, np.concatenate(rises)
