"""Prove the force transducer: its gain, sign and delay by a falling weight, its fixture's mass."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sautereau.daq.file.reading import read_recording
from sautereau.daq.signals.calibration import restored
from sautereau.rig.acquisition import Channel, Daq
from sautereau.rig.edit import TomlValue
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY, format_quantity
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.contact import between_rests, over_key, play_recorded
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments, to_angles

HANGING = 6.0  # s, of the recording in which the thread is cut
REST = 0.4  # s, of a rest of the arm
STROKE = 3e-3  # m, of the fingertip in the air
STROKES = 8  # Number of them, down and up again
BAND = 60.0  # Hz, in which force and acceleration in the air are compared; the strokes take 20 ms
BLOCK = 20e-3  # s, over which the force is averaged: one period of the mains
BESIDE = 0.1  # s, beside the cut that is omitted: thread and finger swing
FALL = 10e-3  # s of free fall that are compared, if the vibrometer's range permits
LOCAL_GRAVITY = 1.5e-3
"""Dimensionless, relative standard uncertainty of the gravity of a place: 9.780 to 9.832 m/s^2."""
SURE = 2.0  # Standard uncertainties beyond which values differ: the intervals are of 95 %


@dataclass(frozen=True)
class Proof:
    """What a weight that was taken off shows about the force channel."""

    gain: float
    """Measured force over the weight, with the scale of the rig; negative with the wrong sign."""
    gain_std: float
    """Standard uncertainty of `gain`."""
    late: float = 0.0
    """s, by which the force lags the speed of the weight, beyond the delays in the rig."""
    late_std: float = 0.0
    """s, standard uncertainty of `late` with correct velocity."""
    speed_gain: float = 0.0
    """Measured over true speed of the weight; near 0 where the vibrometer has not seen it."""
    speed_gain_std: float = 0.0
    """Standard uncertainty of `speed_gain`."""


def prove_force(rig: Rig, ask: Ask) -> Found:
    """Record a weight that falls from the fingertip, and strokes of the fingertip in the air.

    Raises:
        RobotError: The weight was not taken off, or the motion broke off; the motors are off.
    """
    ask_first(
        ask,
        "force",
        f"The arm homes, moves above the key, holds a weight on a thread, and after that moves"
        f" {STROKE * 1e3:g} mm up and down, {STROKES} times. Is its way free?",
    )
    if rig.daq.channel("force") is None:
        return Found(("force: the rig has no force channel",))
    found: list[Found] = []
    mass = ask.number(
        "What is the mass of the weight? With none at hand, press Enter.",
        "kg",
        0.05,  # About the force of a pluck
    )
    with homed(rig) as controller:
        above = np.array([rig.press.hover + STROKE, rig.press.hover])
        up, down = over_key(rig, rig.key.press_arm, above)
        controller.move_to(up, approach_speed(rig))
        if mass is None:
            doubt = "without a weight, gain, sign and delay of the transducer are not proven"
            found.append(Found((), warnings=(doubt,)))
        else:
            ask.act(
                "Hang the weight on the fingertip by a thread, aim the laser at it, and wait until"
                f" it is still. Then cut the thread within {HANGING - 2:g} s of pressing Enter."
            )
            still = between_rests(rig, np.array([up] * 16), [HANGING / 15] * 15)
            _, volts = play_recorded(rig, controller, still)
            joints = to_angles(up, rig.arm.counts_per_revolution)
            proof = proof_of(rig.daq, volts, mass, along=-math.sin(float(joints.sum())))
            found.append(_proven(rig.daq, proof))
            rig = with_values(rig, found[-1].plain)
        capture, volts = play_recorded(rig, controller, _strokes(rig, up, down))
    found.append(_fixture(rig, capture.times, capture.counts, volts))
    return Found(
        tuple(line for one in found for line in one.lines),
        {key: value for one in found for key, value in one.values.items()},
        {key: value for one in found for key, value in one.figures.items()},
        tuple(warning for one in found for warning in one.warnings),
    )


def force_of_recording(path: Path, mass: float) -> Found:
    """Prove the force channel by the recording of a weight that was taken off the transducer.

    Args:
        mass: kg, of the weight, negative if it lay on the transducer; else it hung from it.

    Raises:
        RobotError: There is no force channel, or the weight was not taken off.
    """
    recorded = read_recording(path)
    return _proven(recorded.rig.daq, proof_of(recorded.rig.daq, recorded.volts, mass))


def proof_of(daq: Daq, volts: Mapping[str, Floats], mass: float, along: float = 1.0) -> Proof:
    """Compare force and velocity with the motion of a weight.

    A weight that hangs pulls with m (g - a). Taken off it falls freely: the force steps by m g, the
    speed is v(t) = integral of g s(t) dt, where s rises from 0 to 1 as the force does. A force that
    lags the velocity by d gives v = k (G + d g s) + constant, with G the integral for the force as
    it is: two linear columns, solved again with the force shifted until d is 0.

    Args:
        volts: By channel, shape (n,).
        mass: kg, negative for a weight that presses on the transducer.
        along: Part of a vertical force along the transducer.

    Raises:
        RobotError: There is no force channel, or no step of the force.
    """
    channel = daq.channel("force")
    if channel is None:
        raise RobotError("setup force: the recording has no force channel; add it to daq.channels")
    rate = daq.sample_rate
    force = restored(volts[channel.name], channel, rate)
    step, step_std, cut = _step(force, rate)
    gain = step / (mass * GRAVITY * along)
    gain_std = math.hypot(step_std / abs(step), LOCAL_GRAVITY) * abs(gain)
    speed = daq.channel("velocity")
    if speed is None:
        return Proof(gain, gain_std)
    late, late_std, k, k_std = _fall(force / step, volts[speed.name], speed, cut, rate)
    k_std = math.hypot(k_std, LOCAL_GRAVITY * abs(k))
    return Proof(gain, gain_std, late, late_std, k, k_std)


def _step(force: Floats, rate: float) -> tuple[float, float, int]:
    """Return height [N] and standard uncertainty of the step in a force, and its sample."""
    # 0.7 s before and after the cut are used.
    half, beside, window = (round(t * rate) for t in (BLOCK / 4, BESIDE, 0.7))
    sums = np.cumsum(np.concatenate([[0.0], force]))
    means = (sums[half:] - sums[:-half]) / half
    change = means[half:] - means[:-half]
    cut = int(np.argmax(np.abs(change))) + half
    block = round(BLOCK * rate)
    parts = force[max(0, cut - window) : max(0, cut - beside)], force[cut + beside : cut + window]
    if min(map(len, parts)) < 4 * block:
        raise RobotError(
            f"setup force: the force steps {cut / rate:.2f} s after the start of the recording, of"
            f" {len(force) / rate:.2f} s; take the weight off {BESIDE + 4 * BLOCK:.2g} s or more"
            " from its ends"
        )
    blocks = [p[: len(p) // block * block].reshape(-1, block).mean(1) for p in parts]
    before, after = map(len, blocks)
    offset = round(2 * beside / block)
    place = np.concatenate([np.arange(before), before + offset + np.arange(after)]) * 1.0
    columns = np.stack([place >= before, np.ones_like(place), place - place.mean()], 1)
    values = np.concatenate(blocks)
    fit, _, _, _ = np.linalg.lstsq(columns, values, rcond=None)
    residual = values - columns @ fit
    variance = residual @ residual / (len(values) - 3)
    std = math.sqrt(variance * np.linalg.inv(columns.T @ columns)[0, 0])
    if abs(fit[0]) < 8 * std:
        raise RobotError(
            f"setup force: the largest step of the force is {fit[0] * 1e3:.3g} +-"
            f" {std * 1e3:.2g} mN; hang a heavier weight, and cut its thread at once during the"
            " recording"
        )
    return float(fit[0]), std, cut


def _fall(
    share: Floats, volts: Floats, channel: Channel, cut: int, rate: float
) -> tuple[float, float, float, float]:
    """Return lag of the force [s] and gain of the velocity, each with its standard uncertainty."""
    speed = restored(volts, channel, rate)
    first = cut - round(FALL * rate)
    last = min(cut + round(FALL * rate), len(speed))
    clipped = np.abs(volts[cut:]) > 0.95 * channel.range
    if clipped.any():
        last = min(last, cut + int(np.argmax(clipped)) - math.ceil(channel.lag * rate))
    rows = np.arange(first, last)
    if first < 0 or len(rows) < 1.1 * FALL * rate:
        return 0.0, 0.0, 0.0, 0.0
    late, before = 0.0, share[: max(1, cut - round(BESIDE * rate))][-round(BESIDE * rate) :].mean()
    fit = np.zeros(3)
    std = np.zeros(3)
    for _ in range(8):
        part = np.interp(rows + late * rate, np.arange(len(share)), share) - before
        # A thread parts within 3 ms; hum would shift a longer integral.
        part[rows + late * rate < cut - 3e-3 * rate] = 0.0
        fallen = GRAVITY * (np.cumsum(part) - part / 2) / rate
        columns = np.stack([fallen, GRAVITY * part, np.ones(len(rows))], 1)
        fit, _, _, _ = np.linalg.lstsq(columns, speed[rows], rcond=None)
        residual = speed[rows] - columns @ fit
        variance = residual @ residual / (len(rows) - 3)
        std = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
        if abs(fit[0]) < 0.1:  # the laser does not see the weight
            break
        change = float(fit[1] / fit[0])
        late = float(np.clip(late + change, -FALL, FALL))
        if abs(change) < 0.01 / rate:
            break
    late_std = float(std[1]) / max(abs(fit[0]), 0.1)
    within = 1 / rate / math.sqrt(12)  # a sudden step is somewhere between two samples
    return late, math.hypot(late_std, within), float(fit[0]), float(std[0])


def _proven(daq: Daq, proof: Proof) -> Found:
    """Compare a proof with the rig, and say what is wrong."""
    at, channel = next((i, c) for i, c in enumerate(daq.channels) if c.quantity == "force")
    key, gain, std = f"daq.channels.{at}", proof.gain, proof.gain_std
    lines = [f"force: gain {_interval(gain, std)} times that of the rig, {channel.scale:g} N/V"]
    doubts: list[str] = []
    values: dict[str, TomlValue] = {}
    figures = {"gain": gain, "gain_std": std, "speed_gain": proof.speed_gain}
    if gain < 0:
        doubts.append(
            "the transducer has the wrong sign: its force falls when the finger presses; invert it"
            " at the charge amplifier, and repeat this step: no scale is written"
        )
    else:
        scale = channel.scale / gain
        if abs(gain - 1) > SURE * math.hypot(std, channel.gain_std * gain):
            doubts.append(
                f"the transducer's gain is {gain:.3g} times that of the rig, beyond the uncertainty"
                f" of {SURE * 100 * channel.gain_std:.2g} %: `scale` is {scale:.4g} N/V"
            )
        values[f"{key}.scale"] = {"value": format_quantity(float(f"{scale:.5g}"), "N/V")}
        values[f"{key}.gain_std"] = {"value": float(f"{std / gain:.2g}")}
    velocity = daq.channel("velocity")
    # Of a free fall, where the laser is aimed at the weight.
    if velocity is None or abs(proof.speed_gain) <= 0.5:
        doubts.append("the laser has not seen the weight fall: the delay is not measured")
        return Found(tuple(lines), values, figures, tuple(doubts))
    k, k_std = proof.speed_gain, proof.speed_gain_std
    if k < 0:
        doubts.append(
            "the vibrometer has the wrong sign: a falling weight has a negative velocity; aim it at"
            " the side that it sees of the key, or invert its output"
        )
    elif abs(k - 1) > SURE * math.hypot(k_std, velocity.gain_std * k):
        doubts.append(
            f"the vibrometer shows {k:.3g} times the acceleration of a free fall: check its range;"
            f" its `scale` would be {velocity.scale / k:.4g} m/s/V"
        )
    late_std = math.hypot(proof.late_std, velocity.delay_std)
    delay, stated = channel.delay + proof.late, channel.delay
    lines.append(
        f"force: delay {_interval(delay * 1e3, late_std * 1e3)} ms, {stated * 1e3:.3g} ms in the"
        " rig"
    )
    figures |= {"delay": delay, "delay_std": late_std}
    if abs(proof.late) > SURE * math.hypot(late_std, channel.delay_std):
        doubts.append(
            f"the delay of the force is {delay * 1e3:.3g} ms, and the rig states"
            f" {stated * 1e3:.3g} ms: one of them is wrong, or that of the vibrometer, by"
            f" {abs(proof.late) * 1e3:.3g} ms"
        )
    if delay >= -SURE * late_std:  # else the vibrometer's delay is wrong
        late = float(f"{max(delay, 0.0):.4g}")
        values[f"{key}.delay"] = {"value": format_quantity(late, "s")}
        values[f"{key}.delay_std"] = {"value": format_quantity(float(f"{late_std:.2g}"), "s")}
    return Found(tuple(lines), values, figures, tuple(doubts))


def _interval(value: float, std: float) -> str:
    return f"{value:.4g} +-{SURE * std:.2g} (95 %)"


def _strokes(rig: Rig, up: Counts, down: Counts) -> Segments:
    """Return a motion down and up in the air, with a rest before and after."""
    turn = float(np.abs(up - down).max()) * rig.arm.radians_per_count
    quick = math.sqrt(6 * turn / rig.arm.acceleration_limit)
    counts = np.array([up, up, *(down, up) * STROKES, up])
    return between_rests(rig, counts, [REST, *(quick, quick) * STROKES, REST])


def _fixture(rig: Rig, times: Floats, counts: Counts, volts: Mapping[str, Floats]) -> Found:
    """Fit the inertia of the fixture to the force in the air.

    Force = m s'' + m d s''' + constant + drift: s is the fingertip's motion along the finger,
    downwards, as the encoders record it, d the delay of the controller's clock behind the force.
    Both sides pass the same filter.
    """
    from scipy.signal import butter, sosfiltfilt

    channel = next(c for c in rig.daq.channels if c.quantity == "force")
    rate = rig.daq.sample_rate
    force = restored(volts[channel.name], channel, rate)
    joints = to_angles(counts, rig.arm.counts_per_revolution)
    finger = float(joints.sum(axis=1).mean())
    along = fingertip_place(rig.arm, joints) @ np.array([math.cos(finger), math.sin(finger)])
    time = np.arange(len(force)) / rate
    low = butter(2, BAND, fs=rate, output="sos")
    derivatives = [sosfiltfilt(low, np.interp(time, times, along))]
    for _ in range(3):
        derivatives.append(np.gradient(derivatives[-1], 1 / rate))
    inside = (time > REST / 2) & (time < min(time[-1], times[-1]) - REST / 2)
    columns = np.stack([*derivatives[2:], np.ones_like(time), time], 1)[inside]
    values = sosfiltfilt(low, force)[inside]
    fit, _, _, _ = np.linalg.lstsq(columns, values, rcond=None)
    residual = values - columns @ fit
    independent = 2 * BAND * len(values) / rate  # values in a band of this width
    variance = residual @ residual / len(values) * independent / (independent - 4)
    scaled = columns / np.linalg.norm(columns, axis=0)
    inverse = np.linalg.inv(scaled.T @ scaled)[0, 0] / (columns[:, 0] @ columns[:, 0])
    mass, std = float(fit[0]), math.sqrt(variance * inverse * len(values) / independent)
    known = rig.arm.fixture_mass
    line = f"force: fixture {_interval(mass * 1e3, std * 1e3)} g, {known * 1e3:.4g} g in the rig"
    figures = {"fixture_mass": mass, "fixture_mass_std": std}
    if abs(mass - known) <= SURE * std:
        return Found((line,), {}, figures)
    if mass < 0:
        doubt = "the mass of the fixture would be negative: check the sign of the transducer"
        return Found((line,), {}, figures, (doubt,))
    value = format_quantity(float(f"{mass * 1e3:.4g}"), "g")
    return Found((line,), {"arm.fixture_mass": {"value": value}}, figures)
