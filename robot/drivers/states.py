"""The state of the arm, the calls that each state allows, and the way out of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum

from sautereau.robot.errors import NotReady


class State(StrEnum):
    """State of the arm, as known to the host."""

    OFF = "off"
    """Motors off, confirmed by the controller."""
    STOPPED = "stopped"
    """Motors on, at a standstill; the positions are not known for certain."""
    HOMED = "homed"
    """Motors on, at a standstill, at known positions."""
    LOADED = "loaded"
    """Homed, with a motion in the controller."""
    ARMED = "armed"
    """Loaded, with capture and trigger prepared."""
    MOVING = "moving"
    """In motion."""
    FAULTED = "faulted"
    """Unknown: the controller has not confirmed that the motors are off."""


WAYS_OUT = {
    State.OFF: "the motors are off: enter powered() first",
    State.STOPPED: "the joints' positions are unknown: call home() first",
    State.HOMED: "no motion is loaded: call load() first",
    State.LOADED: "the motion is not armed: call arm() first",
    State.ARMED: "the motion has not started: call start() first",
    State.MOVING: "a motion is running: call wait() or stop() first",
    State.FAULTED: "press the emergency stop, then call disconnect() and connect()",
}
"""How to proceed after a refused call, by state."""

_STANDING = frozenset({State.HOMED, State.LOADED, State.ARMED})
_ON = _STANDING | {State.STOPPED, State.MOVING}
_CALLS: dict[str, frozenset[State]] = {
    "powered": frozenset({State.OFF}),
    "home": _STANDING | {State.STOPPED},
    "check_home": _STANDING,
    "move_to": _STANDING,
    "load": _STANDING,
    "arm": frozenset({State.LOADED, State.ARMED}),
    "start": frozenset({State.ARMED}),
    "wait": frozenset({State.MOVING}),
    "capture": _STANDING | {State.OFF, State.STOPPED},
    "stop": _ON,
}
"""States in which a call may be made."""


class States:
    """The arm's state; a refused call names it and the way out."""

    def __init__(self) -> None:
        self.now = State.OFF

    @property
    def on(self) -> bool:
        """Whether the motors are on, or may be."""
        return self.now is not State.OFF

    def require(self, call: str) -> None:
        """Refuse a call that this state does not allow.

        Raises:
            NotReady: Names the state and the way out of it.
        """
        if self.now not in _CALLS[call]:
            way = WAYS_OUT[self.now]
            if call == "powered" and self.now is not State.FAULTED:
                way = "the motors are on already: leave the first powered() block first"
            raise NotReady(f"{call}: the arm is {self.now}; {way}")

    def enter(self, state: State) -> None:
        """Change the state."""
        self.now = state

    @contextmanager
    def moving(self, to: State) -> Iterator[None]:
        """Be MOVING in the block, and in state ``to`` after it unless it fails."""
        self.now = State.MOVING
        yield
        self.now = to
