"""The independent solution of the pluck by itself: closed forms, energy, limits, CalculiX."""

from __future__ import annotations

import csv
import itertools
import shutil
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.budget import slow
from tests.oracles.calculix import release
from tests.oracles.cases import JACK_SPEED, arched, bars, outlines, wedge
from tests.oracles.elastica import Bar
from tests.oracles.outline import Outline, polygon, stepped, uniform
from tests.oracles.pluck import Release, pluck, string_stiffness

MODULUS, WIDTH, LENGTH, THICKNESS = 2.9e9, 0.75e-3, 4.5e-3, 0.48e-3
EI = MODULUS * WIDTH * THICKNESS**3 / 12
STRING = {
    "overlap": 0.263e-3,
    "stiffness": string_stiffness(66.95, 0.46, 0.108),
    "radius": 0.155e-3,
}


def bar_of(outline: Outline, contact: str = "mid-line") -> Bar:
    return Bar(outline, modulus=MODULUS, width=WIDTH, radius=0.155e-3, contact=contact)


@cache
def of_table_1(contact: str, friction: float) -> Release:
    return pluck(
        uniform(LENGTH, THICKNESS),
        modulus=MODULUS,
        width=WIDTH,
        contact=contact,
        friction=friction,
        nodes=24,
        **STRING,
    )


@pytest.mark.parametrize("s", [LENGTH, 3e-3])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_small_load_bends_like_a_beam(s, friction):
    force = 1e-6
    state = bar_of(uniform(LENGTH, THICKNESS)).state(s, force, friction)
    assert -state.mid_z == pytest.approx(force * s**3 / (3 * EI), rel=1e-5)
    assert state.angle == pytest.approx(force * s**2 / (2 * EI), rel=1e-5)
    assert state.energy == pytest.approx(force**2 * s**3 / (6 * EI), rel=1e-5)
    assert s - state.mid_x == pytest.approx(force**2 * s**5 / (15 * EI**2), rel=1e-4)


def test_a_stepped_bar_bends_like_two_beams():
    force, step, ratio = 1e-6, 2e-3, 0.6
    state = bar_of(stepped(LENGTH, [step], [THICKNESS, ratio * THICKNESS])).state(
        LENGTH, force, 0.0
    )
    thin = (LENGTH - step) ** 3 / (3 * ratio**3)
    thick = (LENGTH**3 - (LENGTH - step) ** 3) / 3
    assert -state.mid_z == pytest.approx(force / EI * (thin + thick), rel=1e-5)


def test_a_small_moment_of_the_load_at_the_surface_bends_like_a_beam():
    force, friction = 1e-6, 0.3
    states = [
        Bar(
            uniform(LENGTH, THICKNESS),
            modulus=MODULUS,
            width=WIDTH,
            radius=0.0,
            contact="surface",
            surface_moment=on,
        ).state(LENGTH, force, friction)
        for on in (True, False)
    ]
    turned = states[0].angle - states[1].angle
    assert turned == pytest.approx(friction * force * THICKNESS / 2 * LENGTH / EI, rel=1e-4)


@pytest.mark.parametrize(
    ("force", "deflection", "shortening", "degrees"),
    [(0.33, 0.4979, 0.033, 9.5), (0.5, 0.7501, 0.076, 14.4), (1.0, 1.4565, 0.295, 28.7)],
)
def test_the_known_deflections_of_table_1(force, deflection, shortening, degrees):
    state = bar_of(uniform(LENGTH, THICKNESS)).state(LENGTH, force, 0.0)
    assert -state.mid_z * 1e3 == pytest.approx(deflection, abs=6e-5)
    assert (LENGTH - state.mid_x) * 1e3 == pytest.approx(shortening, abs=6e-4)
    assert np.degrees(state.angle) == pytest.approx(degrees, abs=0.06)


def test_a_clamped_bar_under_a_follower_load_has_the_integral_of_its_moment():
    # first integral of psi'' = F/EI (cos psi + T sin psi): the curvature at the clamp
    force, friction = 1.0, 0.2
    angle = bar_of(uniform(LENGTH, THICKNESS)).state(LENGTH, force, friction).angle
    low = bar_of(uniform(LENGTH, THICKNESS)).state(LENGTH, force, friction)
    along = low.mid_x * np.cos(angle) - low.mid_z * np.sin(angle)
    across = low.mid_x * np.sin(angle) + low.mid_z * np.cos(angle)
    moment = force * (along + friction * across)
    first = 2 * force * (np.sin(angle) + friction * (1 - np.cos(angle))) / EI
    assert moment / EI == pytest.approx(np.sqrt(first), rel=1e-10)


def test_an_outline_of_straight_edges_is_the_bar():
    x = np.linspace(0, LENGTH, 6).tolist()
    points = polygon(x, [THICKNESS / 2] * 6, [-THICKNESS / 2] * 6)
    bar, same = (bar_of(o, "surface") for o in (uniform(LENGTH, THICKNESS), points))
    a, b = (one.state(4.4e-3, 0.6, 0.1) for one in (bar, same))
    assert (a.x, a.z, a.angle) == pytest.approx((b.x, b.z, b.angle), rel=1e-11)


