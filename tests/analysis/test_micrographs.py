"""Sixty micrographs of an independent program: accuracy of the press, and of its intervals."""

import math

import numpy as np
import pytest

from benchmarks.micrographs import Camera, carved, draw
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results.outlined import outline
from sautereau.analysis.results.prediction import OF_OUTLINE, of_outline, quantities
from sautereau.analysis.results.rig import Rig
from sautereau.rig.instrument import Outline, OutlineMember
from tests.budget import amount, slow

LIMITS = {"plectrum_force": 0.01, "work": 0.02, "release_angle": 0.03}
"""Relative, up to `FINE`; three times that up to 10 um a pixel."""
FINE = 4.0  # um a pixel
CASES, SEED = amount(10, 60), 47


def member(edges, scale=1.0, kind=OutlineMember, **more):
    names = ("x", "top", "bottom")
    return kind.model_construct(
        **{n: tuple((scale * np.asarray(getattr(edges, n))).tolist()) for n in names}, **more
    )


def case(number, folder):
    """Return the pixel [um], and rigs with the true outline and with the photograph's."""
    rng = np.random.default_rng((SEED, number))
    shape = carved(rng)
    pixel = rng.uniform(2.0, FINE) if number % 2 else rng.uniform(FINE, 10.0)
    dark = (0.12, 0.8) if rng.integers(2) else (0.75, 0.2)
    jack = bool(rng.integers(2))
    camera = Camera(
        pixel=pixel * 1e-3,
        tilt=math.radians(rng.uniform(-8, 8)),
        blur=rng.uniform(0.7, 2.0),
        noise=rng.uniform(0.01, 0.06),
        light=tuple(rng.uniform(-0.3, 0.3, 3)),
        dark=dark,
        left=bool(rng.integers(2)),
        upside_down=bool(rng.integers(2)),
        jack=jack,
        seed=number,
    )
    drawn = draw(shape, camera)
    photo = drawn.save(folder / f"{number}.png")
    # A person marks a ruler of 4 mm and the clamp to within 0.7 pixels.
    marks = np.array([[0.0, 10.0], [4.0 / camera.pixel, 10.0]]) + rng.normal(0, 0.7, (2, 2))
    (x0, y0), (x1, y1) = marks.tolist()
    column, row = (np.array(drawn.clamp) + rng.normal(0, 0.7, 2)).tolist()
    clamp = {} if jack else {"clamp": f"{column},{row}"}
    found = outline(photo, ruler=f"{x0},{y0} {x1},{y1} 4 mm", **clamp).found
    values = Rig().values
    ensemble = tuple(map(member, found.ensemble))
    true, seen = (
        values.model_copy(
            update={
                "plectrum": values.plectrum.outlined(own).model_copy(update={"contact": "surface"}),
                "assumed": {},
            }
        )
        for own in (
            member(shape, 1e-3, Outline),
            member(found.edges, 1.0, Outline, ensemble=ensemble),
        )
    )
    return pixel, true, seen, found.warnings


def errors(true, seen, level):
    exact, found = (
        dict(zip(OF_OUTLINE, quantities(rig, predict(rig, level), OF_OUTLINE), strict=True))
        for rig in (true, seen)
    )
    return {name: found[name] / exact[name] - 1 for name in LIMITS}, exact


@pytest.mark.parametrize("number", [1, slow(2)])
def test_the_press_of_a_micrograph(tmp_path, number):
    pixel, true, seen, warnings = case(number, tmp_path)
    assert not warnings
    own, _ = errors(true, seen, "elastica")
    for name, limit in LIMITS.items():
        assert abs(own[name]) < limit * (1 if pixel <= FINE else 3)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_many_micrographs(tmp_path):
    """Accuracy by `fe`, intervals by the elastica, which takes a tenth of the time."""
    within, covered, warned = [], [], 0
    for number in range(CASES):
        pixel, true, seen, warnings = case(number, tmp_path)
        warned += bool(warnings)
        own, _ = errors(true, seen, "fe")
        _, exact = errors(true, seen, "elastica")
        factor = 1 if pixel <= FINE else 3
        within.append([abs(own[name]) < factor * limit for name, limit in LIMITS.items()])
        spread = {i.name: i for i in of_outline(seen, "elastica").intervals}
        covered.append([spread[n].low <= exact[n] <= spread[n].high for n in LIMITS])
    assert warned <= CASES // 10
    assert np.all(np.mean(within, axis=0) >= 0.9)
    assert 0.88 <= np.mean(covered) <= 0.99
