"""docs/add-a-controller.md, followed literally: a controller that another package provides."""

import re

import pytest

from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.controller import motion_controller
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.steps import find_home


class Agreeing:
    def confirm(self, question):
        return True


@pytest.fixture
def page(follow):
    return follow("add-a-controller.md")


def test_the_page_plays_a_press(page, capsys):
    exec(compile(page.bodies("python")[1], str(page.path), "exec"), {})
    assert re.fullmatch(r"off: \d+ rows, until 0\.\d+ s\n", capsys.readouterr().out)


def test_the_set_up_homes_the_toy(page):
    assert "found twice" in find_home(load_rig("my-rig.toml"), Agreeing()).lines[0]


def test_the_toy_is_as_safe_as_the_others(page):
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
