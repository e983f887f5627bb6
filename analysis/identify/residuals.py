"""Inverse-dynamics residuals of presses: force at every instant, rise at every release."""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.identify.elastic import Mode, modes_of, responses
from sautereau.analysis.identify.observed import Observed
from sautereau.analysis.identify.parameters import (
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
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats, Motion

MODEL_STD = 5e-4
"""Dimensionless, accuracy of the model over the largest force. Without noise, smaller errors of the
model would be taken for those of the calibrations."""


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
        self._solved: dict[tuple[object, ...], Pluck] = {}

    def with_free(self, free: Sequence[Parameter]) -> "InverseDynamics":
        """Return the same dynamics with other free parameters."""
        return InverseDynamics(self.rig, free, self.presses, self.level)

    @property
    def floor(self) -> float:
        """N, smallest scale of the force residuals: the accuracy of the model, not of the data."""
        return MODEL_STD * max(float(np.abs(p.force()[p.used]).max()) for p in self.presses)

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
            Forces [N] at the fitted instants of each press, and the rises at all releases in
            units of their standard uncertainties.

        Raises:
            ModelError: The model has no solution there.
        """
        values = dict(zip((p.name for p in self.free), point.tolist(), strict=True))
        rig, lag = with_parameters(self.rig, values), values.get(TIME, 0.0)
        gains = values.get(FORCE_GAIN, 1.0), values.get(VELOCITY_GAIN, 1.0)
        sliding = values.get(SLIDING, 0.0), values.get(LATE_SLIDING, 0.0)
        plucks = [self._pluck(choir) for choir in choirs(rig)]
        late = 1 + values.get(RELEASE, 0.0)
        released = [
            angle_of_rise(key_of(rig, choir), choir.jack.string_clearance + late * p.release_height)
            for choir, p in zip(choirs(rig), plucks, strict=True)
        ]
        angles = np.array(released, float)
        order = np.argsort(angles, kind="stable").tolist()  # in which the strings are released
        modelled = rise_of_angle(rig.key, angles[order])
        modes, foot = modes_of(values), values.get(FOOT, 0.0)
        forces, rises = [], []
        for press in self.presses:
            count = min(len(order), len(press.releases))
            measured = rise_of_angle(rig.key, gains[1] * press.release_angles[:count])
            measured = measured - press.release_speeds[:count] * lag
            angle = gains[1] * press.part_angle
            held = _Held(rig, plucks, order, press, lag, foot)
            bent = None
            if modes:
                bent = held.bend(modes, gains[0], angle)
                measured = measured + np.interp(
                    press.releases[:count] - lag, press.part_time, held.yielded
                )
            strings = np.stack([press.smoothed(force) for force in held.forces(angle, bent)])
            motion = Motion(*(gains[1] * part for part in press.motion))
            if bent is not None:
                smooth = [press.smoothed(row) for row in bent]
                motion = Motion(*(whole - part for whole, part in zip(motion, smooth, strict=True)))
            # In units of the measured force, whose noise is the same for every gain.
            force, seen = finger_force(rig, motion, strings), press.force(lag)
            slid = seen * (sliding[0] * seen + sliding[1] * press.late_force)
            forces.append((seen + slid - force / gains[0])[press.used])
            rises.append((measured - modelled[:count]) / press.release_stds[:count])
        return forces, np.concatenate(rises)

    def _pluck(self, choir: Choir) -> Pluck:
        """Return the pluck of a choir, solved once for each plectrum and string."""
        plectrum = choir.plectrum
        key = (choir.string, plectrum)
        if key not in self._solved:
            if len(self._solved) > 64:
                self._solved.clear()
            self._solved[key] = choir_pluck(choir, self.level)
        return self._solved[key]


class _Held:
    """The strings of one press, which its plectra hold until the measured releases.

    Args:
        rig: The bench with the parameters' values.
        plucks: Of its choirs.
        order: In which they are released.
        press: The press.
        lag: s, of the force behind the motion.
        foot: m/N, compliance under each jack.
    """

    def __init__(
        self,
        rig: Rig,
        plucks: Sequence[Pluck],
        order: Sequence[int],
        press: Observed,
        lag: float,
        foot: float,
    ):
        self.rig, self.plucks, self.press, self.lag, self.foot = rig, plucks, press, lag, foot
        self.releases = dict(zip(order, press.releases - lag, strict=False))
        self.before = np.zeros((len(plucks), len(press.part_time)))
        self.rise: Floats | float = 0.0
        self.yielded = np.zeros(len(press.part_time))
        """m, what the first jack rises more than it would on a rigid key."""

    def bend(self, modes: Sequence[Mode], force_gain: float, angle: Floats) -> Floats:
        """Return what modes add to the key's angle [rad] and its derivatives; shape (3, n)."""
        key, press = self.rig.key, self.press
        arms = np.array([choir.jack_arm for choir in choirs(self.rig)])
        masses = np.array([choir.jack.mass for choir in choirs(self.rig)])
        scale = key.press_arm, key.inertia + float(masses @ arms**2)
        finger, time = force_gain * press.part_force(self.lag), press.part_time - press.lifted
        bent = np.zeros((3, len(angle)))
        for _ in range(2):
            # The strings' forces hardly depend on the bending.
            strings = arms @ self.forces(angle, bent)
            bent, self.rise = responses(modes, finger, strings, scale, time)
        self.yielded = key.jack_arm * (self.rise - bent[0]) - self.foot * self.before[0]
        return bent

    def forces(self, angle: Floats, bent: Floats | None) -> Floats:
        """Return the forces [N] of the strings on the jacks; shape (choirs, n).

        A string that is held beyond the modelled release keeps its force: so the residual is
        smooth in the parameters, and the release enters by its rise.
        """
        found = np.zeros((len(self.plucks), len(angle)))
        rigid = angle if bent is None else angle - bent[0]
        for number, release in self.releases.items():
            choir, pluck = choirs(self.rig)[number], self.plucks[number]
            rise = rise_of_angle(key_of(self.rig, choir), rigid) + choir.jack_arm * self.rise
            height = rise - choir.jack.string_clearance - self.foot * self.before[number]
            held = (self.press.part_time < release) & (height > 0)
            lifted = np.minimum(height[held], pluck.release_height)
            found[number, held] = pluck.force_on_jack(lifted)
        self.before = found
        return found
