"""The acquisition of a motion, and when in it the motion starts."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.alignment import find_start
from sautereau.daq.file.recorded import BY_EDGE, MOTION, Block, Event
from sautereau.daq.source.source import Source, open_source
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, MotionController
from sautereau.trajectory.segments import to_angles

LATEST = 0.1
"""Largest delay of the host (s). An acquisition that no edge starts is longer by this time, and the
motion is searched within this time of its expected start."""


class MotionSource:
    """The samples of one motion, counted from where it should start; see `open_motion`.

    Args:
        lead: s, from the start of the acquisition to that of the motion; None where the trigger's
            edge starts both.
    """

    def __init__(self, source: Source, rig: Rig, lead: float | None):
        self.source, self._rig = source, rig
        self.triggered = lead is None
        """Whether the trigger's edge starts the acquisition."""
        self._before = 0 if lead is None else round(lead * source.rate)
        self._blocks: list[Block] = []

    def start(self) -> None:
        """Arm the acquisition, or start it; then the motion may start."""
        self.source.start()

    def blocks(self) -> Iterator[Block]:
        """Yield consecutive blocks; the samples of the rest before a motion count as negative."""
        for block in self.source.blocks():
            if not self.triggered:
                counted = tuple(replace(c, stop=c.stop - self._before) for c in block.counted)
                first = block.first_sample - self._before
                block = replace(block, first_sample=first, counted=counted)
                self._blocks.append(block)
            yield block

    def motion(self, capture: Capture) -> Event:
        """Return the start of the motion by the controller's record of it, after all blocks."""
        if self.triggered:
            return Event(capture.trigger_delay, MOTION, BY_EDGE, capture.start_std)
        rate = self.source.rate
        volts = np.concatenate([block.volts for block in self._blocks], axis=1)
        try:
            start, std = find_start(
                self._rig,
                volts,
                -self._before / rate,
                rate,
                capture.times,
                to_angles(capture.counts, self._rig.arm.counts_per_revolution),
                LATEST,
            )
        except AnalysisError as error:
            text = f"started, by the host's clock: {error}"
            return Event(0.0, MOTION, text, LATEST / np.sqrt(3))
        text = "started, as encoders and vibrometer show it"
        return Event(start, MOTION, text, float(np.hypot(std, capture.start_std)))


@contextmanager
def open_motion(rig: Rig, controller: MotionController, duration: float) -> Iterator[MotionSource]:
    """Open the acquisition of a motion of ``duration`` s.

    The trigger's edge starts it where the controller gives one; otherwise it starts before the
    motion, and lasts longer by what the host may be late.

    Raises:
        DaqError: As `open_source`.
    """
    can = controller.capabilities
    lead = None if can.trigger_output else can.lead(rig.controller.sample_period)
    longer = 0.0 if lead is None else lead + LATEST
    with open_source(rig.daq, duration + longer, triggered=lead is None) as source:
        yield MotionSource(source, rig, lead)
