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

import numpy as np

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
LARGEST_STEP = 0.45 * np.pi
"""Half the angle of a mode in one step, above which its frequency is not exact."""
MOST = 3
"""Largest number of modes."""


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
        "damping": (1e-3, 0.9, damping, known[1]),
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


def foot_parameter() -> Parameter:
    """Return the hidden compliance of the cloth under the jack."""
    return Parameter(FOOT, "m/N", 0.0, 0.0, 10 * FOOT_STD, 0.0, FOOT_STD, hidden=True)


def responses(
    modes: Sequence[Mode], finger: Floats, strings: Floats, scale: tuple[float, float], time: Floats
) -> tuple[Floats, Floats]:
    """Return what the modes add to the laser's angle with its derivatives, and to a jack's rise.

    Args:
        modes: The modes.
        finger: N, force without that at rest; shape (n,).
        strings: N m, moment of the strings about the pin; shape (n,).
        scale: Lever arm of the finger [m], and inertia of the key with its jacks [kg m^2].
        time: s, equidistant, 0 where the key leaves its rail; shape (n,).

    Returns:
        The angle [rad] with its first two derivatives, shape (3, n); and the rise [rad] of a jack
        over its lever arm, shape (n,).
    """
    arm, inertia = scale
    angle, rise = np.zeros((3, len(time))), np.zeros(len(time))
    for mode in modes:
        turn = 2 * np.pi * mode.frequency
        push = (arm * finger - mode.jack_by_finger * strings) / (inertia * turn**2)
        moved = _moved(push, turn, mode.damping, float(time[1] - time[0]))
        p = turn * complex(-mode.damping, np.sqrt(1 - mode.damping**2))
        ringing = complex(mode.cosine, -mode.sine) * np.exp(p * np.maximum(time, 0.0)) * (time > 0)
        ringing = ringing * np.array([1.0, p, p * p])[:, None]
        moved = moved + arm / (inertia * turn**2) * ringing.real
        angle += mode.weight * moved
        rise += mode.weight * mode.jack_by_laser * moved[0]
    return angle, rise


def _moved(push: Floats, turn: float, damping: float, step: float) -> Floats:
    """Return position, velocity and acceleration of an oscillator from rest; shape (3, n).

    By the bilinear transform, which is exact for slow pushes and at the mode's frequency.
    """
    from scipy.signal import lfilter

    c = turn / np.tan(min(turn * step / 2, LARGEST_STEP))
    by_order = [
        np.array(row) for row in ([1.0, 2.0, 1.0], [c, 0.0, -c], [c * c, -2 * c * c, c * c])
    ]
    poles = by_order[2] + 2 * damping * turn * by_order[1] + turn**2 * by_order[0]
    return np.stack([lfilter(turn**2 * row, poles, push) for row in by_order])


def mode_names(number: int) -> list[str]:
    """Return the names of the parameters of a mode, in the order of `FIELDS`."""
    return [f"{MODE}{number}.{field}" for field in FIELDS]
