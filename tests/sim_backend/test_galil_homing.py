"""HM, FE and FI: the home switch is at 1500 and -700, an index every 4000 counts from 100."""

import numpy as np
import pytest

RATE = 1024  # Samples that the firmware counts as a second


@pytest.mark.parametrize(
    ("polarity", "start", "state", "first"),
    [("CN ,-1", 0, 0, 1), ("CN ,-1", 3000, 1, -1), ("CN ,1", 0, 1, -1), ("CN ,1", 3000, 0, 1)],
)
def test_home_has_three_stages(bench, polarity, start, state, first):
    bench.counts = [start, 0]
    bench.accept("SH", "DP 5000", polarity, "SP 4000;HV 512", "AC 1024000;DC 1024000", "HMA")
    assert bench.number("_HMA") == state
    bench.accept("BGA")
    bench.tick(20)
    assert np.sign(bench.velocities[-1][-1, 0]) == first
    if (start < 1500) == (first > 0):  # towards the switch
        bench.run()
        # It passes the switch at SP, comes back at HV, and ends at the index in front of it.
        path = np.array(bench.positions)[:, -1, 0]
        assert path.max() > 1500
        assert bench.counts[0] == 4100
        assert bench.send("TPA;SCA") == " 0\r\n: 10\r\n:"
        speeds = np.abs(np.array(bench.velocities)[:, -1, 0])
        edge = int(np.argmax(np.diff(path > 1500))) if start == 0 else np.argmax(path < 1500)
        assert speeds[edge] == pytest.approx(4000 / RATE)
        assert speeds[edge + 100 :].max() <= 512 / RATE + 1e-9
        bench.accept("PA 10;BGA")
        bench.run()
        assert bench.counts[0] == 4110
    else:  # away from it, until the host stops it
        bench.tick(3000)
        assert bench.firmware.moving
        bench.accept("ST")
        bench.run()
        assert bench.number("_SCA") == 4


def test_find_edge_ends_past_the_switch(bench):
    bench.accept("SH", "SP 2000,2000", "FE", "BG")
    assert bench.send("SC") == " 0, 0\r\n:"
    bench.run()
    rate = 256_000 / RATE**2
    over = (2000 / RATE) ** 2 / 2 / rate
    assert bench.counts[0] == pytest.approx(1500 + over, abs=4)
    assert bench.counts[1] == pytest.approx(-700 - over, abs=4)
    assert bench.send("SC;TP").startswith(" 9, 9\r\n: 15")
    bench.assert_smooth()


@pytest.mark.parametrize(("speed", "index"), [(3000, 100), (-3000, -3900)])
def test_find_index_returns_to_the_latch(bench, speed, index):
    bench.accept("SH", f"JGA={speed}", "HV 600", "FIA", "BGA")
    bench.run()
    assert bench.counts[0] == index
    assert bench.send("TPA;SCA") == " 0\r\n: 10\r\n:"
    bench.assert_smooth()
    bench.accept("ALTA")
    assert bench.number("_ALA") == 1
    bench.accept("JGA=5000;BGA")
    bench.tick(1024)
    assert bench.send("MG _ALA,_RLA") == f" 0.0000 {index + 4000}.0000\r\n:"


def test_a_closed_limit_switch_ends_the_search(bench):
    bench.accept("SH", "JGA=3000", "FIA", "BGA")
    bench.tick(10)
    bench.closed.add(("forward", 0))
    bench.run()
    assert bench.number("_SCA") == 2
    assert bench.number("_LFA") == 0
