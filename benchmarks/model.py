"""The model: one prediction, a sweep of them, and one compiled solve of the pluck."""

import statistics
import time

import numpy as np

from benchmarks.figures import Figure, median_time
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck.batch import Status, predict_many
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.analysis.model.pluck.table import table
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

CASES = 20_000
CHECKED = 20
SAME = 1e-9
"""1, within which two ways to the same scalars are one."""
HEIGHTS = 1000


def run() -> list[Figure]:
    """Return the times of a prediction, of a sweep and of a solve, each with its error."""
    rig = load_rig()
    return [*_one(rig), *_many(rig), *_compiled(rig)]


def _one(rig: Rig) -> list[Figure]:
    found = predict(rig)
    choir = choirs(rig)[0]
    exact = solve_pluck(
        Elastica(choir.plectrum), choir.string.static_stiffness, choir.plectrum.overlap
    )
    speed = rig.press.jack_speed
    rise = rig.jack.string_clearance + exact.height
    force = np.interp(rise, found.rise, found.string_force)
    error = float(
        np.abs(
            force / exact.vertical_force[-1] - exact.vertical_force / exact.vertical_force[-1]
        ).max()
    )
    error = max(error, abs(found.contact_duration * speed / exact.release_height - 1))
    assert error < SAME
    spent = median_time(lambda: predict(rig)) * 1e3
    return [
        Figure("one prediction, once warm", spent, "ms", "limit", 2.0),
        Figure("its error against the elastica's series", error, "1", "limit", SAME),
    ]


def _many(rig: Rig) -> list[Figure]:
    random = np.random.default_rng(0)
    values = {
        "plectrum.youngs_modulus": rig.plectrum.youngs_modulus * random.uniform(0.5, 1.5, CASES),
        "plectrum.overlap": random.uniform(0.05e-3, 1e-3, CASES),
        "plectrum.length": rig.plectrum.length * random.uniform(0.9, 1.1, CASES),
        "string.tension": rig.string.tension * random.uniform(0.5, 1.5, CASES),
        "jack.string_clearance": random.uniform(1e-3, 2e-3, CASES),
        "press.jack_speed": random.uniform(0.005, 1.0, CASES),
    }
    figures = []
    for friction in (0.0, 0.1):
        given = {**values, "plectrum.friction": friction}
        found = predict_many(rig, given)
        assert np.all(found.status == Status.RELEASED)
        error = max(_error(rig, given, found, i) for i in range(CHECKED))
        assert error < SAME
        rates = []
        for _ in range(5):
            begun = time.perf_counter()
            predict_many(rig, given)
            rates.append(CASES / (time.perf_counter() - begun))
        what = f"a sweep of {CASES} with friction {friction}"
        rate = statistics.median(rates)
        figures += [
            Figure(f"{what}: predictions per second", rate, "1/s", "at least", 20_000.0),
            Figure(f"{what}: error of {CHECKED} of them", error, "1", "limit", SAME),
        ]
    return figures


def _error(rig: Rig, values: dict, found, case: int) -> float:
    """Return the largest relative error of a case's scalars against `predict`."""
    sections: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        section, field = name.split(".")
        sections.setdefault(section, {})[field] = float(
            value if np.ndim(value) == 0 else value[case]
        )
    update = {s: getattr(rig, s).model_copy(update=fields) for s, fields in sections.items()}
    expected = predict(rig.model_copy(update=update))
    names = ("contact_duration", "release_force", "release_lift", "release_angle", "v_osc")
    return max(abs(getattr(found, n)[case] / getattr(expected, n) - 1) for n in names)


def _compiled(rig: Rig) -> list[Figure]:
    """Walk along the pluck in steps of height, each solve begun at the last contact."""
    try:
        import numba
    except ImportError:
        return [Figure("one compiled solve (numba is not installed)", np.nan, "ns", "limit", 1e3)]
    from sautereau.analysis.model.pluck.compiled import SOLVED, cell_major, compiled_solve

    solve = compiled_solve()

    @numba.njit
    def walk(heights, s, force, cells, q_max, bending, rest, stiffness, places, forces):
        lost = 0
        for i in range(len(heights)):
            s, force, status = solve(heights[i], s, force, cells, q_max, bending, rest, stiffness)
            places[i], forces[i] = s, force
            lost += status != SOLVED
        return lost

    pluck, lookup = rig_pluck(rig), table(0.0)
    coarse = pluck.height
    heights = np.interp(np.linspace(0, len(coarse) - 1, HEIGHTS), np.arange(len(coarse)), coarse)
    places, forces = np.empty(HEIGHTS), np.empty(HEIGHTS)
    plectrum = rig.plectrum
    rest = plectrum.length - plectrum.overlap
    numbers = (lookup.q_max, plectrum.bending_stiffness, rest, rig.string.static_stiffness)

    def whole_walk() -> int:
        return walk(heights, rest, 0.0, cell_major(lookup), *numbers, places, forces)

    assert whole_walk() == 0
    at = Elastica(plectrum).bend(places, forces)
    stiffness = rig.string.static_stiffness
    along = at.x - rest + forces * np.sin(at.theta) / stiffness
    up = heights + at.z - forces * np.cos(at.theta) / stiffness
    error = float(np.abs([along, up]).max() / plectrum.length)
    error = max(error, abs(forces[-1] / pluck.force[-1] - 1))
    assert error < SAME
    spent = median_time(whole_walk) / HEIGHTS * 1e9
    return [
        Figure("one compiled solve of the pluck", spent, "ns", "limit", 1e3),
        Figure(
            "its residuals over the length, by the elastica's series", error, "1", "limit", SAME
        ),
    ]
