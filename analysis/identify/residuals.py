"""What the model misses of a press: force at every instant, rise at every release."""

from collections.abc import Mapping, Sequence

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.observed import Observed
from sautereau.analysis.identify.parameters import GAIN, TIME, Parameter, with_parameters
from sautereau.analysis.model.choirs import choir_pluck, choirs, key_of
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle
from sautereau.trajectory.motion import Floats


class InverseDynamics:
    """The dynamics of forces of recorded presses under values of the parameters.

    Nothing is integrated: the model pushes against the motion that was measured, and the string
    is held as long as it was.

    Args:
        rig: The bench; what is not fitted keeps its value.
        free: What is fitted.
        presses: The recordings.
        level: Of the plectra.
    """

    def __init__(
        self, rig: Rig, free: Sequence[Parameter], presses: Sequence[Observed], level: str
    ):
        self.rig, self.free, self.presses, self.level = rig, tuple(free), tuple(presses), level
        self._solved: dict[tuple[object, ...], Pluck] = {}

    def values(self, point: Floats) -> dict[str, float]:
        """Return the parameters' values [SI] by name at a point."""
        return dict(zip((p.name for p in self.free), point.tolist(), strict=True))

    @property
    def rise_stds(self) -> Floats:
        """m, uncertainty of the rise at each release that the model has; shape (releases,)."""
        count = len(choirs(self.rig))
        return np.concatenate([press.release_stds[:count] for press in self.presses])

    def residuals(self, point: Floats) -> tuple[list[Floats], Floats]:
        """Return what is measured less what the model says.

        Args:
            point: Values of the parameters [SI].

        Returns:
            Forces [N] at the used instants of each press, and the rises at all releases in
            their standard uncertainties.

        Raises:
            ModelError: The model has no solution there.
        """
        values = self.values(point)
        rig, lag = with_parameters(self.rig, values), values.get(TIME, 0.0)
        gain = values.get(GAIN, 1.0)
        plucks = [self._pluck(choir) for choir in choirs(rig)]
        order = _order(rig, plucks)
        forces, rises = [], []
        for press in self.presses:
            forces.append(self._force(rig, plucks, order, press, lag, gain))
            rises.append(_rises(rig, plucks, order, press, lag))
        return forces, np.concatenate(rises)

    def _force(
        self,
        rig: Rig,
        plucks: Sequence[Pluck],
        order: Sequence[int],
        press: Observed,
        lag: float,
        gain: float,
    ) -> Floats:
        strings = np.zeros((len(plucks), len(press.time)))
        for number, release in zip(order, press.releases - lag, strict=False):
            choir, pluck = choirs(rig)[number], plucks[number]
            rise = rise_of_angle(key_of(rig, choir), press.part_angle)
            height = rise - choir.jack.string_clearance
            held = (press.part_time < release) & (height > 0)
            # Held longer than the model holds it, it is held as at the model's release: so the
            # misfit stays smooth, and the release itself tells by the rise.
            force = np.zeros_like(height)
            force[held] = pluck.force_on_jack(np.minimum(height[held], pluck.release_height))
            strings[number] = press.smoothed(force)
        missed = press.force(lag) - gain * finger_force(rig, press.motion, strings)
        return missed[press.used]

    def _pluck(self, choir: Choir) -> Pluck:
        """Solve a pluck once for each plectrum that is asked for."""
        plectrum = choir.plectrum
        key = (choir.string, plectrum)
        if key not in self._solved:
            if len(self._solved) > 64:
                self._solved.clear()
            self._solved[key] = choir_pluck(choir, self.level)
        return self._solved[key]


def check_alike(rigs: Mapping[str, Rig]) -> Rig:
    """Return the rig of several recordings, which may differ in how they press alone.

    Args:
        rigs: By the recordings' names.

    Raises:
        AnalysisError: Key, jack, plectrum or string are not those of the first one.
    """
    (first_name, first), *others = rigs.items()
    faults = []
    for name, rig in others:
        differ = [
            part
            for part in ("key", "jack", "plectrum", "string", "more_choirs")
            if getattr(rig, part) != getattr(first, part)
        ]
        if differ:
            faults.append(f"{name}: its {', '.join(differ)} differ from those of {first_name}")
    if faults:
        raise AnalysisError(
            "\n".join([*faults, "these are different instruments: give the recordings of one"])
        )
    return first


def _order(rig: Rig, plucks: Sequence[Pluck]) -> list[int]:
    """Return the choirs in the order in which their strings are released."""

    def released(number: int) -> float:
        choir = choirs(rig)[number]
        height = choir.jack.string_clearance + plucks[number].release_height
        return float(angle_of_rise(key_of(rig, choir), height))

    return sorted(range(len(plucks)), key=released)


def _rises(
    rig: Rig, plucks: Sequence[Pluck], order: Sequence[int], press: Observed, lag: float
) -> Floats:
    """Return by how many standard uncertainties the rises at the releases are missed."""
    rises = []
    for number in order[: len(press.releases)]:
        choir = choirs(rig)[number]
        own = choir.jack.string_clearance + plucks[number].release_height
        angle = angle_of_rise(key_of(rig, choir), own)
        rises.append(float(rise_of_angle(rig.key, angle)))
    count = len(rises)
    measured = press.release_rises[:count] - press.release_speeds[:count] * lag
    return (measured - np.array(rises)) / press.release_stds[:count]
