"""The signals of a press for finding phases, with flagged samples interpolated."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d
from scipy.signal import butter

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.drift import departure
from sautereau.analysis.loading.press import UNITS, Press, Signal, columns_of
from sautereau.analysis.phases.settings import SETTINGS, PhaseSettings
from sautereau.daq.signals.calibration import white_noise
from sautereau.rig.acquisition import Channel
from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import key_motion, moving_inertia
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import press_law

LARGEST = {"force": 1e4, "velocity": 1e3}
"""N and m/s, limits of the samples; beyond them the sums of a fit lose all digits."""
SPIKE = 12.0  # Height of a spike in standard deviations


@dataclass(frozen=True)
class LowPass:
    """A Butterworth filter, whose delay of slow motions is compensated."""

    corner: float
    """Hz."""
    order: int
    delay: float
    """s, of slow motions."""

    def ahead(self, step: float) -> int:
        """Return the number of rows after a row that have a part in it, for rows of a step [s]."""
        return math.ceil(self.delay / step) + 1

    def filtered(self, rows: NDArray[Any], step: float, n: int) -> NDArray[Any]:
        """Return filtered columns.

        Args:
            rows: Of at least n + `ahead` rows, shape (..., rows, columns). Before the first row the
                columns are 0.
            step: s, between rows.
            n: Rows to return.

        Returns:
            Shape (..., n, columns).
        """
        weights = _weights(self, step)
        origin = (len(weights) - 1) // 2 - self.ahead(step)
        found = correlate1d(rows, weights, axis=-2, mode="constant", origin=origin)
        return found[..., :n, :]


def slow_low_pass(channel: Channel | None) -> LowPass | None:
    """Return the low-pass of a channel's sensor, if it is slow and its order is known."""
    if channel is None or not channel.low_pass_order or channel.low_pass > 2.5e3:
        return None  # above this a release is a step in the signal
    return LowPass(channel.low_pass, channel.low_pass_order, channel.low_pass_delay)


@lru_cache(maxsize=16)
def _weights(low_pass: LowPass, step: float) -> Floats:
    """Return the parts of a row's neighbours in it, earlier ones first; their sum is 1.

    Between rows a column is linear. So the parts are second differences of the response to a ramp,
    a line and a sum of exponentials.
    """
    turn = 2 * math.pi * low_pass.corner
    filtering: Any = butter(low_pass.order, turn, analog=True, output="zpk")
    poles = filtering[1]
    others = poles[:, None] - poles
    np.fill_diagonal(others, 1.0)
    residues = turn**low_pass.order / others.prod(1) / poles**2
    # Until a thousandth of the response to a step is left.
    rows = math.ceil(math.log(1e-3) / poles.real.max() / step)
    time = np.arange(rows, -low_pass.ahead(step) - 2, -1) * step + low_pass.delay
    since = np.maximum(time, 0.0)
    ramp = since - low_pass.delay + (np.exp(since[:, None] * poles) @ residues).real
    weights = np.diff(np.where(time > 0, ramp, 0.0), 2)
    return weights / weights.sum()


@dataclass(frozen=True)
class Signals:
    """The signals of a press, interpolated over flagged samples; arrays of shape (n,)."""

    time: Floats
    """s after the trigger."""
    rate: float
    """Hz."""
    force: Floats
    """N, of the finger, without spikes of one or two samples."""
    velocity: Floats
    """m/s, of the key at the laser."""
    deflection: Floats
    """m, of the key at the laser."""
    rise: Floats
    """m, of the jack."""
    speed: Floats
    """m/s, of the jack."""
    inertial: float
    """kg, finger force of the inertia of key and jack over the acceleration of the laser spot."""
    force_noise: float
    """N, of one sample."""
    velocity_noise: float
    """m/s, of one sample."""
    instant_std: float
    """s, uncertainty of any instant: sampling, and error of the sensors' calibrated delays."""
    no_force: NDArray[np.bool_]
    """Where the force is flagged."""
    no_velocity: NDArray[np.bool_]
    """Where the velocity is flagged."""
    low_passes: tuple[LowPass | None, ...] = ()
    """Of the sensors of force and velocity, where they are slow."""
    missing: Signal | None = None
    """The signal that was not recorded: its samples are assumed (`_assumed`)."""
    settings: PhaseSettings = SETTINGS
    fall_std: float = 0.0
    """Dimensionless, relative uncertainty of a fall of the load, of which the missing signal has
    a part."""

    def sample(self, instant: float) -> int:
        """Return the sample nearest to an instant [s]."""
        return round((instant - float(self.time[0])) * self.rate)


