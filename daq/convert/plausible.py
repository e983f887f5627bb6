"""Doubts about imported values: an inverted sensor, a wrong unit, a channel without a signal."""

import numpy as np

from sautereau.daq.file.recorded import Signal
from sautereau.rig.acquisition import MEASURED, Channel

LIMITS = {"velocity": (1e-4, 10.0), "force": (1e-3, 200.0)}
"""Smallest and largest plausible magnitude of a press, SI units, by quantity."""
ONSET = 0.3
"""Dimensionless, fraction of the largest magnitude above which the key counts as moving."""
AVERAGED = 0.005
"""Dimensionless, fraction of the record over which the first deviation is averaged."""
REST = 0.02
"""Dimensionless, fraction of the record, from its start, that counts as rest."""


def doubts(volts: Signal, channel: Channel) -> list[str]:
    """Return what is implausible in the samples of a channel, and how to fix it.

    The key goes down first and the finger presses on it, so the first large deviation from rest
    is positive for velocity and force.

    Args:
        volts: Shape (n_samples,), V.
    """
    name, unit = channel.name, channel.unit
    values = volts * channel.scale
    if np.ptp(values) == 0:
        return [
            f"{name}: all samples are {values[0]:.6g} {unit}; check --column.{name} and the sensor"
        ]
    found = []
    if (most := float(np.abs(volts).max())) > channel.range:
        found.append(
            f"{name}: reaches {most:.5g} V, beyond the range of {channel.range:.5g} V in the rig;"
            f" check --unit.{name}, and scale and range of the rig's channel"
        )
    if channel.quantity not in LIMITS:
        return found
    least, limit = LIMITS[channel.quantity]
    largest = float(np.abs(values).max())
    if not least <= largest <= limit:
        found.append(
            f"{name}: reaches {largest:.5g} {unit}, which is implausible: a press reaches"
            f" {least:g} to {limit:g} {unit}; check --unit.{name} and --column.{name}"
        )
    # A velocity has no offset that matters here, and a file may start in motion.
    rest = 0.0 if channel.quantity == "velocity" else np.median(values[: _share(REST, values)])
    if _first_sign(values - rest) < 0:
        found.append(
            f"{name}: the first large deviation from rest is negative, and positive means that"
            f" {MEASURED.get(channel.quantity).positive}: the sensor seems inverted; if so,"
            f" import again with --invert {name}"
        )
    return found


def _first_sign(moved: Signal) -> float:
    """Return the sign of the first large deviation from rest."""
    magnitude = np.abs(moved)
    first = int(np.argmax(magnitude > ONSET * np.quantile(magnitude, 0.999)))
    return float(np.sign(moved[first : first + _share(AVERAGED, moved)].mean()))


def _share(fraction: float, values: Signal) -> int:
    return max(1, round(fraction * len(values)))
