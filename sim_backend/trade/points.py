"""One measured way to simulate a scene, and all of them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    """A scene simulated one way: how wrong and how fast it was."""

    scene: str
    """Description of the scene, or whose engine it is."""
    dt: float
    """s, of a step."""
    engine: str
    level: str
    """Of the plectrum."""
    string: str
    iterations: int
    """Of the solver, each step."""
    error: float | None
    """s, largest of all events; None where the point failed."""
    force_error: float | None
    """1, of the largest force; None where the point failed."""
    real_time_factor: float | None
    """1, simulated over real time, the median of repeats; None where the point failed."""
    failed: str = ""
    """Why there is nothing to be said: events missed or invented, or the engine's error."""


@dataclass(frozen=True)
class Trade:
    """What the ways to simulate a scene cost and give, on one machine."""

    scene: str
    """Description of the scene."""
    machine: str
    """What they were measured on."""
    wanted: float
    """s, error of events for which one is recommended."""
    points: tuple[Point, ...]
    pareto: tuple[int, ...]
    """Indices of the points that no other beats, the most accurate first."""
    recommended: int | None
    """Index of the fastest point that is as accurate as wanted; None if none is."""
    cached: bool = False
    """Whether it was measured before."""
