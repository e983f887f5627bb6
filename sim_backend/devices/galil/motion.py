"""The profilers of one axis: PVT segments, trapezoids, jogs and decelerated stops.

Everything here is in the raw encoder's frame and in the controller's own time: counts, counts
per sample, counts per sample squared. A profile returns the state at the end of a sample; between
two samples the reference is the cubic with those positions and velocities at its ends, which
inside a PVT segment is the segment's own cubic.
"""

import math
from abc import ABC, abstractmethod
from collections import deque
from enum import IntEnum
from typing import NamedTuple

SAMPLES_PER_SECOND = 1024
"""The firmware's fixed ratio between counts per second and counts per sample, at any TM."""


class StopCode(IntEnum):
    """The answers of SC."""

    RUNNING = 0
    AT_TARGET = 1
    FORWARD_LIMIT = 2
    REVERSE_LIMIT = 3
    STOPPED = 4
    ABORT_INPUT = 6
    ABORTED = 7
    OFF_ON_ERROR = 8
    EDGE_FOUND = 9
    HOMED = 10
    SELECTIVE_ABORT = 11
    ENCODER_FAILURE = 12
    AMPLIFIER_FAULT = 15
    PVT_RUNNING = 30
    PVT_COMPLETE = 31
    PVT_STARVED = 32
    NOT_IN_POSITION = 99


class Segment(NamedTuple):
    """One entry of the PVT buffer."""

    distance: int
    """Counts, relative."""
    velocity: int
    """Counts per second, at the segment's end."""
    samples: int
    """Controller samples; 0 ends the sequence."""


class Profile(ABC):
    """A motion being executed."""

    code: StopCode
    """Answer of SC while it runs and after its end."""
    done: bool
    """Whether the axis is at rest at the end of the last step."""
    homes = False
    """Whether its end becomes position 0."""

    @abstractmethod
    def step(self) -> tuple[float, float]:
        """Advance by one sample; return position [counts] and velocity [counts per sample]."""


class Ramp(Profile):
    """A motion of piecewise constant acceleration that ends at rest.

    Args:
        position: Counts, at the start.
        velocity: Counts per sample, at the start.
        pieces: Durations [samples] and accelerations [counts per sample squared].
        target: Counts, of the end; None for the sum of the pieces.
        code: Stop code of the motion and of its end.
    """

    def __init__(
        self,
        position: float,
        velocity: float,
        pieces: list[tuple[float, float]],
        target: float | None = None,
        code: StopCode = StopCode.RUNNING,
    ) -> None:
        self.code, self.done = code, not pieces
        self._position, self._velocity = position, velocity
        self._pieces = deque(pieces)
        self.target = target

    def moved(self, distance: float) -> "Ramp":
        """Return what remains of it, from a place that lies further by some counts."""
        return Ramp(self._position + distance, self._velocity, list(self._pieces), code=self.code)

    def step(self) -> tuple[float, float]:
        left = 1.0
        pieces = self._pieces
        while pieces:
            duration, acceleration = pieces[0]
            time = min(duration, left)
            self._position += (self._velocity + acceleration * time / 2) * time
            self._velocity += acceleration * time
            left -= time
            if time < duration:
                pieces[0] = (duration - time, acceleration)
                return self._position, self._velocity
            pieces.popleft()
        self.done = True
        self._velocity = 0.0
        if self.target is not None:
            self._position = self.target
        return self._position, self._velocity


def brake(velocity: float, deceleration: float) -> list[tuple[float, float]]:
    """Return the pieces of a `Ramp` from ``velocity`` to rest."""
    if velocity == 0 or deceleration == math.inf:
        return []
    return [(abs(velocity) / deceleration, -math.copysign(deceleration, velocity))]


