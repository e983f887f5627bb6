"""A session: n presses, each recorded, the arm made safe by whatever way it ends."""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from daq.acquisition import Acquisition
from daq.recording import Recording, SessionInfo
from rig.schema import Rig
from robot.controller import MotionController
from robot.errors import RobotError
from trajectory.counts import to_angles
from trajectory.press import Trajectory
from trajectory.segments import Segments

FILE = "press-{:04d}.mcap"


def run_session(
    rig: Rig,
    trajectory: Trajectory,
    controller: MotionController,
    out: Path,
    n: int,
    *,
    scene: str = "",
    seed: int | None = None,
    notes: str = "",
    on_press: Callable[[Path], None] = lambda path: None,
) -> list[Path]:
    """Make n presses and record each in a file of its own.

    A press is durable before the next begins. Numbers go on from the highest that the
    folder holds, so that nothing already made is ever overwritten.

    Args:
        rig: The bench.
        trajectory: What each press does.
        controller: Not yet connected.
        out: Folder of the recordings; it is made.
        n: Presses.
        scene: TOML text of the stand-in's scene; empty on the hardware.
        seed: Of the stand-in's random numbers.
        notes: The operator's.
        on_press: Called with each finished recording.

    Raises:
        SautereauError: Whatever went wrong; the arm has been stopped and switched off.
    """
    if n < 1:
        raise RobotError(f"session: {n} presses were asked for; ask for 1 or more")
    speed = rig.arm.approach_speed * rig.arm.counts_per_revolution / (2 * np.pi)
    made: list[Path] = []
    with controller:
        numbers = _free_numbers(out, n)
        with controller.powered():
            controller.home()
            controller.move_to(trajectory.hover, speed)
            _play(controller, trajectory.approach)
            for number in numbers:
                path = out / FILE.format(number)
                _press(rig, trajectory, controller, path, number, scene, seed, notes)
                made.append(path)
                on_press(path)
            _play(controller, trajectory.retreat)
    return made


def _play(controller: MotionController, motion: Segments) -> None:
    """Make a motion that nothing records; its trigger's edge goes unheard."""
    controller.load(motion)
    controller.arm()
    controller.start()
    controller.wait()


def _press(
    rig: Rig,
    trajectory: Trajectory,
    controller: MotionController,
    path: Path,
    number: int,
    scene: str,
    seed: int | None,
    notes: str,
) -> None:
    """Make one press: the acquisition is armed first, then the controller starts both."""
    duration = trajectory.segments.total_samples * rig.controller.sample_period + rig.daq.tail
    controller.load(trajectory.segments)
    controller.arm()
    with Acquisition(rig.daq, duration) as acquisition:
        session = SessionInfo(
            press=number,
            started=datetime.now(UTC).isoformat(timespec="milliseconds"),
            simulated=acquisition.simulated or controller.simulated,
            controller=controller.identity,
            daq=acquisition.device_description,
            scene=scene,
            seed=seed,
            notes=notes,
        )
        with Recording(path, rig, session=session, rate=acquisition.rate) as recording:
            acquisition.start()
            controller.start()
            for block in acquisition.blocks():
                recording.write_block(block)
            controller.wait()
            recording.event("trigger", f"edge on {rig.daq.trigger_source}", 0.0)
            joints = trajectory.joints.position
            recording.write_plan(
                trajectory.time, joints[:, 0], joints[:, 1], trajectory.rise.position
            )
            capture = controller.capture()
            angles = to_angles(capture.counts, rig.arm.counts_per_revolution)
            recording.write_joints(capture.times, angles[:, 0], angles[:, 1])


def _free_numbers(out: Path, n: int) -> range:
    """Return the next n press numbers of a folder, which is made if it is not there."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        names = [path.name for path in out.iterdir()]
    except OSError as error:
        raise RobotError(
            f"session folder {out}: {error.strerror}; give a folder that can be written"
        ) from error
    taken = [int(m[1]) for name in names if (m := re.match(r"press-(\d+)\.mcap", name))]
    first = max(taken, default=0) + 1
    return range(first, first + n)
