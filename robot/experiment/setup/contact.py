"""Touch the key in small steps up to the first contact, and find the base by three contacts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, MotionController, play
from sautereau.robot.errors import MotionFault, RobotError
from sautereau.robot.experiment.motion_source import open_motion
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.dynamics import gravity_torque, tip_torque
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.mount.locate import Located, locate_base
from sautereau.trajectory.segments import Counts, Segments, to_counts

_REST = 0.04
"""s, that the finger rests before and after each step; the force is averaged over half of it,
one period of the mains."""
FRACTIONS = (1.0, 0.9, 0.8)
"""Points where the key is touched, as fractions of the pressing point's distance from the pin."""


class NoContact(MotionFault):
    """The finger has met no key."""


@dataclass(frozen=True)
class Creep:
    """How the finger approaches the key."""

    above: float = 4e-3
    """m, start above the surface given by the rig."""
    below: float = 2e-3
    """m, end below that surface."""
    step: float = 0.2e-3
    """m, between two measurements of force; a quarter of it the second time."""
    speed: float = 5e-3
    """m/s, mean speed of a step."""
    sense: float = 0.02
    """N, rise of the force in a step that counts as contact."""
    limit: float = 0.5
    """N, limit of the force, beyond which the motors are switched off."""

    def __post_init__(self) -> None:
        units = {"above": "m", "below": "m", "step": "m", "speed": "m/s", "sense": "N"}
        faults = [
            f"{name} is {value:g} {unit}; give more than 0"
            for name, unit in units.items()
            if not 0 < (value := getattr(self, name)) < math.inf
        ]
        if not self.limit > self.sense:
            faults.append(f"limit is {self.limit:g} N, not above sense, {self.sense:g} N; raise it")
        if faults:
            raise RobotError(f"setup contact: {'; '.join(faults)}")


GENTLY = Creep()  # The default


@dataclass(frozen=True)
class Touch:
    """A first contact."""

    height: float
    """m, of the key's surface above the one given by the rig."""
    joints: tuple[float, float]
    """rad, from the encoders."""
    force: float
    """N, at the end of the last step."""
    uncertainty: float
    """m, standard uncertainty of the height: the contact is somewhere in the last step, and the
    fingertip somewhere within a count of the encoders."""
    by: str
    """What measured it: the force channel, or the motors' torques."""


def find_contact(rig: Rig, ask: Ask, creep: Creep = GENTLY) -> Found:
    """Touch the key where it is pressed, and lift the finger again.

    Raises:
        RobotError: There is no key within the approach, or its force exceeds the limit; the
            motors are off.
    """
    ask_first(
        ask,
        "contact",
        f"The arm homes, moves above the key and approaches it in steps of {creep.step * 1e3:g} mm,"
        f" until the force rises by {creep.sense * 1e3:g} mN; above {creep.limit:g} N the motors go"
        " off. Is its way free?",
    )
    with homed(rig) as controller:
        touch = touch_at(rig, controller, rig.key.press_arm, creep)
    away = f"{touch.height * 1e3:+.2f} mm from"
    lines = (
        f"contact: {away} the surface given by the rig, +-{touch.uncertainty * 1e3:.2f} mm,"
        f" at {touch.force * 1e3:.0f} mN, by {touch.by}",
    )
    figures = {"height": touch.height, "uncertainty": touch.uncertainty, "force": touch.force}
    near = abs(touch.height) <= max(3 * touch.uncertainty, creep.step)
    doubt = "the surface differs from the rig: run the step touch, which finds the base"
    return Found(lines, figures=figures, warnings=() if near else (doubt,))


