"""Scenes with one string in MuJoCo: a push, a prescribed fingertip, and an arm under its servo.

The string's force law is that of the stand-in. MuJoCo's Euler steps change the velocities first,
by the forces at the positions, and then move by them. With half of the forces in the first step
they are leap-frog steps, of the second order; contact, release and return are located within a
step, on a parabola, and the step after the release takes back what the string's force has given too
much.

For a push the jack follows the key by an equality. For a finger all contacts are MuJoCo's own: of
the fingertip and the jack's foot, spheres, with the key's surfaces, boxes. A prescribed arm is so
heavy that nothing moves it, under the force that takes it to the reference at each step's end; a
servo's torque at the start of a controller sample is the mean of the old and the new one, as half
of that step belongs to each.

Nothing but the first step is called from Python: string, felt and servo are a compiled callback,
which MuJoCo's own loop calls, and which keeps its numbers in MuJoCo's `userdata`.
"""

import ctypes
import math
import time
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numba import carray, cfunc, njit, types

from benchmarks.figures import check
from sautereau.analysis.model.choirs import pluck_of
from sautereau.rig.instrument import Plectrum, String
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.drive import Drive, PressDrive
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.laws import surface
from sautereau.sim_backend.physics.observation import Observation
from sautereau.sim_backend.physics.rigid.finger import touching_angle
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.motion import Floats

_PUSH, _PRESS = (
    Path(__file__).with_name(name).read_text(encoding="utf-8")
    for name in ("mujoco_peer.xml", "mujoco_press.xml")
)
"""In the first the jack follows the key by the series of its rise, and never loses contact."""
_SLIDER = """
<mujoco>
  <size nuserdata="1"/>
  <worldbody>
    <body><joint type="slide"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody>
</mujoco>
"""
CELLS = 4000  # Of the force law, which is linear in each
FOOT = 5e-3  # m, radius of the jack's foot, whose centre is that much above the surface
HEAVY = 1e6  # kg m^2, of the joints of a prescribed arm: contacts turn it by 1e-8 rad
CLEARANCE, RELEASE, STEP, STEPS, RISE, SPEED, STATE, TIMES, LAW = 0, 1, 2, 3, 4, 5, 6, 7, 10
"""Places in `userdata`: m; m, from contact to release; s; number of steps done; m and m/s, of the
jack at the start of the last one; state of the string; s, of contact, release and return, infinite
before each; N, the forces of the law. Then the rows of the motion: rad, rad/s, m and N at the start
of each step."""
BELOW, HELD, ABOVE = 0, 1, 2  # States of the string
DIP, FELT, DAMPING, FINGER = 0, 1, 2, 3
PERIOD, PARTS, RADIANS, TIME, START, GAINS, LOOPS, REFERENCE = 0, 1, 2, 3, 4, 6, 14, 20
"""Places from `LAW + CELLS + 1` on: rad, N m/rad and N m s/rad of the felt. Then of a prescribed
arm N m for both joints at each step; of a servo s, steps in a sample, rad in a count, s of the
integral; rad, start of the joints; k, c, feedforward and limit of each; integral, torque and last
error of each; and counts and rad/s^2 of both joints at each sample."""
KEPT = LAW + CELLS + 1


def observe_in_mujoco(
    rig: Rig, scene: Scene, step: float, drive: Drive
) -> tuple[float, float, Observation]:
    """Run a scene's drive in MuJoCo.

    Args:
        step: s, of which a controller sample is a multiple.

    Returns:
        The processor times to build and to run it, s, and the observation.
    """
    began = time.process_time()
    steps = round(drive.samples * rig.controller.sample_period / step)
    parameters = np.zeros(FINGER)
    if scene.push is not None:
        steps = round(scene.push.duration / step)
    elif isinstance(drive, PressDrive):
        parameters = np.concatenate([parameters, _finger(rig, scene, step, steps, drive)])
    rows = KEPT + len(parameters)
    model = _model(rig, scene, step, rows + 4 * (steps + 1))
    data = mujoco.MjData(model)
    release, forces = _law(rig.plectrum, rig.string, scene.on_bench(rig).plectrum)
    user, key = data.userdata, rig.key
    user[CLEARANCE], user[RELEASE], user[STEP] = rig.jack.string_clearance, release, step
    user[TIMES:LAW], user[LAW:KEPT], user[KEPT:rows] = math.inf, forces, parameters
    user[KEPT + DIP] = key.dip / key.press_arm if scene.felt else math.inf
    user[KEPT + FELT] = key.felt_stiffness * key.press_arm**2
    user[KEPT + DAMPING] = key.felt_damping * key.press_arm**2
    moment = key.gravity_moment
    if scene.push is not None:
        moment += scene.push.force * key.press_arm
    else:
        angle = max(
            0.0, float(touching_angle(rig, fingertip_place(rig.arm, np.array(drive.start))))
        )
        rise, _, _ = surface(key.jack_arm, key.jack_surface_height, angle)
        data.qpos[:] = angle, rise, *drive.start
    built = time.process_time()
    kind = "push" if scene.push is not None else scene.finger
    mujoco.set_mjcb_passive(_action(kind, rows).ctypes)
    try:
        _scale_forces(model, 0.5)
        data.qfrc_applied[0] = moment / 2
        mujoco.mj_step(model, data)
        _scale_forces(model, 2.0)
        data.qfrc_applied[0] = moment
        mujoco.mj_step(model, data, steps - 1)
        ran = time.process_time()
        _nothing_was_reset(data, steps * step)
        mujoco.mj_forward(model, data)  # the callback sees the end of the last step
    finally:
        mujoco.set_mjcb_passive(None)
    calls = int(user[STEPS])
    check(calls == steps + 1, f"MuJoCo called the string {calls} times in {steps} steps")
    angle, speed, rise, string = user[rows:].reshape(-1, 4)[1:].T.copy()
    force = scene.push.force if scene.push is not None else math.nan  # of a contact: not kept
    motions = Motions(
        step * np.arange(1.0, steps + 1), angle, speed, rise, np.full(steps, force), string,
        np.zeros(steps),
    )  # fmt: skip
    events, ends = PluckEvents(), (0.0, float(forces[-1]), 0.0)
    lists = events.contacts, events.releases, events.returns
    for found, place, end in zip(lists, user[TIMES:LAW], ends, strict=True):
        if place < math.inf:
            found.append(StringEvent(float(place), 0, end))
    return built - began, ran - built, Observation(motions, events)


