"""What the driver sent or assumed at first, where the reference refuses it or says otherwise.

A driver that does so fails at connect, homing and capture, and leaves motors on after faults. The
tables name the step of a press, what was sent, and the reference's heading.
"""

import re

import pytest

from sautereau.sim_backend.controller_part import ControllerUnit

NETWORK = {"interface": "ethernet"}
STRONG = {"amplifier": "D3040", "burned": ("MO", "AG 2,2")}
STRICT = {"odd_pvt": "refuse"}
REFUSED = {
    # step: (sent, heading, unit, sent before, error code where the reference gives one)
    "connect, Ethernet": ("EO 1", "EO", NETWORK, (), None),
    "connect, amplifiers at their largest gain": ("TL 9.9980,9.9980", "TL", STRONG, (), 6),
    "load, odd velocity": ("PVA=10,101,12", "PV", STRICT, (), None),
    "load, odd time": ("PVA=10,100,11", "PV", STRICT, (), None),
    "load, step": ("PVA=44000000,0,2048", "PV", {}, (), 6),
    "load, velocity": ("PVA=0,22000000,2048", "PV", {}, (), 6),
    "load, time": ("PVA=0,0,2050", "PV", {}, (), 6),
    "stop": ("DC 63661056,63661056", "DC", {}, ("SH", "PR 90000", "BG"), 7),
}
WATCH = "#WATCH\rWT 2\rwleft=wleft-1\rJP #WATCH,wleft>0\rEN"
OTHERWISE = {
    # step: (sent, heading, what is read then, what the driver took for granted, what it is)
    "connect, listing": (["DL\r#A\rEN\r\\"], "LS", "LS", "0 #A\r\n1 EN", "0 #A \r\n1 EN "),
    "homing, place": (["SH;SP 8000;HV 8000;HM A;BG A"], "HM", "place", "1500", "4100"),
    "homing, duration": (["SH;SP 8000;HM A;BG A"], "HM", "_BGA", "0", "1"),
    "press, trigger on a brake": (["BW 100,0", "SB 1"], "BW", "@OUT[1]", "1", "0"),
    "press, a refusal without #CMDERR": (
        [f"DL\r{WATCH}\r#PRESS\rBT AB\rEN\r\\", "wleft=9999;SH;XQ #WATCH,0;XQ #PRESS,1"],
        "#CMDERR",
        "_XQ0<0&(_MOA=0)",
        "0",
        "1",
    ),
    "press, a limit with OE 1": (
        ["SH;OE 1,1;PR 9000,90000;BG", "limit"],
        "OE",
        "_MOA+_MOB",
        "2",
        "0",
    ),
    "press, an error not cleared before RE": (
        ["DL\r#A\rJP #A\r#POSERR\rn=n+1\rRE 1\r\\", "n=0;XQ #A;ER 5;SH", "slip"],
        "#POSERR",
        "n",
        "1",
        "[2-9].*|1.+",
    ),
    "capture, end of an upload": (["DM x[2]"], "QU", "QU x[],0,1,1", "[^\x1a]*", ".*\x1a"),
    "capture, torque": (["DM x[4]", "RA x[];RD _TTA;RC 1"], "RD", "x[1]", "0.5", "1638"),
}


@pytest.mark.parametrize("step", REFUSED)
def test_a_form_that_is_refused(make_bench, step):
    form, _, unit, before, code = REFUSED[step]
    bench = make_bench(ControllerUnit.model_validate(unit))
    for line in before:
        bench.send(line)
    bench.tick()
    port = bench.firmware.connect() if unit == NETWORK else "S"
    assert bench.firmware.receive(f"{form}\r".encode(), port).endswith(b"?")
    assert code in (None, int(bench.number("_TC")))


@pytest.mark.parametrize("step", OTHERWISE)
def test_an_answer_that_is_another(make_bench, step):
    sent, _, asked, assumed, answered = OTHERWISE[step]
    bench = make_bench()
    for line in sent:
        if line == "limit":
            bench.tick(5)
            bench.closed.add(("forward", 0))
        elif line == "slip":
            bench.follows, bench.counts = False, [100, 0]
        else:
            assert "?" not in bench.send(line)
    bench.tick(1500)
    if asked == "place":
        found = str(bench.counts[0])
    elif asked[:2] in ("LS", "QU"):
        found = bench.send(asked).removesuffix("\r\n:")
    else:
        found = f"{bench.number(asked):g}"
    assert re.fullmatch(answered, found, re.DOTALL)
    assert not re.fullmatch(assumed, found, re.DOTALL)
