"""Live views of a session: in the terminal, and in Foxglove over its websocket."""

import contextlib
import io
import itertools
import json
import socket
import struct
import sys
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sautereau.commands.live import LiveError
from sautereau.commands.live.process import watching
from sautereau.commands.live.terminal import TerminalView
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.schemas import schema_data
from sautereau.daq.file.survey import LAYOUT
from sautereau.rig.errors import MissingExtraError
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.monitor import Fault, Made, Samples, Stage
from tests.daq.declared import declared_class

RIG = load_rig()
RATE = 51_200.0


PATIENT = 100.0  # s, after which a test fails that would wait forever
WAITS = (
    "commands.live.process.START_TIMEOUT",
    "commands.live.process.END_TIMEOUT",
    "robot.experiment.monitor.PATIENCE",
)


def samples(press=1, first=0, n=1024):
    time = (first + np.arange(n)) / RATE
    return Samples(
        press, RIG.daq.channels, RATE, Block(first, np.stack([np.sin(9 * time), np.cos(9 * time)]))
    )


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=100, height=40)


def test_the_terminal_shows_state_traces_and_faults():
    console = terminal()
    with TerminalView("rig paper on the stand-in: SIMULATED", console) as view:
        view.show([Stage("moving", "reading", 7), samples(7), Made(7, Path("x"))], 0)
        view.show([Fault("joint 1 is off its plan\x1b[2J")], 3)
        view.show([], 3)
    text = console.file.getvalue()
    for shown in ("SIMULATED", "moving", "reading", "force (N)", "velocity (m/s)", "⠤"):
        assert shown in text
    last = text[text.rindex("╭") :]
    assert "joint 1 is off its plan?[2J" in last
    assert "3 events are not shown" in last


def test_the_terminal_shows_traces_with_nan():
    console = terminal()
    one = samples()
    one.block.samples[0] = np.nan
    with TerminalView("rig", console) as view:
        view.show([Stage("moving", "reading", 1), one], 0)
    assert "velocity (m/s): nothing" in console.file.getvalue()


def test_a_new_press_starts_a_new_trace():
    view = TerminalView("rig", terminal())
    view.show([Stage("moving", "reading", 1), samples(1), samples(1, 1024)], 0)
    assert {len(parts) for parts in view._traces.values()} == {2}
    view.show([Stage("loading", "idle", 2)], 0)
    assert view._traces == {}


@pytest.fixture
def foxglove():
    pytest.importorskip("websockets")
    from sautereau.commands.live.foxglove import FoxgloveView

    return FoxgloveView


def connected(view, **more):
    from websockets.sync.client import connect

    options = {"subprotocols": ["foxglove.sdk.v1"], "proxy": None, "close_timeout": 0.2}
    options["open_timeout"] = PATIENT
    return connect(f"ws://127.0.0.1:{view.port}", **options, **more)


def received(view, show, topics):
    """Connect as Foxglove does, subscribe to all, and return the messages of each topic."""
    channels, found = {}, {}
    with connected(view) as client:
        while not topics <= set(channels.values()) or sum(map(len, found.values())) == 0:
            message = client.recv(timeout=PATIENT)
            if isinstance(message, str):
                operation = json.loads(message)
                if operation["op"] == "serverInfo":
                    show()
                if operation["op"] == "advertise":
                    ids = {c["id"]: c["topic"] for c in operation["channels"]}
                    channels |= ids
                    asked = [{"id": number, "channelId": number} for number in ids]
                    client.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
                    if topics <= set(channels.values()):
                        break
        while not topics <= set(found):
            try:
                message = client.recv(timeout=1.0)
            except TimeoutError:  # the server does not say when it has read the subscriptions
                show()
                continue
            if isinstance(message, bytes) and message[0] == 1:
                number, at = struct.unpack_from("<IQ", message, 1)
                found.setdefault(channels[number], []).append((at, message[13:]))
    return found


def last(viewer):
    """Read until the connection ends."""
    while True:
        viewer.recv(timeout=PATIENT)


def until_subscribed(view, viewer):
    """Show events until the first arrives: a pong may be sent before a subscription is taken."""
    while True:
        view.show([Fault("oh")], 0)
        with contextlib.suppress(TimeoutError):
            if isinstance(viewer.recv(timeout=0.05), bytes):
                return


@pytest.mark.slow
def test_foxglove_sees_previews_and_events(foxglove):
    """An independent client reads our messages, under the topic names of the layout."""
    topics = {"/preview", "/events"}
    with foxglove("rig", port=0) as view:
        numbers = itertools.count(1)

        def show():
            press = next(numbers)
            blocks = [samples(press, first) for first in range(0, 8192, 1024)]
            view.show([Stage("moving", "reading", press), *blocks, Fault("oh")], 0)

        found = received(view, show, topics)
    at, data = found["/preview"][0]
    scale = RIG.daq.channel("force").scale
    schema = schema_data({"Preview": [channel.name for channel in RIG.daq.channels]})
    row = declared_class(schema, "sautereau.Preview").FromString(data)
    assert 0 < abs(row.force) <= abs(scale) * 1.01
    assert at > 10**18
    event = declared_class(schema, "foxglove.Log").FromString(found["/events"][0][1])
    assert (event.name, event.message) == ("state", "arm moving, acquisition reading")
    layout = LAYOUT.read_text(encoding="utf-8")
    assert all(topic in layout for topic in topics)


def test_foxglove_is_served_on_the_loopback_alone(foxglove):
    with foxglove("rig", port=0) as view:
        table = Path("/proc/net/tcp")
        if not table.exists():
            pytest.skip("only Linux lists the listening sockets")
        listening = [line.split()[1] for line in table.read_text(encoding="utf-8").splitlines()[1:]]
        own = [a for a in listening if a.endswith(f":{view.port:04X}")]
        assert "0100007F:" + f"{view.port:04X}" in own
        assert not [a for a in own if a.startswith("00000000:")]


