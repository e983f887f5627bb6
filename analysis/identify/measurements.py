"""Measurements that would make a result identifiable.

The Jacobian of a fit also shows how certain a result would be if other numbers were known exactly
(the Jacobian without their columns), or if there were more presses (its rows multiplied).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.identify.combinations import covariance_of
from sautereau.analysis.identify.parameter_names import (
    CLOTH,
    DAMPER,
    DAMPER_LIFT,
    FORCE_GAIN,
    LATE_SLIDING,
    MODE,
    OF_STRING,
    SLIDING,
    TIME,
    VELOCITY_GAIN,
    is_name,
)
from sautereau.trajectory.motion import Floats

MORE = 4
"""Ratio by which the number of presses is increased in the advice to record more."""
USEFUL = 0.9
"""A measurement is listed if it reduces the uncertainty to less than this fraction."""
LISTED = 2
"""Largest number of measurements that are listed for a result."""
_HOW = {
    FORCE_GAIN: "calibrate the force transducer, and give gain_std",
    VELOCITY_GAIN: "calibrate the vibrometer, and give gain_std",
    TIME: "measure the delays of force and velocity, and give delay_std",
    **dict.fromkeys((SLIDING, LATE_SLIDING), "support the finger more stiffly along the key"),
    **dict.fromkeys((DAMPER, DAMPER_LIFT), "raise the damper"),
}
"""How to measure or remove what a hidden parameter describes."""


@dataclass(frozen=True)
class Measurement:
    """A measurement that would reduce the uncertainty of a result."""

    what: str
    """What to measure or to change."""
    std: float
    """Standard uncertainty of the result if what is measured were known exactly, SI."""


@dataclass(frozen=True)
class Information:
    """What recordings and priors say about the parameters of a fit."""

    names: Sequence[str]
    """Names of all parameters."""
    data: Floats
    """Derivatives of independent residuals by the scaled parameters, shape (n, parameters)."""
    prior: Floats
    """Derivatives of the priors, shape (priors, parameters). That of a parameter does not count for
    its own uncertainty."""
    lacking: Floats
    """Uncertainty of the scaled parameters that no residual shows, shape (parameters,)."""
    inputs: Mapping[str, Floats]
    """Changes of the scaled parameters by the standard uncertainty of each fixed number with an
    assumed range, shape (parameters,)."""

    def std(
        self, number: int, known: Sequence[int] = (), presses: float = 1.0, measured: str = ""
    ) -> float:
        """Return the total standard uncertainty of a scaled parameter; infinite if undetermined.

        Args:
            number: Number of the parameter.
            known: Numbers of the parameters that are known exactly.
            presses: Ratio of the number of presses to that of the recorded ones.
            measured: Name of a fixed number that is known exactly.
        """
        kept = [k for k in range(len(self.names)) if k not in known]
        prior = self.prior[self.prior[:, number] == 0]
        rows = np.vstack([np.sqrt(presses) * self.data, prior])
        covariance, determined = covariance_of(rows[:, kept])
        at = kept.index(number)
        if not determined[at]:
            return np.inf
        effects = [moved[number] for name, moved in self.inputs.items() if name != measured]
        return float(np.linalg.norm([np.sqrt(covariance[at, at]), self.lacking[number], *effects]))

    def measurements(self, number: int, scale: float) -> tuple[Measurement, ...]:
        """Return the measurements that would reduce a parameter's uncertainty most, best first.

        Args:
            number: Number of the parameter.
            scale: SI, scale of the parameter.
        """
        now, known = self.std(number), {}
        for k, name in enumerate(self.names):
            if k != number and (how := _how(name)):
                known.setdefault(how, []).append(k)
        found = [Measurement(how, self.std(number, own) * scale) for how, own in known.items()]
        found += [
            Measurement(f"measure {name}, and give it without a range", std * scale)
            for name in self.inputs
            for std in [self.std(number, measured=name)]
        ]
        more = self.std(number, presses=MORE)
        found.append(Measurement(f"record {MORE} times as many presses", more * scale))
        found = [each for each in found if each.std < USEFUL * now * scale]
        return tuple(sorted(found, key=lambda each: each.std)[:LISTED])


def _how(name: str) -> str | None:
    """Return how to measure or remove what a parameter describes; None if that is impossible."""
    if name.startswith(MODE) or name == CLOTH:
        return "record presses at another speed as well"
    if name.startswith(OF_STRING[0].partition("{")[0]):
        return "press with the other registers off"
    measured = f"measure {name}, free it, and give it by --prior" if is_name(name) else None
    return _HOW.get(name, measured)
