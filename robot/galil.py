"""The driver of a Galil DMC-4x: a press, preloaded as PVT segments and played by itself.

Positions are counts, speeds counts a second, durations controller samples.
"""

import numpy as np

from robot.controller import Capture
from robot.dmc import (
    CAPTURE_INTERVAL,
    CLEAR_SEGMENTS,
    END_OF_MOTION,
    NORMAL_ENDS,
    capture_commands,
    capture_rows,
    press_program,
    segment_commands,
    segments_from,
)
from robot.errors import MotionFault, NotReady, SettingNotTaken
from robot.galil_arm import MARGIN, GalilArm, Stage
from robot.line import Line
from trajectory.segments import Segments


class GalilController(GalilArm):
    """A `MotionController` over a serial line; arguments as for `GalilArm`."""

    _motion: Segments | None = None

    def load(self, segments: Segments) -> Segments:
        """Preload a motion into the controller's FIFO; return what was really sent."""
        line = self._axes("load", standing=True).line
        self._limits.check_motion(segments, self._settings.segment_limit)
        self._stage, self._motion = "empty", None
        free = self._empty_fifo(line)
        commands = segment_commands(segments)
        line.ask_packed([*commands, *END_OF_MOTION])
        left = line.read("_PVA", "_PVB")
        falls = [before - after for before, after in zip(free, left, strict=True)]
        count = len(segments)
        if any(fall not in (count, count + 1) for fall in falls):  # the end may count as one
            raise SettingNotTaken(
                f"controller on {line.name}: {count} segments were sent and its FIFO took"
                f" {falls[0]:g} and {falls[1]:g}; load() again, and check the cable's shield"
            )
        self._stage, self._motion = "loaded", segments_from(commands, segments.start)
        return self._motion

    def _empty_fifo(self, line: Line) -> list[float]:
        """Return the free space of both FIFOs, emptied of a motion that was never played."""
        limit = self._settings.segment_limit
        free = line.read("_PVA", "_PVB")
        if free != [limit, limit]:
            line.ask(*CLEAR_SEGMENTS)
            free = line.read("_PVA", "_PVB")
        if min(free) < limit:
            raise SettingNotTaken(
                f"controller on {line.name}: its FIFO has room for {min(free):g} segments after"
                f" it was cleared, and controller.segment_limit is {limit}; switch the"
                " controller off and on, or correct the rig file"
            )
        return free

    def arm(self) -> None:
        """Prepare capture, trigger and start; refuse where the arm is not at the start."""
        axes = self._axes("arm", powered=True, homed=True, standing=True)
        motion = self._loaded("arm", "loaded", "call load() first")
        self._limits.check_at(axes.positions(), motion.start, "arm: the arm")
        for command in capture_commands(capture_rows(motion.total_samples)):
            axes.line.ask(command)
        axes.line.download(press_program(self._settings.trigger_output))
        self._stage = "armed"

    def start(self) -> None:
        """Let the controller start the motion and return at once."""
        axes = self._axes("start", powered=True, homed=True)
        self._loaded("start", "armed", "call arm() first")
        self._stage = "running"
        with self._guarded(axes):
            axes.line.ask("XQ #PRESS")

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should."""
        axes = self._axes("wait")
        motion = self._loaded("wait", "running", "call start() first")
        duration = motion.total_samples * self._settings.sample_period
        with self._guarded(axes):
            axes.await_(lambda: _ended(axes.line), "the press", duration + MARGIN)
            axes.check_stop("the press", NORMAL_ENDS)
            played = axes.line.read("_BTA", "_BTB")
            if any(done not in (len(motion), len(motion) + 1) for done in played):
                raise MotionFault(
                    f"the press ended after {played[0]:g} and {played[1]:g} of its"
                    f" {len(motion)} segments; check the stop inputs, then load() again"
                )
        self._stage = "done"

    def capture(self) -> Capture:
        """Read the encoder positions of the last whole motion."""
        line = self._axes("capture", standing=True).line
        motion = self._loaded("capture", "done", "wait() for the end of a motion first")
        rows = capture_rows(motion.total_samples)
        columns = [line.numbers(f"QU {name}[],0,{rows - 1},1", rows) for name in ("XA", "XB")]
        return Capture(
            samples=CAPTURE_INTERVAL * np.arange(rows, dtype=np.int64),
            counts=np.rint(np.transpose(columns)).astype(np.int64),
            sample_period=self._settings.sample_period,
        )

    def _loaded(self, caller: str, stage: Stage, remedy: str) -> Segments:
        if self._stage != stage or self._motion is None:
            raise NotReady(f"{caller}: no motion is {stage}; {remedy}")
        return self._motion


def _ended(line: Line) -> bool:
    """Whether both axes stand and the program has run to its end."""
    _, moving_a, moving_b, program = line.read("_BTA", "_BGA", "_BGB", "_XQ")
    return program < 0 and not moving_a and not moving_b