def trapezoid(
    distance: float, speed: float, acceleration: float, deceleration: float, velocity: float = 0.0
) -> list[tuple[float, float]]:
    """Return the pieces of a `Ramp` to rest over ``distance`` counts, towards which it may move.

    At a speed of 0 it waits until it is stopped, as the controller does.
    """
    if distance == 0:
        return []
    if speed == 0:
        return [(math.inf, 0.0)]
    start, sign = abs(velocity), math.copysign(1.0, distance)
    ramps = (1 / acceleration + 1 / deceleration) / 2
    length = abs(distance) + start**2 / acceleration / 2  # as if it had started from rest
    speed = max(start, min(speed, math.sqrt(length / ramps)))
    cruise = max(0.0, (length - ramps * speed**2) / speed)
    return [
        ((speed - start) / acceleration, sign * acceleration),
        (cruise, 0.0),
        (speed / deceleration, -sign * deceleration),
    ]


def jog(
    velocity: float, goal: float, acceleration: float, deceleration: float
) -> list[tuple[float, float]]:
    """Return the pieces of a `Ramp` from ``velocity`` to ``goal``, which is held until a stop."""
    pieces: list[tuple[float, float]] = []
    if velocity * goal < 0:
        pieces = brake(velocity, deceleration)
        velocity = 0.0
    rate = acceleration if abs(goal) > abs(velocity) else deceleration
    pieces.append((abs(goal - velocity) / rate, math.copysign(rate, goal - velocity)))
    return [*pieces, (math.inf, 0.0)]


class Pvt(Profile):
    """The execution of an axis's PVT buffer.

    If the buffer becomes empty, or the sequence ends at speed, the axis decelerates.

    Args:
        position: Counts, start of the first segment, at rest.
        fifo: The buffer, shared with the axis, which adds segments to it.
        deceleration: Counts per sample squared, of that deceleration; infinite for a stop at once.
    """

    def __init__(self, position: float, fifo: deque[Segment], deceleration: float) -> None:
        self.code = StopCode.PVT_RUNNING
        self.done = False
        self.executed = 0
        """Segments executed; the closing zero segment counts as one."""
        self._fifo, self._deceleration = fifo, deceleration
        self._start, self._start_velocity = position, 0.0
        self._distance, self._velocity = 0.0, 0.0
        self._sample = self._samples = 0
        self._brake: Ramp | None = None

    def step(self) -> tuple[float, float]:
        if self._brake is None and self._sample == self._samples:
            self._next_segment()
        if self._brake is not None:
            state = self._brake.step()
            self.done = self._brake.done
            return state
        self._sample += 1
        if self._sample == self._samples:
            self._start += self._distance
            self._start_velocity = self._velocity
            self.executed += 1
            if self._fifo and self._fifo[0].samples == 0:
                self._next_segment()
            return self._start, self._start_velocity
        # Cubic Hermite interpolation: x = p0 + v0 t + (3 q - 2 v0 - v1) t s + (v0 + v1 - 2 q) t s^2
        # with s = t / T and the mean velocity q = (p1 - p0) / T.
        time = self._sample
        s = time / self._samples
        mean = self._distance / self._samples
        v0 = self._start_velocity
        second = 3 * mean - 2 * v0 - self._velocity
        third = v0 + self._velocity - 2 * mean
        position = self._start + time * (v0 + s * (second + s * third))
        return position, v0 + s * (2 * second + 3 * s * third)

    def _next_segment(self) -> None:
        segment = self._fifo.popleft() if self._fifo else None
        if segment is not None and segment.samples > 0:
            self._distance = float(segment.distance)
            self._velocity = segment.velocity / SAMPLES_PER_SECOND
            self._sample, self._samples = 0, segment.samples
            return
        if segment is not None:
            self.executed += 1
            self._fifo.clear()
        self.code = StopCode.PVT_STARVED if segment is None else StopCode.PVT_COMPLETE
        pieces = brake(self._start_velocity, self._deceleration)
        self._brake = Ramp(self._start, self._start_velocity, pieces, code=self.code)
        self.done = self._brake.done
