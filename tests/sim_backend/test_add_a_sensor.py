"""docs/add-a-sensor.md, followed literally: an outside package adds a third channel."""

import re
import runpy
import shlex
import sys
import tomllib
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

PAGE = Path(__file__).parents[2] / "docs" / "add-a-sensor.md"
BLOCK = re.compile(r'^```\w+(?: title="([^"]+)")?\n(.*?)^```', re.DOTALL | re.MULTILINE)
MEASURED = "sautereau.measured_quantities"


@pytest.fixture(name="install")
def install_sensor(tmp_path, monkeypatch, install):
    """Write the files of the page, and install the package with some groups of entry points."""
    files = {title: body for title, body in BLOCK.findall(PAGE.read_text()) if title}
    site = tmp_path / "site"
    site.mkdir()
    for name in ("channel.toml", "check.py"):
        (tmp_path / name).write_text(files[name])
    (site / "key_gyroscope.py").write_text(files["key_gyroscope.py"])
    project = tomllib.loads(files["pyproject.toml"])["project"]
    monkeypatch.chdir(tmp_path)
    yield lambda *groups: install(site, project, *groups)
    sys.modules.pop("key_gyroscope", None)


def run_page():
    """Run the page's commands, those of sautereau and Python in this process."""
    shell = (body for title, body in BLOCK.findall(PAGE.read_text()) if not title)
    for line in "".join(shell).splitlines():
        words = shlex.split(line)
        if words[0] == "sautereau":
            assert app(words[1:]) == 0, line
        elif words[0] == "python":
            sys.argv = words[1:]
            runpy.run_path(words[1], run_name="__main__")
        else:
            _, source, _, target = words
            with Path(target).open("a") as file:
                file.write(Path(source).read_text())
        if "init" in words:  # so that no answer is too late on a busy machine
            rig = Path("my-rig.toml")
            text, n = re.subn(r"(?m)^timeout = .*$", 'timeout = "10 s"', rig.read_text())
            assert n == 1
            rig.write_text(text)


def test_a_third_channel_is_recorded(install, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", sys.argv)
    install()
    run_page()
    (percent,) = re.findall(r"within (.*)% of the largest velocity", capsys.readouterr().out)
    assert float(percent) < 0.1
    channel = read_recording(Path("rotated/press-0001.mcap")).rig.daq.channel("angular_velocity")
    assert channel is not None
    assert channel.unit == "rad/s"
    assert channel.scale == pytest.approx(np.radians(20))


def test_its_scale_has_the_dimension_of_its_quantity(install):
    install()
    Path("rig.toml").write_text(_with_channel().replace("20 deg/s/V", "20 mm/s/V"))
    with pytest.raises(RigError, match=r'give a quantity in rad/s/V such as "10 deg/s/V'):
        load_rig("rig.toml")


def test_an_unknown_quantity_is_refused_by_its_name(install):
    Path("rig.toml").write_text(_with_channel())
    with pytest.raises(
        RigError, match=r"'angular_velocity' is unknown; .* known: velocity, force, "
    ):
        load_rig("rig.toml")


def test_a_quantity_that_nothing_simulates_is_refused_by_the_stand_in(install):
    install(MEASURED)
    Path("rig.toml").write_text(_with_channel())
    with pytest.raises(SceneError, match=r"channels\.2\.quantity: .*'angular_velocity' is unknown"):
        Bench(load_rig("rig.toml"), load_scene("ideal"))


def _with_channel():
    app(["init", "start.toml"])
    return Path("start.toml").read_text() + Path("channel.toml").read_text()
