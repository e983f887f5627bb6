"""Simulated presses as the analysis gets them, of the stand-in and the independent simulator."""

from collections.abc import Mapping
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.random import Generator

from benchmarks.independent import Pressed, write_rig
from sautereau.analysis.errors import ModelError
from sautereau.analysis.loading.press import Press, press_of
from sautereau.daq.file.recorded import Recorded, SessionInfo
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.clock import FairLock
from sautereau.sim_backend.devices.daqmx.card import TaskSetup
from sautereau.sim_backend.devices.daqmx.runs import SampledRun, Wiring
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.parts import Push, Sensors
from sautereau.sim_backend.physics.base import World
from sautereau.sim_backend.physics.drive import LEAD, PressDrive, drive_of
from sautereau.sim_backend.physics.events import Motions, Truth, truths
from sautereau.sim_backend.physics.observation import Observation, observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene, load_scene
from sautereau.trajectory.motion import Floats

SCENES = ("ideal", "paper", "return", "two-choirs", "pluck", "free-key")
"""Packaged scenes that `random_case` draws from."""
PROBABILITIES = (0.2, 0.35, 0.15, 0.2, 0.05, 0.05)  # Dimensionless probability of each scene
MUTE_FRACTION = 0.15  # Dimensionless fraction of the planned presses without strings
SPECKLED_FRACTION = 0.3  # Dimensionless fraction of the cases with drop-outs of the vibrometer
DAY = datetime(2026, 1, 1, tzinfo=UTC).isoformat()


def simulated_press(rig: Rig, scene: Scene, seed: int = 0) -> tuple[Press, Truth]:
    """Simulate a press with the scene's engine and sensors, without device protocols and files.

    Args:
        scene: Scene with a step.
        seed: Seed of the sensors' noise and drop-outs.

    Returns:
        The press, and its true events in s after the trigger.
    """
    return sensed(rig, scene, observe(rig, scene), seed)


def sensed(rig: Rig, scene: Scene, seen: Observation, seed: int = 0) -> tuple[Press, Truth]:
    """Return the press that the scene's sensors measure of a motion; see `simulated_press`."""
    recorded, truth = acquired(rig, scene, seen, seed)
    return press_of(recorded), truth


def acquired(
    rig: Rig, scene: Scene, seen: Observation, seed: int = 0, world: World | None = None
) -> tuple[Recorded, Truth]:
    """Return what the card acquires of a motion; see `simulated_press`.

    Args:
        world: Of the motion, for sensors of its strings.
    """
    wired = scene.as_wired(rig)
    led = isinstance(drive_of(rig, scene), PressDrive)
    edge = LEAD * rig.controller.sample_period if led else 0.0
    rate, motions = rig.daq.sample_rate, seen.motions
    before = motions.time <= edge
    parts = {f.name: getattr(motions, f.name)[before] for f in fields(motions)}
    rest = Motions(**parts) if before.any() else None
    terminals = tuple(map(wired.daq.physical, wired.daq.channels))
    n = int((motions.time[-1] - edge) * rate)
    modes = world.string_modes if world else None
    wiring = Wiring(wired, scene, seed, FairLock(), modes=modes)
    run = SampledRun(wiring, TaskSetup(terminals, rate, n, None), 0, rest)
    run.trigger(edge)
    run.feed(motions)
    volts = dict(zip((c.name for c in wired.daq.channels), run.read(0, n), strict=True))
    recorded = as_recorded(wired, volts, rate, 0, f"simulated-{seed}.mcap", seed)
    return recorded, truths(seen.events, [edge])[0]


def as_recorded(
    rig: Rig, volts: dict[str, Floats], rate: float, first_sample: int, name: str, seed: int
) -> Recorded:
    """Return simulated volts as a recording holds them, without a plan or events.

    Args:
        rig: With the calibrations of the channels.
        volts: V, by the name of the channel, each of shape (n_samples,).
        rate: Hz.
        first_sample: Index of the first sample, counted from the trigger.
        name: Of the file that there is not.
    """
    return Recorded(
        t0_ns=0,
        rate=rate,
        first_sample=first_sample,
        volts=volts,
        path=Path(name),
        rig=rig,
        session=SessionInfo(1, DAY, True, "simulated arm", "simulated card", seed=seed),
        plan=None,
        joints=None,
        events=(),
        software={},
        channels={},
        gaps=(),
    )


def random_case(seed: int) -> tuple[Rig, Scene]:
    """Return a random rig and scene: jack speed, instrument, sensors, drop-outs.

    The simulated instrument differs from the rig that the analysis gets, within the ranges that
    `rig/paper.toml` assumes; the noise is from zero to three times that of the scene `paper`.
    Every case can be simulated.
    """
    random = np.random.default_rng([8, seed])
    while True:
        rig, scene = _rig(random), _scene(random)
        try:
            drive_of(rig, scene)
            new_world(rig, scene)
        except (SceneError, ModelError):
            continue
        return rig, scene


