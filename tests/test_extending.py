"""The pages docs/add-a-*.md, followed literally: packages outside sautereau add what they say."""

import json
import re
import runpy
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.model.plectrum.levels import LEVELS, levels_help
from sautereau.analysis.model.predict import predict
from sautereau.commands.app import app
from sautereau.daq.errors import DaqError, RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.source.source import open_source
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import motion_controller
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.steps import find_home
from sautereau.sim_backend.bench import Bench
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import load_scene


def test_the_page_adds_a_plectrum_level(follow, capsys):
    page = follow("add-a-plectrum-level.md")
    assert LEVELS.names() == ["auto", "elastica", "fe", "rods", "beam", "two-beam", "hinge"]
    assert levels_help().endswith("two-beam, hinge.")
    tests = runpy.run_path("test_hinge_level.py")
    for name in [name for name in tests if name.startswith("test_")]:
        tests[name]()
    command = re.findall(r"^sautereau (predict .*)$", page.text, re.MULTILINE)
    assert app([*command[0].split(), "--json"], result_action="return_value") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["pluck_duration"] == pytest.approx(predict(load_rig(), "hinge").pluck_duration)


@pytest.fixture
def source(follow):
    return follow("add-a-source.md")


def test_the_command_on_the_page_records_from_it(source, capsys):
    words = re.search(r"`sautereau (acquire .*?)`", source.text).group(1)
    arguments = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', words)]
    assert app([*arguments, "--json"], result_action="return_value") == 0
    assert json.loads(capsys.readouterr().out)["simulated"] is True
    found = read_recording(Path("a.mcap"))
    assert (found.n_samples, found.simulated, found.session.daq) == (5120, True, "sine logger")
    expected = np.sin(2 * np.pi * 100 * np.arange(5120) / 51_200)
    np.testing.assert_allclose(found.volts["force"], expected, atol=1e-12)


def test_what_it_cannot_do_it_refuses(source):
    with pytest.raises(DaqError, match="no trigger input"):
        open_source(load_rig("my-rig.toml").daq, 0.1)


@pytest.fixture
def import_command(follow):
    (text,) = follow("add-an-import-format.md").bodies("sh")
    return shlex.split(text.replace("\\\n", " "))[1:]


def test_the_page_s_format_imports_its_file(import_command, capsys):
    assert app(import_command, print_error=False, exit_on_error=False) == 0
    assert capsys.readouterr().out.startswith("measured: press.mcap\n4 samples at 1000 Hz")
    found = read_recording(Path("press.mcap"))
    assert found.rate == 1000.0
    assert found.first_sample == -1
    np.testing.assert_array_equal(found.volts["velocity"], [0.0, 0.1, 0.2, 0.1])
    np.testing.assert_array_equal(found.volts["force"], [0.0, 1.0, 2.0, 0.5])


