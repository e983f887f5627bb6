"""The emulated bus servos: the packets of the manual's examples, registers, profile, watchdog."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.sim_backend.devices.dynamixel.firmware import Servos, emulate
from sautereau.sim_backend.devices.dynamixel.packets import Receiver, crc, packet
from sautereau.sim_backend.devices.dynamixel.servo import BANDWIDTH, CENTRE
from sautereau.sim_backend.errors import SceneError
from tests.emulated import Encoders

PERIOD = 1e-3


class Bare(Encoders):
    """Two servos."""

    def __init__(self, counts=(0, 0), home=(0, 0), stepped=False):
        super().__init__(counts, home)
        self.firmware = Servos(self, PERIOD, stepped=stepped)

    def say(self, servo, instruction, *parameters):
        return self.firmware.receive(packet(servo, instruction, bytes(parameters)))

    def write(self, servo, address, value, size):
        """Write; return the error byte."""
        data = value.to_bytes(size, "little", signed=value < 0)
        return self.say(servo, 3, address & 255, address >> 8, *data)[8]

    def read(self, servo, address, size):
        answer = self.say(servo, 2, address, 0, size, 0)
        return int.from_bytes(answer[9:-2], "little", signed=address in (98, 132))


# Packets as printed in the examples of ROBOTIS's e-Manual, page dxl/protocol2.
PING = "FF FF FD 00 01 03 00 01 19 4E"
READ = "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"
READ_ANSWER = "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"
WRITE = "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"
ACKNOWLEDGED = "FF FF FD 00 01 04 00 55 00 A1 0C"
REBOOT = "FF FF FD 00 01 03 00 08 2F 4E"
SYNC_READ = "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"
SYNC_READ_ANSWERS = READ_ANSWER + "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"
SYNC_WRITE = "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87"
EXAMPLES = [
    (READ, READ_ANSWER),
    (WRITE, ACKNOWLEDGED),
    (REBOOT, ACKNOWLEDGED),
    (SYNC_READ, SYNC_READ_ANSWERS),
    (SYNC_WRITE, ""),
]


@pytest.mark.parametrize(("sent", "answered"), EXAMPLES)
def test_the_examples_of_the_manual(sent, answered):
    bench = Bare((166 - CENTRE, 2079 - CENTRE))
    assert bench.firmware.receive(bytes.fromhex(sent)) == bytes.fromhex(answered)
    goals = [servo.value("goal_position") for servo in bench.firmware.axes]
    assert goals == {WRITE: [512, 0], SYNC_WRITE: [150, 170]}.get(sent, [0, 0])


def test_a_ping_gives_model_and_firmware():
    answer = Bare().firmware.receive(bytes.fromhex(PING))
    assert answer == packet(1, 0x55, bytes([0, 1020 & 255, 1020 >> 8, 45]))


@given(st.binary(min_size=1, max_size=40))
def test_the_crc_is_that_of_the_vendor(data):
    sdk = pytest.importorskip("dynamixel_sdk")
    assert crc(data) == sdk.PacketHandler(2.0).updateCRC(0, data, len(data))


@given(st.lists(st.binary(max_size=12).map(lambda b: b"\xff\xff\xfd" + b), max_size=4))
def test_packets_are_found_among_noise_and_what_looks_like_a_header(parts):
    sent = [packet(1, 3, part) for part in parts]
    found = Receiver().feed(b"\xff\x00noise".join(sent))
    assert [one.parameters for one in found] == parts
    assert all(one.intact for one in found)


def test_noise_neither_crashes_nor_moves():
    bench = Bare()
    bench.firmware.receive(np.random.default_rng(3).integers(0, 256, 1 << 16, np.uint8).tobytes())
    assert bench.firmware.motors_on == (False, False)


@pytest.mark.parametrize(
    ("address", "value", "size", "error"),
    [
        (0, 5, 2, 7),  # read-only
        (5, 0, 1, 7),  # no item
        (116, 0, 2, 5),  # too short
        (64, 2, 1, 4),  # out of range
        (116, 4096, 4, 6),  # beyond Max Position Limit
        (200, 0, 1, 7),
    ],
)
def test_what_a_servo_refuses(address, value, size, error):
    assert Bare().write(1, address, value, size) == error


def test_the_torque_locks_the_eeprom_and_takes_the_position_as_its_goal():
    bench = Bare((100, 0))
    assert bench.write(1, 10, 4, 1) == 0
    assert bench.write(1, 64, 1, 1) == 0
    assert bench.read(1, 116, 4) == CENTRE + 100
    assert bench.write(1, 10, 0, 1) == 7
    assert bench.say(1, 2, 200, 0, 4, 0)[8] == 7
    assert bench.say(1, 0x10)[8] == 2  # an instruction that is not emulated
    spoilt = bytearray(packet(1, 1, b""))
    spoilt[-1] ^= 1
    assert bench.firmware.receive(bytes(spoilt))[8] == 3
    bench.firmware.axes[0].shut_down(0x20)
    assert bench.firmware.motors_on == (False, False)
    assert bench.write(1, 64, 1, 1) == 0x80  # alert
    assert bench.firmware.motors_on == (False, False)


def test_a_profile_by_time_ends_on_time_behind_the_loop():
    bench = Bare()
    bench.write(1, 10, 4, 1)
    bench.write(1, 64, 1, 1)
    bench.write(1, 112, 400, 4)
    bench.write(1, 108, 100, 4)
    bench.write(1, 116, CENTRE + 300, 4)
    bench.tick(200)
    assert bench.counts[0] == pytest.approx(150 - 2 / BANDWIDTH * 1000, abs=2)  # half the way
    assert bench.read(1, 122, 1) == 1
    bench.tick(300)
    assert bench.counts[0] == 300
    assert bench.read(1, 122, 1) == 0
    assert not bench.firmware.moving


def test_a_watchdog_stops_a_servo_and_locks_its_goal():
    bench = Bare()
    bench.write(2, 10, 4, 1)
    bench.write(2, 64, 1, 1)
    bench.write(2, 112, 1000, 4)
    bench.write(2, 98, 5, 1)
    bench.write(2, 116, CENTRE + 1000, 4)
    assert bench.firmware.watching
    bench.tick(90)
    bench.say(1, 1)  # any packet renews it
    bench.tick(90)
    assert bench.read(2, 98, 1) == 5
    bench.tick(300)
    assert bench.read(2, 98, 1) == -1
    assert bench.counts[1] == pytest.approx(280, abs=5)
    assert bench.firmware.motors_on == (False, True)
    assert bench.write(2, 116, CENTRE, 4) == 4
    assert bench.write(2, 98, 0, 1) == 0
    assert bench.write(2, 116, CENTRE, 4) == 0


def test_stepped_time_waits_for_the_host_while_it_is_held():
    bench = Bare(stepped=True)
    assert bench.write(1, 1004, 1, 1) == 0
    assert bench.firmware.held
    bench.write(1, 1000, 4000, 4)
    assert bench.firmware.moving
    bench.tick(4)
    assert bench.firmware.held
    assert Bare().write(1, 1004, 1, 1) == 7  # not in real time


def test_other_encoders_are_refused():
    with pytest.raises(SceneError, match="counts_per_revolution: 2000000, and these servos have"):
        emulate(load_rig(), Bare(), lambda *_: None, True)