def _finger(rig: Rig, scene: Scene, step: float, steps: int, drive: PressDrive) -> Floats:
    """Return the numbers of the arm from `FINGER` on, as its part of the callback needs them."""
    if scene.servo is None:
        joints = drive.joints(step * np.arange(-1.0, steps + 2)).position
        return (HEAVY * np.diff(joints, 2, axis=0) / step**2).ravel()
    servo, arm, period = scene.servo, rig.arm, rig.controller.sample_period
    counts, speeds = drive.ends()
    spins = np.diff(speeds, axis=0, append=speeds[-1:]) * arm.radians_per_count / period**2
    gains = [servo.stiffness, servo.damping, servo.feedforward, [arm.torque_limit] * 2]
    weight = gravity_torque(arm, np.array(drive.start))
    fixed = [period, round(period / step), arm.radians_per_count, servo.integral_time]
    loops = np.concatenate([weight, weight, [0.0, 0.0]])
    return np.concatenate(
        [fixed, drive.start, np.ravel(gains), loops, np.hstack([counts, spins]).ravel()]
    )


@njit
def _crossed(at, rise):
    """Let the string's state follow; return the event in the last step, or -1, and its rise."""
    state, low, high = at[STATE], at[CLEARANCE], at[CLEARANCE] + at[RELEASE]
    if state == BELOW and rise > low:
        at[STATE] = HELD
        return 0, low
    if state == HELD and rise > high:
        at[STATE] = ABOVE
        return 1, high
    if state != BELOW and rise < low:
        at[STATE] = BELOW
        return (2, low) if state == ABOVE else (-1, low)
    return -1, low


@njit
def _pull(at, row, rise, speed):
    """Return the string's force on the jack at the start of a step, and keep its events."""
    count, step = int(at[STEPS]), at[STEP]
    correction = held = 0.0
    kind, height = _crossed(at, rise)
    if kind >= 0:
        # By which half the acceleration moves the jack in a step.
        before, bend = at[RISE], (speed - at[SPEED]) * step / 2
        part = (height - before) / (rise - before)
        for _ in range(3):  # of before + (rise - before) part + bend part (part - 1)
            part = (height - before - bend * part * (part - 1)) / (rise - before)
        if math.isinf(at[TIMES + kind]):
            at[TIMES + kind] = (count - 1 + part) * step
        if kind == 1:
            last = at[row - 1]
            correction = part * (last + at[LAW + CELLS]) / 2 - last / 2
    cell = (rise - at[CLEARANCE]) / at[RELEASE] * CELLS
    if at[STATE] == HELD and 0 <= cell < CELLS:
        low = LAW + int(cell)
        held = at[low] + (cell - int(cell)) * (at[low + 1] - at[low])
    at[row + 2], at[row + 3] = rise, held
    at[RISE], at[SPEED], at[STEPS] = rise, speed, count + 1
    return held + correction


@njit
def _close_loops(at, count, q, force):
    """Add the torques of the servo in the step that starts."""
    first = KEPT + FINGER
    sample, within = count // int(at[first + PARTS]), count % int(at[first + PARTS])
    for j in range(2):
        loop, gain = first + LOOPS + j, first + GAINS + j
        before = at[loop + 2]
        if within == 0:
            reference = first + REFERENCE + 4 * sample + j
            counts = at[reference] - round((q[2 + j] - at[first + START + j]) / at[first + RADIANS])
            lag = counts * at[first + RADIANS]
            torque = at[gain] * lag + at[gain + 2] * (lag - at[loop + 4]) / at[first + PERIOD]
            torque += at[gain + 4] * at[reference + 2] + at[loop]
            limit, at[loop + 4] = at[gain + 6], lag
            if abs(torque) < limit:
                at[loop] += at[gain] * lag * at[first + PERIOD] / at[first + TIME]
            at[loop + 2] = min(max(torque, -limit), limit)
            force[2 + j] += (before + at[loop + 2]) / 2
        else:
            force[2 + j] += before


