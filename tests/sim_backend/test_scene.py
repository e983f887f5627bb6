"""Scenes: the shipped ones, every fault of a file at once, truth and calibrations."""

import importlib.machinery
import sys
import types
from importlib.util import find_spec

import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Bending
from sautereau.sim_backend.scene import (
    current_scene,
    load_scene,
    packaged_scenes,
    parse_scene,
)
from tests.presses import MUTE_TEXT

BEST = "exact" if find_spec("numba") else "rigid"
MUTE = MUTE_TEXT.replace("1 ms", "100 us") + "iterations = 10\n"


@pytest.fixture(scope="module")
def rig():
    return load_rig("paper")


def test_shipped_scenes_load():
    names = "free-key ideal paper pluck return transient two-choirs"
    assert packaged_scenes() == names.split()
    for name in packaged_scenes():
        scene = load_scene(name)
        assert len(scene.description) > 20
        assert scene.step in (pytest.approx(1e-4), pytest.approx(5e-5))
        assert scene.engine == "auto"
        assert scene.with_engine().engine == ("rigid" if name == "transient" else BEST)
        assert scene.truth == {}


def test_a_file_is_a_scene(tmp_path):
    path = tmp_path / "mute.toml"
    path.write_text(MUTE, encoding="utf-8")
    assert load_scene(path) == parse_scene(MUTE)
    assert load_scene(str(path)).plectrum == "none"


def test_no_such_scene(tmp_path):
    with pytest.raises(
        SceneError, match=r"'cathedral' is neither a file nor .* \(free-key, ideal, .*two-choirs\)"
    ):
        load_scene("cathedral")
    with pytest.raises(SceneError, match=r"none\.toml: cannot be read"):
        load_scene(tmp_path / "none.toml")


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match=r"broken\.toml: cannot be read"):
        load_scene(path)
    path.write_text("finger = [", encoding="utf-8")
    with pytest.raises(SceneError, match=r"broken\.toml"):
        load_scene(path)


def test_all_faults_are_reported_at_once():
    text = MUTE.replace('"ideal"', '"glove"').replace('"100 us"', '"3 ms"')
    text = text.replace("iterations = 10", "iteration = 10").replace("felt = false", "")
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "my scene")
    message = str(caught.value)
    assert message.startswith("my scene: 4 faults\n")
    for part in (
        "line 2: finger: 'glove' is refused",
        "line 7: step",
        "iteration: unknown key; did you mean 'iterations'?",
        "felt: missing; add it",
    ):
        assert part in message


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"100 us"', '"0 s"', "step"),
        ('"100 us"', '"nan s"', "step"),
        ('"100 us"', '"1 mm"', "step"),
        ("= 10", "= 0", "iterations"),
        ('plectrum = "none"', 'plectrum = "elastica"', "set both or neither"),
        ('"ideal"', '"servo"', r"needs the table \[servo\]"),
        ('"ideal"', '"servo"\nsensors = { hum = "1 V" }', r"sensors\.hum"),
        ('step = "100 us"', "", "step, accuracy: neither is given"),
        ("iterations = 10", 'accuracy = "10 us"', "step, accuracy: both are given"),
        (
            'string = "none"',
            'string = "auto"',
            '"auto" is chosen by the requested accuracy',
        ),
        ('step = "100 us"', 'accuracy = "5 mm"', r"accuracy: '5 mm' has the dimension \[length\]"),
        ('step = "100 us"', 'accuracy = "20 ms"', "accuracy: '20 ms' must lie between 0 and 10 ms"),
        (
            'plectrum = "none"\nstring = "none"',
            'plectrum = "rods"\nstring = "modal"\nengine = "exact"',
            r'engine: "exact" has .*use engine = "rigid"',
        ),
        (
            '"ideal"\nplectrum = "none"',
            '"servo"\nplectrum = "rods"',
            r"(?s)2 faults.*\[servo\].*set both",
        ),
        ('"ideal"', '"push"', r'finger: "push" needs the table \[push\]'),
        ("= 10", '= 20\nengine = "exact"', 'iterations: .* no effect without engine = "rigid"'),
        (
            '"ideal"',
            '"ideal"\npush = { force = "1 N", duration = "1 s" }',
            'push: .*finger = "push"',
        ),
    ],
)
def test_a_fault_names_its_key(old, new, words):
    with pytest.raises(SceneError, match=words):
        parse_scene(MUTE.replace(old, new))


@pytest.mark.parametrize(("numba", "best"), [(None, "rigid"), (types.ModuleType("numba"), "exact")])
def test_the_engine_follows_from_the_scene_and_from_numba(monkeypatch, rig, numba, best):
    if numba:
        numba.__spec__ = importlib.machinery.ModuleSpec("numba", None)
    monkeypatch.setitem(sys.modules, "numba", numba)
    paper = load_scene("paper")
    assert paper.on_rig(rig).engine == paper.on_bench(rig).engine == best
    assert paper.on_rig(rig).plectrum == "elastica"
    for change in ({"string": "modal"}, {"bending": Bending(frequency="300 Hz")}):
        assert paper.model_copy(update=change).on_rig(rig).engine == "rigid"
    for engine in ("rigid", "exact"):
        assert paper.model_copy(update={"engine": engine}).with_engine().engine == engine
    asked = paper.model_copy(update={"step": None, "accuracy": "10 us"})
    assert asked.on_rig(rig).engine == "auto"  # `select_solver` chooses it with the step


