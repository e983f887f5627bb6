"""All faults of a rig file in one message, each with line, key, value and how to fix it."""

import math
import re
from importlib import resources

import pytest

from sautereau.rig.errors import RigError
from sautereau.rig.instrument import Choir
from sautereau.rig.load import load_rig, parse_rig
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity

PAPER = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")


def line_with(start):
    return next(n for n, line in enumerate(PAPER.split("\n"), 1) if line.startswith(start))


def test_three_faults_in_one_error(changed):
    with pytest.raises(RigError) as raised:
        changed(
            ('jack_arm = { value = "215 mm"', 'jack_arm = { value = "215 g"'),
            ("register_friction =", "register_frction ="),
            ('name = "paper"', 'name = "paper"; colour = "red"'.replace("; ", "\n")),
        )
    text = str(raised.value)
    assert text.startswith("bench.toml: 4 faults\n")
    assert f"line {line_with('jack_arm') + 1}: key.jack_arm: '215 g' has the dimension" in text
    assert f"line {line_with('register_friction') + 1}: jack.register_frction: unknown" in text
    assert "line 8: colour: unknown key; the top level has arm, controller" in text
    assert f"line {line_with('[jack]') + 1}: jack.register_friction: missing; add it" in text


def test_faults_come_in_the_order_of_the_file(changed):
    with pytest.raises(RigError) as raised:
        changed(('"185 mm"', '"185 g"'), ('"6 g"', '"6 m"'), ('"460 mm"', "460"), ('"1 s"', '"s"'))
    lines = [int(n) for n in re.findall(r"line (\d+):", str(raised.value))]
    assert len(lines) == 4
    assert lines == sorted(lines)


@pytest.mark.parametrize(
    ("old", "new", "messages"),
    [
        ('"108 mm"', "108", ["string.plucking_point: 108 has no unit", 'such as "108 mm"']),
        ('"365 Hz"', "365", ["string.frequency: 365 has no unit", 'Hz such as "365 Hz"']),
        ('"108 mm"', "true", ["string.plucking_point: True is not a quantity"]),
        ('"108 mm"', '["108 mm"]', ["string.plucking_point: ['108 mm'] is not a quantity"]),
        ('"108 mm"', '"-108 mm"', ["string.plucking_point: -0.108 m is refused", "greater than 0"]),
        ('"0.072 m/s"', '"9 m/s"', ["press.jack_speed: 9.0 m/s is refused", "equal to 1"]),
        ('"1.5 m/s^2"', '"1e200 m/s^2"', ["press.run_down_acceleration: 1e+200 m/s**2 is refused"]),
        ('"12 m/s^2"', '"1e200 m/s^2"', ["run_up_acceleration: '1e200 m/s^2'", "10000 m/s**2"]),
        ('"6 rad/s"', '"6 Hz"', ["arm.speed_limit: '6 Hz' has no angle", "rad/s"]),
        ('"365 Hz"', '"365 rad/s"', ["string.frequency: '365 rad/s' has an angle"]),
        ("value = 0.35", 'value = "0.35"', ["plectrum.poisson_ratio: '0.35' is refused"]),
        ("value = 0.35", "value = 0.5", ["plectrum.poisson_ratio: 0.5 is refused", "less than"]),
        ("value = 0.35", "value = nan", ["plectrum.poisson_ratio: nan is refused", "finite"]),
        ("= 115200", '= "115200"', ["controller.baud_rate: '115200' is refused", "integer"]),
        ("trigger_output = 1", "trigger_output = true", ["controller.trigger_output: True"]),
        ('elbow = "up"', 'elbow = "left"', ["arm.elbow: 'left' is refused", "'up' or 'down'"]),
        ('hold = "point"', "hold = 1", ["press.hold: 1 is refused", "'point' or 'normal'"]),
        ('["0 deg", "-90 deg"]', '["0 deg"]', ["arm.home_angles.1: missing; add it"]),
        ('["0 deg", "-90 deg"]', '"0 deg"', ["arm.home_angles: '0 deg'", "give an array"]),
        ('["0 deg", "-90 deg"]', "[0, 1]", ["arm.home_angles.1: 1 has no unit", "-90 deg"]),
        ('name = "force"', 'name = "Force 1"', ["daq.channels.1.name: 'Force 1' is refused"]),
        ("[jack]\n", "[jakc]\n", ["jack.mass: missing", "jakc: unknown key; did you mean 'jack'?"]),
        ("[jack]\n", "[jack]\ndip = 3\n", ["jack.dip: unknown key; did you mean 'key.dip'?"]),
        ('name = "paper"', "", ["bench.toml: name: missing; add it"]),
        (
            'name = "paper"',
            'name = "a"\nassumed = {}',
            ["line 8: assumed: unknown key", "table of each quantity"],
        ),
        ('name = "paper"', 'name = "a"\nforce = 3', ["line 8: force: unknown key"]),
        ('name = "paper"', 'name = "a"\n"a.b" = {value=1, assumed=[1]}', ["a.b: unknown key"]),
        ('"6 g", assumed', '"6 g", assumd', ["jack.mass.assumd", "did you mean 'assumed'?"]),
        ('source = "paper"', "source = 5", ["plectrum.contact.source: 5 is refused: give a text"]),
    ],
)
def test_a_fault_has_key_value_and_how_to_fix_it(changed, old, new, messages):
    with pytest.raises(RigError) as raised:
        changed((old, new))
    for message in messages:
        assert message in str(raised.value)
    assert "assumed range" not in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('["4 g", "12 g"]', '["12 g", "4 g"]', "is empty; give the smallest value first"),
        ('["4 g", "12 g"]', '["4 g"]', "give the smallest and the largest quantity in kg"),
        ('["4 g", "12 g"]', "[4, 12]", "give the smallest and the largest quantity in kg"),
        ('["4 g", "12 g"]', '["4 m", "12 m"]', "'4 m' has the dimension [length]; give"),
        ('["4 g", "12 g"]', '["7 g", "12 g"]', "'6 g' is outside its assumed range '7 g' to"),
    ],
)  # fmt: skip
def test_a_faulty_assumed_range(changed, old, new, message):
    with pytest.raises(RigError) as raised:
        changed((old, new))
    assert f"bench.toml: line {line_with('mass')}: jack.mass: " in str(raised.value)
    assert message in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("value = 0.35", "value = 0.35, assumed = [0.3, 0.4]", "plectrum.poisson_ratio"),
        (
            '["0 deg", "-90 deg"]',
            '{ value = ["0 deg", "1 deg"], assumed = ["0 m", "1 m"] }',
            "arm.home_angles",
        ),
    ],
)
def test_only_a_quantity_has_an_assumed_range(changed, old, new, key):
    with pytest.raises(RigError, match=f"{key}: only a single quantity .* remove assumed"):
        changed((old, new))


