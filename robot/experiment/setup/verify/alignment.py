"""Group B: from the trigger's edge to the motion, by the finger's contact with the key.

The force channel and the encoders both see the contact, each on its own clock. At a speed v the
encoders read, at the instant at which the force rises, a place v times the delay below the contact.
Two speeds separate the place from the delay.
"""

import math

import numpy as np

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Channel
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture
from sautereau.robot.experiment.setup.contact import (
    Creep,
    NoContact,
    even,
    over_key,
    play_recorded,
    touch_at,
)
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench
from sautereau.trajectory.arm import fingertip_place, joints_holding_point
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.segments import Segments

_APART = 0.6e-3
"""Distance of start and end from the key's surface (m), which is crossed at a constant speed."""
_RAMP = 20e-3  # Duration of acceleration and of deceleration (s)
_REST = 20e-3  # Rest before the motion (s)
_CREEP = Creep(step=0.4e-3, speed=10e-3)
_APPROACH = {"arm.approach_speed": "0.2 rad/s"}


def trigger_delay(bench: Workbench) -> None:
    """Touch the key fast and slowly; compare contact in the force with that in the encoders."""
    rig = with_values(bench.rig, _APPROACH | bench.of_daq)
    channel = rig.daq.channel("force")
    if channel is None:
        bench.warn("not measured: the rig has no force channel; the delay is the rig file's")
        return
    if not bench.ask.confirm(
        "The finger touches the key where it is pressed, and moves it by less than 1 mm. Is the"
        " finger above the key, and the emergency stop in your hand?"
    ):
        bench.warn("not measured: the finger was not to touch the key")
        return
    try:
        with bench.controller.powered():
            bench.controller.home()
            height = touch_at(rig, bench.controller, rig.key.press_arm, _CREEP).height
            starts = 5 if bench.controller.simulated else 50
            # Speeds of the finger in m/s.
            slow = [_contact(bench, rig, channel, height, 0.003) for _ in range(3)]
            fast = [_contact(bench, rig, channel, height, 0.03) for _ in range(starts)]
    except (NoContact, DaqError) as error:
        bench.warn(f"not measured: {error}; run setup touch, then setup verify again")
        return
    delay, spread = delay_of(np.array(slow), np.array(fast))
    std = math.hypot(spread, channel.delay_std)
    bench.figures |= {"trigger_delay": delay, "trigger_delay_std": std}
    bench.values["controller.trigger_delay"] = f"{delay * 1e3:.3f} ms"
    bench.values["controller.trigger_delay_std"] = f"{std * 1e3:.3f} ms"
    bench.say(
        f"the motion starts {delay * 1e3:.3f} ms after the trigger's edge, standard uncertainty"
        f" {std * 1e3:.3f} ms, from {starts} starts"
    )


def delay_of(slow: Floats, fast: Floats) -> tuple[float, float]:
    """Return the delay [s] from edge to motion, and the standard deviation of a single start [s].

    Args:
        slow: m and m/s, `place_at` slow contacts; shape (n, 2).
        fast: The same of fast ones, shape (m, 2).
    """
    (place, speed), heights, speeds = slow.mean(axis=0), fast[:, 0], fast[:, 1]
    delays = (place - heights) / (speeds - speed)
    scatter = slow[:, 0].std(ddof=1) / (speeds.mean() - speed)
    return float(delays.mean()), math.hypot(delays.std(ddof=1), scatter)


def _contact(
    bench: Workbench, rig: Rig, channel: Channel, height: float, speed: float
) -> tuple[float, float]:
    """Return height [m] and downward speed [m/s] by the encoders where the force rises."""
    motion = stroke(rig, height, speed)
    bench.controller.move_to(motion.start, rig.arm.approach_speed / rig.arm.radians_per_count)
    capture, volts = play_recorded(rig, bench.controller, motion)
    force = volts[channel.name] * channel.scale
    return place_at(capture, rig, onset(force, rig.daq.sample_rate) - channel.lag)


def place_at(capture: Capture, rig: Rig, at: float) -> tuple[float, float]:
    """Return the fingertip's height [m] and downward speed [m/s] at a time of the record [s]."""
    angles = capture.counts.astype(np.float64) * rig.arm.radians_per_count
    heights = fingertip_place(rig.arm, angles)[:, 1]
    row = int(np.clip(np.searchsorted(capture.times, at), 1, len(capture) - 1))
    speed = np.diff(heights)[row - 1] / np.diff(capture.times)[row - 1]
    return float(np.interp(at, capture.times, heights)), -float(speed)


def onset(force: Floats, rate: float) -> float:
    """Return the time [s] at which a force begins to rise.

    Args:
        force: N, at rest at first; shape (n,).
        rate: Hz.

    Raises:
        NoContact: It does not rise.
    """
    rest = force[: round(_REST / 2 * rate)]
    rise = np.abs(force - rest.mean())
    level = max(20e-3, 6 * float(rest.std()))  # 20 mN: the contact's beginning is extrapolated
    above = np.flatnonzero(rise > level)
    if not len(above):
        raise NoContact("the finger met no key")
    first = int(above[0])
    end = first + max(2, int(np.argmax(rise[first:] > 3.0 * level)))
    slope, offset = np.polyfit(np.arange(first, end), rise[first:end], 1)
    begun = -offset / slope if slope > 0 else first
    return float(np.clip(begun, 2 * first - end, first)) / rate


def stroke(rig: Rig, height: float, speed: float) -> Segments:
    """Return a stroke [PVT segments] across the key, at a constant speed at the contact.

    Args:
        height: m, of the key's surface above the one given by the rig.
        speed: m/s, of the fingertip there.
    """
    period = rig.controller.sample_period
    ramp, rest = (even(t / period) for t in (_RAMP, _REST))
    cruise = even((2 * _APART - speed * _RAMP) / speed / period)
    samples = np.array([rest, ramp, cruise, ramp, rest])
    speed = 2 * _APART / ((ramp + cruise) * period)  # as complete samples have it
    speeds = np.array([0.0, 0.0, -speed, -speed, 0.0, 0.0])
    moved = np.cumsum((speeds[1:] + speeds[:-1]) / 2 * samples * period)
    heights = height + _APART + np.concatenate([[0.0], moved])
    counts = over_key(rig, rig.key.press_arm, heights)
    z = rig.key.surface_height + rig.arm.fingertip_radius + heights
    centre = np.stack([np.full_like(z, -rig.key.press_arm), z], -1)
    down = np.stack([np.zeros_like(speeds), speeds], -1)
    turning = joints_holding_point(rig.arm, Motion(centre, down, np.zeros_like(down))).velocity
    return Segments(
        start=counts[0],
        steps=np.diff(counts, axis=0),
        velocities=2 * np.rint(turning[1:] / rig.arm.radians_per_count / 2).astype(np.int64),
        samples=samples,
    )


STEPS = (
    VerifyStep(
        "B9",
        "trigger delay",
        "from the trigger's edge to the motion, by contacts in force and encoders",
        trigger_delay,
    ),
)
