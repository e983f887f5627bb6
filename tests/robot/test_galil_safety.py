"""What a real controller demands beyond a press, by transcripts from the command reference."""

import numpy as np
import pytest

from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.dmc import check_segments, controller_program, pieces, signature
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import (
    GarbledAnswer,
    MotionFault,
    NotReady,
    UnsafeRequest,
)
from sautereau.trajectory.segments import Segments
from tests.robot.motions import no_keep_alive

FAULTS = ("#CMDERR", "#POSERR", "#LIMSWI", "#AMPERR", "#TCPERR", "#SAFE")


@pytest.mark.parametrize("label", FAULTS)
def test_every_fault_aborts_before_anything_else(label):
    program = controller_program(3)
    assert program[program.index(label) + 1] == "AB 1;MO AB"


def test_routines_end_as_the_reference_says_and_send_no_message():
    program = controller_program(3)
    ends = {}
    for line in program:
        if line.startswith("#"):
            label = line.partition(";")[0]
        ends[label] = line
    assert ends["#CMDERR"] == "EN 1"
    assert {ends[name] for name in ("#POSERR", "#LIMSWI", "#AMPERR", "#TCPERR")} == {"RE 1"}
    assert not any("MG" in line for line in program)
    assert max(map(len, ends)) <= 8
    assert signature(3) != signature(4)


@pytest.mark.parametrize(
    ("sign", "left", "running", "later", "stopped"),
    [
        ("0", 8, 2, 50, True),
        ("0", 10, 2, 300, True),
        ("0", 10, 2, 100, False),
        ("x", 8, -1, 300, True),
        ("x", 0, -1, 300, False),
        ("x", 8, 3, 300, False),
    ],
)
def test_a_watchdog_that_another_client_replaced_stops_the_arm(
    bench, lines, sign, left, running, later, stopped
):
    """With no counts left it has tripped by itself; a signature may be a few counts old."""
    sign = sign.replace("x", str(signature(1)))
    answer = f" {sign}.0000 {left}.0000 {running}.0000 {5001 + later}.0000\r\n:::"
    renewal = (lines.on[7][0], answer)
    asked = [] if stopped else [("MG _TPA,_TPB", " 1.0000 2.0000\r\n:")]
    after = [*lines.abort, *lines.off] if stopped else [*asked, *lines.off]
    controller, _ = bench(lines.connect, lines.on, [renewal], after)
    with controller, controller.powered():
        controller.driver.identity = "DMC4020 Rev 1.3c"
        controller.driver.renew()
        if stopped:
            with pytest.raises(MotionFault, match="its program was replaced"):
                controller.positions()
        else:
            controller.positions()


def test_a_message_of_a_program_is_reported_with_its_text(bench, lines):
    said = bytes(byte | 128 for byte in b"?6 BT AB") + b" 1.0000 2.0000\r\n:"
    controller, _ = bench(lines.connect, [("MG _TPA,_TPB", b"MG _TPA,_TPB\r\n" + said)])
    controller.connect()
    with pytest.raises(GarbledAnswer, match=r"sent b'\?6 BT AB' by itself"):
        controller.positions()


def real(pairs):
    return [
        (sent, answer.replace("-SIM", "") if isinstance(answer, str) else answer)
        for sent, answer in pairs
    ]


@pytest.mark.parametrize(
    ("verified", "settings", "said"),
    [
        ("", "", "was never verified on this bench; run `sautereau setup verify`"),
        (
            "DMC4020 Rev 1.3c, serial number 1",
            "as now",
            "changed since 2026-01-02: 'DMC.* 1' is now",
        ),
        ("as now", "MTA=-1", "'MTA=-1' is now 'MTA=1 MTB=1"),
        ("as now", "as now", None),
    ],
)
def test_a_real_controller_is_only_powered_as_it_was_verified(
    rig, lines, transcript_of, verified, settings, said
):
    memory = "MTA=1 MTB=1 CEA=0 CEB=0 AGA=1 AGB=1 KPA=6 KPB=6 KIA=0.5 KIB=0.5 KDA=64 KDB=64"
    at = with_values(
        rig,
        {
            "controller.verified": verified.replace(
                "as now", "DMC4020 Rev 1.3c, serial number 4711"
            ),
            "controller.verified_settings": settings.replace("as now", memory),
            "controller.verified_on": "2026-01-02",
        },
    )
    script = real([*lines.connect, *([] if said else lines.on), *lines.off])
    transcript = transcript_of(script)
    controller = GalilController(at, open_port=transcript.open, keep_alive=no_keep_alive)
    with controller:
        if said is None:
            with controller.powered():
                pass
        else:
            with pytest.raises(NotReady, match=said), controller.powered():
                pass
    transcript.check()


def test_segments_off_the_controllers_steps_are_refused(segments):
    check_segments(segments)
    odd = Segments(
        segments.start,
        segments.steps + np.array([30_000_000, 0]),
        segments.velocities + np.array([[1, 0], [0, 0], [0, 0]]),
        np.array([10, 15, 2050]),
    )
    said = "a step of 3.*a segment of 2050 samples.*1 of its velocities.*1 of its samples"
    with pytest.raises(UnsafeRequest, match=said):
        check_segments(odd)


@pytest.mark.parametrize("rows", [2, 3, 5, 100, 101, 1001])
@pytest.mark.parametrize("longest", [2, 3, 10, 10_000])
def test_uploads_in_pieces_cover_every_row(rows, longest):
    found = list(pieces(rows, longest))
    assert [row for first, last in found for row in range(first, last + 1)] == list(range(rows))
    assert all(2 <= last - first + 1 <= max(longest, 3) for first, last in found)


def end_of_search(lines, stopped_by):
    """Return a script of homing up to its first search, which ends with codes."""
    asked, _ = found = lines.both_edges[-1]
    return [*lines.home[: lines.home.index(found)], (asked, f" {stopped_by}\r\n:")]


def not_found_twice(lines):
    end = lines.home.index(("DP 0,-500000", ":")) - 1
    return [*lines.home[:end], ("MG _TPA,_TPB", " 1.0000 -499000.0000\r\n:")]


def at_a_limit(lines):
    """The abort overwrites the stop codes."""
    names = ",".join(f"_{name}{axis}" for axis in "AB" for name in ("LF", "LR", "TP", "FL", "BL"))
    first, second = "1.0000 1.0000 5.0000 900.0000 -900.0000", "1.0000 0.0000 5.0000 900.0000 -9.0"
    read = (f"MG {names}", f" {first} {second}\r\n:")
    return [*end_of_search(lines, "7.0000 7.0000 1.0000 9.0000 -1.0000"), read]


@pytest.mark.parametrize(
    ("homing", "said"),
    [
        (not_found_twice, "found twice, 0 and 999 counts apart"),
        (
            lambda lines: end_of_search(lines, "9.0000 3.0000 1.0000 9.0000 0.0000"),
            "homing broke off: joint 2 stopped by the reverse",
        ),
        (
            lambda lines: end_of_search(lines, "7.0000 7.0000 1.0000 9.0000 20.0000"),
            r"refused a command of its program, with code 20 \(TC\)",
        ),
        (at_a_limit, "joint 2 stopped by the reverse limit; remove"),
    ],
)
def test_a_homing_that_fails_is_explained(bench, lines, homing, said):
    controller, _ = bench(lines.connect, lines.on, homing(lines), lines.abort)
    with pytest.raises(MotionFault, match=said), controller, controller.powered():
        controller.home()
