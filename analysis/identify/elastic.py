"""Elastic modes of a compliant key, the cloth under its jack, and the strings that jacks hold.

The forces F of the finger and N of the string drive a linear structure. It has the rotation about
the balance pin and elastic modes orthogonal to it. The coordinate q of a mode obeys

    q'' + 2 d w q' + w^2 q = w^2 (p F - u b N) / (I w^2),

where w is its angular frequency, d its damping ratio, I the inertia of the key with its jacks, and
p and b are the lever arms of finger and jack. The mode adds r q to the angle that the laser
measures, and r v b q to the rise of the jack. Let P, L and B be the mode's displacements at finger,
laser and jack, each divided by that of a rotation, for a modal mass of I. Then r = L P, u = B / P
and v = B / L.

The force of the back rail is unknown. Each mode therefore has an unknown initial state at the
instant at which the key leaves the rail. The modes are computed from the measured force. No
equation of motion of the key is integrated, so damped modes cannot diverge.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.identify.observed import WINDOW, Observed, Stacked
from sautereau.analysis.identify.parameters import INERTIA, MODE, Parameter
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.string.string import ModalString
from sautereau.rig.instrument import String
from sautereau.trajectory.motion import Floats

SHAPES = {"key": (-0.6, -0.6), "second": (0.8, -0.35), "cloth": (-2.5, -2.5)}
"""u and v of three shapes: the first bending or the heave of a uniform key, its second bending, and
a jack of a few grams on its cloth."""
SHAPE_STD = 0.4  # Prior standard uncertainty of u and of v
WEIGHT_STD = 1.5  # Prior standard uncertainty of r
RINGING_STD = 0.3  # Prior standard uncertainty of the ringing amplitudes (N)
CLOTH_STD = 1e-5  # Prior std of the compliance under the jack of a compliant key (m/N)
LARGEST_STEP = 0.45 * np.pi  # Largest w T / 2 of a step T with an exact frequency
LEAST_PERIODS = 4.0  # Smallest number of periods of a mode in a press
MOST = 3  # Largest number of modes


@dataclass(frozen=True)
class Mode:
    """One elastic mode; the module explains its parameters."""

    frequency: float
    """Hz."""
    damping: float
    """Damping ratio."""
    weight: float
    """r."""
    jack_by_finger: float
    """u."""
    jack_by_laser: float
    """v."""
    cosine: float = 0.0
    """Cosine amplitude of its ringing from when the key leaves the rail, as the finger force that
    would cause the same static deflection (N)."""
    sine: float = 0.0
    """Sine amplitude of the same ringing (N)."""


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
        number: Number of the mode, from 0.
        start: Values at which the fit starts.
        stds: Standard uncertainties of frequency [Hz] and damping ratio if they were measured
            separately; None if they are known from the recordings only.
    """
    frequency, damping = start.frequency, start.damping
    known = stds or (frequency / 2, 0.2)
    bounds = {
        # Between 60 Hz and 3 kHz.
        "frequency": (max(60.0, frequency / 2), min(3000.0, frequency * 2), frequency, known[0]),
        # The least damping is that of wood without felt.
        "damping": (5e-3, 0.9, damping, known[1]),
        "weight": (-10.0, 10.0, 0.0, WEIGHT_STD),
        "jack_by_finger": (-12.0, 12.0, start.jack_by_finger, SHAPE_STD),
        "jack_by_laser": (-12.0, 12.0, start.jack_by_laser, SHAPE_STD),
        "cosine": (-5.0, 5.0, 0.0, RINGING_STD),
        "sine": (-5.0, 5.0, 0.0, RINGING_STD),
    }
    units = {"frequency": "Hz", "cosine": "N", "sine": "N"}
    return [
        Parameter(name, units.get(field, ""), getattr(start, field), *ends, hidden=True)
        for name, (field, ends) in zip(mode_names(number), bounds.items(), strict=True)
    ]


def noise_gain(modes: Sequence[Mode], record: float) -> float:
    """Return the RMS of the smoothed force residual divided by that of a rigid key.

    The modes are computed from the measured force and amplify its white noise. In a record of
    finite length [s] they do not reach their full resonance.
    """
    if not modes:
        return 1.0
    # 400 frequencies up to the highest that passes the smoothing, 2 over the width of the window.
    turn = np.linspace(0.0, 2 * np.pi * 2.0 / WINDOW, 400)[1:]
    x = turn * WINDOW / 2
    smoothing = (3 * (np.sin(x) - x * np.cos(x)) / x**3) ** 2
    gain = np.ones(len(turn), complex)
    for mode in modes:
        own = 2 * np.pi * mode.frequency
        damping = np.hypot(mode.damping, 1 / (own * record))
        gain -= mode.weight * turn**2 / (own**2 - turn**2 + 2j * damping * own * turn)
    return float(np.sqrt(np.abs(gain) ** 2 @ smoothing / smoothing.sum()))