def test_a_tilted_bar_is_the_bar_turned():
    # unloaded at 0.2 rad, as long and as thick across its mid-line as the straight one
    tilt = 0.2
    length, half = LENGTH * np.cos(tilt), THICKNESS / np.cos(tilt) / 2
    drop = length * np.tan(tilt)
    tilted = polygon([0, length], [half, half - drop], [-half, -half - drop])
    stiffer = (2 * half / THICKNESS) ** 3  # the document's thickness is vertical
    straight = bar_of(uniform(LENGTH, THICKNESS)).state(LENGTH, 0.6, 0.0)
    turned = Bar(tilted, modulus=MODULUS / stiffer, width=WIDTH, radius=0.0, contact="mid-line")
    state = turned.state(length, 0.6, 0.0)
    assert state.angle == pytest.approx(straight.angle + tilt, rel=1e-10)
    x = straight.mid_x * np.cos(tilt) + straight.mid_z * np.sin(tilt)
    assert state.mid_x == pytest.approx(x, rel=1e-10)


@pytest.mark.parametrize("contact", ["surface", "mid-line"])
@pytest.mark.parametrize("friction", [slow(0.0), slow(0.06), 0.2])
def test_the_work_is_energy_and_losses(contact, friction):
    r = of_table_1(contact, friction)
    spent = r.string_energy + r.bending_energy + r.friction_loss + r.offset_work
    assert r.work == pytest.approx(spent, rel=1e-9)
    assert (r.friction_loss > 0) == (friction > 0)


@pytest.mark.slow
def test_the_work_is_energy_on_a_sloping_top_only_with_the_moment_of_the_surface():
    errors = []
    for surface_moment in (True, False):
        r = pluck(
            arched(),
            modulus=MODULUS,
            width=WIDTH,
            surface_moment=surface_moment,
            nodes=16,
            **STRING,
        )
        errors.append(abs(r.work / (r.string_energy + r.bending_energy) - 1))
    assert errors[0] < 1e-5
    assert 1e-3 < errors[1] < 1e-2


@pytest.mark.parametrize(
    ("contact", "force", "duration"), [("mid-line", 0.535, 20.0), ("surface", 0.655, 24.5)]
)
def test_the_known_releases_of_table_1(contact, force, duration):
    r = of_table_1(contact, 0.0)
    assert r.at == "tip"
    assert r.force == pytest.approx(force, abs=6e-4)
    assert r.height / JACK_SPEED * 1e3 == pytest.approx(duration, abs=0.06)


def test_the_string_first_moves_outwards_on_a_thick_plectrum():
    names = {f: [p.name for p in of_table_1("surface", f).phases] for f in (0.0, 0.06, 0.2)}
    assert names == {
        0.0: ["inward", "outward"],
        0.06: ["inward", "stick", "outward"],
        0.2: ["stick", "outward"],
    }


def test_the_phases_meet():
    phases = of_table_1("surface", 0.06).phases
    for before, after in itertools.pairwise(phases):
        for quantity in ("height", "force", "position", "lift"):
            end, start = getattr(before, quantity)(1.0), getattr(after, quantity)(0.0)
            assert start == pytest.approx(end, rel=1e-7)
    assert phases[1].friction(0.0) == pytest.approx(-0.06, rel=1e-6)
    assert phases[1].friction(1.0) == pytest.approx(0.06, rel=1e-6)


def test_a_rounded_tip_releases_at_the_fold():
    r = pluck(outlines()["rounded 0.4 mm"], modulus=MODULUS, width=WIDTH, nodes=24, **STRING)
    assert r.at == "fold"
    assert r.position < LENGTH
    assert r.height == pytest.approx(r.curve[:, 0].max(), rel=1e-6)


@pytest.mark.slow
def test_tighter_tolerances_change_nothing():
    for case in list(bars())[4:14:9]:
        a, b = case.solve(1e-11, nodes=24), case.solve(1e-13, nodes=32)
        for quantity in ("force", "height", "lift", "work"):
            assert getattr(a, quantity) == pytest.approx(getattr(b, quantity), rel=1e-8)


@pytest.mark.slow
def test_the_table_is_this_solution():
    with (Path(__file__).parent / "plucks.csv").open() as file:
        rows = {row["case"]: row for row in csv.DictReader(file)}
    for case in list(bars())[1::8]:
        r, row = case.solve(nodes=24), rows[case.name]
        for quantity in ("force", "height", "lift", "shift", "angle", "work"):
            assert float(row[quantity]) == pytest.approx(getattr(r, quantity), rel=1e-8)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("ccx"), reason="CalculiX (ccx) is not installed")
@pytest.mark.parametrize("outline", [wedge(), arched()], ids=["wedge", "arched"])
def test_calculix_agrees(outline):
    plectrum = {"modulus": MODULUS, "width": WIDTH, **STRING}
    # The elastica lacks the shear: about 0.3 % of the force, 0.1 % of the height
    bent = pluck(outline, surface_moment=True, nodes=8, **plectrum)
    loads = [f * bent.force for f in (0.5, 0.9, 1.0, 1.1)]
    solid = release(outline, loads=loads, poisson=0.35, rows=6, **plectrum)
    assert solid["force"] == pytest.approx(bent.force, rel=5e-3)
    assert solid["height"] == pytest.approx(bent.height, rel=3e-3)
    assert solid["angle"] == pytest.approx(bent.angle, rel=3e-3)
