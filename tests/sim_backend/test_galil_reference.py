"""Every command of the reference's table, at the ends of its ranges and where it is not valid."""

import pytest

from sautereau.sim_backend.devices.galil.commands.table import HANDLERS
from sautereau.sim_backend.devices.galil.reference import ABSENT, entries
from sautereau.sim_backend.parts import ControllerUnit

ENTRIES = list(entries().values())
SETTINGS = [entry for entry in ENTRIES if entry.form == "values" and entry.code != "IP"]
by_code = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.code)


def code_of(bench, line):
    """The error code of a line, 0 if it is accepted."""
    answer = bench.send(line)
    return int(bench.send("TC1").split()[0]) if answer.endswith("?") else 0


def test_every_command_of_the_table_is_carried_out_and_none_besides():
    assert set(HANDLERS) == set(entries())
    assert all(entry.heading for entry in ENTRIES)


def test_a_command_that_is_not_emulated_is_refused_and_no_variable(make_bench):
    bench = make_bench()
    assert not ABSENT & entries().keys()
    for code in ABSENT:
        for line in (code, f"{code} 1", f"{code}A=1", f"{code}*=1", f"{code}=1", f"{code}NAME=1"):
            assert code_of(bench, line) == 1, line
        assert code_of(bench, f"{code}a=1") == code_of(bench, f"{code}0=1") == 0
    assert code_of(bench, "PORT=1;DUAL=1") == 0  # no command begins with PO or DU


@by_code
def test_where_it_is_valid(make_bench, entry):
    bench = make_bench()
    if not entry.in_terminal:
        assert code_of(bench, entry.code) == 2
    if not entry.in_program:
        bench.firmware.receive(f"DL\r#A\r{entry.code}\rEN\r\\".encode())
        bench.send("XQ #A")
        bench.tick(3)
        assert bench.send("TC1").endswith("3 Command not valid in program\r\n:")


@pytest.mark.parametrize("entry", SETTINGS, ids=lambda entry: entry.code)
def test_ranges_and_motion(make_bench, entry):
    bench = make_bench()
    (argument,) = entry.arguments
    low, high = argument.low, argument.high
    for value in argument.choices or (low, high):
        assert code_of(bench, f"{entry.code}A={value:.4f}") == 0, value
    beyond = max(argument.step, 0.01)
    above = high + beyond
    if above < 2**31:
        assert code_of(bench, f"{entry.code}A={above:.4f}") == 6
    if low > -(2**31) and entry.code != "SP":
        assert code_of(bench, f"{entry.code}A={low - beyond:.4f}") == 6
    if argument.choices:
        assert code_of(bench, f"{entry.code}A={high - 0.25:.2f}") == 6
    bench = make_bench()
    bench.accept("SH", "SPA=3000", "PRA=9000", "BGA")
    middle = argument.high if argument.choices else max(low, min(high, 1024))
    if entry.in_motion and entry.code != "JG":
        assert code_of(bench, f"{entry.code}A={middle}") == 0
    elif entry.code != "JG":
        assert code_of(bench, f"{entry.code}A={middle}") == 7
        assert code_of(bench, f"{entry.code}A=?") == 0


@pytest.mark.parametrize("entry", [e for e in SETTINGS if e.burnable], ids=lambda entry: entry.code)
def test_what_is_burned_remains(make_bench, entry):
    bench = make_bench()
    argument = entry.arguments[0]
    value = argument.choices[-1] if argument.choices else argument.accept(argument.high)
    bench.accept(f"{entry.code}B={value:.4f}", "BN", f"{entry.code}B={argument.default}")
    bench.send("RS")
    bench.send("EO 0")
    assert bench.number(f"_{entry.code}B") == pytest.approx(value, abs=1e-3)
    bench.send("\x12\x13")
    bench.send("EO 0")
    assert bench.number(f"_{entry.code}B") == pytest.approx(argument.default, abs=1e-4)


def test_a_burned_lock_remains_until_the_master_reset(make_bench):
    bench = make_bench()
    bench.firmware.receive(b"DL\r#A\rEN\r\\")
    bench.accept("BP", "PW key,key", "\x0c\x0bkey,1", "BN")
    bench.send("RS")
    bench.send("EO 0")
    assert bench.send("\x0c\x0b?") == " 1\r\n:"
    for line, code in (("LS", 106), ("ED", 106), ("PW a,a", 106), ("\x0c\x0bno,0", 136)):
        assert code_of(bench, line) == code
    bench.send("\x12\x13")
    bench.send("EO 0")
    assert code_of(bench, "UL") == 0
    assert bench.send("\x0c\x0b?") == " 0\r\n:"


@pytest.mark.parametrize("model", ["DMC4020", "DMC4123", "DMC2123", "DMC1826", "DMC30012"])
def test_models_lack_what_the_reference_says(make_bench, model):
    unit = ControllerUnit(model=model, burned=())
    bench = make_bench(unit)
    for entry in ENTRIES:
        if entry.code in unit.galil.absent and entry.in_terminal:
            assert code_of(bench, f"{entry.code} 1") == 1, entry.code


@pytest.mark.parametrize("firmware", ["1.3a-FAST", "1.0c"])
def test_other_firmware(make_bench, firmware):
    bench = make_bench(ControllerUnit(firmware=firmware))
    assert f"Rev {firmware}-SIM" in bench.send("\x12\x16")
    assert code_of(bench, "PVA=2,2,2") == (1 if "FAST" in firmware else 0)
    assert code_of(bench, "MG _PVA,_BTA") == (58 if "FAST" in firmware else 0)
    assert bench.number("_DM") == (24_000 if "FAST" in firmware else 16_000)
    bench.firmware.receive(b"DL\r#A\rAT 0\rAT 4,1\rEN\r\\")
    bench.accept("XQ")
    bench.tick(9)
    bench.firmware.receive(b"")
    assert bench.number("_TC") == (0 if "FAST" in firmware else 4)
