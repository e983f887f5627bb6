"""Presses one after the other, each recorded, the arm made safe by whatever way they end."""

import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from sautereau.daq.file.recorded import Joints
from sautereau.daq.file.recording import Recording, SessionInfo
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, MotionController, TorqueTable
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.monitor import Fault, Made, Samples, Stage, Watch
from sautereau.trajectory.counts import to_angles
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.press import Trajectory
from sautereau.trajectory.segments import Segments

FILE = "press-{:04d}.mcap"
_NAME = re.compile(r"press-(\d+)\.mcap")


@dataclass(frozen=True)
class Item:
    """One press to be made, and what its recording says of it."""

    rig: Rig
    """The bench, with the addresses to use."""
    trajectory: Trajectory
    number: int | None = None
    """Of the press in the session's plan, from 1; None without a plan."""
    warm_up: bool = False
    """Whether it only warms the arm up."""
    notes: str = ""
    """The operator's."""
    torques: TorqueTable | None = None
    """Added to those of the position loops; None for nothing."""


@dataclass(frozen=True)
class Origin:
    """What all recordings of a session say alike."""

    session: str = ""
    """Identity of the session."""
    scene: str = ""
    """Of the stand-in, as text; empty on the hardware."""
    seed: int | None = None
    """Of the stand-in's random numbers."""


def run_session(
    rig: Rig,
    trajectory: Trajectory,
    controller: MotionController,
    out: Path,
    n: int,
    *,
    on_press: Callable[[Path], None] = lambda path: None,
) -> list[Path]:
    """Make n equal presses and record each in a file of its own; see `make_presses`.

    Args:
        rig: The bench.
        trajectory: What each press does.
        controller: Not yet connected.
        out: Folder of the recordings; it is made.
        n: Presses.
        on_press: Called with each finished recording.

    Raises:
        SautereauError: Whatever went wrong; the arm has been stopped and switched off.
    """
    if n < 1:
        raise RobotError(f"session: {n} presses were asked for; ask for 1 or more")
    items = [Item(rig, trajectory)] * n
    return make_presses(controller, out, items, on_press=lambda item, path: on_press(path))


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
    """Make presses with the motors on throughout, and record each in a file of its own.

    A press is durable before the next begins. Numbers go on from the highest that the
    folder holds, so that nothing already made is ever overwritten.

    Args:
        controller: Not yet connected.
        out: Folder of the recordings; it is made.
        items: The presses; the next one may depend on what `on_press` has seen.
        origin: What all recordings say alike.
        rest: s, that the arm stands still between presses.
        on_ready: Called once, with the folder there and the motors still off.
        on_press: Called with each press and its finished recording.
        watch: Told what happens meanwhile, as it happens.
        sleep: Wait for seconds.

    Raises:
        SautereauError: Whatever went wrong; the arm has been stopped and switched off.
    """
    made: list[Path] = []
    with _faults_told(watch), controller:
        watch(Stage("motors off", "idle"))
        number = _free_number(out)
        on_ready()
        with controller.powered():
            stands: Trajectory | None = None
            for item in items:
                if stands is not None and rest:
                    sleep(rest)
                watch(Stage("going to the start", "idle"))
                _go_to(controller, item, stands)
                stands = item.trajectory
                path = out / FILE.format(number)
                _press(controller, item, path, number, origin, watch)
                watch(Made(number, path))
                made.append(path)
                number += 1
                on_press(item, path)
            if stands is not None:
                watch(Stage("going home", "idle"))
                _play(controller, stands.retreat)
                controller.check_home()
        watch(Stage("motors off", "idle"))
    return made


@contextmanager
def _faults_told(watch: Watch) -> Iterator[None]:
    try:
        yield
    except BaseException as error:
        told = f"{type(error).__name__}: {error}".removesuffix(": ")
        watch(Fault("\n".join([told, *getattr(error, "__notes__", [])])))
        raise


def _go_to(controller: MotionController, item: Item, stands: Trajectory | None) -> None:
    """Bring the finger to where a press begins, from home or from the last press's end."""
    wanted = item.trajectory
    if stands is None:
        controller.home()
    elif (stands.segments.end == wanted.segments.start).all():
        return
    else:
        _play(controller, stands.retreat)
    per_radian = item.rig.arm.counts_per_revolution / (2 * np.pi)
    controller.move_to(wanted.hover, item.rig.arm.approach_speed * per_radian)
    _play(controller, wanted.approach)


def _play(controller: MotionController, motion: Segments) -> None:
    """Make a motion that nothing records; its trigger's edge goes unheard."""
    controller.load(motion)
    controller.arm()
    controller.start()
    controller.wait()


def _press(
    controller: MotionController,
    item: Item,
    path: Path,
    number: int,
    origin: Origin,
    watch: Watch,
) -> None:
    """Make one press: the acquisition is armed first, then the controller starts both."""
    rig, trajectory = item.rig, item.trajectory
    duration = trajectory.segments.total_samples * rig.controller.sample_period + rig.daq.tail
    watch(Stage("loading", "idle", number))
    controller.load(trajectory.segments, item.torques)
    controller.arm()
    with Acquisition(rig.daq, duration) as acquisition:
        session = SessionInfo(
            press=number,
            started=datetime.now(UTC).isoformat(timespec="milliseconds"),
            simulated=acquisition.simulated or controller.simulated,
            controller=controller.identity,
            daq=acquisition.device_description,
            scene=origin.scene,
            seed=origin.seed,
            notes=item.notes,
            session=origin.session,
            item=item.number,
            warm_up=item.warm_up,
        )
        with Recording(path, rig, session=session, rate=acquisition.rate) as recording:
            acquisition.start()
            watch(Stage("armed", "armed", number))
            controller.start()
            watch(Stage("moving", "reading", number))
            for block in acquisition.blocks():
                recording.write_block(block)
                watch(Samples(number, rig.daq.channels, acquisition.rate, block))
            watch(Stage("moving", "complete", number))
            # An event flushes, and what follows may take a while.
            recording.event("trigger", f"edge on {rig.daq.trigger_source}", 0.0)
            controller.wait()
            watch(Stage("standing", "complete", number))
            if item.torques is not None:
                first, second = np.abs(item.torques.torques).max(axis=0)
                pushed = f"up to {first:.4g} N m at joint 1 and {second:.4g} N m at joint 2"
                recording.event("feed-forward", pushed, 0.0)
            joints = trajectory.joints.position
            recording.write_plan(
                trajectory.time, joints[:, 0], joints[:, 1], trajectory.rise.position
            )
            capture = controller.capture()
            recording.write_joints(_joints(capture, rig))


def _joints(capture: Capture, rig: Rig) -> Joints:
    turn = rig.arm.counts_per_revolution
    columns: dict[str, Floats] = {"q": to_angles(capture.counts, turn)}
    if capture.following_errors is not None:
        columns["e"] = to_angles(capture.following_errors, turn)
    if capture.torques is not None:
        columns["m"] = capture.torques
    named = {f"{name}{j + 1}": c[:, j] for name, c in columns.items() for j in (0, 1)}
    return Joints(t=capture.times, **named)


def _free_number(out: Path) -> int:
    """Return the first press number that a folder has free; it is made if it is not there."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        names = [path.name for path in out.iterdir()]
    except OSError as error:
        raise RobotError(
            f"session folder {out}: {error.strerror}; give a folder that can be written"
        ) from error
    return max((int(m[1]) for name in names if (m := _NAME.match(name))), default=0) + 1
