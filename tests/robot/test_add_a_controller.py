"""docs/add-a-controller.md, followed literally: a controller that another package provides."""

import re
import sys
import tomllib
from importlib import resources
from pathlib import Path

import pytest

from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.joints import find_home

PAGE = Path(__file__).parents[2] / "docs" / "add-a-controller.md"


class Agreeing:
    def confirm(self, question):
        return True


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def installed(tmp_path, monkeypatch, install):
    """Write the page's package into a folder as pip installs it, and its rig file."""
    module, _ = blocks("python")
    project, controller = map(tomllib.loads, blocks("toml"))
    (tmp_path / "toy.py").write_text(module, encoding="utf-8")
    install(tmp_path, {"name": "toy", "version": "1.0"} | project["project"])
    paper = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")
    named = f'[controller]\nkind = "{controller["controller"]["kind"]}"\n'
    (tmp_path / "my-rig.toml").write_text(paper.replace("[controller]\n", named, 1))
    monkeypatch.chdir(tmp_path)
    yield tmp_path / "my-rig.toml"
    sys.modules.pop("toy", None)


def test_the_page_plays_a_press(installed, capsys):
    exec(compile(blocks("python")[1], str(PAGE), "exec"), {})
    assert re.fullmatch(r"off: \d+ rows, until 0\.\d+ s\n", capsys.readouterr().out)


def test_the_set_up_homes_the_toy(installed):
    assert "found twice" in find_home(load_rig(installed), Agreeing()).lines[0]


def test_the_toy_is_as_safe_as_the_others(installed):
    controller = motion_controller(load_rig(installed))
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
