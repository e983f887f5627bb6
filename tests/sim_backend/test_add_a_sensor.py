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