def test_all_jacks_hold_the_key_on_its_back_rail():
    """The moments of the two jacks are 12.65 and 6.33 mN m."""
    paper = load_rig("paper")
    jack = paper.jack.model_copy(update={"mass": paper.jack.mass / 2})
    choir = {"jack_arm": "215 mm", "jack": jack} | {
        name: getattr(paper, name) for name in ("plectrum", "string")
    }
    for moment, heavy in ((18.9e-3, False), (19.1e-3, True)):
        key = paper.key.model_copy(update={"gravity_moment": moment})
        values = dict(paper) | {"key": key, "more_choirs": (Choir(**choir),)}
        if heavy:
            with pytest.raises(ValueError, match=r"not less than the jacks' 18\.97"):
                Rig(**values)
        else:
            assert Rig(**values).key.gravity_moment == moment


@pytest.mark.parametrize(
    ("replacements", "messages"),
    [
        (
            [('"171 mm", assumed = ["166 mm", "216 mm"]', '"190 mm"')],
            ["key.press_arm: 190 mm is beyond", "raise front_arm"],
        ),
        (
            [('"82 mm", assumed = ["77 mm", "127 mm"]', '"190 mm"')],
            ["key.laser_arm: 190 mm is beyond", "lower laser_arm"],
        ),
        (
            [('"4.5 mm", assumed = ["4.4 mm"', '"0.2 mm", assumed = ["0.1 mm"')],
            ["plectrum.overlap: 0.263 mm", "0.2 mm; lower overlap"],
        ),
        ([('"108 mm"', '"460 mm"')], ["string.plucking_point: 460 mm is not on the string"]),
        *(
            ([("source = \"the paper's model has none\" }", f"source = \"s\" }}\n{tip}")], said)
            for tip, said in (
                ('tip_thickness = "0.2 mm"\ntip_length = "6 mm"', ["tip_length: 6 mm is not less"]),
                ('tip_thickness = "0.9 mm"', ["tip_thickness: 0.9 mm is more", "0.48 mm"]),
                ('tip_length = "2 mm"', ["tip_length: it has no effect"]),
            )
        ),
        (
            [('"4 mN m", assumed', '"13 mN m", assumed'), ('"12 mN m"', '"14 mN m"')],
            ["key.gravity_moment: 13 mN m is not less than the jacks' 12.65", "raise jack.mass"],
        ),
        ([('["-80 deg"', '["80 deg"')], ["arm: lower_limits", "joint 1", "lower the first"]),
        ([('name = "force"', 'name = "velocity"')], ["daq.channels: name velocity is used twice"]),
        ([('"ai1"', '"ai0"')], ["daq.channels: terminal Dev1/ai0 is used twice", "give each"]),
        (
            [('high_pass = "0.1 Hz"', 'high_pass = "22 kHz"')],
            ["daq.channels.1.high_pass: 22000 Hz is not below low_pass", "raise low_pass"],
        ),
        ([('address = ""', 'address = ""\ninsecure = true')], ["daq.insecure: it has no effect"]),
    ],
)  # fmt: skip
def test_each_rule_between_fields(changed, replacements, messages):
    with pytest.raises(RigError) as raised:
        changed(*replacements)
    assert re.match(r"bench.toml: line \d+: ", str(raised.value))
    for message in messages:
        assert message in str(raised.value)


