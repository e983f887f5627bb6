"""A push on key, jack and string in MuJoCo, with the force law of the stand-in.

MuJoCo's Euler steps change the velocities first, by the forces at the positions, and then move by
them. With half of the forces in the first step they are leap-frog steps, of the second order; the
contact and the release are located within a step, on a parabola, and the step after the release
takes back what the string's force has given too much.
"""

import time

import mujoco
import numpy as np

from benchmarks.figures import check
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.observation import Observation
from sautereau.sim_backend.scene import Scene

_XML = """
<mujoco>
  <compiler inertiafromgeom="false" boundmass="0" boundinertia="0"/>
  <option timestep="{step}" integrator="Euler" gravity="0 0 -{gravity}"
          iterations="100" tolerance="1e-12">
    <flag eulerdamp="disable"/>
  </option>
  <worldbody>
    <body name="key">
      <joint name="key" type="hinge" axis="0 -1 0" limited="true" range="0 1" margin="0"
             damping="{viscous}" frictionloss="{dry}" {hard}/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="{inertia} {inertia} {inertia}"/>
    </body>
    <body name="jack">
      <joint name="jack" type="slide" axis="0 0 1" frictionloss="{register}" {hard}/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="1e-6 1e-6 1e-6"/>
    </body>
  </worldbody>
  <equality>
    <joint joint1="jack" joint2="key" polycoef="0 {arm} {half} {third} {fourth}"
           solref="{reference} 1" solimp="0.9999 0.9999 0.001"/>
  </equality>
</mujoco>
"""
"""The jack follows the key by the series of its rise; in this scene it never loses contact."""


def observe_in_mujoco(rig: Rig, scene: Scene, step: float) -> tuple[float, Observation]:
    """Run a scene's push in MuJoCo, the string's force applied to the jack at every step.

    Args:
        rig: Rig.
        scene: Scene with a push, a spring string and no contact with the felt.
        step: s.

    Returns:
        The time to build and to run it, s, and the observation.
    """
    assert scene.push is not None
    clock = time.perf_counter()
    model = _model(rig, scene, step)
    data = mujoco.MjData(model)
    law = _Law(rig, scene.plectrum)
    moment = rig.key.gravity_moment + scene.push.force * rig.key.press_arm
    steps = round(scene.push.duration / step)
    rows = np.empty((steps, 4))
    _scale_forces(model, 0.5)
    data.qfrc_applied[0], rise, speed, correction = moment / 2, 0.0, 0.0, 0.0
    for i in range(steps):
        force = law.force(rise)
        data.qfrc_applied[1] = -force - correction
        mujoco.mj_step(model, data)
        if i == 0:
            _scale_forces(model, 2.0)
            data.qfrc_applied[0] = moment
        before, rise, was, speed = rise, data.qpos[1], speed, data.qvel[1]
        rows[i] = data.qpos[0], data.qvel[0], rise, force
        correction = law.note(before, rise, (speed - was) * step / 2, i * step, step)
    seconds = time.perf_counter() - clock
    _nothing_was_reset(data, steps * step)
    angle, speed, rise, string = rows.T
    push = np.full(steps, scene.push.force)
    motions = Motions(step * np.arange(1.0, steps + 1), angle, speed, rise, push, string)
    return seconds, Observation(motions, law.events)


def _scale_forces(model: mujoco.MjModel, factor: float) -> None:
    """Multiply weights and dry friction."""
    model.opt.gravity *= factor
    model.dof_frictionloss *= factor


def _model(rig: Rig, scene: Scene, step: float) -> mujoco.MjModel:
    key, jack = rig.key, rig.jack
    # b tan a + hb (1 / cos a - 1) to the fourth order; the fifth is 1e-8 m at the key's end.
    arm, height = key.jack_arm, key.jack_surface_height
    reference = 2 * step  # the stiffest value that MuJoCo accepts
    return mujoco.MjModel.from_xml_string(
        _XML.format(
            step=step,
            gravity=GRAVITY,
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


class _Law:
    """Quasi-static force of the pluck over the jack's rise, and its events between steps."""

    def __init__(self, rig: Rig, level: str):
        pluck = rig_pluck(rig, level)
        self.clearance = rig.jack.string_clearance
        self.release = pluck.release_height
        self.heights = np.linspace(0, self.release, 4001)
        self.forces = pluck.force_on_jack(self.heights)
        self.events = PluckEvents()
        self.cells = self.forces.tolist()

    def force(self, rise: float) -> float:
        """Return the string's force [N] at a rise [m]."""
        cell = (rise - self.clearance) / self.release * 4000
        if self.events.releases or not 0 <= cell < 4000:
            return 0.0
        low = int(cell)
        return self.cells[low] + (cell - low) * (self.cells[low + 1] - self.cells[low])

    def note(self, before: float, after: float, bend: float, start: float, step: float) -> float:
        """Append the events of a step; return the force [N] that the next step lacks.

        Args:
            before: m, rise at the start.
            after: m, at the end.
            bend: m, by which half the acceleration moves the jack in a step.
            start: s.
            step: s.
        """
        lacking = 0.0
        for height, events, force in (
            (self.clearance, self.events.contacts, 0.0),
            (self.clearance + self.release, self.events.releases, self.cells[-1]),
        ):
            if before <= height < after and not events:
                held = self.force(before)
                part = (height - before) / (after - before)
                for _ in range(3):  # of before + (after - before) part + bend part (part - 1)
                    part = (height - before - bend * part * (part - 1)) / (after - before)
                events.append(StringEvent(start + part * step, 0, force))
                if events is self.events.releases:
                    lacking = part * (held + force) / 2 - held / 2
        return lacking


def _nothing_was_reset(data: mujoco.MjData, duration: float) -> None:
    """Refuse a run in which MuJoCo warned: after a reset it starts again at time 0."""
    counts = {mujoco.mjtWarning(i).name: int(w.number) for i, w in enumerate(data.warning)}
    check(not any(counts.values()), f"MuJoCo warned: {counts}")
    off = abs(data.time - duration)
    check(off < 1e-9 * max(1.0, duration / 1e-6), f"MuJoCo ended {off:.3g} s off its end")