def shortest_record(presses: Sequence[Observed]) -> float:
    """Return the shortest time [s] from the first to the last fitted instant of a press."""
    return min(float(np.ptp(press.time[press.used])) for press in presses)


def close_modes(values: Mapping[str, float]) -> bool:
    """Return whether two modes among the values are too close to be separated."""
    frequencies = sorted(mode.frequency for mode in modes_of(values))
    # Modes at frequencies of a smaller ratio cannot be separated.
    return any(high < 1.15 * low for low, high in pairwise(frequencies))


def doubtful_modes(
    free: Sequence[Parameter], values: Floats, presses: Sequence[Observed]
) -> list[str]:
    """Return why modes may imitate what else the model lacks; empty where nothing says so."""
    named = dict(zip((p.name for p in free), values.tolist(), strict=True))
    if not modes_of(named):
        return []
    lowest = min(mode.frequency for mode in modes_of(named))
    shortest = shortest_record(presses)
    reasons = [
        f"{INERTIA}: the fit reached a bound at {named[INERTIA]:.4g} kg m^2, so that the modes"
        " imitate it: give its range by a prior, or press more slowly"
        for p in free
        if p.name == INERTIA and p.at_bound(named[INERTIA])
    ]
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


def driven(
    modes: Sequence[Mode], presses: Stacked, lag: float, gain: float, arm: float
) -> list[Floats]:
    """Return the moments of the finger, and of the ringing, as modes respond to them.

    Args:
        lag: s, delay of the force after the motion.
        gain: True force divided by measured force.
        arm: m, lever arm of the finger.

    Returns:
        N m, of each mode at `substep_time`, with the first two derivatives; shape
        (3, presses, n) each.
    """
    return [
        np.tensordot(
            [arm * gain, arm * mode.cosine, arm * mode.sine],
            _driven(presses, mode.frequency, mode.damping, lag),
            1,
        )
        for mode in modes
    ]


def bending(
    modes: Sequence[Mode], inertia: float, fingers: Sequence[Floats], strings: Floats, step: float
) -> tuple[Floats, Floats]:
    """Return what modes add to the angle at the laser and to the rise of a jack.

    Args:
        inertia: kg m^2, of the key with its jacks.
        fingers: N m, moment of the finger about the pin as each mode responds to it, with the first
            two derivatives; shape (3, ..., n) each.
        strings: N m, moment of the strings about the pin; shape (..., n).
        step: s, between their values.

    Returns:
        The angle [rad] with its first two derivatives, shape (3, ..., n); and the rise of a jack
        divided by its lever arm [rad], shape (..., n).
    """
    angle, rise = np.zeros((3, *strings.shape)), np.zeros(strings.shape)
    for mode, finger in zip(modes, fingers, strict=True):
        stiffness = inertia * (2 * np.pi * mode.frequency) ** 2
        by_strings = oscillation(strings, mode.frequency, mode.damping, step)
        own = (finger - mode.jack_by_finger * by_strings) * (mode.weight / stiffness)
        angle += own
        rise += mode.jack_by_laser * own[0]
    return angle, rise


@lru_cache(maxsize=8)
def _driven(presses: Stacked, frequency: float, damping: float, lag: float) -> Floats:
    """Return the response of a mode to the measured force, and its free ringing.

    Args:
        frequency: Hz.
        lag: s, delay of the force after the motion.

    Returns:
        N, at `substep_time`: the response to the force; a cosine ringing of 1 N that starts when
        the key leaves the rail; the corresponding sine ringing. Each comes with its first two
        derivatives; shape (3, 3, presses, n).
    """
    turn, time = 2 * np.pi * frequency, np.maximum(presses.substep_time - presses.lift_off, 0.0)
    p = turn * complex(-damping, np.sqrt(1 - damping**2))
    ringing = np.multiply.outer([1.0, p, p * p], np.exp(p * time) * (time > 0))
    pushed = oscillation(presses.substep_force(lag), frequency, damping, presses.step)
    return np.stack([pushed, np.real(ringing), np.imag(ringing)])


