"""Commands that move: motors, references, profiles, PVT, stops, searches (FE, FI and HM).

A search is a sequence of legs. Each leg is a `Ramp` that ends by itself, or as soon as a sensor
that is read at the start of every sample has found what it looks for.
"""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from sautereau.sim_backend.devices.galil.answers import CommandError, write_list
from sautereau.sim_backend.devices.galil.axis import SEARCHES, Axis
from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.grammar import (
    evaluate,
    named_axes,
    parse_axes,
    split_arguments,
)
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.motion import (
    SAMPLES_PER_SECOND,
    Profile,
    Ramp,
    Segment,
    StopCode,
    brake,
    jog,
    trapezoid,
)
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, whole


class Leg(NamedTuple):
    """A piece of a search."""

    pieces: list[tuple[float, float]]
    """Pieces of the `Ramp` that the axis follows."""
    found: Callable[[], bool] | None = None
    """What ends it before its end."""
    target: float | None = None
    """Counts, of its end."""


class Search(Profile):
    """The execution of a search's legs; ends at rest.

    Args:
        legs: Computed one after the other, from the axis's state then.
        code: Stop code of its end.
        homes: Whether its end becomes position 0.
    """

    def __init__(self, axis: Axis, legs: Iterator[Leg], code: StopCode, *, homes: bool) -> None:
        self.code = StopCode.RUNNING
        self.done = False
        self.homes = homes
        self._axis, self._legs, self._end = axis, legs, code
        self._next()

    def step(self) -> tuple[float, float]:
        axis = self._axis
        while not self.done and (self._ramp.done or (self._found is not None and self._found())):
            self._next()
        if self.done:
            return axis.position, 0.0
        return self._ramp.step()

    def _next(self) -> None:
        leg = next(self._legs, None)
        if leg is None:
            self.done, self.code = True, self._end
            return
        axis = self._axis
        self._found = leg.found
        self._ramp = Ramp(axis.position, axis.velocity, leg.pieces, leg.target)


def _jog(axis: Axis, speed: float, found: Callable[[], bool]) -> Leg:
    return Leg(jog(axis.velocity, speed, axis.rate("AC"), axis.rate("DC")), found)


def _stop(axis: Axis) -> Leg:
    return Leg(brake(axis.velocity, axis.rate("DC")))


def find_edge(axis: Axis, home: Callable[[], bool]) -> Iterator[Leg]:
    """FE: move at SP until the home input changes; backward if it is 1."""
    start = home()
    yield _jog(axis, axis.speed("SP") * (-1 if start else 1), lambda: home() != start)
    yield _stop(axis)


def find_index(axis: Axis, speed: float) -> Iterator[Leg]:
    """FI: move until the index passes, then back to it at HV."""
    axis.arm_latch()
    yield _jog(axis, speed, lambda: axis.latched is not None)
    yield _stop(axis)
    if axis.latched is None:
        return
    way = axis.latched - axis.position
    pieces = trapezoid(way, axis.speed("HV"), axis.rate("AC"), axis.rate("DC"))
    yield Leg(pieces, target=float(axis.latched))


def go_home(axis: Axis, home: Callable[[], bool]) -> Iterator[Leg]:
    """HM: find the edge, approach it again at HV and stop there at once, then find the index."""
    start = home()
    yield from find_edge(axis, home)
    back = axis.speed("HV") * (1 if start else -1)
    yield _jog(axis, back, lambda: home() == start)
    axis.velocity = 0.0
    yield from find_index(axis, axis.speed("HV"))


def begin_search(axis: Axis, home: Callable[[], bool]) -> None:
    """Start HM, FE or FI on an axis; ``home`` reads the home input."""
    if axis.mode == "HM":
        search = Search(axis, go_home(axis, home), StopCode.HOMED, homes=True)
    elif axis.mode == "FE":
        search = Search(axis, find_edge(axis, home), StopCode.EDGE_FOUND, homes=False)
    else:
        legs = find_index(axis, axis.jog_speed / SAMPLES_PER_SECOND)
        search = Search(axis, legs, StopCode.HOMED, homes=True)
    axis.start(search)
    axis.mode = "PR"


def motor_off(machine: Machine, call: Call) -> None:
    """MO: switch motors off; the stop codes do not change."""
    for index in call.axes:
        machine.axes[index].switch_off(brake_first=True)
    machine.outputs.update()


def servo_here(machine: Machine, call: Call) -> None:
    """SH: switch motors on, with the reference at the encoder's position."""
    counts = machine.plant.encoder_counts()
    for index in call.axes:
        machine.axes[index].switch_on(counts[index])
        machine.axes[index].stop_code = StopCode.AT_TARGET
    machine.outputs.update()


