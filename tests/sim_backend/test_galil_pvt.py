"""PVT sequences of the emulated controller, against scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from sautereau.sim_backend.parts import ControllerUnit

RATE = 1024  # Samples that the firmware counts as a second

segments = st.lists(
    st.tuples(
        st.integers(-3000, 3000),
        st.integers(-30_000, 30_000).map(lambda half: 2 * half),
        st.integers(1, 20).map(lambda half: 2 * half),
    ),
    min_size=1,
    max_size=12,
)  # fmt: skip


def queue(bench, axis, moves):
    for distance, velocity, samples in moves:
        bench.accept(f"PV{axis}={distance},{velocity},{samples}")
    bench.accept(f"PV{axis}=0,0,0")


@given(moves=segments, start=st.integers(-5000, 5000), seed=st.integers(0, 2**31))
def test_pvt_is_scipys_cubic_hermite_spline(make_bench, moves, start, seed):
    bench = make_bench()
    bench.counts = [start, 0]
    moves[-1] = (moves[-1][0], 0, moves[-1][2])
    bench.accept("SH", "DP 77,0")
    queue(bench, "A", moves)
    bench.accept("BTA")
    times = np.cumsum([0] + [samples for _, _, samples in moves])
    knots = start + np.cumsum([0] + [distance for distance, _, _ in moves])
    slopes = np.array([0] + [velocity for _, velocity, _ in moves]) / RATE
    spline = CubicHermiteSpline(times, knots, slopes)
    fractions = np.random.default_rng(seed).uniform(0, 1, (times[-1], 4))
    found = []
    for each in fractions:
        assert bench.firmware.moving
        bench.tick()
        found.append(bench.firmware.reference(each))
    positions, velocities = np.swapaxes(found, 0, 1)
    assert positions.shape == velocities.shape == (times[-1], 4, 2)
    at = np.arange(times[-1])[:, None] + fractions
    np.testing.assert_allclose(positions[..., 0], spline(at), atol=1e-6)
    np.testing.assert_allclose(velocities[..., 0], spline(at, 1), atol=1e-8)
    assert not bench.firmware.moving
    assert bench.number("_SCA") == 31
    assert bench.number("_BTA") == len(moves) + 1
    assert bench.send("RPA") == f"{knots[-1] - start + 77: d}\r\n:"
    bench.assert_smooth()


def test_a_polynomial_is_extrapolated_beyond_its_sample(bench):
    bench.accept("SH")
    queue(bench, "A", [(64, 0, 8)])
    bench.accept("BTA")
    bench.tick()
    beyond, _ = bench.firmware.reference(np.array([1.25]))
    s = 1.25 / 8
    assert beyond[0, 0] == pytest.approx(64 * (3 * s**2 - 2 * s**3))


def test_both_axes_start_and_end_in_step(bench):
    bench.accept("SH")
    for axis, sign in (("A", 1), ("B", -2)):
        queue(bench, axis, [(sign * 100, sign * 9000, 16), (sign * 200, 0, 30)])
    assert bench.number("_PVA") == 252
    bench.accept("BT AB")
    assert bench.send("SC") == " 30, 30\r\n:"
    assert bench.run() == 46
    path = np.array(bench.positions)
    np.testing.assert_allclose(path[..., 1], -2 * path[..., 0], atol=1e-9)
    assert bench.counts == [300, -600]
    assert bench.send("SC;MG _PVA,_BGA") == " 31, 31\r\n: 255.0000 0.0000\r\n:"


def test_fifo_holds_255_segments_and_can_be_refilled(bench):
    bench.accept("SH", *["PVA=1,0,2"] * 255)
    assert bench.number("_PVA") == 0
    assert bench.refusal("PVA=1,0,2") == 32
    bench.accept("PVB=1,0,2", "BTA")
    bench.tick()
    assert bench.number("_PVA") == 1
    bench.accept("PVA=0,0,0")
    assert bench.run() == 2 * 255 - 1
    assert bench.counts == [255, 0]
    bench.accept("PVA=1,0,2", "PVA=0,0,-1")
    assert bench.number("_PVA") == 255


def test_what_follows_the_end_of_a_sequence_is_dropped(bench):
    bench.accept("SH")
    queue(bench, "A", [(100, 0, 10)])
    bench.accept("PVA=999,0,10", "BTA")
    bench.run()
    assert bench.counts == [100, 0]
    assert bench.number("_PVA") == 255


@pytest.mark.parametrize(("ending", "code"), [((), 32), (("PVA=0,0,0",), 31)])
def test_a_sequence_that_ends_at_speed_brakes(bench, ending, code):
    bench.accept("SH", "DC 1024000", "PVA=400,8192,100", *ending, "BTA")
    samples = bench.run()
    # v = 8 counts per sample, a = 1000/1024 counts per sample squared
    assert samples == 100 + int(np.ceil(8 / (1000 / 1024)))
    assert bench.positions[-1][-1, 0] == pytest.approx(400 + 8**2 / (2 * 1000 / 1024))
    assert bench.number("_SCA") == code
    bench.assert_smooth()


def test_a_sequence_that_ends_at_rest_without_a_terminator_counts_as_starved(bench):
    bench.accept("SH", "PVA=400,0,100", "BTA")
    bench.run()
    assert bench.counts[0] == 400
    assert bench.number("_SCA") == 32


def test_stop_during_pvt_forgets_the_rest(bench):
    bench.accept("SH")
    queue(bench, "A", [(1000, 20_000, 50), (1000, 0, 50)])
    bench.accept("BTA")
    bench.tick(40)
    bench.accept("ST")
    bench.run()
    assert bench.number("_PVA") == 255
    assert bench.number("_SCA") == 4
    assert bench.refusal("BTA") == 24  # nothing is left
    bench.assert_smooth()


@pytest.mark.parametrize("line", ["PVA=1,3,2", "PVA=1,2,3"])
def test_odd_values_may_be_refused(make_bench, line):
    bench = make_bench(ControllerUnit(odd_pvt="refuse"))
    assert bench.refusal(line) == 6
    bench.accept("PVA=1,2,4", "PVA=,,0", "PVA=,,-1")


def test_an_empty_buffer_at_speed_may_stop_the_axis_at_once(make_bench):
    bench = make_bench(ControllerUnit(underrun="stop"))
    bench.accept("SH", "PVA=400,8192,100", "BTA")
    bench.run()
    assert bench.counts[0] == 400
    assert bench.number("_SCA") == 32


@pytest.mark.parametrize("limited", [True, False])
def test_limits_may_act_in_pvt_or_not(make_bench, limited):
    unit = ControllerUnit(pvt_error_limit=limited, pvt_soft_limits=limited)
    bench = make_bench(unit)
    bench.accept("SH", "FLA=150", "PVA=400,0,100", "PVA=,,0", "BTA")
    bench.run()
    assert bench.number("_SCA") == (2 if limited else 31)
    bench = make_bench(unit)
    bench.follows = False
    bench.accept("SH", "OE 1;ER 100", "PVA=400,0,100", "PVA=,,0", "BTA")
    bench.tick(90)
    assert bench.number("_MOA") == limited