def locate_by_touch(rig: Rig, ask: Ask, creep: Creep = GENTLY) -> Found:
    """Touch the key at three points, and estimate the position of the base.

    The zeros of the joints are assumed to be exact.

    Raises:
        RobotError: A touch fails; the motors are off.
        TrajectoryError: The base is not identifiable from the contacts.
    """
    points = [fraction * rig.key.press_arm for fraction in FRACTIONS]
    ask_first(
        ask,
        "touch",
        f"The arm homes and approaches the key at {len(points)} points, until the force rises by"
        f" {creep.sense * 1e3:g} mN; above {creep.limit:g} N the motors go off. Is its way free,"
        " and is a rule at hand?",
    )
    touches: list[Touch] = []
    where: list[float | None] = []
    with homed(rig) as controller:
        for point in points:
            touches.append(touch_at(rig, controller, point, creep))
            where.append(
                ask.number(
                    "How far in front of the balance pin did the fingertip touch the key?",
                    "m",
                    point,
                )
            )
    measured = all(distance is not None for distance in where)
    along = [-(p if w is None else w) for p, w in zip(points, where, strict=True)]
    joints = np.array([touch.joints for touch in touches])
    located = locate_base(rig, joints, np.array(along), offsets=0)
    return _base_found(rig, located, touches, measured)


def _base_found(rig: Rig, located: Located, touches: list[Touch], measured: bool) -> Found:
    """Return the values for the rig: those that differ from it by more than their uncertainty."""
    base_x = located.base_x if measured else rig.arm.base_x
    away = math.hypot(base_x - rig.arm.base_x, located.base_z - rig.arm.base_z)
    values: dict[str, str | int] = {}
    std_x, std_z = located.std
    if abs(located.base_z - rig.arm.base_z) > std_z:
        values["arm.base_z"] = f"{located.base_z * 1e3:.3f} mm"
    if abs(base_x - rig.arm.base_x) > std_x:
        values["arm.base_x"] = f"{base_x * 1e3:.3f} mm"
    doubts = list(located.warnings)
    if not measured:
        doubts.append("the points of contact along the key were not measured: base_x is unchanged")
    along = f"+-{std_x * 1e3:.2f}" if measured else "unchanged"
    heights = [touch.height for touch in touches]
    return Found(
        (
            f"touch: the base is at x = {base_x * 1e3:.2f} mm ({along}), z ="
            f" {located.base_z * 1e3:.2f} mm (+-{std_z * 1e3:.2f}), {away * 1e3:.2f} mm from"
            " the base in the rig",
        ),
        values,
        {
            "base_x": base_x,
            "base_z": located.base_z,
            "away": away,
            "residual": located.residual,
            "lowest": min(heights),
            "highest": max(heights),
        },
        tuple(doubts),
    )


def touch_at(rig: Rig, controller: MotionController, along: float, creep: Creep) -> Touch:
    """Approach a point of the key, again in finer steps, and lift the finger.

    Args:
        controller: At home, motors on.
        along: m, of the point in front of the balance pin.

    Raises:
        NoContact: There is no contact within the approach.
        RobotError: The force exceeds its limit.
    """
    hover = over_key(rig, along, np.array([rig.press.hover]))[0]
    controller.move_to(hover, approach_speed(rig))
    touch = _creep_down(rig, controller, along, creep.above, -creep.below, creep)
    if touch is None:
        controller.move_to(hover, approach_speed(rig))
        raise NoContact(
            f"setup contact: no contact down to {creep.below * 1e3:g} mm below the surface given by"
            f" the rig, {along * 1e3:.4g} mm in front of the pin; check where the finger is, and"
            " correct arm.base_x and arm.base_z by hand"
        )
    fine = replace(creep, step=creep.step / 4)
    first, last = touch.height + 1.5 * creep.step, touch.height - creep.step
    touch = _creep_down(rig, controller, along, first, last, fine) or touch
    controller.move_to(hover, approach_speed(rig))
    return touch


