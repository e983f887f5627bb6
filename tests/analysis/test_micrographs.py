"""Sixty micrographs of an independent program: accuracy of the press, and of its intervals."""

import math

import numpy as np
import pytest

from benchmarks.micrographs import Camera, area, carved, draw
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


def kinds(rng, pixel):
    """Return what else is in a picture, each with a probability of 1/3."""
    own = {
        "shadow": {
            "shadow": rng.uniform(0.1, 0.35),
            "shadow_at": (*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.06, 0.2)),
        },
        "dust": {"dust": int(rng.integers(1, 15))},
        "texture": {"texture": rng.uniform(0.005, 0.03)},
        "jpeg": {"jpeg": int(rng.integers(85, 96))},
        "defocus": {"defocus": rng.uniform(0.01, 0.02) / pixel},
        "electrons": {"well": 10 ** rng.uniform(3, 4.5), "noise": rng.uniform(0.005, 0.02)},
        "colour": {"rgb": True},
    }
    return {name: what for name, what in own.items() if rng.random() < 1 / 3}


def case(number, folder):
    """Return the pixel [um], and rigs with the true outline and with the photograph's."""
    rng = np.random.default_rng((SEED, number))
    shape = carved(rng)
    pixel = rng.uniform(2.0, FINE) if number % 2 else rng.uniform(FINE, 10.0)
    dark = (0.12, 0.8) if rng.integers(2) else (0.75, 0.2)
    jack = bool(rng.integers(2))
    camera = {
        "pixel": pixel * 1e-3,
        "tilt": math.radians(rng.uniform(-8, 8)),
        "blur": rng.uniform(0.7, 2.0),
        "noise": rng.uniform(0.01, 0.06),
        "light": tuple(rng.uniform(-0.3, 0.3, 3)),
        "dark": dark,
        "left": bool(rng.integers(2)),
        "upside_down": bool(rng.integers(2)),
        "jack": jack,
        "seed": number,
    }
    for what in kinds(rng, pixel * 1e-3).values():
        camera |= what
    drawn = draw(shape, Camera(**camera))
    photo = drawn.save(folder / f"{number}.png")
    # A person marks a ruler of 4 mm and the clamp to within 0.7 pixels.
    marks = np.array([[0.0, 10.0], [4.0 / drawn.pixel, 10.0]]) + rng.normal(0, 0.7, (2, 2))
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


def test_covered_pixels_have_the_area_of_the_polygon():
    """Also of one that the picture cuts, by the shoelace formula and by a rectangle's sides."""
    corners = np.array([[3.2, 4.7], [20.1, 2.3], [15.5, 17.9], [1.1, 12.2]])
    (x, y), (after_x, after_y) = corners.T, np.roll(corners, -1, axis=0).T
    covered = area(corners, (20, 25))
    assert covered.sum() == pytest.approx(abs(np.sum(x * after_y - y * after_x)) / 2, rel=1e-12)
    assert covered.min() >= 0
    assert covered.max() <= 1 + 1e-12
    cut = area(np.array([[-5, 2.25], [3.5, 2.25], [3.5, 40], [-5, 40]]), (10, 8))
    exact = np.outer([0, 0, 0.75, *[1] * 7], [1, 1, 1, 0.5, 0, 0, 0, 0])
    np.testing.assert_allclose(cut, exact, atol=1e-12)


@pytest.mark.parametrize("dark", [(0.12, 0.8), (0.75, 0.2)])
@pytest.mark.parametrize("blurred", [{}, {"blur": 2.0}, {"blur": 0.7, "defocus": 4.0}])
def test_an_edge_of_the_drawing_is_at_half_level(dark, blurred):
    """The upper edge of a plectrum without bow, where both sides of the blur are straight."""
    shape = carved(np.random.default_rng(1))
    shape = type(shape)(shape.x, np.full_like(shape.x, shape.thickness / 2), shape.bottom)
    drawn = draw(shape, Camera(noise=0, tilt=0.1, dark=dark, **blurred))
    column, row = drawn.clamp
    columns = np.arange(round(column) + 300, round(column) + 700)
    rows = np.arange(drawn.image.shape[0])
    up = np.array([math.sin(0.1), math.cos(0.1)]) * shape.thickness / 2 / drawn.pixel
    edge = (column, row) - up
    exact = edge[1] - (columns - edge[0]) * math.tan(0.1)
    half = 255 * sum(dark) / 2
    seen = []
    for c, at in zip(columns, exact, strict=True):
        near = rows[int(at) - 8 : int(at) + 9]
        level = drawn.image[near, c].astype(float)
        order = np.argsort(level, kind="stable")
        seen.append(np.interp(half, level[order], near[order]))
    assert np.mean(np.subtract(seen, exact)) == pytest.approx(0, abs=0.02)


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
        warned += any("specks" not in own for own in warnings)  # Dust is seen, and no fault
        own, _ = errors(true, seen, "fe")
        _, exact = errors(true, seen, "elastica")
        factor = 1 if pixel <= FINE else 3
        within.append([abs(own[name]) < factor * limit for name, limit in LIMITS.items()])
        spread = {i.name: i for i in of_outline(seen, "elastica").intervals}
        covered.append([spread[n].low <= exact[n] <= spread[n].high for n in LIMITS])
    assert warned <= CASES // 10
    assert np.all(np.mean(within, axis=0) >= 0.9)
    assert 0.88 <= np.mean(covered) <= 0.99
