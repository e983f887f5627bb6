"""A sequence of recorded presses; the arm is made safe however it ends."""

import math
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path

import numpy as np

from sautereau.daq.file.recorded import Joints, date_now
from sautereau.daq.file.recording import Recording, SessionInfo
from sautereau.rig.disk import explained, make_folder
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, MotionController, TorqueTable, play
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.monitor import Fault, Made, Samples, Stage, Watch, logged
from sautereau.robot.experiment.motion_source import open_motion
from sautereau.trajectory.arm import base, fingertip_place, link_vectors
from sautereau.trajectory.key import contact_angle, rise_of_angle, surface_axes
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.press import Trajectory
from sautereau.trajectory.segments import to_angles
from sautereau.trajectory.urdf import JACK

PRESS, WARM_UP = "press-{:04d}.mcap", "warm-up-{:02d}.mcap"
"""Names of the recordings of presses, and of warm-up presses."""
WARM_UPS = "warm-up-*.mcap"  # Pattern of the second
WRITABLE = "give a folder that can be written"  # How to fix one that cannot
_NAME = re.compile(r"(press|warm-up)-(\d+)\.mcap")


@dataclass(frozen=True)
class Item:
    """One press to be made, and what is recorded about it."""

    rig: Rig
    """The bench, with the addresses of its devices."""
    trajectory: Trajectory
    number: int | None = None
    """Number of the press in the session's plan, from 1; None without a plan, and for warm-up."""
    warm_up: bool = False
    """Whether it only brings the finger onto the key."""
    notes: str = ""
    """The operator's."""
    torques: TorqueTable | None = None
    """Added to those of the position loops; None for none."""
    levels: Mapping[str, str] = field(default_factory=dict)
    """Levels of the factors of a design; empty without one."""
    block: int | None = None
    """Block of the design, from 1."""


@dataclass(frozen=True)
class Origin:
    """Common metadata of all recordings of a session."""

    session: str = ""
    """Identity of the session."""
    scene: str = ""
    """Scene of the stand-in as text; empty on the hardware."""
    seed: int | None = None
    """Seed of the stand-in's random numbers."""


def make_presses(
    controller: MotionController,
    out: Path,
    items: Iterable[Item],
    origin: Origin = Origin(),
    *,
    rest: float = 0.0,
    on_ready: Callable[[], None] = lambda: None,
    on_press: Callable[[Item, Path], None] = lambda item, path: None,
    watch: Watch = lambda seen: None,
    sleep: Callable[[float], None] = time.sleep,
) -> list[Path]:
    """Make presses with the motors on throughout, and record each one in a separate file.

    A press is on the disk before the next starts. The numbers of presses, and those of warm-up
    presses, continue from the highest in the folder, so that no earlier recording is ever
    overwritten.

    Args:
        items: The presses; the next one may depend on earlier calls of `on_press`.
        origin: What all recordings have in common.
        rest: s, pause between presses.
        on_ready: Called once, when the folder exists and before the motors are switched on.
        on_press: Called with each press and its finished recording.
        watch: Called with each event of the session.
        sleep: Wait for seconds.

    Raises:
        SautereauError: Of any kind; the arm has been stopped and switched off.
    """
    watch = logged(watch)
    made: list[Path] = []
    with _faults_watched(watch), controller:
        watch(Stage("motors off", "idle"))
        numbers = _free_numbers(out)
        on_ready()
        pending = iter(items)
        first = next(pending, None)
        if first is not None:  # a card that is missing or in use, before any motion
            with open_motion(first.rig, controller, _duration(first)):
                pass
        with controller.powered():
            last: Trajectory | None = None
            for item in chain([first] if first else [], pending):
                if last is not None and rest:
                    sleep(rest)
                watch(Stage("going to the start", "idle"))
                _go_to(controller, item, last)
                last = item.trajectory
                name = WARM_UP if item.warm_up else PRESS
                number = next(numbers[name])
                path = out / name.format(number)
                _press(controller, item, path, number, origin, watch)
                watch(Made(number, path))
                made.append(path)
                on_press(item, path)
            if last is not None:
                watch(Stage("going home", "idle"))
                play(controller, last.retreat)
                controller.check_home()
        watch(Stage("motors off", "idle"))
    return made


