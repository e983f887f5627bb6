"""A push on key, jack and string in MuJoCo, with the force law of the stand-in.

MuJoCo's Euler steps change the velocities first, by the forces at the positions, and then move by
them. With half of the forces in the first step they are leap-frog steps, of the second order; the
contact and the release are located within a step, on a parabola, and the step after the release
takes back what the string's force has given too much.

Nothing but the first step is called from Python: the string is a compiled callback, which MuJoCo's
own loop calls, and which keeps its numbers in MuJoCo's `userdata`.
"""

import ctypes
import math
import time
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numba import carray, cfunc, types

from benchmarks.figures import BenchmarkFault, check
from sautereau.analysis.model.choirs import pluck_of
from sautereau.rig.instrument import Plectrum, String
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.observation import Observation
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

_XML = Path(__file__).with_suffix(".xml").read_text(encoding="utf-8")
"""The jack follows the key by the series of its rise; in this scene it never loses contact."""
_SLIDER = """
<mujoco>
  <size nuserdata="1"/>
  <worldbody>
    <body><joint type="slide"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody>
</mujoco>
"""
CELLS = 4000  # Of the force law, which is linear in each
CLEARANCE, RELEASE, STEP, STEPS, RISE, SPEED, CONTACT_TIME, RELEASE_TIME, LAW = range(9)
"""Places in `userdata`: m; m, from contact to release; s; number of steps done; m and m/s, of the
jack at the start of the last one; s, infinite before the event; N, the forces of the law. The rows
of the motion follow: rad, rad/s, m and N at the start of each step."""
ROWS = LAW + CELLS + 1


def observe_in_mujoco(rig: Rig, scene: Scene, step: float) -> tuple[float, float, Observation]:
    """Run a scene's push in MuJoCo, the string's force applied to the jack at every step.

    Args:
        step: s.

    Returns:
        The times to build and to run it, s, and the observation.
    """
    push = scene.push
    if push is None:
        raise BenchmarkFault("the peer in MuJoCo simulates a push only; give a scene with a push")
    steps = round(push.duration / step)
    clock = time.perf_counter()
    model = _model(rig, scene, step, ROWS + 4 * (steps + 1))
    data = mujoco.MjData(model)
    release, forces = _law(rig.plectrum, rig.string, scene.plectrum)
    user = data.userdata
    user[CLEARANCE], user[RELEASE], user[STEP] = rig.jack.string_clearance, release, step
    user[CONTACT_TIME] = user[RELEASE_TIME] = math.inf
    user[LAW:ROWS] = forces
    built = time.perf_counter()
    mujoco.set_mjcb_passive(_string().ctypes)
    try:
        moment = rig.key.gravity_moment + push.force * rig.key.press_arm
        _scale_forces(model, 0.5)
        data.qfrc_applied[0] = moment / 2
        mujoco.mj_step(model, data)
        _scale_forces(model, 2.0)
        data.qfrc_applied[0] = moment
        mujoco.mj_step(model, data, steps - 1)
        ran = time.perf_counter()
        _nothing_was_reset(data, steps * step)
        mujoco.mj_forward(model, data)  # the callback sees the end of the last step
    finally:
        mujoco.set_mjcb_passive(None)
    calls = int(user[STEPS])
    check(calls == steps + 1, f"MuJoCo called the string {calls} times in {steps} steps")
    angle, speed, rise, string = user[ROWS:].reshape(-1, 4)[1:].T.copy()
    motions = Motions(
        step * np.arange(1.0, steps + 1), angle, speed, rise, np.full(steps, push.force), string,
        np.zeros(steps),
    )  # fmt: skip
    events = PluckEvents()
    for found, place, force in (
        (events.contacts, CONTACT_TIME, 0.0),
        (events.releases, RELEASE_TIME, float(forces[-1])),
    ):
        if user[place] < math.inf:
            found.append(StringEvent(float(user[place]), 0, force))
    return built - clock, ran - built, Observation(motions, events)


@cache
def _string() -> Any:
    """Compile the string's force on the jack, with its events between steps."""
    position, velocity, force, user = _places()

    @cfunc(types.void(types.voidptr, types.CPointer(types.CPointer(types.float64))))
    def pull(_, data):
        q, v, numbers = carray(data[position], 2), carray(data[velocity], 2), data[user]
        at = carray(numbers, 1 << 30)
        rise, clearance, count = q[1], at[CLEARANCE], int(at[STEPS])
        cell = (rise - clearance) / at[RELEASE] * CELLS
        correction = held = 0.0
        if count > 0:
            # By which half the acceleration moves the jack in a step.
            before, bend = at[RISE], (v[1] - at[SPEED]) * at[STEP] / 2
            for place, height in (
                (CONTACT_TIME, clearance),
                (RELEASE_TIME, clearance + at[RELEASE]),
            ):
                if before <= height < rise and math.isinf(at[place]):
                    part = (height - before) / (rise - before)
                    for _ in range(3):  # of before + (rise - before) part + bend part (part - 1)
                        part = (height - before - bend * part * (part - 1)) / (rise - before)
                    at[place] = (count - 1 + part) * at[STEP]
                    if place == RELEASE_TIME:
                        last = at[ROWS + 4 * count - 1]
                        correction = part * (last + at[LAW + CELLS]) / 2 - last / 2
        if math.isinf(at[RELEASE_TIME]) and 0 <= cell < CELLS:
            low = LAW + int(cell)
            held = at[low] + (cell - int(cell)) * (at[low + 1] - at[low])
        carray(data[force], 2)[1] -= held + correction
        row = ROWS + 4 * count
        at[row], at[row + 1], at[row + 2], at[row + 3] = q[0], v[0], rise, held
        at[RISE], at[SPEED], at[STEPS] = rise, v[1], count + 1

    return pull


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
    key, jack = rig.key, rig.jack
    # b tan a + hb (1 / cos a - 1) to the fourth order; the fifth is 1e-8 m at the key's end.
    arm, height = key.jack_arm, key.jack_surface_height
    reference = 2 * step  # the stiffest value that MuJoCo accepts
    return mujoco.MjModel.from_xml_string(
        _XML.format(
            step=step,
            gravity=GRAVITY,
            numbers=numbers,
            inertia=key.inertia,
            viscous=key.pivot_viscous_friction if scene.friction else 0.0,
            dry=key.pivot_coulomb_friction if scene.friction else 0.0,
            mass=jack.mass,
            register=jack.register_friction if scene.friction else 0.0,
            arm=arm,
            half=height / 2,
            third=arm / 3,
            fourth=5 * height / 24,
            reference=reference,
            hard=f'solreffriction="{reference} 1" solreflimit="{reference} 1"',
        )
    )


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
