"""The arm's states: the calls that each allows, and the way out."""

import pytest

from sautereau.robot.drivers.safety import WAYS_OUT, State, States
from sautereau.robot.errors import NotReady

CALLS = ("powered", "home", "check_home", "move_to", "load", "arm", "start", "wait", "stop")
ALLOWED = {
    State.OFF: {"powered"},
    State.STOPPED: {"home", "stop"},
    State.HOMED: {"home", "check_home", "move_to", "load", "stop"},
    State.LOADED: {"home", "check_home", "move_to", "load", "arm", "stop"},
    State.ARMED: {"home", "check_home", "move_to", "load", "arm", "start", "stop"},
    State.MOVING: {"wait", "stop"},
    State.FAULTED: set(),
}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("call", CALLS)
def test_a_refused_call_names_the_state_and_the_way_out(state, call):
    states = States()
    states.enter(state)
    if call in ALLOWED[state]:
        states.require(call)
        return
    with pytest.raises(NotReady) as caught:
        states.require(call)
    assert f"{call}: the arm is {state}; " in str(caught.value)
    way = WAYS_OUT[state]
    if call == "powered" and state is not State.FAULTED:
        way = "leave the first powered() block first"
    assert way in str(caught.value)


def test_a_motion_that_fails_leaves_the_arm_moving():
    states = States()
    with pytest.raises(ValueError, match="stuck"), states.moving(State.HOMED):
        raise ValueError("stuck")
    assert states.now is State.MOVING
    with states.moving(State.HOMED):
        assert states.on
    assert states.now is State.HOMED


def test_off_alone_is_off():
    states = States()
    assert not states.on
    for state in set(State) - {State.OFF}:
        states.enter(state)
        assert states.on