def test_a_damaged_file_and_an_unknown_extension_are_refused(import_command):
    Path("press.toy").write_text("rate: fast\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"import of press\.toy: it is damaged"):
        app(import_command, print_error=False, exit_on_error=False)
    Path("press.xyz").write_text("", encoding="utf-8")
    words = ["press.xyz" if word == "press.toy" else word for word in import_command]
    with pytest.raises(RecordingError, match=r"'\.xyz'.*\.tdms, \.csv, .*, \.hdf5, \.toy"):
        app(words, print_error=False, exit_on_error=False)


def test_the_help_lists_the_built_in_extensions(capsys):
    app(["import", "--help"], print_error=False, exit_on_error=False)
    text = " ".join(capsys.readouterr().out.split())
    assert all(f".{name}" in text for name in ("tdms", "csv", "wav", "parquet", "mat", "npz", "h5"))


class Agreeing:
    def confirm(self, question):
        return True


@pytest.fixture
def toy(follow):
    return follow("add-a-controller.md")


def test_the_page_plays_a_press(toy, capsys):
    exec(compile(toy.bodies("python")[1], str(toy.path), "exec"), {})
    assert re.fullmatch(r"off: \d+ rows, until 0\.\d+ s\n", capsys.readouterr().out)


def test_the_set_up_homes_the_toy(toy):
    assert "found twice" in find_home(load_rig("my-rig.toml"), Agreeing()).lines[0]


def test_the_toy_is_as_safe_as_the_others(toy):
    controller = motion_controller(load_rig("my-rig.toml"))
    with pytest.raises(ZeroDivisionError) as caught, controller, controller.powered():
        raise ZeroDivisionError
    assert "motors are off: the controller confirms it" in caught.value.__notes__[0]
    with pytest.raises(MotionFault, match="home switch of joint 1") as slipped:  # noqa: PT012, SIM117
        with controller, controller.powered():
            controller.home()
            controller.driver.home_levels = lambda: [1, 1]
            controller.check_home()
    assert "confirms it" in str(slipped.value)


def test_an_unknown_kind_is_refused_by_name():
    with pytest.raises(RigError, match=r"controller 'toy' is unknown; known: galil, odrive"):
        with_values(load_rig(), {"controller.kind": "toy"})


MEASURED = "sautereau.measured_quantities"
PAGE = "add-a-sensor.md"


def run_commands(page):
    """Run the page's commands, those of sautereau and Python in this process."""
    for line in "".join(page.bodies("bash")).splitlines():
        words = shlex.split(line)
        if words[0] == "sautereau":
            assert app(words[1:]) == 0, line
        elif words[0] == "python":
            sys.argv = words[1:]
            runpy.run_path(words[1], run_name="__main__")
        else:
            _, source, _, target = words
            with Path(target).open("a", encoding="utf-8") as file:
                file.write(Path(source).read_text(encoding="utf-8"))
        if "init" in words:  # so that no answer is too late on a busy machine
            rig = Path("my-rig.toml")
            text, n = re.subn(
                r"(?m)^timeout = .*$", 'timeout = "10 s"', rig.read_text(encoding="utf-8")
            )
            assert n == 1
            rig.write_text(text, encoding="utf-8")


@pytest.mark.slow
def test_a_third_channel_is_recorded(follow, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", sys.argv)
    run_commands(follow(PAGE))
    (percent,) = re.findall(r"within (.*)% of the largest velocity", capsys.readouterr().out)
    assert float(percent) < 0.1
    channel = read_recording(Path("rotated/press-0001.mcap")).rig.daq.channel("angular_velocity")
    assert channel is not None
    assert channel.unit == "rad/s"
    assert channel.scale == pytest.approx(np.radians(20))


def write_rig(scale="20 deg/s/V"):
    app(["init", "start.toml"])
    texts = [Path(name).read_text(encoding="utf-8") for name in ("start.toml", "channel.toml")]
    rig = "".join(texts).replace("20 deg/s/V", scale)
    Path("rig.toml").write_text(rig, encoding="utf-8")


@pytest.mark.parametrize(
    ("scale", "installed", "said"),
    [
        ("20 mm/s/V", True, r'give a quantity in rad/s/V such as "10 deg/s/V'),
        ("20 deg/s/V", False, r"'angular_velocity' is unknown; .* known: velocity, force, "),
    ],
)
def test_a_scale_of_another_dimension_and_an_unknown_quantity_are_refused(
    follow, scale, installed, said
):
    follow(PAGE, installed=installed)
    write_rig(scale)
    with pytest.raises(RigError, match=said):
        load_rig("rig.toml")


def test_a_quantity_that_nothing_simulates_is_refused_by_the_stand_in(follow):
    follow(PAGE, MEASURED)
    write_rig()
    with pytest.raises(SceneError, match=r"channels\.2\.quantity: .*'angular_velocity' is unknown"):
        Bench(load_rig("rig.toml"), load_scene("ideal"))
