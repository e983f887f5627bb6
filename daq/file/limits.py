"""What a recording can hold; readers of recordings and of exports refuse everything else."""

import math
from typing import Any

import numpy as np

from sautereau.daq.file.recorded import Event, Joints, Plan
from sautereau.rig.units import shown

HIGHEST_RATE = 1e8  # Hz; the filter of the previews grows with the rate
FARTHEST_SAMPLE = 2**53  # Limit of the index of a sample, counted from the trigger
FARTHEST_TIME = 9e9  # s, limit of a time after or before the trigger: dates have 64 bits of ns
MOST_VOLTS = 512 * 1024**2  # Limit in bytes of the volts that are read at once from any file
VOLTS_PER_BYTE = 32
"""The same limit of a larger file, per byte of the file. A converter's noise cannot be compressed
as much."""
MOST_EVENTS = 100_000  # Limit for a recording


def time_faults(t0_ns: Any, rate: float, *samples: int) -> list[str]:
    """Return what is wrong with the times of samples.

    Args:
        t0_ns: Date of the trigger, ns since 1970.
        rate: Sampling rate, Hz.
        samples: Indices of samples, counted from the trigger.
    """
    faults = []
    if not 0 < rate <= HIGHEST_RATE:
        faults.append(f"rate: {rate!r} Hz is not from 0 to HIGHEST_RATE = {HIGHEST_RATE:g} Hz")
    if not isinstance(t0_ns, int) or not -(2**63) <= t0_ns < 2**63:
        faults.append(f"t0_ns: {shown(t0_ns)} ns is not a date of 64 bits")
    faults += [
        f"first_sample: {shown(sample)} is beyond FARTHEST_SAMPLE = {FARTHEST_SAMPLE}"
        for sample in samples
        if abs(sample) > FARTHEST_SAMPLE
    ]
    if not faults and any(abs(t0_ns + n * 1e9 / rate) >= 2**63 for n in samples):
        faults.append(f"rate: at {rate!r} Hz, its samples reach beyond the dates of 64 bits")
    return faults


def series_faults(name: str, series: Plan | Joints | None) -> list[str]:
    """Return what is wrong with a planned or captured motion."""
    arrays = {} if series is None else vars(series)
    if series is not None and (np.abs(series.t) > FARTHEST_TIME).any():
        return [f"{name}: a time is beyond FARTHEST_TIME = {FARTHEST_TIME:g} s"]
    if all(a.ndim == 1 and np.isfinite(a).all() for a in arrays.values()):
        required = ("t", "q1", "q2", "jack_rise")
        if len({len(a) for key, a in arrays.items() if key in required or len(a)}) < 2:
            return []
    return [f"{name}: its columns must have equally many numbers, all of them finite"]


def event_faults(events: "tuple[Event, ...] | list[Event]") -> list[str]:
    """Return what is wrong with events."""
    if all(
        isinstance(event.time, int | float)
        and abs(event.time) <= FARTHEST_TIME
        and isinstance(event.std, int | float)
        and 0 <= event.std < math.inf
        and isinstance(event.kind, str)
        and isinstance(event.text, str)
        for event in events
    ):
        return []
    return [
        f"events: one has no finite time within FARTHEST_TIME = {FARTHEST_TIME:g} s, no finite"
        " uncertainty, or a kind or text that is not text"
    ]
