"""Random bytes into the driver and into the emulated controller: no crash, no hang, no motion."""

import numpy as np
import pytest

from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import RobotError
from sautereau.sim_backend.devices.galil.commands.table import HANDLERS
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from tests.budget import amount, slow
from tests.emulated import Encoders, ScriptedPort

MEGABYTE = 1 << 20
WORDS = [
    *("PVA=", "PVB=", ",", ":", "?", ";", "\r", "\n", "\\", "#PRESS", "#A", '"', "'", "{F8.2}"),
    *sorted(HANDLERS), *("TC1", "IF", "ELSE", "ENDIF"),
    *("(", ")", "[", "]", "=", "<", ">", "<>", "&", "|", "+", "-", "*", "/", "%", "@ABS["),
    *("@OUT[", "_TPA", "_XQ0", "_PVA", "0", "1", "-1", "255", "4711", "1e9", "x", " "),
]  # fmt: skip


class Noise(ScriptedPort):
    """A port that answers random bytes to everything, and is silent in the end."""

    in_waiting = 0

    def __init__(self, data, chunk):
        super().__init__(data)
        self._chunk, self.sent = chunk, bytearray()

    def read(self, size=1):
        return super().read(self._chunk)

    def write(self, data):
        self.sent += data

    def reset_input_buffer(self):
        return None


def babble(kind, seed, size):
    random = np.random.default_rng(seed)
    match kind:
        case "bytes":
            return random.bytes(size)
        case "text":
            return bytes(random.integers(32, 127, size, dtype=np.uint8))
        case "answers":
            return random.choice(np.frombuffer(b"0123456789.-: ?\r\n,:", np.uint8), size).tobytes()
        case _:
            words = random.choice([*WORDS, *["\r"] * 20], size // 2)  # a line has a few words
            return "".join(words).encode("latin-1")[:size]


@pytest.mark.parametrize("kind", ["bytes", "text", "answers", "words"])
def test_noise_at_the_other_end_never_gets_the_motors_on(rig, kind):
    noise = babble(kind, 2, MEGABYTE)
    for part in range(0, MEGABYTE, MEGABYTE // 64):
        port = Noise(noise[part : part + MEGABYTE // 64], chunk=256)
        controller = GalilController(rig, open_port=port.open)
        with pytest.raises(RobotError):
            controller.connect()
        assert not {b"SH AB", b"BG AB", b"XQ #PRESS,1"} & set(bytes(port.sent).split(b"\r"))


@pytest.mark.parametrize("size", [MEGABYTE // 16, slow(MEGABYTE)])
@pytest.mark.parametrize("kind", ["bytes", "text", "answers", "words"])
def test_noise_into_the_controller(kind, size):
    """Without SH nothing may move, nor without RS: by factory settings the motors start on."""
    changed = []
    plant = Encoders()
    firmware = GalilFirmware(plant, on_output=lambda *change: changed.append(change))
    data = babble(kind, 3, size).replace(b"SH", b"SX").replace(b"RS", b"SX")
    for part in range(0, size, 4096):
        firmware.receive(data[part : part + 4096])
        for _ in range(4):
            firmware.tick()
        assert firmware.motors_on == (False, False)
        assert not firmware.reference(np.array([0.0, 1.0]))[0].any()
    firmware.receive(b"\\\r\r")
    firmware.receive(b"HX\rAB\rEO 0\r")
    firmware.receive(b"")
    assert firmware.receive(b"MG 4711\r").endswith(b" 4711.0000\r\n:")
    assert firmware.receive(b"MG _MOA,_MOB\r") == b" 1.0000 1.0000\r\n:"


@pytest.mark.parametrize("seed", [*range(20), *map(slow, range(20, amount(40, 200)))])
def test_noisy_programs_can_be_stopped(seed):
    """A program of random words runs in all the threads at once."""
    random = np.random.default_rng(seed)
    words = [word for word in WORDS if word not in ("\r", "\n", "\\")]
    lines = ["".join(random.choice(words, 3)) for _ in range(40)]
    firmware = GalilFirmware(Encoders(), on_output=lambda number, level: None)
    firmware.receive(("EO 0\rDL\r#A\r" + "\r".join(lines) + "\rJP #A\rEN\r\\\r").encode())
    firmware.receive(b"XQ 0,0;XQ 1,1;XQ 2,2;XQ 3,7\r")
    for _ in range(200):
        firmware.tick()
    assert firmware.motors_on == (False, False)
    firmware.receive(b"EO 0\rAB\r")
    assert not firmware.watching
    assert firmware.receive(b"MG 4711\r").endswith(b" 4711.0000\r\n:")
