"""Errors, limits, abort, and the automatic subroutines that they run."""

import pytest

from sautereau.sim_backend.parts import ControllerUnit


def trip(bench, limit=300):
    """Jog axis A away from an encoder that does not follow."""
    bench.follows = False
    bench.accept("ER 100,9999", "JGA=20000;BGA")
    bench.tick(limit)


@pytest.mark.parametrize("threads", [(), ("XQ #W",), ("XQ #W,1",)])
@pytest.mark.parametrize(("kind", "off"), [(0, False), (1, True), (2, False), (3, True)])
def test_a_position_error_stops_its_own_axis_and_runs_poserr(bench, threads, kind, off):
    bench.load("#W", "WT 4", "JP #W", "#POSERR", "n=n+1", "ER -1", "RE 1")
    bench.accept("n=0", "SH", f"OE {kind},{kind}", *threads, "JGB=500;BGB")
    trip(bench)
    assert bench.firmware.motors_on == (not off, True)
    assert bench.number("_SCA") == (8 if off else 0)
    assert bench.number("_BGB") == 1
    assert bench.number("n") == 1
    assert bench.number("_XQ0") == (-1 if threads != ("XQ #W",) else pytest.approx(0.5, abs=0.5))


def test_re_enters_again_until_the_error_is_cleared(bench):
    bench.load("#POSERR", "n=n+1", "RE")
    bench.accept("n=0", "SH", "OE 1,1")
    trip(bench)
    assert bench.firmware.motors_on == (False, True)
    assert bench.number("n") > 50
    bench.accept("DPA=_TPA")
    bench.tick(5)
    n = bench.number("n")
    bench.tick(50)
    assert bench.number("n") == n


def test_en_in_place_of_re_leaves_the_routine_in_progress(bench):
    bench.load("#W", "WT 2;JP #W", "#POSERR", "n=n+1", "EN")
    bench.accept("n=0", "SH", "XQ #W")
    trip(bench)
    assert bench.number("n") == 1


def test_cmderr_interrupts_thread_0_and_ends_the_failing_thread(bench):
    bench.load(
        "#W", "WT 2;n=n+1;JP #W", "#BAD", "WT 10", "BT AB", "EN",
        "#CMDERR", "code=_TC;line=_ED0;from=_ED1;me=_ED4", "EN 1",
    )  # fmt: skip
    bench.accept("n=0", "XQ #W", "XQ #W,1", "XQ #BAD,3")
    bench.tick(40)
    assert bench.number("_NO") == 3
    assert bench.send("MG code,line,from,me") == " 20.0000 4.0000 3.0000 0.0000\r\n:"
    n = bench.number("n")
    bench.tick(20)
    assert bench.number("n") > n
    bench.accept("HX", "XQ #BAD,3")  # thread 0 need not run
    bench.tick(40)
    assert bench.number("_NO") == 0


@pytest.mark.parametrize("last", ["RE", "XX"])
def test_an_error_in_cmderr_ends_all_threads(bench, last):
    bench.load("#W", "WT 2;JP #W", "#BAD", "XX", "#CMDERR", last)
    bench.accept("XQ #W", "XQ #W,1", "XQ #BAD,2")
    bench.tick(20)
    assert bench.number("_NO") == 0


@pytest.mark.parametrize(("number", "n"), [(0, 0), (1, 1)])
def test_the_end_restores_a_trip_point_or_not(bench, number, n):
    bench.load("#W", "WT 1000", "n=0", "EN", "#POSERR", "ER -1", f"RE {number}")
    bench.accept("n=1", "SH", "XQ #W")
    trip(bench)
    assert bench.number("n") == n


@pytest.mark.parametrize(
    ("kind", "disable", "off", "stopped"),
    [(0, 0, False, True), (1, 0, False, True), (2, 0, True, True), (3, 1, False, False)],
)
def test_a_limit_switch_stops_the_motion_towards_it(bench, kind, disable, off, stopped):
    bench.load("#LIMSWI", "n=n+1", "RE")
    bench.accept("n=0", "SH", f"OEA={kind};LDA={disable};SDA=1024000", "JGA=8192;BGA")
    bench.tick(100)
    bench.closed |= {("reverse", 0), ("forward", 1)}
    bench.tick(10)
    assert bench.number("n") == 0
    bench.closed.add(("forward", 0))
    bench.tick(20)
    assert bench.send("MG _LFA,_LRA,_LFB,_LRB,n").split() == [
        *("0.0000", "0.0000", "0.0000", "1.0000"),
        f"{int(stopped)}.0000",
        ":",
    ]
    assert bench.firmware.motors_on == (not off, True)
    assert bench.number("_BGA") == (not stopped)
    assert bench.number("_TSA") // 4 % 4 == 0
    if stopped:
        assert bench.number("_SCA") == 2
        assert bench.refusal("SH;JGA=200;BGA") == 22
    bench.accept("CN 1")
    assert bench.send("MG _LFA,_LRA,_LFB,_LRB") == " 1.0000 1.0000 1.0000 0.0000\r\n:"