def test_a_scene_of_before_the_engines_is_of_rigid_bodies():
    stored = parse_scene(MUTE).model_dump(mode="json")
    del stored["engine"]
    assert current_scene(stored)["engine"] == "rigid"


@pytest.mark.parametrize("name", ["reduced", "reference", "exact"])
def test_engines_of_earlier_versions_are_the_exact_one(name):
    scene = parse_scene(MUTE.replace("iterations = 10", f'engine = "{name}"'))
    assert scene.engine == "exact"
    stored = scene.model_dump(mode="json") | {"engine": name}
    assert current_scene(stored) == scene.model_dump(mode="json")


@pytest.mark.parametrize("part", ["tongue", "damper"])
def test_a_part_without_values_is_refused(rig, part):
    bare = rig.replaced({f"jack.{part}": None})
    scene = load_scene("return")
    scene.true_rig(rig)
    with pytest.raises(SceneError, match=rf"no table \[jack\.{part}\]; add it, or set {part} = f"):
        scene.true_rig(bare)


def test_truth_overrides_the_rig(rig):
    scene = parse_scene(MUTE + '[truth]\n"jack.mass" = "7 g"\n"plectrum.overlap" = "0.3 mm"\n')
    true = scene.true_rig(rig)
    assert true.jack.mass == pytest.approx(7e-3)
    assert true.plectrum.overlap == pytest.approx(0.3e-3)
    assert true.key == rig.key
    assert rig.jack.mass == pytest.approx(6e-3)
    assert parse_scene(MUTE).true_rig(rig) is rig


def test_truth_that_is_no_part_of_a_rig(rig):
    scene = parse_scene(MUTE + '[truth]\n"jack.masss" = "7 g"\n')
    with pytest.raises(SceneError, match=r"\[truth\].*jack.masss.*mass"):
        scene.true_rig(rig)


def test_truth_without_an_effect_is_refused(rig):
    """A servo's fingertip presses where the arm puts it."""
    truth = {"key.press_arm": "165 mm"}
    scene = load_scene("paper").model_copy(update={"truth": truth})
    with pytest.raises(SceneError, match=r"key.press_arm.*arm.base_x"):
        scene.true_rig(rig)
    ideal = load_scene("ideal").model_copy(update={"truth": truth})
    assert ideal.true_rig(rig).key.press_arm == pytest.approx(0.165)


@pytest.mark.parametrize(
    ("scene", "key", "value", "named"),
    [
        ("paper", "arm.servo_stiffness", ["10 N m/rad", "5 N m/rad"], r"table \[servo\]"),
        ("paper", "key.neighbour_height", "25 mm", "no part of the stand-in"),
        ("paper", "jack.damper.lift", "1.2 mm", "damper = true"),
        ("two-choirs", "more_choirs.0.string.frequency", "400 Hz", 'string = "modal"'),
        ("paper", "string.frequency", "400 Hz", 'string = "modal"'),
        ("pluck", "key.pivot_coulomb_friction", "1 mN m", "friction = true"),
    ],
)
def test_truth_of_what_is_not_simulated_is_refused(scene, key, value, named):
    """The bench would be that of the rig, and its user would take it for another one."""
    told = load_scene(scene).model_copy(update={"truth": {key: value}})
    with pytest.raises(SceneError, match=rf"\[truth\].*{key}: .*{named}"):
        told.true_rig(load_rig())


def test_truth_of_what_is_simulated_is_kept(rig):
    """The same keys, in scenes that have the part."""
    truth = {"jack.damper.lift": "1.2 mm", "jack.tongue.pivot": "9 mm"}
    assert load_scene("return").model_copy(update={"truth": truth}).true_rig(rig) != rig
    modal = {"truth": {"string.frequency": "400 Hz"}, "string": "modal"}
    assert load_scene("paper").model_copy(update=modal).true_rig(rig).string.frequency == 400


def test_without_sensors_the_calibrations_are_those_of_ideal_ones(rig):
    rig = with_values(rig, {"daq.channels.1.low_pass_order": 2})
    ideal = load_scene("ideal").as_wired(rig).daq.channels
    for channel, stated in zip(ideal, rig.daq.channels, strict=True):
        assert (channel.delay, channel.low_pass, channel.high_pass, channel.lag) == (0, 0, 0, 0)
        for name in ("scale", "range", "terminal"):
            assert getattr(channel, name) == getattr(stated, name)
    assert load_scene("paper").as_wired(rig) is rig


def test_truth_without_quotes_is_the_same():
    quoted, bare = (
        parse_scene(MUTE + f'[truth]\n{name} = "0.3 mm"\n')
        for name in ('"plectrum.overlap"', "plectrum.overlap")
    )
    assert bare.truth == quoted.truth == {"plectrum.overlap": "0.3 mm"}


def test_truth_without_effect_is_refused_with_all_its_faults():
    truth = {
        "controller.trigger_delay": "20 ms",
        "press.jack_speed": "0.1 m/s",
        "daq.channels.0.delay": "5 ms",
        "jack.mass": "7 g",
    }
    scene = load_scene("ideal").model_copy(update={"truth": truth})
    with pytest.raises(SceneError) as caught:
        scene.true_rig(load_rig())
    lines = str(caught.value).splitlines()
    for key in list(truth)[:3]:
        assert sum(key in line for line in lines) == 1
    assert len(lines) == 3
    assert "[sensors]" in lines[2]