def _creep_down(
    rig: Rig, controller: MotionController, along: float, first: float, last: float, creep: Creep
) -> Touch | None:
    """Approach from one height [m] to another; return the contact, with the finger still there."""
    n = math.ceil((first - last) / creep.step)
    heights = first - creep.step * np.arange(n + 1, dtype=np.float64)
    counts = over_key(rig, along, heights)
    controller.move_to(counts[0], approach_speed(rig))
    torque_before: Floats | None = None
    for i in range(n):
        durations = (_REST, creep.step / creep.speed, _REST)
        segments = between_rests(rig, counts[[i, i, i + 1, i + 1]], durations)
        capture, measured = play_measured(rig, controller, segments)
        angles = np.stack([counts[i], counts[i + 1]]) * rig.arm.radians_per_count
        by_motors, torque_before = _by_motors(rig, angles[1], capture, torque_before)
        by_sensor = None if measured is None else abs(_rise(measured, rig.daq.sample_rate))
        force = by_motors if by_sensor is None else by_sensor
        if (largest := max(force, by_motors)) > creep.limit:
            raise MotionFault(
                f"setup contact: {largest:.3g} N at {heights[i + 1] * 1e3:.2f} mm above the"
                f" surface, and the limit is {creep.limit:g} N; remove what is in the way"
            )
        if force >= creep.sense:
            joint1, joint2 = angles.mean(axis=0)
            return Touch(
                float(heights[i : i + 2].mean()),
                (float(joint1), float(joint2)),
                float(force),
                math.hypot(creep.step, rig.arm.resolution) / math.sqrt(12),
                "the motors' torques" if by_sensor is None else "the force channel",
            )
    return None


def _rise(force: Floats, rate: float) -> float:
    """Return the force [N] in the last rest minus that in the first."""
    half = round(_REST / 2 * rate)
    return float(force[-half:].mean() - force[half : 2 * half].mean())


def _by_motors(
    rig: Rig, joints: Floats, capture: Capture, before: Floats | None
) -> tuple[float, Floats | None]:
    """Return the vertical force [N] relative to the first step, and the first step's torques."""
    if capture.torques is None:
        return 0.0, None
    late = capture.times >= capture.times[-1] - _REST / 2
    missing = gravity_torque(rig.arm, joints[None])[0] - capture.torques[late].mean(axis=0)
    if before is None:
        return 0.0, missing
    per_newton = np.stack([tip_torque(rig.arm, joints, axis) for axis in np.eye(2)], -1)
    return abs(float(np.linalg.solve(per_newton, missing - before)[1])), before


def over_key(rig: Rig, along: float, heights: Floats) -> Counts:
    """Return the joint positions [counts, (n, 2)] with the fingertip above the key at rest.

    Args:
        along: m, in front of the balance pin.
        heights: m, of the fingertip above the surface; shape (n,).
    """
    z = rig.key.surface_height + rig.arm.fingertip_radius + heights
    centre = np.stack([np.full_like(z, -along), z], -1)
    still = np.zeros_like(centre)
    joints = joints_holding_point(rig.arm, Motion(centre, still, still), "the approach of the key")
    return to_counts(joints.position, rig.arm.counts_per_revolution)


def play_measured(
    rig: Rig, controller: MotionController, segments: Segments
) -> tuple[Capture, Floats | None]:
    """Play a motion from the arm's position; return the controller's record of it, and the force.

    The force [N] is from the motion's start to its end, shape (n,); None where the rig has no
    force channel.
    """
    channel = rig.daq.channel("force")
    if channel is None:
        play(controller, segments)
        return controller.capture(), None
    capture, volts = play_recorded(rig, controller, segments)
    return capture, volts[channel.name] * channel.scale


def play_recorded(
    rig: Rig, controller: MotionController, segments: Segments
) -> tuple[Capture, dict[str, Floats]]:
    """Play a motion; return the controller's record of it, and the volts by channel, shape (n,)."""
    controller.load(segments)
    controller.arm()
    duration = segments.total_samples * rig.controller.sample_period
    with open_motion(rig, controller, duration) as motion:
        motion.start()
        controller.start()
        blocks = [block.volts[:, max(0, -block.first_sample) :] for block in motion.blocks()]
        controller.wait()
    volts = np.concatenate(blocks, axis=1)
    names = [channel.name for channel in rig.daq.channels]
    return controller.capture(), dict(zip(names, volts, strict=True))


def between_rests(rig: Rig, counts: Counts, durations: Sequence[float]) -> Segments:
    """Return a motion through points [counts, (n + 1, 2)], with a rest at each, in n times [s]."""
    samples = [even(duration / rig.controller.sample_period) for duration in durations]
    still = np.zeros((len(samples), 2), np.int64)
    return Segments(counts[0], np.diff(counts, axis=0), still, np.array(samples))


def even(samples: float) -> int:
    """Return the next even number of samples, 2 at least."""
    return max(2, 2 * math.ceil(samples / 2))
