"""The request/answer line: valid and invalid answers, silence, and downloads."""

import pickle

import pytest

from sautereau.robot.drivers.galil.dmc import LONGEST_LINE, pack
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    LineLost,
    SettingNotTaken,
    SilentController,
)


@pytest.fixture
def line(bench, lines):
    def make(*pairs):
        controller, transcript = bench(lines.connect, pairs)
        controller.connect()
        return controller.driver.line, transcript

    return make


def test_a_refused_command_is_named_with_its_code(line):
    refused, _ = line(("SP 1,1;AC 0,0;DC 1,1", ":?"), ("TC1", "6 Number out of range\r\n:"))
    with pytest.raises(CommandRefused, match=r"'AC 0,0': 6 Number out of range; .*range") as caught:
        refused.ask("SP 1,1", "AC 0,0", "DC 1,1")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        ("150 Odd\r\n:", CommandRefused, "look up code 150 under TC"),
        *((text, GarbledAnswer, "TC1") for text in ("?", "what\r\n:", "\r\n:")),
    ],
)
def test_a_refusal_with_an_unknown_code_or_without_one(line, answer, error, said):
    refused, _ = line(("XX", "?"), ("TC1", answer))
    with pytest.raises(error, match=said):
        refused.ask("XX")


def test_silence_names_command_timeout_and_fix(line):
    silent, _ = line(("MG _TPA", " 12.00"), ("", ""), ("MG 4711", ""))
    with pytest.raises(
        SilentController, match=r"'MG _TPA' within 0\.125 s after '.* 12\.00'; check its power"
    ):
        silent.read("_TPA")


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ((b"\xfe\x80\x00:", b"\x00\x00", b"12\x7f:"), "baud_rate"),
        (("1.0 2.0\r\n:", "one\r\n:", "\r\n:", ":", "1.0.0\r\n:"), "1 numbers were expected"),
        (("1" * 600_000,), "with more than 262144"),
    ],
    ids=["no text", "no such numbers", "no end"],
)
def test_answers_that_are_not_the_numbers_asked_for(line, lines, answers, said):
    for answer in answers:
        garbled, _ = line(("MG _TPA", answer), *lines.fresh, ("MG _TPA", answer))
        with pytest.raises(GarbledAnswer, match=said):
            garbled.read("_TPA")


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        *(
            (f"{echo}\r:".encode(), "echoed|no text")
            for echo in ("SH CB", "SHAB", "", "SH AB\x7fB")
        ),
        (b"XH AB\r?", "was sent 'SH AB' and echoed 'XH AB'"),  # no refusal of what was sent
        ("::", "more than was asked"),
    ],
)
def test_another_echo_or_more_than_was_asked(line, heard, said):
    garbled, _ = line(("SH AB", heard))
    with pytest.raises(GarbledAnswer, match=said):
        garbled.ask("SH AB")


@pytest.mark.parametrize("said", [OSError("gone"), OSError(5, "Input/output error")])
def test_a_port_that_went_away(line, said):
    lost, _ = line(("MG _TPA", said))
    with pytest.raises(LineLost, match=r"lost at 'MG _TPA': .*check the cable"):
        lost.read("_TPA")


@pytest.mark.parametrize(
    "said",
    [(b"", b"", b"::"), (b":", b"", b":"), (b"", b"", b":"), (b":", b":", b":"), ("", "", "")],
)
def test_a_download_however_the_firmware_acknowledges_it(line, said):
    pairs = zip(("DL", "EN", "\\"), said, strict=True)
    listed = ("LS", "0 EN\r\n:")
    downloading, port = line(*pairs, ("MG 4711", " 4711.0000\r\n:"), listed)
    downloading.download(["EN"])
    assert not port.incoming


def test_a_refused_download(line):
    refused, _ = line(
        ("DL", ""),
        ("EN", ""),
        ("\\", b"?"),
        ("MG 4711", " 4711.0000\r\n:"),
        ("TC1", "51 Full\r\n:"),
    )
    with pytest.raises(CommandRefused, match="'DL': 51 Full"):
        refused.download(["EN"])


@pytest.mark.parametrize("listed", ["0 EM", "1 EN\r\n2 EN", ""])
def test_a_program_that_is_not_the_one_that_was_sent(line, listed):
    held = ("LS", f"{listed}\r\n:")
    other, _ = line(("DL", ""), ("EN", ""), ("\\", b":"), ("MG 4711", " 4711.0000\r\n:"), held)
    with pytest.raises(SettingNotTaken, match="another program than was sent"):
        other.download(["EN"])


def test_packing_fills_lines_and_loses_nothing():
    commands = [f"PVA={i},{i * i},{i % 7 + 1}" for i in range(300)]
    packed = list(pack(commands))
    assert [command for group in packed for command in group] == commands
    lengths = [len(";".join(group)) for group in packed]
    assert max(lengths) <= LONGEST_LINE
    assert all(
        length + 1 + len(following[0]) > LONGEST_LINE
        for length, following in zip(lengths, packed[1:], strict=False)
    )
    assert list(pack([])) == []
