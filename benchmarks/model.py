"""The model: one prediction, and a batch of them."""

import numpy as np

from benchmarks.figures import Figure, check, median_time
from sautereau.analysis.model.batch import predict_many
from sautereau.analysis.model.choirs import _kept
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import OnePlectrum
from sautereau.analysis.model.pluck.paths import Status, solve_paths
from sautereau.analysis.model.predict import predict
from sautereau.analysis.session.compare import held_steps
from sautereau.rig.instrument import Outline
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

CASES = 20_000
CHECKED = 20
SAME = 1e-9  # Dimensionless tolerance between two ways to the same scalars


WEDGE = Outline.model_validate(
    {
        "x": ["0 mm", "2 mm", "4.5 mm"],
        "top": ["0.24 mm"] * 3,
        "bottom": ["-0.24 mm", "-0.24 mm", "-0.04 mm"],
    }
)


def run() -> list[Figure]:
    """Return the times of one prediction and of a batch, each with its error."""
    rig = load_rig()
    return [*_one(rig), *_many(rig)]


def _one(rig: Rig) -> list[Figure]:
    found, plectrum = predict(rig), rig.plectrum
    # The general equations, which see a map without its table.
    exact = solve_paths(
        Equilibria(
            OnePlectrum(Elastica(plectrum)),
            np.array([rig.string.static_stiffness]),
            np.array([plectrum.overlap]),
        ),
        201,
    ).curves[-1]
    rise = rig.jack.string_clearance + exact.height[0]
    pushed = exact.lift[0] * rig.string.static_stiffness
    held = held_steps(found.choirs[0])  # without the instant at which the force has fallen
    force = np.interp(rise, found.rise[held], found.string_force[held])
    error = float(np.abs(force - pushed).max() / pushed[-1])
    duration = found.pluck_duration * rig.press.jack_speed
    error = max(error, abs(duration / exact.height[0, -1] - 1))
    spent = median_time(lambda: (_kept.cache_clear(), predict(rig))) * 1e3
    return [
        Figure("one prediction, once warm", spent, "ms", "limit", 2.0),
        Figure("its error against the general equations", error, "1", "limit", SAME),
    ]


def _many(rig: Rig) -> list[Figure]:
    random = np.random.default_rng(0)
    values = {
        "plectrum.youngs_modulus": rig.plectrum.youngs_modulus * random.uniform(0.5, 1.5, CASES),
        "plectrum.overlap": random.uniform(0.05e-3, 1e-3, CASES),
        "plectrum.width": rig.plectrum.width * random.uniform(0.9, 1.1, CASES),
        "string.tension": rig.string.tension * random.uniform(0.5, 1.5, CASES),
        "jack.string_clearance": random.uniform(1e-3, 2e-3, CASES),
        "press.jack_speed": random.uniform(0.005, 1.0, CASES),
    }
    figures = []
    for shape, friction, least in (
        ({"contact": "mid-line"}, 0.0, 20_000.0),
        ({"contact": "surface"}, 0.1, 20_000.0),
        ({"contact": "surface", "outline": WEDGE}, 0.1, 5_000.0),
    ):
        one = rig.model_copy(update={"plectrum": rig.plectrum.model_copy(update=shape)})
        given = {**values, "plectrum.friction": friction}
        if "outline" in shape:  # within its table
            given["plectrum.overlap"] = values["plectrum.overlap"] * 0.4
        found = predict_many(one, given)
        check(bool(np.all(found.status == Status.RELEASED)), "a predicted press does not release")
        error = max(_error(one, given, found, i) for i in range(CHECKED))
        rate = CASES / median_time(lambda one=one, given=given: predict_many(one, given), 5)
        what = f"a batch of {CASES}, {'carved' if 'outline' in shape else 'uniform'}"
        what += f" with friction {friction}, the string on the {shape['contact']}"
        figures += [
            Figure(f"{what}: predictions per second", rate, "1/s", "at least", least),
            Figure(f"{what}: error of {CHECKED} of them", error, "1", "limit", SAME),
        ]
    return figures


def _error(rig: Rig, values: dict, found, case: int) -> float:
    """Return the largest relative error of a case's scalars against `predict`."""
    of_case = {name: float(np.atleast_1d(v)[case % np.size(v)]) for name, v in values.items()}
    expected = predict(rig.replaced(of_case))
    names = ("pluck_duration", "plectrum_force", "release_lift", "release_angle", "v_osc")
    return max(abs(getattr(found, n)[case] / getattr(expected, n) - 1) for n in names)
