"""Tap the resting key, and find the modes in which it bends and heaves."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sautereau.analysis.transient.tap import BAND, TapResponse, tap_response
from sautereau.daq.file.reading import read_recording
from sautereau.daq.signals.calibration import restored
from sautereau.rig.acquisition import Daq
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.contact import between_rests, over_key, play_recorded
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Segments

TAPS = 8  # Number of taps
REST = 0.4  # Rest before each tap and after the last one (s)
ABOVE = 0.3e-3  # Height of the fingertip above the key between taps (m)
BELOW = 0.2e-3  # Depth of the fingertip below the key's rest at the bottom of a tap (m)


def tap_key(rig: Rig, ask: Ask) -> Found:
    """Tap the key with the finger, and find its modes.

    Raises:
        RobotError: The rig has no channel of force or velocity, or the motion broke off; the
            motors are off.
        AnalysisError: The taps were not recorded.
    """
    ask_first(
        ask,
        "tap",
        f"The arm homes and taps the key {TAPS} times from {ABOVE * 1e3:g} mm above it, down to"
        f" {BELOW * 1e3:g} mm below its surface. Is its way free?",
    )
    with homed(rig) as controller:
        hover = over_key(rig, rig.key.press_arm, np.array([rig.press.hover]))[0]
        controller.move_to(hover, approach_speed(rig))
        segments = _taps(rig)
        controller.move_to(segments.start, approach_speed(rig))
        _, volts = play_recorded(rig, controller, segments)
        controller.move_to(hover, approach_speed(rig))
    found = _found(tap_response([_signals(rig.daq, volts, "this rig")], rig.daq.sample_rate))
    if not (mass := rig.arm.fixture_mass):
        return found
    doubt = (
        f"the force of the taps contains the inertia of the fixture, {mass * 1e3:.3g} g"
        " (arm.fixture_mass), and so do the modes: tap with a hammer"
    )
    return replace(found, warnings=(*found.warnings, doubt))


def modes_of_recordings(paths: Sequence[Path]) -> Found:
    """Find the modes of a key in recordings of taps, by a hammer on the force channel or a finger.

    Raises:
        RobotError: A recording has no channel of force or velocity, or another rate.
        AnalysisError: There are too few taps.
    """
    records, rates = [], set()
    for path in paths:
        recorded = read_recording(path)
        records.append(_signals(recorded.rig.daq, recorded.volts, str(path)))
        rates.add(recorded.rate)
    if len(rates) > 1:
        listed = ", ".join(f"{rate:g} Hz" for rate in sorted(rates))
        raise RobotError(f"setup tap: the recordings have different rates, {listed}; give one rate")
    return _found(tap_response(records, rates.pop()))


def _taps(rig: Rig) -> Segments:
    """Return the motion: rests above the key, and between them down and up again."""
    above, below = over_key(rig, rig.key.press_arm, np.array([ABOVE, -BELOW]))
    # The largest acceleration of a cubic between two rests is six lengths over its squared time.
    turn = float(np.abs(below - above).max()) * rig.arm.radians_per_count
    quick = math.sqrt(6 * turn / rig.arm.acceleration_limit)
    counts = np.array([above, *(above, below, above) * TAPS, above])
    return between_rests(rig, counts, [*(REST, quick, quick) * TAPS, REST])


def _signals(daq: Daq, volts: Mapping[str, Floats], of: str) -> tuple[Floats, Floats]:
    """Return force [N] and velocity [m/s] without the sensors' delays; shape (n,) each."""
    found = []
    for quantity in ("force", "velocity"):
        channel = daq.channel(quantity)
        if channel is None:
            raise RobotError(
                f"setup tap: {of} has no channel of {quantity}; add it to daq.channels"
            )
        found.append(restored(volts[channel.name], channel, daq.sample_rate))
    count = min(map(len, found))
    return found[0][:count], found[1][:count]


def _found(response: TapResponse) -> Found:
    count, highest = response.taps, response.highest
    lines = [f"tap: {count} taps; modes of the key up to {highest:.0f} Hz: {len(response.modes)}"]
    if response.cut:
        lines.append(f"not used: {response.cut} taps that the ends of a recording cut off")
    if response.flight:
        lines.append(
            f"after a tap the key left its rest for up to {response.flight * 1e3:.0f} ms; its fall"
            " is fitted with the modes"
        )
    lines += [
        f"mode: {m.frequency:.1f} +- {m.frequency_std:.1f} Hz, damping {m.damping * 100:.2g} +-"
        f" {m.damping_std * 100:.1g} % of critical, coherence {m.coherence:.2f}"
        for m in response.modes
    ]
    modes: list[dict[str, str | float]] = [
        {
            "frequency": format_quantity(round(m.frequency, 2), "Hz"),
            "frequency_std": format_quantity(round(m.frequency_std, 3), "Hz"),
            "damping": round(m.damping, 5),
            "damping_std": round(m.damping_std, 6),
        }
        for m in response.modes
    ]
    figures = {"taps": float(count), "cut": float(response.cut), "highest": highest}
    for n, mode in enumerate(response.modes):
        figures |= {f"frequency_{n}": mode.frequency, f"damping_{n}": mode.damping}
    return Found(
        tuple(lines),
        {"key.modes": modes} if modes else {},
        figures,
        ()
        if modes
        else (f"these taps show no mode of {BAND[0]:.0f} to {highest:.0f} Hz: tap with a hammer",),
    )