def with_warm_ups(
    items: Iterable[Item], presses: int, goes_on: Callable[[], bool] = lambda: True
) -> Iterator[Item]:
    """Yield presses, and warm-up presses before each that starts from a lift.

    The approach ends within the following error of the position loops, so that the run-up hits the
    key or pushes it early.

    Args:
        presses: Number of warm-up presses.
        goes_on: Returns whether to continue after a warm-up press.
    """
    last: Trajectory | None = None
    for item in items:
        for _ in range(presses if is_lifted(item.trajectory, last) else 0):
            yield replace(item, number=None, warm_up=True)
            if not goes_on():
                return
        last = item.trajectory
        yield item


@contextmanager
def _faults_watched(watch: Watch) -> Iterator[None]:
    try:
        yield
    except BaseException as error:
        interrupted = isinstance(error, KeyboardInterrupt)
        message = "interrupted" if interrupted else f"{type(error).__name__}: {error}"
        watch(Fault("\n".join([message, *getattr(error, "__notes__", [])])))
        raise


def _go_to(controller: MotionController, item: Item, last: Trajectory | None) -> None:
    """Move the finger to the start of a press, from home or from the end of the last press."""
    trajectory = item.trajectory
    if not is_lifted(trajectory, last):
        return
    if last is None:
        controller.home()
    else:
        play(controller, last.retreat)
    arm = item.rig.arm
    controller.move_to(trajectory.hover, arm.approach_speed / arm.radians_per_count)
    play(controller, trajectory.approach)


def is_lifted(trajectory: Trajectory, last: Trajectory | None) -> bool:
    """Return whether a press starts from above the key, and not where the last press has ended."""
    return last is None or bool((last.segments.end != trajectory.segments.start).any())


def _press(
    controller: MotionController, item: Item, path: Path, number: int, origin: Origin, watch: Watch
) -> None:
    """Make one press: the acquisition is armed first, then the controller starts both."""
    rig, trajectory = item.rig, item.trajectory
    watch(Stage("loading", "idle", number))
    controller.load(trajectory.segments, item.torques)
    with open_motion(rig, controller, _duration(item)) as motion:
        controller.arm()  # as late as possible: it checks that nobody has changed the controller
        acquisition = motion.source
        session = SessionInfo(
            press=number,
            started=date_now(),
            simulated=acquisition.simulated or controller.simulated,
            controller=controller.identity,
            daq=acquisition.device_description,
            scene=origin.scene,
            seed=origin.seed,
            notes=item.notes,
            session=origin.session,
            item=item.number,
            warm_up=item.warm_up,
            levels=item.levels,
            block=item.block,
        )
        of_device = acquisition.of_device(rig)
        with Recording(
            path, of_device, session=session, rate=acquisition.rate, scaling=acquisition.scaling
        ) as recording:
            recording.before_trigger()
            motion.start()
            if motion.triggered:
                recording.before_trigger()  # the controller raises it
            watch(Stage("armed", "armed", number))
            controller.start()
            watch(Stage("moving", "reading", number))
            for number_of_block, block in enumerate(motion.blocks()):
                if not number_of_block:
                    _note_start(recording, item, triggered=motion.triggered)
                recording.write_block(block)
                watch(Samples(number, rig.daq.channels, acquisition.rate, block))
            watch(Stage("moving", "complete", number))
            recording.flush()  # the rest may take a while
            controller.wait()
            watch(Stage("standing", "complete", number))
            capture = controller.capture()
            joints = trajectory.joints.position
            start = motion.motion(capture)
            planned = trajectory.time + start.time
            recording.event(start.kind, start.text, start.time, start.std)
            recording.write_plan(planned, joints[:, 0], joints[:, 1], trajectory.rise.position)
            captured = _joints(capture, start.time, rig)
            recording.write_joints(captured)
            recording.write_scenes(*draw(rig, captured))


