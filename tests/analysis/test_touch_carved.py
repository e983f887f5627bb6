"""Carved plectra: numbers of their shapes, and the touch that a campaign of them shows."""

import json
from itertools import count

import numpy as np
import pytest
from scipy.stats import kendalltau

from benchmarks.campaign import write_session
from sautereau.analysis.campaign.row import column_faults
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.shape import PLECTRUM, numbers_of
from sautereau.analysis.campaign.touch import FELT, find_touch
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results.touch import JudgedTouch
from sautereau.analysis.session.compare import pluck_features
from sautereau.rig.load import parse_rig, with_values
from sautereau.sim_backend.scene import load_scene
from tests.analysis.test_touch import campaign_of, rows_of

LENGTH, BLANK = 4.5e-3, 0.48e-3  # m
SPEEDS = (0.05, 0.1)  # m/s
SET_UP = 0.005  # 1, standard deviation of the overlap from one set-up to the next


def carved(overlap=0.263e-3, depth=0.0, start=2e-3, name="paper"):
    """Return a rig whose plectrum is cut from below, from `start` to `depth` at the tip [m]."""
    x, top = (0.0, start, LENGTH), BLANK / 2
    bottom = [-top, -top, depth - top]
    outline = {"x": x, "top": [top] * 3, "bottom": bottom}
    edges = ", ".join(f"{k} = {json.dumps([f'{v!r} m' for v in vs])}" for k, vs in outline.items())
    return parse_rig(
        f'name = "{name}"\nbase = "paper"\n[plectrum]\noverlap = "{overlap!r} m"\n'
        f"outline = {{ {edges} }}\n"
    )


def test_a_uniform_plectrum_has_the_compliances_of_the_textbook(paper):
    found, plectrum = numbers_of(paper.plectrum), paper.plectrum
    assert set(found) == set(PLECTRUM)
    stiffness = plectrum.bending_stiffness
    reach = plectrum.length - plectrum.overlap
    assert found["tip_compliance"] == pytest.approx(plectrum.length**3 / 3 / stiffness, rel=1e-12)
    assert found["contact_compliance"] == pytest.approx(reach**3 / 3 / stiffness, rel=1e-12)
    assert found["bending_stiffness"] == stiffness
    assert found["tip_thickness"] == pytest.approx(plectrum.thickness)
    assert found["taper"] == 0


def test_a_wedge_has_the_compliance_of_its_closed_form():
    """h = a - c x: the integral of (L - x)^2 / h^3, with u = a - c x."""
    depth = 0.25e-3
    rig = carved(depth=depth, start=1e-12)
    a, c = BLANK, depth / LENGTH
    b = a - c * LENGTH  # L - x = (u - b) / c
    exact = (np.log(a / b) + 2 * b * (1 / a - 1 / b) - b**2 / 2 * (1 / a**2 - 1 / b**2)) / c**3
    plectrum = rig.plectrum
    exact *= 12 / (plectrum.youngs_modulus * plectrum.width)
    found = numbers_of(plectrum)
    assert found["tip_compliance"] == pytest.approx(exact, rel=1e-6)
    assert found["tip_thickness"] == pytest.approx(BLANK - 0.95 * depth, rel=1e-6)
    assert found["taper"] == pytest.approx(0.95 * c, rel=1e-6)


def test_the_compliance_is_that_of_the_model_under_a_small_load():
    from sautereau.analysis.model.plectrum.levels import plectrum_map

    plectrum = carved(depth=0.2e-3).plectrum
    place = plectrum.length - plectrum.overlap
    small = plectrum_map(plectrum, "elastica").bend(place, 1e-6)
    found = numbers_of(plectrum)["contact_compliance"]
    assert found == pytest.approx(-float(small.z_f), rel=5e-3)


def test_the_exponent_of_the_speed_comes_from_presses_of_one_session():
    rows = rows_of(4, 2, 6, stds=(0.01, 0.0, 0.02))
    speeds = {}
    for row, number in zip(rows, count()):
        row["jack_speed"] = 0.05 * (1 + number % 3)
        speeds[row["path"]] = 1 + number % 3
        for column in FELT:
            row[column] *= speeds[row["path"]] ** 0.5
    found = find_touch(campaign_of(rows))
    for felt in found.felt.values():
        speed = felt.exponents["jack_speed"]
        assert speed.low < 0.5 < speed.high
        assert speed.high - speed.low < 0.05
        assert speed.degrees == len(rows) - 8 - 1
        assert felt.exponents["plectrum_thickness"].degrees == 4 - 2 - 1
    # Means are those at the mean speed, whatever the speeds of a plectrum's own presses.
    part = [r for r in rows if r["plectrum"] != "p0" or speeds[r["path"]] == 3]
    fewer = find_touch(campaign_of(part))
    means = [
        next(p for p in one.plectra if p.name == "p0").felt["release_force"].value
        * (speed if one is fewer else 1.0)
        for one, speed in ((found, 1.0), (fewer, 1.0))
    ]
    ratio = _mean_speed(part) / _mean_speed(rows)
    assert means[1] / means[0] == pytest.approx(ratio**0.5, rel=0.02)