def _rig(random: Generator) -> Rig:
    """Return a rig with random jack speed, run-up and sample rate."""
    speed = float(np.exp(random.uniform(np.log(0.02), np.log(0.3))))
    run_up = max(12.0, speed**2 / random.uniform(1.5e-3, 9e-3))
    return with_values(
        load_rig(),
        {
            "press.jack_speed": f"{speed} m/s",
            "press.run_up_acceleration": f"{run_up} m/s^2",
            "press.run_up_jerk": f"{250 * run_up} m/s^3",
            "press.run_down_acceleration": f"{max(1.5, speed**2 / 2e-3)} m/s^2",
            "press.run_down_jerk": f"{max(200.0, speed**3 / 1e-6)} m/s^3",
            "daq.sample_rate": f"{random.choice([25.6, 51.2, 51.2, 51.2, 102.4])} kHz",
            "daq.channels.0.range": "10 V",
            "daq.channels.0.delay_std": "0 s",  # the stand-in's are exact
            "daq.channels.1.delay_std": "0 s",
        },
    )


def _scene(random: Generator) -> Scene:
    """Return a packaged scene with random instrument, noise and drop-outs."""
    name = str(random.choice(SCENES, p=PROBABILITIES))
    scene, uniform = load_scene(name), random.uniform
    moment, mass = uniform(0, 8), uniform(4, 12)
    truth = {
        "key.inertia": f"{uniform(5e-4, 10e-4)} kg m^2",
        "key.gravity_moment": f"{min(moment, 1.8 * mass)} mN m",
        "key.pivot_coulomb_friction": f"{uniform(0, 3)} mN m",
        "jack.mass": f"{mass} g",
        "jack.register_friction": f"{uniform(0, 60)} mN",
        "jack.string_clearance": f"{uniform(1.5, 2.5)} mm",
        "plectrum.overlap": f"{uniform(0.15, 0.35)} mm",
        "plectrum.thickness": f"{uniform(0.40, 0.55)} mm",
        "plectrum.friction": float(uniform(0, 0.15)),
    }
    if not scene.friction:  # of which the bench has none, so that the scene would be refused
        del truth["key.pivot_coulomb_friction"], truth["jack.register_friction"]
    changes: dict[str, object] = {"truth": truth}
    # Rigid bodies spread the force drop at a release over one step.
    changes |= {"step": 25e-6} if scene.finger == "servo" else {"engine": "exact"}
    if scene.push is not None:
        longer = {"force": f"{uniform(0.8, 1.5)} N", "duration": "25 ms", "rest": "0 s"}
        changes["push"] = Push.model_validate(longer)
    if random.random() < MUTE_FRACTION and name != "two-choirs":
        changes |= {"plectrum": "none", "string": "none", "tongue": False}
    noise = max(0.0, uniform(-0.6, 3.0))
    changes["sensors"] = Sensors.model_validate(
        {
            "velocity_noise": f"{0.05 * noise} mm/s",
            "force_noise": f"{5 * noise} mN",
            "hum": f"{noise} mN",
            "hum_frequency": f"{random.choice([50, 60])} Hz",
        }
    )
    if random.random() < SPECKLED_FRACTION:
        speckle = {
            "rate": f"{uniform(2, 40)} Hz",
            "duration": f"{uniform(0.2, 1.4)} ms",
            "level": float(uniform(0, 0.3)),
            "spike": f"{uniform(0, 20)} mm/s",
        }
        changes["faults"] = Faults.model_validate({"speckle": speckle})
    return scene.model_copy(update=changes)


def judged_press(pressed: Pressed, values: Mapping[str, str | float] | None = None) -> Press:
    """Return a press as loaded from its recording; see `judged_recording`."""
    return press_of(judged_recording(pressed, values))


def judged_recording(pressed: Pressed, values: Mapping[str, str | float] | None = None) -> Recorded:
    """Return the recording of a press with the rig of its experimenter.

    Args:
        values: Of the rig by dotted key, which replace those of the experimenter.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        write_rig(pressed, path)
        rig = load_rig(path)
    if values:
        rig = with_values(rig, values)
    names = {channel.quantity: channel.name for channel in rig.daq.channels}
    volts = {names["velocity"]: pressed.velocity_volts, names["force"]: pressed.force_volts}
    first, name = -round(pressed.t0 * pressed.rate), f"independent-{pressed.seed}.mcap"
    return as_recorded(rig, volts, pressed.rate, first, name, pressed.seed)
