"""What programs can say: variables, branches, jumps, subroutines, time, automatic subroutines."""

import pytest

from sautereau.sim_backend.devices.galil.firmware import GalilFirmware


@pytest.fixture
def run(bench):
    """Run a program; return where it ended, by its message."""

    def go(*lines, limit=5000):
        assert bench.load("#A", *lines) == ":"
        bench.accept("XQ #A")
        while bench.firmware.watching:  # one that goes round as well
            bench.tick()
            assert bench.firmware.samples < limit, "does not come to an end"
        return bench.firmware.receive(b"").decode()

    return go


def test_variables_and_elements(bench):
    assert bench.refusal("MG x") == 9
    bench.accept("x=1", "x=x+1.5", "DM v[3]", "v[x-1.5]=-7.25", "longname=v[1]*2", "SPA=x*1000")
    assert bench.send("MG x,v[1],v[0],longname") == " 2.5000 -7.2500 0.0000 -14.5000\r\n:"
    assert bench.number("_SPA") == 2500
    assert bench.refusal("v[3]=1") == 56
    assert bench.refusal("v[-1]=1") == 56
    assert bench.refusal("w[0]=1") == 82
    assert bench.send("x=?;x=;v[0]=?") == " 2.5000\r\n: 2.5000\r\n: 0.0000\r\n:"
    assert bench.refusal("x=y") == 9
    assert bench.refusal("toolongname=1") == 1
    bench.accept(*[f"a{number}=0" for number in range(508)])
    assert bench.refusal("b=0") == 67
    bench.accept("x=3")


@pytest.mark.parametrize(("x", "said"), [(0, "zero"), (1, "one"), (2, "many")])
def test_branches_nest(run, bench, x, said):
    bench.accept(f"x={x}")
    many = ("ELSE", 'MG "many"', "ENDIF")
    told = run("IF (x=0)", 'MG "zero"', "ELSE", 'IF (x=1);MG "one"', *many, "ENDIF;y=x", "EN")
    assert told.split() == [said]
    assert bench.number("y") == x


def test_a_subroutine_may_be_skipped(run, bench):
    run("x=1", "JS #SUB,x>1", "JS #SUB,x=1", "EN", "#SUB", "x=x+10", "EN")
    assert bench.number("x") == 11


@pytest.mark.parametrize(
    ("line", "code"),
    [("JP #NONE", 10), ("JP #A,1,2", 4), ("RE", 8), ("JP #A,(", 83), ("IF", 50), ("WT", 50)],
)
def test_a_program_cannot(run, bench, line, code):
    assert run(line, "EN").startswith("?1 ")
    assert bench.send("TC1").startswith(f"{code} ")


def test_a_watchdog_that_is_not_renewed_switches_off(bench):
    bench.load("#W", "WT 10", "left=left-1", "JP #W,left>0", "AB 1;MO AB;CB 1", "EN")
    bench.accept("SH", "SB 1", "left=5", "JGA=5000;BGA", "XQ #W")
    for _ in range(10):
        bench.tick(40)
        bench.accept("left=5")
        assert bench.firmware.motors_on == (True, True)
    bench.tick(52)
    assert bench.firmware.motors_on == (False, False)
    assert bench.outputs[-1][1:] == (1, False)
    assert not bench.firmware.watching


def test_a_looping_program_of_the_host_does_not_advance_time(bench):
    bench.load("#W", "WT 10", "n=n+1", "JP #W", "EN")
    bench.accept("n=0", "XQ #W")
    assert bench.run() < 20
    assert bench.firmware.watching
    bench.tick(100)
    assert bench.number("n") == pytest.approx(10, abs=1)


def test_it_waits_while_the_host_waits_for_rest(bench):
    firmware = bench.firmware = GalilFirmware(bench, on_output=bench._note_output, host_waits=True)
    firmware.receive(b"EO 0\r")
    bench.load("#W", "WT 10", "n=n+1", "JP #W", "EN", "#POSERR", "SB 3", "RE 1")
    bench.accept("n=0", "SH", "ER 50", "XQ #W")
    bench.tick(200)
    assert bench.number("n") == 1
    bench.follows = False
    bench.accept("JGA=20000;BGA")
    bench.tick(200)
    assert (3, True) in [change[1:] for change in bench.outputs]


def test_offsets_and_torque_limits_go_to_the_amplifiers(bench):
    bench.accept("OF 1,2", "TL 3,4", "OFB=-1")
    assert bench.driven == ((1, -1), (3, 4))
    assert bench.send("OF ?,?") == " 1.0000,-1.0000\r\n:"
    bench.accept("AB", "MO")
    assert bench.driven[0] == (1, -1)