def test_contradictions_come_with_the_faults_of_other_tables(changed):
    with pytest.raises(RigError) as raised:
        changed(
            ('"171 mm", assumed = ["166 mm", "216 mm"]', '"190 mm"'), ('"460 mm"', '"100 mm"'),
            ('"4.5 mm", assumed = ["4.4 mm"', '"0.2 mm", assumed = ["0.1 mm"'),
            ("register_friction =", "register_frction ="), ('name = "force"', 'name = "velocity"'),
        )  # fmt: skip
    named = re.findall(r"line \d+: ([\w.]+): ", str(raised.value))
    assert named == [
        "key.press_arm", "jack.register_friction", "jack.register_frction", "plectrum.overlap",
        "string.plucking_point", "daq.channels",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('quantity = "force"', "", ".quantity: missing; add it"),
        ('quantity = "force"', 'quantity = "mood"', ".quantity: measured quantity 'mood' is"),
        ('scale = { value = "1 N/V"', 'scale = { value = "1 m/s/V"', ".scale: '1 m/s/V' has the"),
        ('terminal = "ai1"', 'terminl = "ai1"', ".terminl: unknown key; did you mean 'terminal'?"),
        ('terminal = "ai1"', 'terminal = "ai1"\nforce = 1', ".force: unknown key"),
    ],
)  # fmt: skip
def test_faults_of_a_channel_are_readable(changed, old, new, message):
    with pytest.raises(RigError) as raised:
        changed((old, new))
    assert f"daq.channels.1{message}" in str(raised.value)
    assert all(len(line) < 300 for line in str(raised.value).split("\n"))


def test_faults_of_all_channels_are_no_fault_of_the_list(changed):
    """Pydantic adds that the list is too short without the refused ones."""
    with pytest.raises(RigError) as raised:
        changed(('sensor = "Polytec', 'senor = "P'), ('sensor = "B&K', 'senor = "B'))
    assert str(raised.value).startswith("bench.toml: 4 faults\n")
    assert "after validation" not in str(raised.value)


def test_an_empty_file_lists_what_is_missing():
    with pytest.raises(RigError) as raised:
        parse_rig("", "empty.toml")
    assert str(raised.value).startswith("empty.toml: 9 faults\n")
    for section in ("name", "key", "jack", "plectrum", "string", "press", "arm", "daq"):
        assert f"  {section}: missing; add it" in str(raised.value)


NO_TOML = r"rig: .*; (correct|shorten)"
NO_RIG = "press: missing; add it"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name = ", NO_TOML),
        ("name = 'a'\nname = 'b'", NO_TOML),
        ("x = 1" + "0" * 5000, NO_TOML),
        ("x = " + "[" * 20_000, NO_TOML),
        ("x = 2024-13-01", NO_TOML),
        ("\x00", NO_TOML),
        ("value = 3", NO_RIG),
        ("value = 3\nassumed = [1, 2]", NO_RIG),
        ("key = 3\njack = []", NO_RIG),
    ],
    ids=range(9),
)
def test_text_that_is_no_rig(text, said):
    with pytest.raises(RigError, match=said):
        parse_rig(text)


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b'name = "Fl\xfcgel"')
    (tmp_path / "folder.toml").mkdir()
    for name in ("latin.toml", "folder.toml", "none.toml", "\x00.toml", "x" * 300 + ".toml"):
        with pytest.raises(
            RigError, match=r"cannot be read: .*; give the path of a UTF-8 text file"
        ):
            load_rig(tmp_path / name)


@pytest.mark.parametrize("name", ["papre", "", ".", "../rig/paper2", "x" * 300])
def test_a_name_that_no_rig_has(name):
    with pytest.raises(RigError, match=r"give the path of a .*file"):
        load_rig(name)


def test_the_example_of_a_message_is_of_the_field(changed):
    """Of its default where the packaged rig has no value; of the first string for a further one."""
    with pytest.raises(RigError) as raised:
        changed(("upper_length =", "tilt_limit = 3\nupper_length ="))
    assert 'arm.tilt_limit: 3 has no unit; give a quantity in rad such as "' in str(raised.value)
    example = str(raised.value).rpartition('such as "')[2].rstrip('"')
    assert parse_quantity(example, "rad") == pytest.approx(math.radians(5), rel=1e-5)
