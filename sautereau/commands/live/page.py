"""A page about a session for a browser on the same machine; it can be read, and nothing else."""

import ctypes
import json
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, Full, Queue
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from sautereau.commands.live import LOOPBACK
from sautereau.rig.errors import require
from sautereau.robot.experiment.monitor import Made, Samples, Seen, Stage
from sautereau.robot.experiment.session import WARM_UPS

CONNECTIONS = 16  # At a time; further ones are closed
WAITING = 256  # Events that wait for a browser that does not read, before it is disconnected
STRETCH = 64  # Number of samples of which the smallest and the largest are drawn
KEPT = 600  # Events of the running press for browsers that come late: 60 s
NOTHING = "<!DOCTYPE html><title>no press yet</title><p>no press yet</p>"
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'self'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class PageView:
    """Serves a page about a session, with the report of its newest presses; a context manager.

    Only GET and HEAD are answered, on the loopback and to its own name, so that no page of another
    site reads it. A report that fails is named on the page, and the session continues.

    Args:
        title: Title of the page.
        level: Plectrum model of the report.

    Raises:
        MissingExtraError: The packages of the report are not installed.
    """

    def __init__(self, title: str, level: str = "auto"):
        require("report", "--page", "jinja2", "plotly")
        from sautereau.analysis.report.build import build_live

        self._level = level
        self._live = build_live(title).encode()
        self._report = NOTHING.encode()
        self._lock = threading.Lock()
        self._browsers: list[Queue[bytes | None]] = []
        self._latest: dict[str, bytes] = {}
        """The last event of each kind that has only one current value."""
        self._past: deque[bytes] = deque(maxlen=KEPT)
        self._press = 0
        self._dropped, self._watched = 0, False
        self._recordings: list[Path] = []
        self._warnings: Sequence[str] = ()
        self._new, self._ended = threading.Event(), threading.Event()

    def __enter__(self) -> "PageView":
        self._http = _Http((LOOPBACK, 0), partial(_Handler, self))
        self.address = f"http://{LOOPBACK}:{self._http.server_port}/"
        self.instruction = f"page: open {self.address} in a browser on this machine"
        """How to open the page."""
        serve = partial(self._http.serve_forever, poll_interval=0.1)
        self._threads = [threading.Thread(target=run, daemon=True) for run in (serve, self._build)]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ended.set()
        self._new.set()
        self._http.shutdown()
        self._http.server_close()
        with self._lock:
            for browser in self._browsers:
                self._end(browser)

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Send everything new since the last call to all browsers."""
        for one in seen:
            match one:
                case Stage():
                    self._begin(one.press)
                    self._send("stage", {"arm": one.arm, "daq": one.daq, "press": one.press})
                case Samples():
                    self._begin(one.press)
                    traces = [
                        (f"{channel.name} ({channel.unit})", _numbers(volts, channel.scale))
                        for channel, volts in zip(one.channels, one.block.volts, strict=True)
                    ]
                    self._send("samples", {"press": one.press, "traces": traces})
                case Made():
                    if not one.path.match(WARM_UPS):
                        self.made([*self._recordings, one.path])
                case _:
                    self._send("fault", {"text": one.text})
        if dropped != self._dropped:
            self._dropped = dropped
            self._count()

    def made(
        self, recordings: list[Path], warnings: Sequence[str] = (), *, watched: bool = False
    ) -> None:
        """Show the report of recordings, of which the newest are drawn.

        Args:
            watched: Whether another process makes them, whose state is not known.
        """
        self._recordings, self._warnings, self._watched = recordings, warnings, watched
        self._count()
        self._new.set()

    def _count(self) -> None:
        counts = {"made": len(self._recordings), "dropped": self._dropped}
        self._send("made", {**counts, "watched": self._watched})

    def _begin(self, press: int | None) -> None:
        """Forget the samples of an earlier press."""
        if press is not None and press != self._press:
            self._press = press
            with self._lock:
                self._past.clear()

    def _send(self, kind: str, event: dict[str, Any]) -> None:
        data = f"data: {json.dumps({'kind': kind, **event}, allow_nan=False)}\n\n".encode()
        with self._lock:
            if kind == "samples":
                self._past.append(data)
            else:
                self._latest[kind] = data
            for browser in list(self._browsers):
                try:
                    browser.put_nowait(data)
                except Full:
                    self._end(browser)
                    self._browsers.remove(browser)

    @staticmethod
    def _end(browser: "Queue[bytes | None]") -> None:
        with suppress(Empty):
            browser.get_nowait()
        with suppress(Full):
            browser.put_nowait(None)

    def events(self, write: Any) -> None:
        """Write events for one browser until it leaves or the session ends: first the past."""
        browser: Queue[bytes | None] = Queue(WAITING)
        with self._lock:
            past = [*self._latest.values(), *self._past]
            self._browsers.append(browser)
        try:
            write(b"retry: 2000\n\n" + b"".join(past))
            while not self._ended.is_set():
                try:
                    event = browser.get(timeout=2.0)  # s, between signs of life
                except Empty:
                    event = b": alive\n\n"
                if event is None:
                    return
                write(event)
        finally:
            with self._lock, suppress(ValueError):
                self._browsers.remove(browser)

    def answer(self, path: str) -> bytes | None:
        """Return a page; None where there is none."""
        return {"/": self._live, "/report": self._report}.get(path)

    def _build(self) -> None:
        """Make the report again whenever there are new recordings: one at a time, the newest."""
        version = 0
        while self._new.wait() and not self._ended.is_set():
            self._new.clear()
            recordings, warnings = self._recordings, self._warnings
            newest = recordings[-12:]  # Which the report shows
            try:
                from sautereau.entrance.report import page_of

                folder = newest[0].parent
                page, _ = page_of(newest, folder, warnings, self._level, newest=True)
                self._report = page.encode()
                del page, _
            except Exception as error:  # noqa: BLE001 - the page says it, the session continues
                self._send("fault", {"text": f"report: {type(error).__name__}: {error}"})
                continue
            # Otherwise glibc keeps what the build has freed, in pieces: 50 MiB after an hour.
            with suppress(AttributeError, OSError, TypeError):  # another C library; Windows
                ctypes.CDLL(None).malloc_trim(0)
            version += 1
            text = f"the newest {len(newest)} of {len(recordings)}"
            self._send("report", {"version": version, "text": text})


def _numbers(volts: np.ndarray, scale: float) -> list[float | None]:
    """Return the smallest and the largest value of every stretch, for JSON: None for NaN."""
    from sautereau.analysis.report.pictures import envelope

    values = volts[envelope(volts, 2 * len(volts) // STRETCH)] * scale
    return [float(f"{v:.4g}") if np.isfinite(v) else None for v in values.tolist()]


class _Http(ThreadingHTTPServer):
    daemon_threads, block_on_close = True, False

    def __init__(self, *given: Any):
        self._free = threading.BoundedSemaphore(CONNECTIONS)
        super().__init__(*given)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: a browser that leaves is no error of the session."""


