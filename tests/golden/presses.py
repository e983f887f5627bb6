"""Presses of the stand-in and of the independent simulator, and what the analysis finds in them."""

from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.independent import ONE_FACTOR, press, random_conditions
from benchmarks.simulated import acquired, judged_recording, random_case
from sautereau.analysis.loading.press import press_of
from sautereau.analysis.phases import find_phases
from sautereau.daq.file.recorded import Recorded
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import Scene, load_scene
from tests.golden.plain import checksum, plain, subject
from tests.outlines import outline_from

RANDOM = 92  # Random rigs and scenes
SCENES = ("ideal", "paper", "return", "two-choirs", "transient", "pluck", "free-key")
SPEEDS = ("30 mm/s", "50 mm/s", "72 mm/s", "150 mm/s")
INDEPENDENT = 201
OLD_RIG = Path(__file__).parents[1] / "data" / "written_by_0.1" / "rig.toml"


def answer(recorded: Recorded) -> dict[str, Any]:
    """Return recorded samples, loaded signals, phases with uncertainties, subjects of warnings."""
    found = press_of(recorded)
    phases = find_phases(found)
    names = ("string", "contact", "contact_std", "release", "release_std", "release_force",
             "force_drop", "force_slope", "doubtful")  # fmt: skip
    plucks = {name: [getattr(each, name) for each in phases.plucks] for name in names}
    return plain(
        {
            "sampled": {name: checksum(volts) for name, volts in recorded.volts.items()},
            "signals": {name: checksum(found.samples[name]) for name in ("velocity", "force")},
            **{name: getattr(phases, name) for name in ("start", "bottom", "bottomed", "returned")},
            **(plucks if phases.plucks else {}),
            "speeds": [phases.free_speed, phases.held_speed, phases.released_speed],
            "fit": phases.fit and [phases.fit.model, phases.fit.verdict],
            "missed": phases.missed,
            "warnings": [subject(text) for text in (*found.warnings, *phases.warnings)],
            "remarks": [subject(text) for text in (*found.remarks, *phases.remarks)],
        }
    )


def carved_rig() -> Rig:
    """Return the packaged rig with a plectrum that is thinner at its tip."""
    rig = load_rig()
    length = rig.plectrum.length
    outline = outline_from(lambda x: 0.5e-3 - 0.15e-3 * x / length, length)
    plectrum = rig.plectrum.model_copy(update={"outline": outline})
    return rig.model_copy(update={"plectrum": plectrum})


def _stand_in(rig: Rig, scene: Scene, seed: int) -> dict[str, Any]:
    return answer(acquired(rig, scene, observe(rig, scene), seed)[0])


def _random(seed: int) -> dict[str, Any]:
    return _stand_in(*random_case(seed), seed)


def _of_scene(scene: str, speed: str, seed: int) -> dict[str, Any]:
    """Press at a speed; a weight, which has none, gets a plectrum of another thickness."""
    values = {"press.jack_speed": speed}
    if load_scene(scene).finger == "push":
        values["plectrum.thickness"] = f"{0.40 + 0.03 * (seed % 4)} mm"
    return _stand_in(with_values(load_rig(), values), load_scene(scene), seed)


def _carved() -> dict[str, Any]:
    scene = load_scene("ideal").model_copy(update={"plectrum": "fe"})
    return _stand_in(carved_rig(), scene, 1)


def _independent(seed: int) -> dict[str, Any]:
    """Press in random conditions; those that cannot be simulated or planned are drawn again."""
    random = np.random.default_rng([15, seed])
    while True:
        try:
            return answer(judged_recording(press(random_conditions(random), seed)))
        except (ValueError, ArithmeticError, RigError):
            continue


def _one_factor(name: str) -> dict[str, Any]:
    return answer(judged_recording(press(ONE_FACTOR[name], 0)))


_MANY = {
    f"{scene}, {speed}": partial(_of_scene, scene, speed, seed)
    for seed, (scene, speed) in enumerate(product(SCENES[:-1], SPEEDS))
}
STAND_IN = {
    **{f"random {seed:03}": partial(_random, seed) for seed in range(RANDOM)},
    **_MANY,
    "free-key": partial(_of_scene, "free-key", "72 mm/s", 1),
    "rig of version 0.1": lambda: _stand_in(load_rig(OLD_RIG), load_scene("paper"), 7),
    "carved": _carved,
    "slowest, other seed": partial(_of_scene, "paper", "20 mm/s", 99),
}
_FACTORS = {name: partial(_one_factor, name) for name in ONE_FACTOR}
_DRAWN = range(INDEPENDENT - len(_FACTORS))
JUDGED = {**_FACTORS, **{f"random {seed:03}": partial(_independent, seed) for seed in _DRAWN}}
