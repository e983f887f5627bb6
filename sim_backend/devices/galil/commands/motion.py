"""Commands that move: motors, references, profiles, PVT, stops."""

import re

from sautereau.sim_backend.devices.galil.axis import LARGEST, SETTINGS
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    integers,
    parse_axes,
    parse_list,
    split_arguments,
    write_list,
)
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.motion import Segment, StopCode
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, whole
from sautereau.sim_backend.devices.galil.program import THREADS, Thread

SEGMENT_DISTANCE = 44_000_000
"""Counts, the longest PVT segment."""
SEGMENT_VELOCITY = 22_000_000
"""Counts per second, the largest velocity at a PVT segment's end."""
SEGMENT_SAMPLES = 2048
"""Samples, the longest duration of a PVT segment."""


def setting(machine: Machine, name: str, args: str) -> str | None:
    """Set or report a number stored for every axis."""
    limits = SETTINGS[name]
    values = parse_list(args, machine)
    for value in values.values():
        if value is not None and not limits.low <= value <= limits.high:
            raise CommandError(6)
    answers = []
    for index, value in values.items():
        settings = machine.axes[index].settings
        if value is None:
            answers.append(settings[name])
        else:
            settings[name] = value // limits.step * limits.step if limits.step else value
    if name in ("TL", "OF"):
        machine.drive()
    return write_list(answers, 0 if limits.step else 4) if answers else None


def tell(machine: Machine, name: str, args: str) -> str:
    """Report one number of each axis."""
    value = AXIS_OPERANDS[name]
    return write_list(
        [value(machine, index) for index in parse_axes(args)], 4 if name == "TT" else 0
    )


def motor_off(machine: Machine, args: str, thread: Thread | None) -> None:
    """MO: switch motors off; the stop codes do not change."""
    for axis in _resting(machine, args):
        axis.motor_on = False


def servo_here(machine: Machine, args: str, thread: Thread | None) -> None:
    """SH: switch motors on, with the reference at the encoder's position."""
    counts = machine.plant.encoder_counts()
    for index in parse_axes(args):
        axis = machine.axes[index]
        if axis.profile is not None:
            raise CommandError(7)
        axis.follow(counts[index])
        axis.motor_on = True
        axis.stop_code = StopCode.AT_TARGET


def define_position(machine: Machine, args: str, thread: Thread | None) -> str | None:
    """DP: redefine the reported position of the reference; nothing moves."""
    new, asked = _integers(machine, args, LARGEST)
    if any(machine.axes[index].profile is not None for index in new):
        raise CommandError(7)
    for index, value in new.items():
        machine.axes[index].offset += value - machine.commanded(index)
    return write_list([machine.position(index) for index in asked]) if asked else None


def define_auxiliary(machine: Machine, args: str, thread: Thread | None) -> str | None:
    """DE: the same for the auxiliary encoder."""
    new, asked = _integers(machine, args, LARGEST)
    for index, value in new.items():
        machine.axes[index].auxiliary = value
    return write_list([machine.axes[index].auxiliary for index in asked]) if asked else None


def aim(machine: Machine, mode: str, args: str) -> str | None:
    """PA, PR and JG: choose the next motion and its target."""
    new, asked = _integers(machine, args, SEGMENT_VELOCITY if mode == "JG" else LARGEST)
    for index in new:
        axis = machine.axes[index]
        if axis.profile is not None and not (mode == "JG" and axis.jogging):
            raise CommandError(13 if mode == "JG" else 7)
    for index, value in new.items():
        axis = machine.axes[index]
        axis.mode, axis.target = mode, value
        if axis.jogging:
            axis.begin_jog()
    return write_list([machine.axes[index].target for index in asked]) if asked else None


def home(machine: Machine, args: str, thread: Thread | None) -> None:
    """HM: make the next BG move to the home switch, which becomes position 0."""
    for axis in _resting(machine, args):
        axis.mode = "HM"


