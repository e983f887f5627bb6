"""A push on key, jack and string in MuJoCo, with the force law of the stand-in."""

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
  <option timestep="{step}" integrator="{integrator}" gravity="0 0 -{gravity}"
          iterations="100" tolerance="1e-12"/>
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


def observe_in_mujoco(
    rig: Rig, scene: Scene, step: float, integrator: str
) -> tuple[float, Observation]:
    """Run a scene's push in MuJoCo, the string's force applied to the jack at every step.

    Args:
        rig: Rig.
        scene: Scene with a push, a spring string and no contact with the felt.
        step: s.
        integrator: Name of an integrator of MuJoCo.

    Returns:
        The time of its steps, s, and the observation.
    """
    assert scene.push is not None
    model = _model(rig, scene, step, integrator)
    data = mujoco.MjData(model)
    law = _Law(rig, scene.plectrum)
    moment = scene.push.force * rig.key.press_arm
    steps = round(scene.push.duration / step)
    rows = np.empty((steps, 4))
    clock = time.perf_counter()
    for i in range(steps):
        before = data.qpos[1]
        force = law.force(before)
        data.qfrc_applied[0] = rig.key.gravity_moment + moment
        data.qfrc_applied[1] = -force
        mujoco.mj_step(model, data)
        rows[i] = data.qpos[0], data.qvel[0], data.qpos[1], force
        law.note(before, data.qpos[1], i * step, step)
    seconds = time.perf_counter() - clock
    _nothing_was_reset(data, steps * step)
    angle, speed, rise, string = rows.T
    push = np.full(steps, scene.push.force)
    motions = Motions(step * np.arange(1.0, steps + 1), angle, speed, rise, push, string)
    return seconds, Observation(motions, law.events)


def _model(rig: Rig, scene: Scene, step: float, integrator: str) -> mujoco.MjModel:
    key, jack = rig.key, rig.jack
    # b tan a + hb (1 / cos a - 1) to the fourth order; the fifth is 1e-8 m at the key's end.
    arm, height = key.jack_arm, key.jack_surface_height
    reference = 2 * step  # the stiffest value that MuJoCo accepts
    return mujoco.MjModel.from_xml_string(
        _XML.format(
            step=step,
            integrator=integrator,
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

    def note(self, before: float, after: float, start: float, step: float) -> None:
        """Append the events of a step, interpolated linearly."""
        for height, events, force in (
            (self.clearance, self.events.contacts, 0.0),
            (self.clearance + self.release, self.events.releases, self.cells[-1]),
        ):
            if before <= height < after and not events:
                part = (height - before) / (after - before)
                events.append(StringEvent(start + part * step, 0, force))


def _nothing_was_reset(data: mujoco.MjData, duration: float) -> None:
    """Refuse a run in which MuJoCo warned: after a reset it starts again at time 0."""
    counts = {mujoco.mjtWarning(i).name: int(w.number) for i, w in enumerate(data.warning)}
    check(not any(counts.values()), f"MuJoCo warned: {counts}")
    off = abs(data.time - duration)
    check(off < 1e-9 * max(1.0, duration / 1e-6), f"MuJoCo ended {off:.3g} s off its end")
