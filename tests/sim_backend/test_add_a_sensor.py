"""docs/add-a-sensor.md, followed literally: an outside package adds a third channel."""

import re
import runpy
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig
from sautereau.sim_backend.bench import Bench
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import load_scene

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


def test_its_scale_has_the_dimension_of_its_quantity(follow):
    follow(PAGE)
    Path("rig.toml").write_text(
        _with_channel().replace("20 deg/s/V", "20 mm/s/V"), encoding="utf-8"
    )
    with pytest.raises(RigError, match=r'give a quantity in rad/s/V such as "10 deg/s/V'):
        load_rig("rig.toml")


def test_an_unknown_quantity_is_refused_by_its_name(follow):
    follow(PAGE, installed=False)
    Path("rig.toml").write_text(_with_channel(), encoding="utf-8")
    with pytest.raises(
        RigError, match=r"'angular_velocity' is unknown; .* known: velocity, force, "
    ):
        load_rig("rig.toml")


def test_a_quantity_that_nothing_simulates_is_refused_by_the_stand_in(follow):
    follow(PAGE, MEASURED)
    Path("rig.toml").write_text(_with_channel(), encoding="utf-8")
    with pytest.raises(SceneError, match=r"channels\.2\.quantity: .*'angular_velocity' is unknown"):
        Bench(load_rig("rig.toml"), load_scene("ideal"))


def _with_channel():
    app(["init", "start.toml"])
    return Path("start.toml").read_text(encoding="utf-8") + Path("channel.toml").read_text(
        encoding="utf-8"
    )
