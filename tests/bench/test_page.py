"""The page of a running session: read-only, on the loopback, in a real browser."""

import http.client
import itertools
import json
import signal
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.live import page as pages
from sautereau.commands.live.page import PageView
from sautereau.daq.file.recorded import Block
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.monitor import Fault, Feed, Made, Samples, Stage
from sautereau.robot.experiment.plan import Plan, Row
from sautereau.robot.experiment.session_folder import SessionFolder
from tests.bench.browser import OVERLAPS, WIDE, observed
from tests.budget import slow

RIG = load_rig()
HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
TITLE = f"rig {HOSTILE}, SIMULATED"


def samples(press, first=0, n=2048):
    time = (first + np.arange(n)) / 51_200.0
    block = Block(first, np.stack([np.sin(99 * time), np.full(n, np.nan)]))
    return Samples(press, RIG.daq.channels, 51_200.0, block)


@pytest.fixture
def view():
    pytest.importorskip("jinja2")
    pytest.importorskip("plotly")
    with PageView(TITLE) as view:
        yield view


def port_of(view):
    return int(view.address.rstrip("/").rpartition(":")[2])


def requested(view, method, path, host=None):
    connection = http.client.HTTPConnection("127.0.0.1", port_of(view), timeout=60)
    connection.request(method, path, headers={"Host": host} if host else {})
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def events(view, until):
    """Read events as a browser does, until one of a kind has come; return all of them."""
    connection = http.client.HTTPConnection("127.0.0.1", port_of(view), timeout=60)
    connection.request("GET", "/events")
    answer, found = connection.getresponse(), []
    while not found or found[-1]["kind"] != until:
        line = answer.readline()
        assert line, found
        if line.startswith(b"data: "):
            found.append(json.loads(line[6:]))
    connection.close()
    return found


