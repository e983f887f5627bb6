"""The line to an ODrive: what is no answer never becomes a number."""

import io

import numpy as np
import pytest

from sautereau.robot.drivers.odrive.line import OdriveLine, framed
from sautereau.robot.drivers.odrive.power import error_names
from sautereau.robot.errors import (
    GarbledAnswer,
    RobotError,
    SilentController,
)


class Fed:
    """A port that only says what it was given."""

    in_waiting = 0

    def __init__(self, data):
        self._data = io.BytesIO(data)

    @property
    def empty(self):
        return self._data.tell() == len(self._data.getbuffer())

    def read(self, size=1):
        return self._data.read(size)

    def write(self, data):
        return len(data)

    def reset_input_buffer(self):
        return None

    def close(self):
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


@pytest.mark.parametrize("size", [1 << 17, pytest.param(1 << 20, marks=pytest.mark.slow)])
def test_noise_ends_in_errors_and_never_in_a_number(size):
    noise = np.random.default_rng(4).integers(0, 256, size, dtype=np.uint8).tobytes()
    port = Fed(noise)
    line, errors = OdriveLine(port, "port", 0.1), 0
    while not port.empty:
        try:
            line.read("axis0.error")
        except RobotError:
            errors += 1
        else:
            pytest.fail("noise was taken for a number")
    assert errors > size // 1000


def test_unrequested_text_is_not_taken_for_an_answer():
    port = Fed(framed("invalid property").encode())
    port.in_waiting = 18
    with pytest.raises(GarbledAnswer, match="before it was asked"):
        OdriveLine(port, "port", 0.1).read("axis0.error")


def test_names_of_errors():
    assert error_names("error", 0x40 | 0x200) == "error: MOTOR_FAILED, CONTROLLER_FAILED"
