"""The string at its release, as a sensor of its own measures it, and as the model predicts it.

While it is held slowly, the string has the shape of a static force at the plucking point: from the
displacement at a place, from the integral of the velocity there, or from the force on the bridge
follows its lift at the plucking point. A straight line through the lift of the last milliseconds,
which ends before any release that the press's uncertainty allows, gives lift and velocity at the
release. There a wave starts at the plucking point, and reaches the sensor after its distance over
c = 2 L f. Then the partials ring: least squares with harmonics of one frequency, whose amplitudes
are linear in time over some periods, give those of the modes' displacement at the release.
"""

import math
from typing import Any

import numpy as np

from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.acquisition import Channel
from sautereau.rig.instrument import String

OF_START: tuple[str, ...] = (
    "release_lift", "release_velocity", "first_partial", "second_partial", "third_partial",
)  # fmt: skip
"""Quantities of the string at its release."""
PARTIALS: Floats = np.arange(1.0, 4.0)
SPAN = 4e-3  # s, of the line through the lift; at most a third of the pluck
NEAR = 0.5e-3  # s, between its end and the release, and between the wave and the partials
PERIODS = 12  # Of the fundamental, of the window in which the partials are fitted
DETUNED = 0.03  # Largest relative deviation of the fundamental from the rig's


def measured_start(
    channel: Channel, string: String, time: Floats, values: Floats, contact: float, release: float
) -> dict[str, float]:
    """Return the quantities of `OF_START` [SI] that a sensor shows; none of a string not at rest.

    Args:
        time: s, shape (n,).
        values: SI, of the sensor, shape (n,).
        contact: s, of the string with its plectrum.
        release: s.
    """
    from scipy.optimize import minimize_scalar

    step = float(time[1] - time[0])
    speed = 2 * string.length * string.frequency
    place = string.length if channel.place is None else channel.place
    delay = abs(place - string.plucking_point) / speed
    resting = (time > contact - 2 * SPAN) & (time < contact - step)
    ringing = time >= release + delay + NEAR
    ringing[ringing] = np.arange(ringing.sum()) * step * string.frequency < PERIODS
    recorded = resting.any() and time[0] < contact < release < time[-1]
    if not (recorded and np.isfinite(values).all()):
        return {}
    # The sensor must be quiet before contact, compared with the ringing string.
    if np.ptp(values[resting]) > 0.1 * np.ptp(values[time > release]):
        return {}  # it still vibrates from the last press
    seen = values - np.median(values[resting])
    if channel.quantity == "string_velocity":
        seen = np.cumsum(seen) * step
        seen = seen - np.interp(contact, time, seen)
    line = _line(time, seen / _static(channel, string), contact, release)
    found = dict(zip(OF_START, line, strict=False))
    if ringing.sum() * step * string.frequency < PERIODS - 1:
        return found
    count = min(16, int(0.4 / step / string.frequency))  # The higher ones would bias the first
    since, own = time[ringing] - release - delay, values[ringing]

    def fitted(frequency: float) -> tuple[Floats, float]:
        phase = 2 * np.pi * frequency * np.outer(since, np.arange(1, count + 1))
        waves = np.hstack([np.cos(phase), np.sin(phase)])
        design = np.hstack([waves, waves * since[:, None], np.ones((len(since), 1))])
        found, *_ = np.linalg.lstsq(design, own, rcond=None)
        return np.asarray(found, float), float(np.sum((own - design @ found) ** 2))

    grid = string.frequency * np.linspace(1 - DETUNED, 1 + DETUNED, 25)
    best = int(np.argmin([fitted(frequency)[1] for frequency in grid]))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    least: Any = minimize_scalar(lambda f: fitted(f)[1], bounds=ends, method="bounded")
    waves = fitted(float(least.x))[0]
    amplitudes = np.hypot(waves[:count], waves[count : 2 * count])
    seen_by = _of_modes(channel, string, float(least.x))
    for name, amplitude, gain in zip(OF_START[2:], amplitudes, seen_by, strict=False):
        if gain:
            found[name] = float(amplitude / gain)
    return found


def _line(time: Floats, lift: Floats, contact: float, release: float) -> tuple[float, float]:
    """Return lift [m] and velocity [m/s] of the string at its release, by a straight line."""
    end = release - NEAR
    at = np.linspace(end - min(SPAN, (release - contact) / 3), end, 64)
    slope, intercept = np.polyfit(at - release, np.interp(at, time, lift), 1)
    return float(intercept), float(slope)


def _static(channel: Channel, string: String) -> float:
    """Return what a sensor shows, over the lift of the string that a force holds."""
    b, length = string.plucking_point, string.length
    if channel.place is None:
        return string.tension / (length - b)
    return min(channel.place / b, (length - channel.place) / (length - b))


def _of_modes(channel: Channel, string: String, frequency: float) -> Floats:
    """Return the amplitude that a sensor shows over that of each of `PARTIALS`; 0 near a node."""
    if channel.place is None:
        return np.asarray(PARTIALS * np.pi * string.tension / string.length, float)
    shape = np.abs(np.sin(PARTIALS * np.pi * channel.place / string.length))
    rate = 2 * np.pi * frequency * PARTIALS if channel.quantity == "string_velocity" else 1.0
    # A sensor near a node does not see the mode.
    return np.asarray(np.where(shape < 0.1, 0.0, shape * rate), float)


def predicted_start(string: String, choir: ChoirPluck, time: Floats) -> dict[str, float]:
    """Return the quantities of `OF_START` [SI] of a predicted pluck.

    The modes are those of a string that a point force lifts and moves:
    q_n = 2 h sin(n pi b) / (pi^2 b (1 - b) n^2), and likewise their velocities.

    Args:
        time: s, of the prediction, shape (n,).
    """
    b = string.plucking_point / string.length
    held = choir.string_force > 0
    lifts = choir.string_force[held] / string.static_stiffness
    lift, velocity = _line(time[held], lifts, choir.contact, choir.release)
    shape = 2 * np.sin(PARTIALS * np.pi * b) / (math.pi**2 * b * (1 - b) * PARTIALS**2)
    omega = 2 * np.pi * string.frequency * PARTIALS
    amplitudes = np.abs(shape) * np.hypot(lift, velocity / omega)
    return dict(zip(OF_START, [lift, velocity, *amplitudes.tolist()], strict=True))