@cache
def _action(kind: str, rows: int) -> Any:
    """Compile the forces of the string, the felt and the finger, with the rows from a place on."""
    position, velocity, force, user = _places()
    n, prescribed, servo = (2 if kind == "push" else 4), kind == "ideal", kind == "servo"

    @cfunc(types.void(types.voidptr, types.CPointer(types.CPointer(types.float64))))
    def act(_, data):
        q, v, pushed = carray(data[position], n), carray(data[velocity], n), carray(data[force], n)
        at = carray(data[user], 1 << 30)
        count = int(at[STEPS])
        row = rows + 4 * count
        at[row], at[row + 1] = q[0], v[0]
        pushed[1] -= _pull(at, row, q[1], v[1])
        over = q[0] - at[KEPT + DIP]
        if over > 0.0:
            pushed[0] -= max(0.0, at[KEPT + FELT] * over + at[KEPT + DAMPING] * v[0])
        if prescribed:
            pushed[2] += at[KEPT + FINGER + 2 * count]
            pushed[3] += at[KEPT + FINGER + 2 * count + 1]
        elif servo:
            _close_loops(at, count, q, pushed)

    return act


def _places() -> list[int]:
    """Return where `mjData` has the pointers that the string needs, in words from its start."""
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(_SLIDER))
    wanted = [a.ctypes.data for a in (data.qpos, data.qvel, data.qfrc_passive, data.userdata)]
    places: dict[int, int] = {}
    word = 0
    while not places.keys() >= set(wanted):  # it has them all
        value = ctypes.c_size_t.from_address(data._address + 8 * word).value
        places.setdefault(value, word)
        word += 1
    return [places[value] for value in wanted]


def _scale_forces(model: mujoco.MjModel, factor: float) -> None:
    """Multiply weights and dry friction."""
    model.opt.gravity *= factor
    model.dof_frictionloss *= factor


def _model(rig: Rig, scene: Scene, step: float, numbers: int) -> mujoco.MjModel:
    key, jack, arm = rig.key, rig.jack, rig.arm
    reference = 2 * step  # the stiffest value that MuJoCo accepts
    values = {
        "step": step, "gravity": GRAVITY, "numbers": numbers, "inertia": key.inertia,
        "viscous": key.pivot_viscous_friction if scene.friction else 0.0,
        "dry": key.pivot_coulomb_friction if scene.friction else 0.0,
        "mass": jack.mass, "register": jack.register_friction if scene.friction else 0.0,
        "arm": key.jack_arm, "reference": reference,
        "hard": f'solreffriction="{reference} 1" solreflimit="{reference} 1"',
    }  # fmt: skip
    if scene.push is not None:
        # b tan a + hb (1 / cos a - 1) to the fourth order; the fifth is 1e-8 m at the key's end.
        height = key.jack_surface_height
        series = {"half": height / 2, "third": key.jack_arm / 3, "fourth": 5 * height / 24}
        return mujoco.MjModel.from_xml_string(_PUSH.format(**values, **series))
    rods = [mass * length**2 / 12 for mass, length in (
        (arm.upper_mass, arm.upper_length), (arm.lower_mass, arm.lower_length)
    )]  # fmt: skip
    values |= {
        "front": key.surface_height - 0.05, "back": key.jack_surface_height - FOOT - 0.05,
        "height": key.jack_surface_height, "foot": FOOT, "radius": arm.fingertip_radius,
        "base_x": arm.base_x, "base_z": arm.base_z, "upper": arm.upper_length,
        "lower": arm.lower_length, "half1": arm.upper_length / 2, "half2": arm.lower_length / 2,
        "mass1": arm.upper_mass, "mass2": arm.lower_mass, "rod1": rods[0], "rod2": rods[1],
        "armature": HEAVY if scene.finger == "ideal" else 0.0,
    }  # fmt: skip
    return mujoco.MjModel.from_xml_string(_PRESS.format(**values))


@lru_cache
def _law(plectrum: Plectrum, string: String, level: str) -> tuple[float, Floats]:
    """Return the height of release [m] and the law's forces [N]; kept, as the stand-in's is."""
    pluck = pluck_of(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    heights = np.linspace(0, pluck.release_height, CELLS + 1)
    return pluck.release_height, pluck.force_on_jack(heights)


def _nothing_was_reset(data: mujoco.MjData, duration: float) -> None:
    """Refuse a run in which MuJoCo warned: after a reset it starts again at time 0."""
    counts = {mujoco.mjtWarning(i).name: int(w.number) for i, w in enumerate(data.warning)}
    check(not any(counts.values()), f"MuJoCo warned: {counts}")
    off = abs(data.time - duration)
    check(off < 1e-9 * max(1.0, duration / 1e-6), f"MuJoCo ended {off:.3g} s off its end")
