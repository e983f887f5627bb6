"""Trapezoids, jogs, stops, limits and homing of the emulated controller, against closed forms."""

import numpy as np
import pytest

RATE = 1024  # Samples that the firmware counts as a second


@pytest.mark.parametrize("distance", [1, -40, 10_000, -100_000])
def test_a_move_takes_the_time_of_its_trapezoid(bench, distance):
    speed, acceleration, deceleration = 20_000, 1_024_000, 512_000
    bench.accept(f"SP {speed};AC {acceleration};DC {deceleration};SH;PRA={distance};BGA")
    samples = bench.run()
    ramps = (1 / acceleration + 1 / deceleration) / 2
    length = abs(distance)
    if length > ramps * speed**2:
        expected = 2 * ramps * speed + (length - ramps * speed**2) / speed
    else:
        expected = 2 * np.sqrt(ramps * length)
    assert abs(samples - expected * RATE) <= 1
    assert bench.counts == [distance, 0]
    assert np.abs(bench.velocities).max() <= speed / RATE * (1 + 1e-9)
    assert bench.number("_SCA") == 1
    bench.assert_smooth()


@pytest.mark.parametrize("after", [0, 10, 60, 120])
def test_a_move_that_is_extended_ends_there_and_is_no_slower_than_one_move(bench, after):
    bench.accept("SP 20000;AC 512000;DC 512000;SH;PRA=-3000;BGA")
    whole = bench.run()
    bench.accept("PRA=-2000;BGA")
    bench.tick(after)
    bench.accept("IPA=-1000")
    samples = after + bench.run()
    assert bench.counts == [-6000, 0]
    decelerates = after > 2000 / 20_000 * RATE
    assert samples > whole if decelerates else abs(samples - whole) <= 1
    assert np.abs(bench.velocities).max() <= 20_000 / RATE * (1 + 1e-9)
    bench.assert_smooth()
    bench.accept("IPA=7")
    bench.run()
    assert bench.counts == [-5993, 0]
    bench.accept("MO")
    assert bench.refusal("IPA=1") == 20


def test_increments_that_are_refused_and_those_of_a_jog(bench):
    bench.accept("SH", "PR 2000;BGA")
    assert bench.refusal("IPA=-1") == 16
    bench.accept("STA")
    assert bench.refusal("IPA=1") == 16
    bench.run()
    bench.accept("JGA=1024;BGA")
    bench.tick(100)
    place = bench.number("_RPA")
    bench.accept("IPA=500")
    assert bench.number("_RPA") == place + 500
    bench.tick(10)
    assert bench.number("_RPA") == pytest.approx(place + 510, abs=1)
    bench.accept("PVB=2,2,2", "BTB")
    assert bench.refusal("IPB=1") == 7


def test_stop_takes_the_distance_and_time_of_its_deceleration(bench):
    bench.accept("SH", "DC 512000,512000", "JG 40960,-20480", "BG")
    bench.tick(300)
    start = bench.positions[-1][-1]
    np.testing.assert_allclose(bench.velocities[-1][-1], [40, -20])
    bench.accept("ST AB")
    assert bench.send("SC") == " 4, 4\r\n:"
    rate = 512_000 / RATE**2
    assert bench.run() == int(np.ceil(40 / rate))
    distance = bench.positions[-1][-1] - start
    np.testing.assert_allclose(distance, [40**2 / 2 / rate, -(20**2) / 2 / rate])
    assert bench.send("SC;MG _BGA") == " 4, 4\r\n: 0.0000\r\n:"
    bench.assert_smooth()


def test_jog_changes_its_speed_smoothly_through_zero(bench):
    bench.accept("SH", "JGA=10240", "BGA")
    bench.tick(200)
    assert bench.refusal("PRA=1") == 7
    bench.accept("JGA=-5120")
    bench.tick(200)
    assert bench.velocities[-1][-1, 0] == pytest.approx(-5)
    bench.accept("STA")
    bench.run()
    bench.assert_smooth()
    assert bench.refusal("PRA=10;BGA;JGA=5") == 13


@pytest.mark.parametrize(
    ("limit", "speed", "code"), [("FLA=3000", 20_480, 2), ("BLA=-3000", -20_480, 3)]
)
def test_software_limit_brakes(bench, limit, speed, code):
    bench.accept("SH", limit, f"JGA={speed};BGA")
    bench.run()
    assert bench.number("_SCA") == code
    rate = 256_000 / RATE**2
    reach = abs(bench.counts[0]) - 3000
    assert 20**2 / 2 / rate - 1 <= reach <= 20**2 / 2 / rate + 21
    bench.assert_smooth()
    assert bench.refusal("BGA") == 22
    bench.accept(f"PVA={np.sign(speed) * 9},0,9")
    assert bench.refusal("BTA") == 22
    bench.accept(f"JGA={-speed};BGA")


def test_abort_stops_dead(bench):
    bench.accept("SH", "JGA=10240", "BGA")
    bench.tick(200)
    bench.accept("AB")
    here = bench.counts[0]
    assert not bench.firmware.moving
    bench.tick(5)
    assert bench.counts[0] == here
    assert bench.firmware.motors_on == (True, True)
    assert bench.send("SC") == " 7, 1\r\n:"
    bench.accept("OE 1,0;BGA;AB")
    assert bench.firmware.motors_on == (False, True)


@pytest.mark.parametrize("setup", ["OE 0", "ER -1;OE 1"])
def test_without_an_error_limit_the_motor_stays_on(bench, setup):
    bench.accept("SH", "ER 10", setup, "PR 1000", "BGA")
    bench.follows = False
    bench.run()
    assert bench.firmware.motors_on == (True, True)
    assert bench.send("TE") == " 1000, 0\r\n:"
    assert int(bench.send("TSA").split()[0]) == bench.number("_TSA")
    bench.accept("SH")
    assert bench.send("TE") == " 0, 0\r\n:"


def test_motor_off_lets_the_reference_follow(bench):
    bench.counts = [123, -45]
    bench.tick()
    np.testing.assert_array_equal(bench.positions[-1], [[123, -45]] * 3)
    np.testing.assert_array_equal(bench.velocities[-1], 0)
    assert bench.send("TP;RP;TE") == " 123,-45\r\n: 0, 0\r\n:-123, 45\r\n:"
    bench.accept("DP 123,-45")
    assert bench.send("RP;TE") == " 123,-45\r\n: 0, 0\r\n:"
