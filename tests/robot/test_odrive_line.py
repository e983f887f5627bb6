"""The line to an ODrive: what is no answer never becomes a number."""

import numpy as np
import pytest

from sautereau.robot.drivers.odrive.line import OdriveLine, framed
from sautereau.robot.errors import (
    GarbledAnswer,
    RobotError,
    SilentController,
)
from tests.budget import slow
from tests.emulated import ScriptedPort


class Fed(ScriptedPort):
    """A port that only says what it was given, and not how much that is."""

    in_waiting = 0

    def reset_input_buffer(self):
        return None


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"", SilentController),
        (b"1.0", SilentController),
        (b"1.0\r\n", GarbledAnswer),
        (b"1.0*30\r\n", GarbledAnswer),
        (b"1.1*31\r\n", GarbledAnswer),
        (b"\xff" * 80, GarbledAnswer),
        (framed("one").encode(), GarbledAnswer),
        (framed("1 2").encode(), GarbledAnswer),
        (framed("").encode(), GarbledAnswer),
        (framed("invalid property").encode(), RobotError),
    ],
)
def test_invalid_answers(answer, error):
    with pytest.raises(error):
        OdriveLine(Fed(answer), "port", 0.1).read("axis0.error")


@pytest.mark.parametrize("size", [1 << 17, slow(1 << 20)])
def test_noise_ends_in_errors_and_never_in_a_number(size):
    noise = np.random.default_rng(4).integers(0, 256, size, dtype=np.uint8).tobytes()
    port = Fed(noise)
    line, errors = OdriveLine(port, "port", 0.1), 0
    while port.incoming:
        try:
            line.read("axis0.error")
        except RobotError:
            errors += 1
        else:
            pytest.fail("noise was taken for a number")
    assert errors > size // 1000


IDENTITY = ("Hardware version: 3.6-56V", "Firmware version: 0.5.6", "Serial number: 1")


def test_the_refusal_of_an_empty_line_and_late_answers_are_skipped():
    late = b"unknown command\r\n" + framed("1.0").encode() + b"\xff*0\r\n"
    port = Fed(late + "".join(map(framed, (*IDENTITY, "2.0"))).encode())
    line = OdriveLine(port, "port", 0.1)
    assert line.resynchronise() == [*IDENTITY]
    assert line.read("axis0.error") == 2.0


def test_a_device_that_talks_without_end_is_no_odrive():
    port = Fed(framed("1.0").encode() * 5000)
    with pytest.raises(GarbledAnswer, match="does not end"):
        OdriveLine(port, "port", 0.1).resynchronise()
