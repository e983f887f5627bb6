"""A live view of a session in Foxglove, on the same machine."""

import time
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from sautereau.commands.live import LOOPBACK, LiveError
from sautereau.daq.file.log_order import Decimator
from sautereau.daq.file.recorded import Event
from sautereau.daq.file.schemas import LOG, PACKAGE, encode_log, encode_rows, schema_data
from sautereau.daq.file.survey import LAYOUT
from sautereau.rig.errors import require
from sautereau.robot.experiment.monitor import Made, Samples, Seen, Stage

PORT = 8765  # Default port of Foxglove; if it is in use, another free one is taken


class FoxgloveView:
    """Serves previews and events over Foxglove's websocket, bound to the loopback.

    Topics and messages are those of a recording, so that one layout shows both. Use it as
    a context manager.

    Raises:
        MissingExtraError: The package is not installed.
        LiveError: No port is free.
    """

    def __init__(self, title: str, port: int = PORT):
        require("live", "--live", "websockets")
        self._title, self._port = title, port
        self._server: Any = None
        self._channels: dict[str, int] = {}
        self._press, self._dropped = 0, 0
        self._t0, self._first = 0, 0
        self._decimator: Any = None

    @property
    def port(self) -> int:
        """Port of the server."""
        return self._server.port

    @property
    def instruction(self) -> str:
        """How to connect Foxglove."""
        return (
            f"live: in Foxglove, open the connection ws://{LOOPBACK}:{self.port} and the layout"
            f" {LAYOUT}"
        )

    def __enter__(self) -> "FoxgloveView":
        from sautereau.commands.live.server import Server

        for port in (self._port, 0):
            try:
                self._server = Server(self._title, port).__enter__()
                return self
            except OSError as error:
                if port == 0:
                    raise LiveError(
                        f"--live: no port of {LOOPBACK} is free: {error}; press without --live"
                    ) from error
        return self

    def __exit__(self, *exception: object) -> None:
        self._server.__exit__()

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Send everything new since the last call to all connected viewers."""
        for one in seen:
            match one:
                case Samples():
                    self._send(one)
                case Stage():
                    self._event("state", f"arm {one.arm}, acquisition {one.daq}")
                case Made():
                    self._event("recorded", one.path.name)
                case _:
                    self._event("fault", one.text)
        if dropped != self._dropped:
            self._dropped = dropped
            self._event("dropped", f"{dropped} events are not shown")

    def _send(self, samples: Samples) -> None:
        block, channels = samples.block, samples.channels
        if samples.press != self._press or self._decimator is None:
            self._press = samples.press
            last = block.first_sample + block.n_samples
            self._t0 = time.time_ns() - round(last / samples.rate * 1e9)
            self._first = block.first_sample
            self._decimator = Decimator(samples.rate, len(channels))
        places, values = self._decimator.feed(block.volts)
        names = [channel.name for channel in channels]
        units = {channel.name: channel.unit for channel in channels}
        topic = self._topic("/preview", f"{PACKAGE}.Preview", names, units)
        columns = [row * channel.scale for channel, row in zip(channels, values, strict=True)]
        for place, row in zip(places.tolist(), encode_rows(columns), strict=True):
            at = self._t0 + round((self._first + place) / samples.rate * 1e9)
            self._server.send(topic, at, row)

    def _event(self, kind: str, text: str) -> None:
        now = time.time_ns()
        since_start = (now - self._t0) / 1e9 if self._t0 else 0.0
        event = encode_log(now, Event(since_start, kind, text))
        self._server.send(self._topic("/events", LOG), now, event)

    def _topic(
        self,
        name: str,
        message: str,
        rows: Sequence[str] = (),
        metadata: Mapping[str, str] = MappingProxyType({}),
    ) -> int:
        if name not in self._channels:
            data = schema_data({"Preview": rows})
            self._channels[name] = self._server.add(name, message, data, metadata)
        return self._channels[name]