class _Handler(BaseHTTPRequestHandler):
    timeout = 10.0  # s, for a browser to send its request or to take a part of the answer
    server_version, sys_version = "sautereau", ""

    def __init__(self, view: PageView, *given: Any):
        self._view = view
        super().__init__(*given)

    def do_GET(self) -> None:
        port = self.connection.getsockname()[1]
        if self.headers["Host"] not in {f"{name}:{port}" for name in (LOOPBACK, "localhost")}:
            self._head(403, "text/plain")  # another site's name that leads here (DNS rebinding)
            return
        path = urlsplit(self.path).path
        if path == "/events":
            self._head(200, "text/event-stream")
            if self.command == "GET":
                self._view.events(self.wfile.write)
            return
        page = self._view.answer(path)
        self._head(404 if page is None else 200, "text/html; charset=utf-8", page or b"")
        if page and self.command == "GET":
            self.wfile.write(page)

    do_HEAD = do_GET  # noqa: N815

    def _refuse(self) -> None:
        self._head(405, "text/plain")

    do_POST = do_PUT = do_PATCH = do_DELETE = do_OPTIONS = _refuse  # noqa: N815

    def _head(self, status: int, kind: str, page: bytes | None = None) -> None:
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        if page is not None:
            self.send_header("Content-Length", str(len(page)))
        if status == 405:
            self.send_header("Allow", "GET, HEAD")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: what strangers request is not for the operator's terminal."""