def begin(machine: Machine, args: str, thread: Thread | None) -> None:
    """BG: start the motions chosen by PA, PR, JG or HM, on all axes in the same sample."""
    indices = parse_axes(args)
    moves = {index: _destination(machine, index) for index in indices}
    for index, distance in moves.items():
        _check_begin(machine, index, distance)
    for index, distance in moves.items():
        axis = machine.axes[index]
        if axis.mode == "JG":
            axis.begin_jog()
        elif axis.mode == "HM":
            axis.begin_move(float(machine.plant.home_counts()[index]), home=True)
        else:
            axis.begin_move(float(machine.commanded(index) + distance - axis.offset))


def _destination(machine: Machine, index: int) -> int:
    """Return the distance [counts] of the motion, or any number of its sign."""
    axis = machine.axes[index]
    if axis.mode == "PA":
        return axis.target - machine.commanded(index)
    if axis.mode == "HM":
        return machine.plant.home_counts()[index] - round(axis.position)
    return axis.target


def _check_begin(machine: Machine, index: int, distance: float) -> None:
    axis = machine.axes[index]
    if not axis.motor_on:
        raise CommandError(20)
    if axis.profile is not None:
        raise CommandError(7)
    beyond = (axis.reported > axis.settings["FL"]) - (axis.reported < axis.settings["BL"])
    if beyond * distance > 0:
        raise CommandError(22)


def segment(machine: Machine, args: str, thread: Thread | None) -> None:
    """PV: add a segment to an axis's buffer; ``0,0,0`` ends the sequence, ``0,0,-1`` clears it.

    Both axes read their buffers independently.
    """
    named = re.fullmatch(r" *([A-Z]) *=(.*)", args)
    if not named:
        raise CommandError(4)
    (index,) = parse_axes(named[1])
    axis = machine.axes[index]
    if len(split_arguments(named[2])) < 3:
        raise CommandError(50)
    limits = (-SEGMENT_DISTANCE, SEGMENT_DISTANCE), (-SEGMENT_VELOCITY, SEGMENT_VELOCITY)
    distance, velocity, samples = integers(machine, named[2], *limits, (-1, SEGMENT_SAMPLES))
    if samples <= 0 and (distance or velocity):
        raise CommandError(6)
    if samples < 0:
        axis.fifo.clear()
    elif axis.free == 0:
        raise CommandError(32)
    else:
        axis.fifo.append(Segment(distance, velocity, samples))


def begin_pvt(machine: Machine, args: str, thread: Thread | None) -> None:
    """BT: start the PVT sequences of all axes in the same sample."""
    indices = parse_axes(args)
    for index in indices:
        fifo = machine.axes[index].fifo
        _check_begin(machine, index, fifo[0].distance if fifo else 0)
        if not fifo:
            raise CommandError(24)
    for index in indices:
        machine.axes[index].begin_pvt()


def stop(machine: Machine, args: str, thread: Thread | None) -> None:
    """ST: decelerate; from the host and without axes it ends the programs as well."""
    for index in parse_axes(args):
        machine.axes[index].stop(StopCode.STOPPED)
    if not args and thread is None:
        machine.halt_threads(range(THREADS))


def abort(machine: Machine, args: str, thread: Thread | None) -> None:
    """AB: stop at once and end the programs; AB1 does not end the programs."""
    if args not in ("", "0", "1"):
        raise CommandError(4)
    machine.abort(programs=args != "1")


def _integers(machine: Machine, args: str, limit: int) -> tuple[dict[int, int], list[int]]:
    """Return the new integers by axis, each from -limit - 1 to limit, and the queried axes."""
    values = parse_list(args, machine)
    new = {i: whole(v, -limit - 1, limit) for i, v in values.items() if v is not None}
    return new, [i for i, v in values.items() if v is None]


def _resting(machine: Machine, args: str):
    axes = [machine.axes[index] for index in parse_axes(args)]
    if any(axis.profile is not None for axis in axes):
        raise CommandError(7)
    return axes