@pytest.mark.parametrize(
    ("origin", "served"),
    [
        (None, True),
        ("https://app.foxglove.dev", True),
        ("file://", True),
        ("app://foxglove", True),
        ("null", False),
        ("http://localhost:3000", False),
        ("https://app.foxglove.dev.example.org", False),
    ],
)
def test_other_web_pages_cannot_read_the_live_view(foxglove, origin, served):
    from websockets.exceptions import InvalidStatus

    with foxglove("rig", port=0) as view:
        if served:
            with connected(view, origin=origin) as viewer:
                assert json.loads(viewer.recv(timeout=PATIENT))["name"] == "rig"
        else:
            with pytest.raises(InvalidStatus, match="403"), connected(view, origin=origin):
                pass


@pytest.mark.parametrize(
    "message",
    ["", "[", "{}", '{"op": "subscribe"}', b"\0\xff", "[" * 60_000,
     '{"op": "subscribe", "subscriptions": [{"id": Infinity, "channelId": 1}]}'],
)  # fmt: skip
def test_what_is_no_subscription_ends_a_viewer_and_no_other(foxglove, message):
    from websockets.exceptions import ConnectionClosed

    with foxglove("rig", port=0) as view, connected(view) as other:
        # Only then does the server know it: the handshake ends before.
        told = [json.loads(other.recv(timeout=PATIENT))["op"] for _ in range(2)]
        view.show([Fault("oh")], 0)
        with connected(view) as viewer:
            viewer.send(message)
            with pytest.raises(ConnectionClosed):
                last(viewer)
        told.append(json.loads(other.recv(timeout=PATIENT))["op"])
        assert told == ["serverInfo", "advertise", "advertise"]


def test_a_viewer_that_does_not_read_is_disconnected(foxglove, monkeypatch):
    from websockets.exceptions import ConnectionClosed

    from sautereau.commands.live import server

    monkeypatch.setattr(server, "BEHIND", 100_000)
    with foxglove("rig", port=0) as view, socket.socket() as small:
        small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 10_000)  # or it may take all
        small.connect(("127.0.0.1", view.port))
        with connected(view, sock=small) as viewer:
            viewer.recv(timeout=PATIENT)  # now the server knows it
            view.show([Fault("oh")], 0)
            asked = [{"id": 1, "channelId": 1}]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            until_subscribed(view, viewer)
            for _ in range(200):
                view.show([Fault("x" * 100_000)], 0)
            with connected(view):  # which the server answers after it has sent all that
                pass
            with pytest.raises(ConnectionClosed):
                last(viewer)


def test_a_port_that_is_taken_is_no_hindrance(foxglove):
    with foxglove("rig", port=0) as first, foxglove("rig", port=first.port) as second:
        assert second.port != first.port


def test_without_the_package_it_says_what_to_install(foxglove, monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'sautereau\[live\]'"):
        foxglove("rig")


@pytest.fixture
def patient(monkeypatch):
    """Let the session wait until its views have started, and shown everything."""
    for name in WAITS:
        monkeypatch.setattr(f"sautereau.{name}", PATIENT)


@pytest.mark.usefixtures("patient")
def test_the_views_run_in_their_own_process(capfd, monkeypatch):
    """What is printed during a view is shown after it."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stdout", screen)
    with watching("rig paper", ["view"]) as watch:
        watch(Stage("moving", "reading", 7))
        watch(samples(7))
        sys.stdout.write("press-0001.mcap\n")
        watch(Fault("the lid was open"))
        assert screen.getvalue() == ""
    assert screen.getvalue() == "press-0001.mcap\n"
    shown = capfd.readouterr().err
    assert "see below" in shown
    assert "force (N)" in shown
    assert "the lid was open" in shown


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_views_that_are_killed_stop_nothing_and_are_reported(capsys):
    with watching("rig", ["view"]) as watch:
        for process in active_children():
            if process.name == "live view":
                process.kill()
                process.join()
        watch(Fault("a"))
    printed = capsys.readouterr().err
    assert "warning: live view: ViewProcess: LiveError: its process has ended" in printed


@pytest.mark.usefixtures("patient")
def test_views_that_cannot_start_refuse_the_session(monkeypatch):
    """A process that ends at the start, before any press."""
    monkeypatch.setattr("sautereau.commands.live.process._run", int)
    with (
        pytest.raises(LiveError, match="ended at the start; press without"),
        watching("rig", ["view"]),
    ):
        pass


def test_there_is_no_view_by_default():
    with watching("rig", []) as watch:
        assert watch(Fault("a")) is None


@pytest.mark.slow
def test_presses_are_recorded_and_reported_under_a_view(sautereau, bare, rig_file):
    """`--json` stays one object beside a view."""
    words = ["press", str(rig_file()), "-n", "2", "--scene", str(bare), "--out", "out", "--view"]
    program = "\n".join(
        [
            "import sys",
            *(f"import sautereau.{name.rpartition('.')[0]}" for name in WAITS),
            *(f"sautereau.{name} = {PATIENT}" for name in WAITS),
            f"sys.argv = ['sautereau', *{words}, '--json']",
            "from sautereau.commands.app import main",
            "main()",
        ]
    )
    ran = sautereau("-c", program)
    assert ran.returncode == 0, ran.stderr
    assert len(json.loads(ran.stdout)["recordings"]) == 2
    assert "SIMULATED" in ran.stderr
    assert "made 2" in ran.stderr