@pytest.mark.parametrize("keep", [0, 1])
def test_the_abort_input(bench, keep):
    bench.load("#W", "WT 2;JP #W")
    bench.accept("SH", "OE 1,0", f"CN ,,,,{keep}", "JG 5000,5000;BG", "XQ #W,1")
    bench.tick(50)
    assert bench.number("_AB") == 1
    bench.closed.add(("abort", 0))
    bench.tick(2)
    assert bench.send("MG _AB,_BGA,_BGB,_SCA,_SCB") == (" 0.0000 0.0000 0.0000 6.0000 6.0000\r\n:")
    assert bench.firmware.motors_on == (False, True)
    assert bench.number("_NO") == 2 * keep


@pytest.mark.parametrize(("torque", "stop"), [(5.0, True), (0.5, False)])
def test_an_encoder_that_does_not_move_under_torque_has_failed(bench, torque, stop):
    bench.load("#POSERR", "n=n+1", "SH", "RE")
    bench.accept("n=0", "OV 2;OT 20;OA 1", "SH", "JGA=400;BGA")
    bench.tick(100)
    bench.torques = torque, 0
    bench.tick(50)
    assert bench.number("_MOA") == 0  # it moves
    bench.follows = False
    bench.tick(25)
    assert bench.number("n") == stop
    assert bench.number("_BGA") == (not stop)
    bench.torques = 0, 0
    bench.accept("AB")
    assert bench.refusal("OV 10") == 6
    bench.accept("TL 1")
    assert bench.refusal("OV 1.5") == 6


def test_an_input_may_abort_its_axis(bench):
    bench.load("#POSERR", "n=n+1", "RE")
    bench.accept("n=0", "SH", "OE 1,1", "CN ,,,1", "JG 5000,5000;BG")
    bench.tick(9)
    bench.firmware.inputs[5] = False
    bench.tick(9)
    assert bench.send("MG _SCA,_SCB,_MOA,_MOB,n").split(" ")[1:5] == [
        *("0.0000", "11.0000", "0.0000", "1.0000")
    ]
    assert bench.number("n") == 1


def test_an_amplifier_fault_switches_off_every_axis_with_oe(bench):
    bench.load("#AMPERR", "bits=_TA0", "#W;WT 2;JP #W")
    bench.accept("SH", "OE 1,1", "JGB=500;BGB")
    bench.tick(9)
    bench.broken.add(0)
    bench.tick(9)
    assert bench.firmware.motors_on == (False, False)
    assert bench.send("MG bits,_SCB,_TB") == " 1.0000 15.0000 144.0000\r\n:"


def test_motion_complete_times_out(bench):
    bench.load("#A", "MCA", "late=TIME-t", "EN", "#MCTIME", "code=_SCA", "EN 1")
    bench.accept("SH", "TWA=50", "t=TIME;late=0;code=0", "PRA=500;BGA", "XQ #A,1")
    bench.run()
    assert bench.send("MG late>20,code") == " 1.0000 0.0000\r\n:"
    bench.follows = False
    bench.accept("t=TIME;PRA=500;BGA", "XQ #A,1")
    bench.run()
    assert bench.number("code") == 99
    assert 50 < bench.number("late") < 400


def test_zs_makes_the_subroutine_a_jump(bench):
    bench.load("#W", "WT 2;JP #W", "#POSERR", "a=_ZS0;ZS;b=_ZS0;ER -1", "EN")
    bench.accept("SH", "XQ #W")
    trip(bench)
    assert bench.send("MG a,b,_XQ0") == " 1.0000 0.0000-1.0000\r\n:".replace("0-1", "0 -1")


def test_a_brake_output_is_out_of_reach(make_bench):
    bench = make_bench(ControllerUnit(burned=("MO", "BW 100")))
    assert bench.outputs == [(0, 1, True)]
    bench.accept("SB 1", "CB 1", "OP 3")
    assert bench.number("@OUT[1]") == 0
    assert bench.outputs[1:] == [(0, 2, True)]
    bench.accept("SH")
    assert bench.outputs[2:] == [(0, 1, False)]
    bench.accept("MO")
    assert bench.outputs[3:] == [(0, 1, True)]
    bench.tick(99)
    assert bench.firmware.motors_on == (True, False)
    bench.tick()
    assert bench.firmware.motors_on == (False, False)


@pytest.mark.parametrize(("burned", "on"), [((), True), (("MO",), False), (("MOA",), None)])
def test_motors_start_as_burned(make_bench, burned, on):
    program = "#AUTO\nSB 3\nEN\n"
    bench = make_bench(ControllerUnit(burned=burned, burned_program=program))
    expected = (False, True) if on is None else (on, on)
    assert bench.firmware.motors_on == expected
    bench.tick()
    assert bench.outputs == [(0, 3, True)]
    assert bench.send("LS").startswith("0 #AUTO \r\n1 SB 3 \r\n2 EN \r\n:")
    bench.accept("SH;KP 12;BN;MO")
    bench.send("RS")
    assert bench.firmware.motors_on == (True, True)
    assert bench.number("_KPA") == 12
    assert bench.number("_EO") == 0  # burned as well