def aim(machine: Machine, call: Call) -> str | None:
    """PA, PR and JG: choose the next motion and its target."""
    axes = [machine.axes[index] for index, _ in call.given]
    if any(axis.profile is not None and not axis.jogging for axis in axes):
        raise CommandError(13)
    for axis, (_, value) in zip(axes, call.given, strict=True):
        axis.mode = call.code
        if call.code == "PR":
            axis.distance = int(value)
        elif call.code == "PA":
            axis.target = int(value)
            axis.distance = axis.target - axis.reported
        else:
            axis.jog_speed = int(value)
            axis.settings["SP"] = abs(value)
            if axis.jogging:
                axis.begin_jog()
    return write_list([AXIS_OPERANDS[call.code](machine, index) for index in call.asked])


def increment(machine: Machine, call: Call) -> str | None:
    """IP: move on by some counts, from rest as PR and BG do."""
    for index, value in call.given:
        axis = machine.axes[index]
        if axis.profile is not None:
            axis.increment(int(value))
        else:
            _check_begin(machine, index, value)
            axis.begin_move(int(value))
    return write_list([machine.position(index) for index in call.asked])


def search(machine: Machine, call: Call) -> None:
    """HM, FE and FI: make the next BG a search for the home switch or the index."""
    for index in call.axes:
        machine.axes[index].mode = call.code


def begin(machine: Machine, call: Call) -> None:
    """BG: start the motions chosen before, on all axes in the same sample."""
    moves = {index: _direction(machine, index) for index in call.axes}
    for index, distance in moves.items():
        _check_begin(machine, index, distance)
    for index, distance in moves.items():
        axis = machine.axes[index]
        if axis.mode == "JG":
            axis.begin_jog()
        elif axis.mode in SEARCHES:
            begin_search(axis, partial(machine.home_state, index))
        else:
            axis.begin_move(distance)


def _direction(machine: Machine, index: int) -> float:
    """Return the distance [counts] of the motion, or any number of its sign."""
    axis = machine.axes[index]
    if axis.mode in ("JG", "FI"):
        return axis.jog_speed
    if axis.mode in SEARCHES:
        return -1 if machine.home_state(index) else 1
    return axis.target - axis.reported if axis.mode == "PA" else axis.distance


def _check_begin(machine: Machine, index: int, distance: float) -> None:
    if not machine.axes[index].motor_on:
        raise CommandError(20)
    if machine.blocks(index, distance):
        raise CommandError(22)


def segment(machine: Machine, call: Call) -> None:
    """PV: add a segment to an axis's buffer; ``,,0`` ends the sequence, ``,,-1`` clears it.

    Both axes read their buffers independently. A segment without a time has that of the last one.
    """
    named = re.fullmatch(r" *([A-Z]|~[a-h]) *=(.*)", call.text)
    if not named:
        raise CommandError(4)
    (index,) = parse_axes(named_axes(machine, named[1]), machine)
    axis = machine.axes[index]
    parts = split_arguments(named[2])
    if len(parts) > 3:
        raise CommandError(4)
    numbers = [evaluate(part, machine) if part else None for part in [*parts, "", ""][:3]]
    distance, velocity = numbers[0] or 0.0, numbers[1] or 0.0
    time = numbers[2] if numbers[2] is not None else axis.last_samples
    if numbers[2] is None and not axis.last_samples:
        raise CommandError(39)
    if distance != int(distance) or velocity != int(velocity) or time != int(time):
        raise CommandError(6)
    if machine.unit.odd_pvt == "refuse" and (velocity % 2 or (time > 0 and time % 2)):
        raise CommandError(6)
    if time < 0:
        whole(time, -1, 0)
        axis.fifo.clear()
        return
    accept = [argument.accept for argument in call.entry.arguments]
    entered = Segment(int(accept[0](distance)), int(accept[1](velocity)), int(accept[2](time)))
    if entered.samples == 0 and time > 0:
        raise CommandError(6)
    if axis.free == 0:
        raise CommandError(32)
    axis.fifo.append(entered)
    axis.last_samples = entered.samples or axis.last_samples


def begin_pvt(machine: Machine, call: Call) -> None:
    """BT: start the PVT sequences of the axes in the same sample."""
    for index in call.axes:
        fifo = machine.axes[index].fifo
        _check_begin(machine, index, fifo[0].distance if fifo else 0)
        if not fifo:
            raise CommandError(24)
    for index in call.axes:
        machine.axes[index].begin_pvt(stop_at_once=machine.unit.underrun == "stop")


def stop(machine: Machine, call: Call) -> None:
    """ST: decelerate; from the host and without axes it ends the programs as well."""
    for index in call.axes:
        machine.axes[index].stop(StopCode.STOPPED)
    if not call.text and call.thread is None:
        machine.tasks.halt()


def abort(machine: Machine, call: Call) -> None:
    """AB: stop at once and end the programs; AB 1 does not end the programs."""
    machine.abort_axes(StopCode.ABORTED)
    if call.number() == 0:
        machine.tasks.halt()