def oscillation(push: Floats, frequency: float, damping: float, step: float) -> Floats:
    """Return the response of an oscillator that starts at rest, with its first two derivatives.

    It is computed by the bilinear transform, which is exact for slow forces and at the frequency of
    the oscillator.

    Args:
        push: Force in any unit, shape (..., n).
        frequency: Hz.
        step: s, time between values.

    Returns:
        The response in the unit of the force: 1 for a static force of 1; shape
        (3, ..., n).
    """
    from scipy.signal import lfilter

    turn = 2 * np.pi * frequency
    c = turn / np.tan(min(turn * step / 2, LARGEST_STEP))
    poles = [c * c + 2 * damping * turn * c + turn**2, 2 * (turn**2 - c * c)]
    poles.append(poles[0] - 4 * damping * turn * c)
    state = np.zeros((*push.shape[:-1], push.shape[-1] + 2))
    state[..., 2:] = lfilter([turn**2], poles, push)
    now, before, earlier = state[..., 2:], state[..., 1:-1], state[..., :-2]
    both = now + earlier
    return np.stack([both + 2 * before, c * (now - earlier), c * c * (both - 2 * before)])


def mode_names(number: int) -> list[str]:
    """Return the names of the parameters of a mode, in the order of the fields of `Mode`."""
    return [f"{MODE}{number}.{field.name}" for field in fields(Mode)]


@dataclass(frozen=True)
class HeldString:
    """The force of a string on its jack: the quasi-static pluck, and the string's vibration.

    A string of the static flexibility 1 / K follows the force N of a slow jack by N / K. The force
    of a faster one excites its modes. Let w be the displacement of the string, and d = N / K - w
    how far it is behind. The plectrum is then bent as in a quasi-static pluck at the height h + d
    of the jack. The modes n at the plucking point have the shapes s_n and the masses m, and obey

        m (q_n'' + w_n^2 q_n) = s_n N,    d = sum of s_n (s_n N / (m w_n^2) - q_n).

    Towards the release N rises ever more slowly with h, because the string slides along the
    plectrum. Within a period of its vibration it does not slide but moves across the plectrum, and
    in that direction the stiffness of both stays that of first contact (to 2 %, by the derivatives
    of the force along and across by both displacements). So d is that of a string on a spring.
    """

    string: String
    pluck: Pluck
    """The quasi-static pluck."""
    vibration: float
    """Vibration of the string divided by that of an undamped string."""

    @cached_property
    def slope(self) -> float:
        """N/m, slope of the force on the height at first contact."""
        return float(self.pluck.vertical_force[1] / self.pluck.height[1])

    def force(self, height: Floats, behind: Floats) -> Floats:
        """Return the downward force [N] on a jack.

        Args:
            height: m, of the jack above first contact, shape (..., n).
            behind: m, `behind`.
        """
        return self.pluck.force_on_jack(np.minimum(height + behind, self.pluck.release_height))

    def behind(self, height: Floats, step: float) -> Floats:
        """Return how far the string is behind its static displacement [m], shape (..., n).

        Args:
            height: m, of the jack above first contact, shape (..., n).
            step: s, time between values.
        """
        found, push = np.zeros_like(height), self.slope * np.maximum(height, 0.0)
        if self.vibration and push.any():
            first = int(np.argmax(push.reshape(-1, push.shape[-1]).any(axis=0)))
            count = push.shape[-1] - first
            size = 1 << count.bit_length()
            own = _response(self.string, self.slope, step, size)  # pyright: ignore
            spectrum = np.fft.rfft(push[..., first:], 2 * size) * own
            found[..., first:] = np.fft.irfft(spectrum)[..., :count]
        return self.vibration * found


@lru_cache(maxsize=32)
def _response(string: String, slope: float, step: float, count: int) -> NDArray[np.complex128]:
    """Return how far a string on a spring is behind after a force of 1 N during one step.

    A mode responds as by the bilinear transform, which is exact for slow forces and at the
    frequency of the mode.

    Args:
        slope: N/m, of the spring.
        step: s.
        count: Number of steps.

    Returns:
        m, its transform with as many zeros behind it; shape (count + 1,).
    """
    # The smoothing removes vibrations faster than 1.5 kHz.
    modal = ModalString(string, max(1, round(1500.0 / string.frequency)))
    flexibility = float(np.sum(modal.shape**2 / (modal.mass * modal.omega**2)))
    free = 1 - slope * flexibility
    joined = slope / free / modal.mass * np.outer(modal.shape, modal.shape)
    squares, shapes = np.linalg.eigh(np.diag(modal.omega**2) + joined)
    own = (modal.shape @ shapes) ** 2 / (modal.mass * squares)
    turn = np.minimum(np.sqrt(squares) * step, 2 * LARGEST_STEP)
    modes = np.sin(turn)[:, None] * np.sin(np.outer(turn, np.arange(count)))
    modes[:, 0] = (1 - np.cos(turn)) / 2
    found = -(own / free) @ modes
    found[0] += flexibility
    return np.fft.rfft(found / free, 2 * count)