def _mean_speed(rows):
    return np.exp(np.mean(np.log([row["jack_speed"] for row in rows])))


@pytest.mark.slow
def test_a_speed_of_each_plectrum_alone_costs_a_degree_of_freedom():
    rows = rows_of(7, 2, 4)
    for row in rows:
        row["jack_speed"] = 0.05 * (1 + int(row["plectrum"][1:]) % 3)
    for felt in find_touch(campaign_of(rows)).felt.values():
        assert {e.degrees for e in felt.exponents.values()} == {7 - 1 - 3}
    alone = find_touch(campaign_of([r for r in rows if int(r["plectrum"][1:]) < 4]))
    assert any("too few" in note for note in alone.notes)


def test_a_table_with_wrong_numbers_of_a_shape_is_refused():
    rows = [row | {"plectrum_tip_compliance": 1e-3} for row in rows_of(3, 1, 2)]
    assert column_faults(campaign_of(rows).table) == []
    for value, said in ((0.0, "not numbers from"), (None, "a press has no value")):
        bad = [*rows[1:], rows[0] | {"plectrum_tip_compliance": value}]
        (fault,) = column_faults(campaign_of(bad).table)
        assert fault.startswith(f"plectrum_tip_compliance: {said}")


@pytest.mark.slow
def test_thirds_of_the_plectra_are_ordered_by_their_force():
    found = find_touch(campaign_of(rows_of(7, 2, 3)))
    force = {p.name: p.felt["release_force"].value for p in found.plectra}
    order = [name for third in found.hardness.values() for name in third]
    assert order == sorted(force, key=lambda name: force[name])
    assert [len(third) for third in found.hardness.values()] == [3, 2, 2]
    assert find_touch(campaign_of(rows_of(2, 2, 3))).hardness == {}


@pytest.mark.slow
def test_a_campaign_of_carved_plectra_finds_what_carving_does(tmp_path):
    """On the stand-in, at the level `auto`; judge: the model's own exponents at these shapes."""
    random = np.random.default_rng(3)
    scene = load_scene("ideal").model_copy(update={"sensors": load_scene("paper").sensors})
    rigs, names = [], ("tip_thickness", "overlap")
    for plectrum in range(24):
        overlap, depth = random.uniform(0.2e-3, 0.3e-3), random.uniform(0, 0.25e-3)
        rigs.append(carved(overlap, depth, name=f"p{plectrum:02}"))
        set_up = overlap * (1 + random.normal(0, SET_UP))
        truth = scene.model_copy(update={"truth": {"plectrum.overlap": f"{set_up!r} m"}})
        for speed in SPEEDS:
            own = with_values(rigs[-1], {"press.jack_speed": f"{speed} m/s"})
            place = tmp_path / "presses" / f"p{plectrum:02}" / f"{speed}"
            place.mkdir(parents=True)
            list(write_session(place, own, truth, 2, int(random.integers(2**31))))
    found = find_touch(run_campaign(tmp_path / "presses", tmp_path / "t.parquet").campaign)
    assert len(found.plectra) == 24
    columns, expected = [], []
    for rig in rigs:
        numbers = numbers_of(rig.plectrum)
        for speed in SPEEDS:
            model = predict(with_values(rig, {"press.jack_speed": f"{speed} m/s"}))
            features = pluck_features(rig, model, model.choirs[0])
            columns.append([1.0, np.log(speed), *(np.log(numbers[name]) for name in names)])
            expected.append([np.log(features[name]) for name in FELT])
    true = np.linalg.lstsq(np.array(columns), np.array(expected), rcond=None)[0][1:]
    for felt, exponents in zip(FELT, true.T, strict=True):
        own = found.felt[felt].exponents
        assert list(own) == ["jack_speed", *(f"plectrum_{name}" for name in names)]
        for exponent, value in zip(own.values(), exponents, strict=True):
            assert exponent.low < value < exponent.high, (felt, own)
    force = {rig.name: predict(rig).release_force for rig in rigs}
    felt = {p.rig: p.felt["release_force"].value for p in found.plectra}
    order = [[each[rig.name] for rig in rigs] for each in (force, felt)]
    agreement = float(kendalltau(*order)[0])  # pyright: ignore
    assert agreement > 0.95
    of_name = {plectrum.name: plectrum.rig for plectrum in found.plectra}
    hard, soft = ({of_name[n] for n in found.hardness[level]} for level in ("hard", "soft"))
    by_force = sorted(force, key=lambda name: force[name])
    assert (soft, hard) == (set(by_force[:8]), set(by_force[-8:]))
    assert JudgedTouch(found).lines()
