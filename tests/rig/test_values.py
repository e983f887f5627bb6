"""Changing a rig's values, and writing it down so that it reads back exactly."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.document import rig_document, rig_from_json, rig_json
from sautereau.rig.errors import RigError, SautereauError
from sautereau.rig.load import load_rig, parse_rig, with_values
from tests.budget import examples


def test_replaces_values_and_leaves_the_rest(paper):
    assert with_values(paper, {}) == paper
    faster = with_values(
        paper,
        {
            "press.jack_speed": "0.1 m/s",
            "daq.channels.0.delay": "0.5 ms",
            "arm.home_angles": ["1 deg", "-80 deg"],
            "plectrum.poisson_ratio": 0.4,
        },
    )
    assert faster.press.jack_speed == 0.1
    assert faster.daq.channels[0].delay == 0.5e-3
    assert faster.plectrum.poisson_ratio == 0.4
    assert faster.press.jack_rise == paper.press.jack_rise
    assert faster.assumed == paper.assumed
    assert faster.sources == paper.sources
    assert paper.press.jack_speed == 0.072


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("press.jack_sped", "1 m/s", "unknown quantity; did you mean 'jack_speed'?"),
        ("jack_speed", "1 m/s", "did you mean 'press.jack_speed'?"),
        ("pres.jack_speed", "1 m/s", "did you mean 'press.jack_speed'?"),
        ("foo.bar", "1 m/s", "the top level has arm, controller"),
        ("press", "1 m/s", "press: unknown quantity"),
        ("press.jack_speed.x", "1 m/s", "unknown quantity"),
        ("daq.channels.7.delay", "1 s", "daq.channels.7.delay: unknown quantity"),
        ("daq.channels.first.delay", "1 s", "unknown quantity"),
        ("assumed", {}, "assumed: unknown quantity"),
        ("press.jack_speed", "1 mm", "press.jack_speed: '1 mm' has the dimension [length]"),
        ("press.jack_speed", 0.1, "press.jack_speed: 0.1 has no unit"),
        ("press.jack_speed", None, "press.jack_speed: None is not a quantity"),
        ("key.press_arm", "190 mm", "key.press_arm: 190 mm is beyond the key's front edge"),
        ("", "1 m", "unknown quantity"),
    ],
)
def test_a_wrong_change_is_refused(paper, key, value, message):
    with pytest.raises(RigError) as raised:
        with_values(paper, {key: value})
    assert str(raised.value).startswith("rig paper: ")
    assert message in str(raised.value)


def test_all_wrong_changes_are_reported_together(paper):
    with pytest.raises(RigError, match="3 faults") as raised:
        with_values(paper, {"a": 1, "key.dip": "8 g", "string.length": "1 m", "jack.mass": "0 g"})
    for key in ("a: unknown", "key.dip: '8 g'", "jack.mass: 0.0 kg is refused"):
        assert key in str(raised.value)


def test_the_document_holds_quantities(paper):
    document = rig_document(paper)
    assert document["key"]["press_arm"] == "0.171 m"
    assert document["plectrum"]["poisson_ratio"] == 0.35
    assert document["daq"]["channels"][1]["calibrated"] is None
    assert not {"assumed", "sources"} & set(document)


def between(low, high):
    return st.floats(low, high, allow_nan=False)


@given(
    st.fixed_dictionaries(
        {
            "key.press_arm": between(1e-9, 0.185),
            "key.inertia": between(5e-324, 1e300),
            "arm.base_x": between(-1e300, 1e300),
            "press.jack_speed": between(0.005, 1),
            "string.plucking_point": between(1e-6, 0.459),
            "daq.channels.0.delay": between(0, 10),
            "plectrum.youngs_modulus": between(1, 1e12),
            "arm.torque_limit": between(1e-300, 1e3),
        }
    ),
    between(0, 0.499),
    st.tuples(between(-7, 7), between(-7, 7)),
)
@examples(15, 300)
def test_json_is_exact_for_any_valid_values(values, ratio, angles):
    unit = {
        "key.inertia": "kg m^2",
        "press.jack_speed": "m/s",
        "daq.channels.0.delay": "s",
        "plectrum.youngs_modulus": "Pa",
        "arm.torque_limit": "N m",
    }
    written = {key: f"{value!r} {unit.get(key, 'm')}" for key, value in values.items()}
    rig = with_values(
        load_rig(),
        written
        | {"plectrum.poisson_ratio": ratio, "arm.home_angles": [f"{a!r} rad" for a in angles]},
    )
    assert rig.key.press_arm == values["key.press_arm"]
    assert rig.arm.base_x == values["arm.base_x"]
    assert rig.arm.home_angles == angles
    assert rig_from_json(rig_json(rig)) == rig


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "null",
        "3",
        '{"values": 3, "assumed": {}, "sources": {}}',
        '{"values": {}, "assumed": [], "sources": {}}',
        "[" * 100_000,
        "1" * 5000,
    ],
    ids=range(9),
)
def test_json_that_is_no_rig(text):
    with pytest.raises(RigError, match="the rig stored here cannot be read"):
        rig_from_json(text)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("values", "key", "press_arm"), "1 g", "key.press_arm: '1 g' has the dimension"),
        (("assumed", "jack.mass"), [1], "assumed.jack.mass"),
        (("assumed", "jack.mass"), [10**400, 1], "assumed.jack.mass"),
        (("assumed", "jack.mass"), [float("nan"), 1], "assumed.jack.mass"),
        (("sources", "jack.mass"), 5, "sources.jack.mass: 5 is refused"),
    ],
)
def test_json_with_one_fault_says_where(paper, path, value, message):
    saved = json.loads(rig_json(paper))
    node = saved
    for part in path[:-1]:
        node = node[part]
    node[path[-1]] = value
    with pytest.raises(SautereauError) as raised:
        rig_from_json(json.dumps(saved))
    assert str(raised.value).startswith("the rig stored here cannot be read: ")
    assert message in str(raised.value)


def test_a_gear_ratio_without_effect_is_warned_of(paper_text, caplog):
    gears = paper_text.replace("[arm]", "[arm]\ngear_ratios = [30.0, 30.0]")
    parse_rig(gears)
    line = gears.split("\n").index("gear_ratios = [30.0, 30.0]") + 1
    said = f"line {line}: arm.gear_ratios: it has no effect without arm.rotor_inertias or"
    assert said in caplog.text
    caplog.clear()
    rotors = 'gear_ratios = [30.0, 30.0]\nrotor_inertias = ["1e-6 kg m^2", "0 kg m^2"]'
    for acting in (
        gears.replace("gear_ratios = [30.0, 30.0]", rotors),
        gears.replace("[controller]", "[controller]\nhome_index = true"),
        gears.replace("[controller]", '[controller]\nkind = "odrive"'),
    ):
        parse_rig(acting)
    assert not caplog.text