def signals_of(press: Press, settings: PhaseSettings = SETTINGS) -> Signals:
    """Return the signals of a press, interpolated over drop-outs and spikes.

    Raises:
        AnalysisError: Samples of force or velocity are not numbers.
    """
    rate, key = press.rate, press.rig.key
    time = press.time
    if press.missing is None:
        names = ("force", "velocity", "deflection", "jack_rise", "jack_speed")
        force, velocity, deflection, rise, speed = (press.samples[name] for name in names)
    else:
        force, velocity, deflection, rise, speed = _assumed(press)
    for name, signal in (("force", force), ("velocity", velocity)):
        if not max(signal.max(initial=0.0), -signal.min(initial=0.0)) <= LARGEST[name]:
            bad = int(np.count_nonzero(~(np.abs(signal) <= LARGEST[name])))
            raise AnalysisError(
                f"press {press.path}: {bad} samples of its {name} are not finite numbers up to"
                f" {LARGEST[name]:g} {UNITS[name]}; check the recording and the"
                " calibration, and press again"
            )
    longest = max(1, int(settings.row * rate))
    force_noise, velocity_noise = (
        white_noise(signal[:4096], longest) for signal in (force, velocity)
    )
    no_force, no_velocity = (
        flagged(press, quantity, settings) for quantity in ("force", "velocity")
    )
    force_noise = max(force_noise, settings.force_floor)
    force = _without_spikes(force, SPIKE * force_noise)
    if no_velocity.any() and not no_velocity.all():
        good = ~no_velocity
        velocity = np.interp(time, time[good], velocity[good])
        _, _, _, deflection, rise, speed = columns_of(key, velocity, force, rate)
    inertial = moving_inertia(press.rig) / key.laser_arm / key.press_arm
    velocity_noise = max(velocity_noise, settings.velocity_floor)
    if press.missing == "velocity":
        # With this, rows of one sample have white noise.
        velocity_noise = force_noise / (2 * inertial * rate)
    return Signals(
        time=time,
        rate=rate,
        force=force,
        velocity=velocity,
        deflection=deflection,
        rise=rise,
        speed=speed,
        inertial=inertial,
        force_noise=force_noise,
        velocity_noise=velocity_noise,
        instant_std=math.hypot(1 / rate / math.sqrt(12), _lag_std(press.rig)),
        no_force=no_force,
        no_velocity=no_velocity,
        low_passes=tuple(slow_low_pass(press.rig.daq.channel(q)) for q in ("force", "velocity")),
        missing=press.missing,
        settings=settings,
        fall_std=0.3 if press.missing else 0.0,
    )


def flagged(press: Press, quantity: str, settings: PhaseSettings = SETTINGS) -> NDArray[np.bool_]:
    """Return the rows of force or velocity with values of flagged samples; shape (rows,)."""
    found = np.zeros(len(press.time), bool)
    quantities = {channel.name: channel.quantity for channel in press.rig.daq.channels}
    for mark in press.quality_flags:
        if quantities.get(mark.channel) == quantity:
            first, last = np.searchsorted(press.time, (mark.start, mark.stop))
            # The low-pass of the vibrometer still shows a drop-out within 60 us of it.
            tail = max(2, round(60e-6 * press.rate))
            side = tail if mark.kind == "drop-out" else settings.spread
            found[max(0, first - side) : last + side] = True
    return found


def _assumed(press: Press) -> tuple[Floats, ...]:
    """Return force, velocity, deflection, rise and speed of a press with one signal.

    A missing force is 0: what does not change within milliseconds has no effect on a release. A
    missing velocity is that of the rig's press, from where the force leaves its level at rest.

    Raises:
        AnalysisError: The rig describes no press.
    """
    if press.missing == "force":
        names = ("velocity", "deflection", "jack_rise", "jack_speed")
        velocity, deflection, rise, speed = (press.samples[name] for name in names)
        return np.zeros(len(velocity)), velocity, deflection, rise, speed
    force, key = press.samples["force"], press.rig.key
    planned = press.rig.press
    # Recordings that others made need no run-down that this arm could follow.
    acceleration, jerk = planned.run_up
    sudden = {"run_down_acceleration": acceleration, "run_down_jerk": jerk}
    try:
        law = press_law(planned)
    except TrajectoryError:
        try:
            law = press_law(planned.model_copy(update=sudden))
        except TrajectoryError as error:
            raise AnalysisError(
                f"press {press.path}: without a velocity its motion is that of the rig's [press],"
                f" which describes none: {error}"
            ) from error
    since = (np.arange(len(force)) - departure(force, press.rate)) / press.rate
    angle = key_motion(key, law.law.at(law.start + np.clip(since, 0.0, law.bottom - law.start)))
    velocity = np.where(since < law.bottom - law.start, angle.velocity * key.laser_arm, 0.0)
    _, _, _, deflection, rise, speed = columns_of(key, velocity, force, press.rate)
    return force, velocity, deflection, rise, speed


def _lag_std(rig: Rig) -> float:
    """Return the standard uncertainty of the delays of force and velocity [s].

    A first-order low-pass delays by 1/(2 pi f). A calibration without the order does not define
    whether its delay includes that, so the error is at most 1/(2 pi f) either way.
    """
    channels = [rig.daq.channel(quantity) for quantity in ("force", "velocity")]
    parts = [channel.delay_std for channel in channels if channel]
    force = channels[0]
    if force and force.low_pass and not force.low_pass_order:
        parts.append(1 / (2 * math.pi * force.low_pass) / math.sqrt(3))
    return math.hypot(*parts)


def way_down(signals: Signals) -> tuple[int, int] | None:
    """Return the samples at which the jack leaves rest and reaches its top; None if it does not."""
    top, left = signals.rise.max(initial=0.0), signals.settings.left
    if top < 1e-4:
        return None
    begin = int(np.argmax(signals.rise > left * top))
    return begin, int(np.argmax(signals.rise > (1 - left) * top))


def _without_spikes(force: Floats, least: float) -> Floats:
    """Interpolate spikes of one or two samples, of a least height, between their neighbours."""
    if len(force) < 7:
        return force
    steps = force[3:] - force[:-3]
    high = np.abs(steps) > least
    at = np.flatnonzero(high[:-3] & high[3:])
    before, after = steps[at], -steps[at + 3]
    height = np.minimum(np.abs(before), np.abs(after))
    # A spike returns to the same level; the peak of a pluck does not.
    out = 3 + at[(before * after > 0) & (np.abs(before - after) < 0.3 * height)]
    if not len(out):
        return force
    bridged = force.copy()
    bridged[out] = (force[out - 3] + force[out + 3]) / 2
    return bridged
