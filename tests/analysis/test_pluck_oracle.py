"""Plucks against an independent solution of docs/model.md, whose author did not read this code."""

import csv
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.model.batch import predict_many
from sautereau.analysis.model.choirs import pluck_of
from sautereau.analysis.model.plectrum.levels import level_of
from sautereau.analysis.model.predict import predict
from sautereau.rig.instrument import Outline
from sautereau.rig.load import load_rig

TABLES = Path(__file__).parents[1] / "oracles"
RIG = load_rig()
FIELDS = {"length": "length", "youngs_modulus": "modulus", "width": "width", "overlap": "overlap"}
STRING = {"length": "string_length", "plucking_point": "plucking_point", "tension": "tension"}


def rows(name):
    with (TABLES / name).open(newline="") as file:
        return list(csv.DictReader(file))


def outline(name):
    edges = [row for row in rows("outlines.csv") if row["shape"] == name]
    columns = {k: [f"{float(row[k])!r} m" for row in edges] for k in ("x", "top", "bottom")}
    return Outline.model_validate(columns)


def case(row):
    """Return the rig of a row."""
    values = {field: float(row[name]) for field, name in FIELDS.items()}
    values |= {"friction": float(row["friction"]), "contact": row["contact"]}
    if row["shape"] == "uniform":
        values["thickness"] = float(row["thicknesses"])
    else:
        values["outline"] = outline(row["shape"])
    string = {field: float(row[name]) for field, name in STRING.items()}
    string["diameter"] = float(row["wire_diameter"])
    parts = {
        "plectrum": RIG.plectrum.model_copy(update=values),
        "string": RIG.string.model_copy(update=string),
    }
    return RIG.model_copy(update=parts)


def missed(row, rig):
    """Return the relative differences of force, height, lift, work and angle at release."""
    found = pluck_of(rig.plectrum, rig.string, "auto")
    pairs = {
        "force": found.force[-1],
        "height": found.release_height,
        "lift": found.lift[-1],
        "work": found.work,
        "angle": found.angle[-1],
    }
    return np.array([value / float(row[name]) - 1 for name, value in pairs.items()])


UNIFORM = [row for row in rows("plucks.csv") if row["shape"] == "uniform"]


@pytest.mark.parametrize("row", UNIFORM, ids=[row["case"] for row in UNIFORM])
def test_uniform_bars_with_any_friction(row):
    rig = case(row)
    assert level_of(rig.plectrum) == "elastica"
    assert np.abs(missed(row, rig)).max() < 1e-9


def test_a_batch_has_the_friction_of_the_present_state_too():
    for row in UNIFORM[:4]:
        rig = case(row)
        found, one = predict_many(rig, {}), predict(rig)
        assert found.plectrum_force == pytest.approx(one.plectrum_force, rel=1e-7)
        assert found.pluck_duration == pytest.approx(one.pluck_duration, rel=1e-7)
