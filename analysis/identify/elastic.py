"""What bends between finger, laser and jack: modes of the key, and the cloth under the jack.

Between the finger's force F, the string's force N on the jack and the motion stands a linear
structure: the rotation about the pin, and elastic modes orthogonal to it. A mode moves by

    q'' + 2 d w q' + w^2 q = w^2 (p F - u b N) / (I w^2),

where w is its angular frequency, d its damping, I the inertia of the
key with its jacks, p and b the lever arms of finger and jack. It adds r q to the angle that the
laser shows, and r v b q to the rise of the jack. With the mode's displacements at finger, laser
and jack over those of a rotation, P, L and B, scaled to the mass I: r = L P, u = B / P, v = B / L.

Until the key leaves its back rail, the rail's force is unknown, and so is how it rings from there
on: each mode has an initial state then. All is computed from the measured force, so that no
equation of motion is integrated, and damped modes cannot diverge.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from sautereau.analysis.identify.noise import WINDOW
from sautereau.analysis.identify.observed import PARTS, Observed
from sautereau.analysis.identify.parameters import FOOT, MODE, Parameter
from sautereau.trajectory.motion import Floats

FIELDS = ("frequency", "damping", "weight", "jack_by_finger", "jack_by_laser", "cosine", "sine")
"""Of a mode: frequency [Hz], damping ratio, dimensionless r, u, v; and its ringing when the key
leaves the rail, as the force [N] of the finger that would bend it so."""
SHAPES = {"key": (-0.6, -0.6), "second": (0.8, -0.35), "cloth": (-2.5, -2.5)}
"""u and v of a uniform key that bends or heaves, of its second bending, and of a jack of a few
grams on its cloth."""
SHAPE_STD, WEIGHT_STD = 0.4, 1.5
"""Prior standard uncertainties of u and v, and of r."""
RINGING_STD = 0.3
"""N, prior standard uncertainty of the ringing."""
FOOT_STD = 1e-5
"""m/N, of the compliance under the jack, where the key is compliant."""
LOWEST, HIGHEST = 60.0, 3000.0
"""Hz, bounds of the frequencies."""
LEAST_DAMPING = 5e-3
"""Dimensionless, bound of the dampings: that of wood without felt."""
LARGEST_STEP = 0.45 * np.pi
"""Half the angle of a mode in one step, above which its frequency is not exact."""
LEAST_PERIODS, CLOSE = 4.0, 1.15
"""Fewest periods of a mode in a press, and least ratio of two frequencies."""
MOST = 3
"""Largest number of modes."""
BAND, POINTS = 2.0, 400
"""Dimensionless, highest frequency that the smoothing leaves times its window; and number of
frequencies up to it."""


@dataclass(frozen=True)
class Mode:
    """One elastic mode; see the module."""

    frequency: float
    damping: float
    weight: float
    jack_by_finger: float
    jack_by_laser: float
    cosine: float = 0.0
    sine: float = 0.0


def modes_of(values: Mapping[str, float]) -> list[Mode]:
    """Return the modes among the values of parameters, by name."""
    found: list[Mode] = []
    while (names := mode_names(len(found)))[0] in values:
        found.append(Mode(*(values[name] for name in names)))
    return found


def mode_parameters(
    number: int, start: Mode, stds: tuple[float, float] | None = None
) -> list[Parameter]:
    """Return the hidden parameters of one mode.

    Args:
        number: Of the mode, from 0.
        start: Where the fit starts.
        stds: Standard uncertainties of frequency [Hz] and damping where they were measured
            otherwise; None where only the recordings show them.
    """
    frequency, damping = start.frequency, start.damping
    known = stds or (frequency / 2, 0.2)
    bounds = {
        "frequency": (max(LOWEST, frequency / 2), min(HIGHEST, frequency * 2), frequency, known[0]),
        "damping": (LEAST_DAMPING, 0.9, damping, known[1]),
        "weight": (-10.0, 10.0, 0.0, WEIGHT_STD),
        "jack_by_finger": (-12.0, 12.0, start.jack_by_finger, SHAPE_STD),
        "jack_by_laser": (-12.0, 12.0, start.jack_by_laser, SHAPE_STD),
        "cosine": (-5.0, 5.0, 0.0, RINGING_STD),
        "sine": (-5.0, 5.0, 0.0, RINGING_STD),
    }
    found = []
    for name, (field, (low, high, mean, std)) in zip(
        mode_names(number), bounds.items(), strict=True
    ):
        value = getattr(start, field)
        unit = {"frequency": "Hz", "cosine": "N", "sine": "N"}.get(field, "")
        found.append(Parameter(name, unit, value, low, high, mean, std, hidden=True))
    return found


def noise_gain(modes: Sequence[Mode], record: float) -> float:
    """Return the RMS of a smoothed force residual over that of the white noise of the force.

    The modes are computed from the measured force, whose noise they amplify as far as they ring
    up in the record [s].
    """
    if not modes:
        return 1.0
    turn = np.linspace(0.0, 2 * np.pi * BAND / WINDOW, POINTS)[1:]
    x = turn * WINDOW / 2
    smoothing = (3 * (np.sin(x) - x * np.cos(x)) / x**3) ** 2
    gain = np.ones(len(turn), complex)
    for mode in modes:
        own = 2 * np.pi * mode.frequency
        damping = max(mode.damping, 1 / (own * record))
        gain -= mode.weight * turn**2 / (own**2 - turn**2 + 2j * damping * own * turn)
    return float(np.sqrt(np.abs(gain) ** 2 @ smoothing / smoothing.sum()))


def shortest_record(presses: Sequence[Observed]) -> float:
    """Return the shortest time [s] between the first and the last fitted instant of a press."""
    return min(float(np.ptp(press.time[press.used])) for press in presses)


def close_modes(values: Mapping[str, float]) -> bool:
    """Return whether two modes among the values are too close to be separated."""
    frequencies = sorted(mode.frequency for mode in modes_of(values))
    return any(high < CLOSE * low for low, high in pairwise(frequencies))


def doubtful_modes(
    free: Sequence[Parameter], values: Floats, presses: Sequence[Observed]
) -> list[str]:
    """Return why modes may imitate what else the model lacks; empty where nothing says so."""
    named = dict(zip((p.name for p in free), values.tolist(), strict=True))
    lowest = min((mode.frequency for mode in modes_of(named)), default=np.inf)
    shortest, reasons = shortest_record(presses), []
    if shortest * lowest < LEAST_PERIODS:
        reasons.append(
            f"the key's mode at {lowest:.3g} Hz has {shortest * lowest:.2g} periods"
            f" before the release, and {LEAST_PERIODS:g} are needed: press more slowly"
        )
    if close_modes(named):
        reasons.append(
            "two of the key's modes are too close to be separated: tap the key, so that the rig"
            " states them (sautereau setup tap)"
        )
    return reasons


def foot_parameter() -> Parameter:
    """Return the hidden compliance of the cloth under the jack."""
    return Parameter(FOOT, "m/N", 0.0, 0.0, 10 * FOOT_STD, 0.0, FOOT_STD, hidden=True)


class Bending:
    """What the modes do in one press.

    Args:
        modes: The modes.
        press: The press.
        lag: s, of the force behind the motion.
        gain: True over measured force.
        arm: m, lever arm of the finger.
        inertia: kg m^2, of the key with its jacks.
    """

    def __init__(
        self,
        modes: Sequence[Mode],
        press: Observed,
        lag: float,
        gain: float,
        arm: float,
        inertia: float,
    ):
        self.modes, self._step = modes, press.step / PARTS
        self._stiffnesses = [inertia * (2 * np.pi * mode.frequency) ** 2 for mode in modes]
        self._by_finger = [
            np.tensordot(
                [arm * gain, arm * mode.cosine, arm * mode.sine],
                _driven(press, mode.frequency, mode.damping, lag),
                1,
            )
            for mode in modes
        ]

    def by(self, strings: Floats) -> tuple[Floats, Floats]:
        """Return what the modes add to the laser's angle, and to the rise of a jack.

        Args:
            strings: N m, moment of the strings about the pin, at `part_time`; shape (n,).

        Returns:
            The angle [rad] with its first two derivatives, shape (3, n); and the rise [rad] of a
            jack over its lever arm, shape (n,).
        """
        angle, rise = np.zeros((3, len(strings))), np.zeros(len(strings))
        for mode, stiffness, finger in zip(
            self.modes, self._stiffnesses, self._by_finger, strict=True
        ):
            own = finger - mode.jack_by_finger * _moved(
                strings, mode.frequency, mode.damping, self._step
            )
            own *= mode.weight / stiffness
            angle += own
            rise += mode.jack_by_laser * own[0]
        return angle, rise


@lru_cache(maxsize=128)
def _driven(press: Observed, frequency: float, damping: float, lag: float) -> Floats:
    """Return the motion of an oscillator that the measured force drives, and its free ringing.

    Args:
        press: The press.
        frequency: Hz.
        damping: Fraction of critical damping.
        lag: s, of the force behind the motion.

    Returns:
        N, of the force [N], and of the parts of a ringing of 1 N from the lift of the key on that
        begin with a cosine and with a sine; each with its first two derivatives, at `part_time`;
        shape (3, 3, n).
    """
    turn, time = 2 * np.pi * frequency, np.maximum(press.part_time - press.lifted, 0.0)
    p = turn * complex(-damping, np.sqrt(1 - damping**2))
    ringing = np.outer([1.0, p, p * p], np.exp(p * time) * (time > 0))
    pushed = _moved(press.part_force(lag), frequency, damping, press.step / PARTS)
    return np.stack([pushed, np.real(ringing), np.imag(ringing)])


def _moved(push: Floats, frequency: float, damping: float, step: float) -> Floats:
    """Return the static deflection's size, velocity and acceleration of an oscillator from rest.

    By the bilinear transform, which is exact for slow pushes and at the mode's frequency.

    Args:
        push: Of any unit, shape (n,).
        frequency: Hz.
        damping: Fraction of critical damping.
        step: s, between values.

    Returns:
        In units of the push, with its first two derivatives; shape (3, n).
    """
    from scipy.signal import lfilter

    turn = 2 * np.pi * frequency
    c = turn / np.tan(min(turn * step / 2, LARGEST_STEP))
    poles = [c * c + 2 * damping * turn * c + turn**2, 2 * (turn**2 - c * c)]
    poles.append(poles[0] - 4 * damping * turn * c)
    state = np.zeros(len(push) + 2)
    state[2:] = lfilter([turn**2], poles, push)
    now, before, earlier = state[2:], state[1:-1], state[:-2]
    both = now + earlier
    return np.stack([both + 2 * before, c * (now - earlier), c * c * (both - 2 * before)])


def mode_names(number: int) -> list[str]:
    """Return the names of the parameters of a mode, in the order of `FIELDS`."""
    return [f"{MODE}{number}.{field}" for field in FIELDS]
