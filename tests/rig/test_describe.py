"""The reference of the rig file matches the schema, and `init` writes all of it."""

import re
import tomllib

import pytest

from sautereau.rig.acquisition import BUILT_IN
from sautereau.rig.faults import model_keys
from sautereau.rig.load import load_rig, parse_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.rig.text import commented_rig, describe
from sautereau.sim_backend.scene import Scene

TABLES = {table.name: table for table in describe()}
RUN_UP = dict.fromkeys(("press.run_up_acceleration", "press.run_up_jerk"))


def entry(dotted: str):
    table, _, name = dotted.rpartition(".")
    return next(e for e in TABLES[table].entries if e.name == name)


def test_every_key_of_the_schema_is_described():
    described = {f"{t.name}.{e.name}".lstrip(".") for t in TABLES.values() for e in t.entries}
    assert described | set(TABLES) - {""} == set(model_keys(Rig))


@pytest.mark.parametrize("model", [Rig, Scene])
def test_every_key_says_what_it_is(model):
    for table in describe(model):
        assert table.meaning
        for each in table.entries:
            assert each.meaning, (table.name, each)


@pytest.mark.parametrize(
    ("key", "unit", "kind", "default", "limits"),
    [
        ("key.press_arm", "m", "quantity", None, "> 0"),
        ("key.pivot_viscous_friction", "N m s/rad", "quantity", None, ">= 0"),
        ("press.jack_speed", "m/s", "quantity", None, ">= 0.005, <= 1"),
        ("press.hold", "", "one of point, normal", None, ""),
        ("plectrum.friction", "", "number", "0.0", ">= 0, <= 0.5"),
        ("plectrum.tip_length", "m", "quantity", "", "> 0"),
        ("plectrum.outline.x", "m", "list: quantity", None, ""),
        ("arm.gear_ratios", "", "list of 2: number", "[1.0, 1.0]", "> 0"),
        ("controller.watchdog_period", "s", "quantity", '"0.5 s"', ">= 0.1, <= 5"),
        ("daq.insecure", "", "true or false", "false", ""),
        ("daq.channels.scale", "m/s/V, N/V, m/V, m/s^2/V, Pa/V, V/V", "quantity", None, "> 0"),
        (
            "daq.channels.quantity",
            "",
            f"one of {', '.join(vars(BUILT_IN))}",
            None,
            "",
        ),
        ("daq.channels.calibrated", "", "date", "", ""),
    ],
)
def test_a_key_is_described_as_it_is(key, unit, kind, default, limits):
    found = entry(key)
    assert (found.unit, found.kind, found.default, found.limits) == (unit, kind, default, limits)


def test_units_are_given_once():
    assert entry("key.press_arm").meaning == "distance from the pin to the pressing point."
    assert entry("controller.watchdog_period").meaning.startswith("time without a command")


def test_the_file_to_start_from_is_the_packaged_rig(paper_text):
    """But for the run-up, which the clearance of the instrument chooses."""
    document = tomllib.loads(paper_text)
    for key in RUN_UP:
        del document["press"][key.removeprefix("press.")]
    assert tomllib.loads(commented_rig()) == document
    started, packaged = parse_rig(commented_rig()), with_values(load_rig(), RUN_UP)
    assert started == packaged
    assert started.sources == packaged.sources
    assert started.assumed == packaged.assumed


def test_defaults_that_stand_as_comments_are_valid():
    text = commented_rig()
    for key in ("kind", "full_torque", "watchdog_period", "home_tolerance", "rotor_inertias"):
        text, n = re.subn(rf"(?m)^# ({key} = )", r"\1", text)
        assert n == 1
    assert parse_rig(text) == with_values(load_rig(), RUN_UP)


def test_lines_are_short_enough_to_read():
    comments = [line for line in commented_rig().splitlines() if line.startswith("#")]
    assert max(map(len, comments)) <= 88
