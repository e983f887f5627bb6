"""After every fault the motors are off, a message gives the reason, and no recording is lost.

Run alone with ``SAUTEREAU_FAULTS=docs/faults.md`` and ``-m "slow or not slow"`` (that is
``make faults``) it writes the table of results. The stand-in runs in real time here, so that
the arm continues to move while the host reacts.
"""

import os
import re
import sys
from pathlib import Path

import pytest

from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.load import load_rig
from tests.budget import amount
from tests.robot.fault_desk import Desk
from tests.robot.injected_faults import ALONE, FAULTS, HOST, NOT_OFF, OFF, SOON
from tests.robot.injected_host_faults import burst

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, pseudo-terminals")


RESULTS: dict[tuple[str, str], tuple[float, str, str]] = {}
"""Of each fault and port: s until off, recordings and message."""


def cases():
    """Return the faults over each port; those that the quick run skips are marked slow."""
    return [
        pytest.param(
            each,
            port,
            id=f"{each.name.replace(' ', '-')}-{port}",
            marks=() if each.quick and port == each.ports[0] else pytest.mark.slow,
        )
        for each in FAULTS
        for port in each.ports
    ]


@pytest.mark.parametrize(("each", "port"), cases())
def test_the_arm_ends_off_and_a_message_says_why(each, port, tmp_path, monkeypatch, command_server):
    desk = Desk(tmp_path / "out", monkeypatch, port, command_server)
    each.run(desk)
    message = " ".join(desk.message.split())
    ports = r"/dev/\S*\d|(tcp://)?127\.0\.0\.1:\d+"
    message = re.sub(ports, "PORT", message).replace(str(tmp_path), "OUT")
    RESULTS[each.name, port] = desk.after, desk.recording, message
    assert re.search(each.said, message)
    assert not desk.on
    if each.limit is not None:
        assert desk.after <= each.limit


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(amount(4, 20)))
def test_signals_at_any_time_leave_the_arm_off_and_say_so(
    seed, tmp_path, monkeypatch, command_server
):
    desk = Desk(tmp_path / "out", monkeypatch, ("serial", "tcp")[seed % 2], command_server)
    burst(desk, seed=seed)
    assert re.search(f"{OFF}|{NOT_OFF}", desk.message)
    assert not desk.on


def table() -> str:
    """Return the rows of the page."""
    rows = []
    for each in FAULTS:
        found = [RESULTS[each.name, port] for port in each.ports]
        off = {
            port: f"{after * 1e3:.0f}"
            for port, (after, _, _) in zip(each.ports, found, strict=True)
        }
        who = {SOON: "50", ALONE: "550", HOST: "host"}[each.limit]
        _, recording, message = found[0]
        shown = message.replace("|", "/")
        rows.append(
            f"| {each.name} | {each.done} | {who} | {off.get('serial', '-')} |"
            f" {off.get('tcp', '-')} | {recording} | {shown} |"
        )
    return "\n".join(rows)


@pytest.fixture(scope="module", autouse=True)
def _page():
    """Write the table if it is requested and every fault has been injected."""
    yield
    path = os.environ.get("SAUTEREAU_FAULTS")
    if path and all((each.name, port) in RESULTS for each in FAULTS for port in each.ports):
        page = Path(path)
        head, _, _ = page.read_text(encoding="utf-8").partition("| fault |")
        titles = ("fault", "what was done", "limit, ms", "serial, ms", "TCP, ms", "recording")
        head += f"| {' | '.join((*titles, 'message'))} |\n|{'---|' * 7}\n"
        page.write_text(f"{head}{table()}\n", encoding="utf-8")


@pytest.mark.slow
def test_the_stand_in_itself_presses_without_a_fault(tmp_path, monkeypatch):
    desk = Desk(tmp_path / "out", monkeypatch)
    desk.press()
    assert desk.error is None
    assert desk.recording == "1 complete"
    assert rig_from_json(rig_json(load_rig())) == load_rig()