def test_the_page_is_read_and_nothing_else(view):
    assert view.address.startswith("http://127.0.0.1:")
    status, headers, body = requested(view, "GET", "/")
    assert status == 200
    assert b"<script>alert" not in body
    assert b"default-src 'none'" in body
    assert "frame-ancestors 'self'" in headers["Content-Security-Policy"]
    assert not any(name.lower().startswith("access-control") for name in headers)
    assert requested(view, "HEAD", "/")[2] == b""
    assert requested(view, "GET", "/", f"localhost:{port_of(view)}")[0] == 200
    assert requested(view, "GET", "/../etc/passwd")[0] == 404
    for method in ("POST", "PUT", "PATCH", "DELETE", "OPTIONS"):
        status, headers, _ = requested(view, method, "/")
        assert (status, headers["Allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize("path", ["/", "/report", "/events"])
def test_another_name_for_this_machine_reads_nothing(view, path):
    for host in ("evil.example", f"evil.example:{port_of(view)}", "127.0.0.1:1"):
        status, _, body = requested(view, "GET", path, host)
        assert (status, body) == (403, b"")


def test_a_browser_that_comes_late_sees_the_running_press_and_no_earlier_one(view):
    view.show([Stage("moving", "reading", 1), samples(1), Stage("idle", "idle")], 0)
    view.show([Stage("moving", "reading", 2), samples(2), samples(2, 2048)], 3)
    view.show([Fault("joint 1 is off its plan")], 3)
    found = events(view, "samples")
    found += events(view, "fault")
    assert {event["press"] for event in found if event["kind"] == "samples"} == {2}
    assert {"kind": "made", "made": 0, "dropped": 3, "watched": False} in found
    [first, second] = next(e for e in found if e["kind"] == "samples")["traces"]
    assert 2 * 2048 / pages.STRETCH <= len(first[1]) <= 2 * 2048 / pages.STRETCH + 2
    assert set(second[1]) == {None}


@pytest.mark.slow
def test_memory_is_bounded_and_a_browser_that_does_not_read_is_disconnected(view):
    with socket.create_connection(("127.0.0.1", port_of(view))) as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        lazy.sendall(f"GET /events HTTP/1.0\r\nHost: 127.0.0.1:{port_of(view)}\r\n\r\n".encode())
        while not view._browsers:
            lazy.recv(1)
        for _ in range(pages.WAITING * 20):
            view.show([samples(1, n=1 << 16)], 0)
            if not view._browsers:
                break
        assert view._browsers == []
    for _ in range(pages.KEPT):
        view.show([samples(1)], 0)
    assert len(view._past) == pages.KEPT
    assert len(view._latest) <= 5


def test_further_connections_are_closed(view):
    held = [
        socket.create_connection(("127.0.0.1", port_of(view))) for _ in range(pages.CONNECTIONS)
    ]
    with pytest.raises((http.client.HTTPException, OSError)):
        requested(view, "GET", "/")
    for connection in held:
        connection.close()


def test_a_report_that_fails_is_said_and_the_session_continues(view, tmp_path):
    damaged = tmp_path / "press-0001.mcap"
    damaged.write_bytes(b"no recording")
    with Feed([view]) as feed:
        feed(Made(1, damaged))
        fault = events(view, "fault")[-1]
        feed(Stage("idle", "idle"))
        events(view, "stage")
    assert "press-0001.mcap" in fault["text"]
    assert feed.faults == []


def test_a_running_session_lacks_no_press(view, write_session, tmp_path):
    folder = SessionFolder(tmp_path / "out", Plan(RIG, (Row(RIG, 3),)), 5, 5)
    folder.start()
    write_session(folder.path, 1, session=folder.session)
    view.made([folder.path / "press-0001.mcap"])
    events(view, "report")
    _, _, report = requested(view, "GET", "/report")
    assert b"press-0001.mcap" in report
    assert b"planned presses are on this page" not in report


def test_warm_up_presses_are_not_counted(view):
    view.show([Made(1, Path("warm-up-01.mcap"))], 0)
    view.show([Stage("idle", "idle")], 0)
    assert not any(event["kind"] == "made" for event in events(view, "stage"))


@pytest.fixture
def hostile(write_session, tmp_path):
    folder = tmp_path / "evening <script>alert(3)<"
    write_session(folder, 2, notes=HOSTILE)
    return sorted(folder.glob("*.mcap"))


@pytest.mark.parametrize(
    "looks",
    [
        ((1280, "light"), (800, "dark"), (390, "light"), (390, "dark")),
        slow(((1280, "dark"), (800, "light"))),
    ],
)
def test_in_a_browser_narrow_wide_light_and_dark(view, browser, hostile, looks):
    page, faults, requests = observed(browser)
    page.goto(view.address)
    view.show([Stage("moving", "reading", 1), samples(1), samples(1, 2048)], 0)
    view.show([Made(1, hostile[0])], 0)
    report = page.frame_locator("#report")
    report.locator("html[data-ready=yes]").wait_for()
    assert "1 made" in page.get_by_role("status").inner_text()
    assert "the newest 1 of 1" in page.locator("#shown").inner_text()
    scale = RIG.daq.channels[0].scale
    assert f"velocity (m/s): {-scale:.5f} to {scale:.5f}" in page.locator("#traces").inner_text()
    assert "force (N): nothing" in page.locator("#traces").inner_text()
    view.show([Stage("moving", "reading", 2), samples(2), Made(2, hostile[1]), Fault(HOSTILE)], 0)
    page.get_by_text("the newest 2 of 2").wait_for()
    report.locator("html[data-ready=yes]").wait_for()
    assert HOSTILE in page.locator("#faults").inner_text()
    for width, scheme in looks:
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(300)
        for frame in page.frames:
            seen = frame.evaluate(OVERLAPS)
            assert seen["texts"] > 4
            assert (seen["overlaps"], seen["cut"]) == ([], []), (scheme, width)
            assert seen["wide"] <= width, (scheme, width)
        fitted = "() => document.getElementById('report').contentDocument.body.offsetHeight"
        height = page.locator("#report").evaluate("e => e.clientHeight")
        assert height >= page.evaluate(fitted)
    page.add_style_tag(content=WIDE)
    assert page.evaluate(OVERLAPS)["overlaps"] == []
    page.route("**/report?*", lambda route: route.abort())  # as if the session had ended first
    with page.expect_event("requestfailed"):
        view.made(hostile)
    page.wait_for_timeout(300)
    assert report.locator("html[data-ready=yes]").is_visible()
    view.__exit__()
    page.get_by_text("The session has ended, 2 made").wait_for()
    assert [fault for fault in faults if "ERR_" not in fault] == []
    assert {request.method for request in requests} == {"GET"}
    assert all(request.url.startswith((view.address, "data:", "blob:")) for request in requests)
    page.close()


def kinds_on(stream):
    """Yield the kinds of events of the page whose address is printed on a stream."""
    (address,) = itertools.islice((line for line in stream if "page: open " in line), 1)
    port = int(address.partition("page: open ")[2].split()[0].rstrip("/").rpartition(":")[2])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", "/events")
    for line in iter(connection.getresponse().readline, b""):
        if line.startswith(b"data: "):
            yield json.loads(line[6:])["kind"]


def test_press_serves_the_page_and_is_undisturbed(command_server, tmp_path, bare):
    pytest.importorskip("plotly")
    words = ("press", "--scene", bare, "--seed", 1, "--warm-up", 0, "--out", "out", "--page")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with command_server.start(*words, cwd=tmp_path, **pipes) as process:
        kinds = set(kinds_on(process.stderr))
        _, message = process.communicate(timeout=100)
    assert process.returncode == 0, message
    assert {"stage", "samples", "made"} <= kinds
    assert len(list((tmp_path / "out").glob("press-*.mcap"))) == 1
    assert "warning" not in message


def test_ctrl_c_ends_watch_with_its_page(command_server, write_session, tmp_path):
    pytest.importorskip("plotly")
    write_session(tmp_path / "evening", 1)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with command_server.start("watch", "evening", "--page", cwd=tmp_path, **pipes) as process:
        kinds = kinds_on(process.stdout)  # which stays connected
        assert "report" in kinds
        process.send_signal(signal.SIGINT)
        out, message = process.communicate(timeout=100)
    assert process.returncode == 0, message
    assert "1 press in evening" in out
    assert "Traceback" not in message