def _note_start(recording: Recording, item: Item, *, triggered: bool) -> None:
    """Write the events at time 0."""
    if triggered:
        recording.event("trigger", f"edge on {item.rig.daq.trigger_source}", 0.0)
    if item.torques is not None:
        first, second = np.abs(item.torques.torques).max(axis=0)
        largest = f"up to {first:.4g} N m at joint 1 and {second:.4g} N m at joint 2"
        recording.event("feed-forward", largest, 0.0)


def _duration(item: Item) -> float:
    """Return the duration of a press's acquisition after its trigger, s."""
    samples = item.trajectory.segments.total_samples
    return samples * item.rig.controller.sample_period + item.rig.daq.tail


def _joints(capture: Capture, start: float, rig: Rig) -> Joints:
    turn = rig.arm.counts_per_revolution
    columns: dict[str, Floats] = {"q": to_angles(capture.counts, turn)}
    if capture.following_errors is not None:
        columns["e"] = to_angles(capture.following_errors, turn)
    if capture.torques is not None:
        columns["m"] = capture.torques
    named = {f"{name}{j + 1}": c[:, j] for name, c in columns.items() for j in (0, 1)}
    return Joints(t=capture.times + start, **named)


def _free_numbers(out: Path) -> dict[str, Iterator[int]]:
    """Return the free numbers of recordings in a folder, which is created if it is missing."""
    with explained(RobotError, f"session folder {out}", WRITABLE):
        make_folder(out)
        found = [_NAME.match(path.name) for path in out.iterdir()]
    used = {"press": [0], "warm-up": [0]}
    for match in filter(None, found):
        used[match[1]].append(int(match[2]))
    return {PRESS: count(max(used["press"]) + 1), WARM_UP: count(max(used["warm-up"]) + 1)}


def draw(rig: Rig, joints: Joints) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
    """Return drawings of the rig while its joints moved.

    The key is in contact with the fingertip, or at rest below it.

    Returns:
        Times, s after the trigger, shape (n,); points of each line by name, m, shape
        (n, n_points, 3), in the frame of the key's geometry, whose plane is y = 0; and x and z, m,
        and angle, rad, of each link of the rig's URDF in this frame, shape (n, 3).
    """
    spacing = np.diff(joints.t).mean() if len(joints.t) > 1 else math.inf
    step = max(1, math.ceil(1 / (200.0 * spacing)))  # At most 200 Hz
    q = np.stack([joints.q1, joints.q2], -1)[::step]
    upper, _ = link_vectors(rig.arm.upper_length, q[:, 0])
    shoulder = np.broadcast_to(base(rig.arm), upper.shape)
    tip = fingertip_place(rig.arm, q)
    key = rig.key
    angle = np.maximum(0.0, contact_angle(key.surface_height + rig.arm.fingertip_radius, tip))
    tangent, normal = surface_axes(angle)
    front = key.surface_height * normal - key.front_arm * tangent
    back = key.jack_surface_height * normal + key.jack_arm * tangent
    foot = key.jack_surface_height + rise_of_angle(key, angle)
    ends = [np.stack([np.full_like(foot, key.jack_arm), foot + up], -1) for up in (0.0, JACK)]
    lines = {
        "arm": [shoulder, shoulder + upper, tip],
        "key": [front, key.surface_height * normal, back],
        "jack": ends,
    }
    still = np.zeros_like(angle)
    frames = {
        "arm_1": (shoulder, q[:, 0]),
        "arm_2": (shoulder + upper, q.sum(1)),
        "key": (np.zeros_like(upper), angle),
        "jack": (ends[0], still),
    }
    return (
        joints.t[::step],
        {name: _in_space(points) for name, points in lines.items()},
        {name: np.column_stack([place, turned]) for name, (place, turned) in frames.items()},
    )


def _in_space(points: list[Floats]) -> Floats:
    """Return points of shape (n, n_points, 3) from those in the plane, each of shape (n, 2)."""
    flat = np.stack(points, 1)
    return np.stack([flat[..., 0], np.zeros(flat.shape[:2]), flat[..., 1]], -1)
