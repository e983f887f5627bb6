"""What presses would say of a rig's parameters before they are made.

A press is computed by the model for the planned motion, with white noise of the sensors. Its
information is that of a fit that ends at the rig's values, so that nothing is fitted. Presses add
their information; what the rig states of its numbers is counted once.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.identify.compliant import compliant, known_mode
from sautereau.analysis.identify.elastic import (
    SHAPES,
    WEIGHT_STD,
    Mode,
    bending,
    mode_parameters,
    oscillation,
)
from sautereau.analysis.identify.fit import (
    ROUNDS,
    at_values,
    informative,
    inverse_dynamics,
    whitened,
)
from sautereau.analysis.identify.information import Distribution, Information
from sautereau.analysis.identify.observed import MIN_REST, TURN_MARGIN
from sautereau.analysis.identify.parameters import (
    FORCE,
    VIBRATION,
    Prior,
    assumed_std,
    hidden_parameters,
    of_rig,
    parameters,
    value_of,
    with_parameters,
)
from sautereau.analysis.identify.problem import Problem
from sautereau.analysis.loading.press import UNITS, Press, columns_of
from sautereau.analysis.model.choirs import choirs, key_of
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.rig.document import current_key
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import key_motion, moving_inertia, rise_of_angle
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import press_law

DRAWS = 4  # Instruments: on the packaged rig 16 change the means by at most 6 %
REST = 2 * (MIN_REST + TURN_MARGIN)  # s, before and after the motion, for the noise at rest


@dataclass(frozen=True)
class WhiteNoise:
    """Noise of the sensors: standard deviation of a sample, white."""

    force: float = 5e-3
    """N."""
    velocity: float = 0.05e-3
    """m/s, at the laser."""


@dataclass(frozen=True)
class Planned:
    """Presses of one kind."""

    speed: float
    """m/s, of the jack."""
    muted: bool = False
    """Without any string."""


def planned_press(
    rig: Rig, truth: Rig, noise: WhiteNoise, modes: Sequence[Mode] = (), *, muted: bool = False
) -> Press:
    """Return the press that a rig's plan makes on an instrument, by the model.

    Args:
        rig: What the experimenter states.
        truth: The instrument.
        modes: Elastic modes of its key.
        muted: Without any string.

    Raises:
        TrajectoryError: There is no such motion.
        ModelError: The model has no solution for the instrument.
    """
    law, rate, key = press_law(rig.press).law, rig.daq.sample_rate, truth.key
    time = np.arange(-REST, law.duration + REST, 1 / rate)
    angle = key_motion(key, law.at(np.clip(time, 0.0, law.duration)))
    every, made = choirs(truth), None if muted else predict(truth)
    arms = np.array([choir.jack_arm for choir in every])
    pushing, force = np.zeros((len(every), len(time))), np.zeros(len(time))
    bent, extra = np.zeros((3, len(time))), np.zeros(len(time))
    # Of string and bending: the string's force hardly depends on the bending.
    for _ in range(3 if modes else 1):
        # The same rise of the first jack has the same force.
        rise = rise_of_angle(key, angle.position) + key.jack_arm * extra
        for k, (push, choir) in enumerate(zip(pushing, every, strict=True)):
            push[:] = 0.0
            if made is not None:
                own = made.choirs[k].string_force
                release = made.rise[np.flatnonzero(own > 0)[-1]]
                push += np.interp(rise, made.rise, own) * (np.maximum.accumulate(rise) <= release)
            if (damper := choir.jack.damper) is not None:
                height = rise_of_angle(key_of(truth, choir), angle.position)
                push -= damper.stiffness * np.maximum(damper.lift - height, 0.0)
        force = finger_force(truth, angle, pushing)
        finger, strings = key.press_arm * (force - force[0]), arms @ (pushing - pushing[:, :1])
        fingers = [oscillation(finger, m.frequency, m.damping, 1 / rate) for m in modes]
        bent, extra = bending(modes, moving_inertia(truth), fingers, strings, 1 / rate)
    random = np.random.default_rng(0)
    velocity = key.laser_arm * (angle.velocity + bent[1])
    velocity = velocity + noise.velocity * random.standard_normal(len(time))
    force = force + noise.force * random.standard_normal(len(time))
    samples = dict(zip(UNITS, columns_of(rig.key, velocity, force, rate), strict=True))
    return Press(Path("planned"), rig, True, time, samples, rate)


def forecast(
    rig: Rig,
    names: Sequence[str],
    kinds: Sequence[Planned],
    priors: Mapping[str, Prior] | None = None,
    noise: WhiteNoise = WhiteNoise(),
    *,
    level: str = "auto",
) -> Iterator[tuple[Problem, list[Floats]]]:
    """Yield what a press of each kind would say of parameters, for instruments like the rig.

    Instruments without such presses are omitted.

    What the rig knows to within a range or an uncertainty is drawn for each instrument: the
    friction of a plectrum, for example, is known the better the larger it is. The key is rigid
    unless the rig states modes. Their size at the finger, which no rig states, is that of keys of
    the independent simulator.

    Args:
        names: Free parameters by their one spelling, as for `identify`.
        priors: Prior knowledge of them, by name.

    Yields:
        A problem with the parameters and the priors; and for each kind the derivatives of
        independent residuals by its scaled parameters, shape (n, parameters).

    Raises:
        AnalysisError: A name or prior is wrong, or no instrument makes usable presses.
        TrajectoryError: There is no such motion.
    """
    priors = priors or {}
    free = [*parameters(rig, names, priors), *hidden_parameters(rig, names)]
    free = [p for p in free if not p.name.startswith("offset.")]
    stds = []
    for p in free:
        name, ratio = of_rig(rig, p.name, 1.0)
        stds.append(p.std or assumed_std(rig, current_key(name)) / ratio)
    drawn_of = Distribution(
        tuple(p.name for p in free),
        np.array([p.start for p in free]),
        np.diag(stds) ** 2,
        np.array([p.low for p in free]),
        np.array([p.high for p in free]),
    )
    drawn = drawn_of.drawn(DRAWS)
    failures = []
    for values in tracked(list(drawn)):
        truth = with_parameters(rig, dict(zip(drawn_of.names, values.tolist(), strict=True)))
        try:
            made = [_informed(rig, truth, names, kind, priors, noise, level) for kind in kinds]
        except (AnalysisError, ModelError) as error:  # of no use, or without a solution
            failures.append(str(error))
            continue
        yield made[0][0], [data for _, data in made]
    if len(failures) == len(drawn):
        raise AnalysisError("\n".join(dict.fromkeys(failures)))


def _informed(
    rig: Rig,
    truth: Rig,
    names: Sequence[str],
    kind: Planned,
    priors: Mapping[str, Prior],
    noise: WhiteNoise,
    level: str,
) -> tuple[Problem, Floats]:
    """Return what one press would say, by a fit that ends at the true values."""
    rig, truth = (each.replaced({"press.jack_speed": kind.speed}) for each in (rig, truth))
    shapes = list(SHAPES.values())
    modes = [
        Mode(m.frequency, m.damping, WEIGHT_STD, *shapes[min(k, len(shapes) - 1)])
        for k, m in enumerate(rig.key.modes)
    ]
    press = planned_press(rig, truth, noise, modes, muted=kind.muted)
    phases = find_phases(press)
    if kind.muted == bool(phases.plucks):
        raise AnalysisError(
            f"expected: in the press at {kind.speed:.4g} m/s"
            f" {'a pluck is found that is none' if kind.muted else 'the pluck is not found'} with"
            " this noise; press at another speed, or measure with less noise"
        )
    dynamics = inverse_dynamics([press], [phases], names, priors, level)
    if modes and (dynamics := compliant(dynamics)) is None:
        raise AnalysisError(
            f"expected: at {kind.speed:.4g} m/s too little of the press comes before the release"
            " for a compliant key; press more slowly"
        )
    for number, mode in enumerate(modes):
        own = mode_parameters(number, mode, known_mode(rig, number))
        dynamics = dynamics.with_free([*dynamics.free, *own])
    values = np.array(
        [
            p.start * (p.name != VIBRATION)  # the planned string does not vibrate
            if p.name.startswith("offset.")
            else value_of(truth, p.name)
            for p in dynamics.free
        ]
    )
    fitted = at_values(dynamics, values, FORCE in names)
    for _ in range(ROUNDS - 1):
        fitted = replace(fitted, problem=whitened(fitted))
    problem = fitted.problem
    slopes = problem.differences(values / problem.scales)
    return problem, informative(fitted, problem.white(slopes))


def together(problem: Problem, data: Sequence[Floats], counts: Sequence[int]) -> Information:
    """Return the information of presses with what the rig states, from what `forecast` yields.

    Args:
        counts: Number of presses of each kind.
    """
    return Information(
        [p.name for p in problem.free],
        np.vstack([np.sqrt(n) * rows for n, rows in zip(counts, data, strict=True)]),
        problem.prior_jacobian,
        np.zeros(len(problem.free)),
    )
