"""Foxglove's websocket protocol: channels of messages, sent to all who subscribe to them.

Source: github.com/foxglove/ws-protocol, docs/spec.md. What viewers send can only subscribe.
"""

import asyncio
import json
import logging
import re
import struct
import time
from base64 import b64encode
from collections.abc import Mapping
from concurrent.futures import Future
from threading import Thread
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from sautereau.commands.live import LOOPBACK

SUBPROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
ORIGINS = [None, "https://app.foxglove.dev", re.compile(r"(?!https?:)[a-z][a-z0-9+.-]*://.*")]
"""Who may read: programs, which state no origin or not one of the web, and Foxglove's own page.
Browsers state the origin of any other page, which is therefore refused."""
BEHIND = 1 << 22  # Byte that wait for a viewer that does not read, before it is disconnected
_QUIET = logging.getLogger(__name__)
_QUIET.disabled = True  # what strangers send is not for the operator's terminal


class Server:
    """Serves channels on the loopback, in a thread; a context manager.

    Args:
        name: Shown by the viewers.
        port: 0 for any that is free.

    Raises:
        OSError: The port is in use.
    """

    def __init__(self, name: str, port: int):
        self._info = {
            "op": "serverInfo", "name": name, "capabilities": [], "sessionId": str(time.time_ns()),
        }  # fmt: skip
        self.port = port
        self._added = 0
        self._channels: list[dict[str, Any]] = []
        self._viewers: dict[ServerConnection, dict[int, int]] = {}
        """Subscriptions of each viewer by channel."""
        self._loop: asyncio.AbstractEventLoop
        self._ended: asyncio.Event

    def __enter__(self) -> "Server":
        started: Future[int] = Future()
        self._thread = Thread(target=lambda: asyncio.run(self._serve(started)), daemon=True)
        self._thread.start()
        self.port = started.result()
        return self

    def __exit__(self, *exception: object) -> None:
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    def add(self, topic: str, schema: str, data: bytes, metadata: Mapping[str, str]) -> int:
        """Add a channel of protobuf messages, and return its number."""
        self._added += 1
        channel = {
            "id": self._added, "topic": topic, "encoding": "protobuf", "schemaName": schema,
            "schemaEncoding": "protobuf", "schema": b64encode(data).decode(),
            "metadata": dict(metadata),
        }  # fmt: skip
        self._loop.call_soon_threadsafe(self._advertise, channel)
        return self._added

    def send(self, channel: int, at: int, message: bytes) -> None:
        """Send a message to the subscribers of a channel.

        Args:
            channel: Its number.
            at: ns since 1970.
            message: Of the channel's schema.
        """
        self._loop.call_soon_threadsafe(self._send, channel, at, message)

    async def _serve(self, started: "Future[int]") -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        options: Any = {"origins": ORIGINS, "subprotocols": SUBPROTOCOLS, "logger": _QUIET}
        options |= {"compression": None, "close_timeout": 0.2, "max_size": 1 << 16}
        try:
            server = await serve(self._view, LOOPBACK, self.port, **options)
        except OSError as error:
            started.set_exception(error)
            return
        async with server:
            started.set_result(next(iter(server.sockets)).getsockname()[1])
            await self._ended.wait()

    async def _view(self, viewer: ServerConnection) -> None:
        self._tell([viewer], self._info)
        self._tell([viewer], {"op": "advertise", "channels": self._channels})
        wanted = self._viewers[viewer] = {}
        try:
            async for message in viewer:
                self._take(wanted, json.loads(message))
        except ConnectionClosed:
            pass
        except (KeyError, OverflowError, RecursionError, TypeError, ValueError):
            await viewer.close(1008, "only subscriptions are understood")
        finally:
            del self._viewers[viewer]

    def _take(self, wanted: dict[int, int], asked: Any) -> None:
        if asked["op"] == "subscribe":
            for one in asked["subscriptions"]:
                if 0 < one["channelId"] <= len(self._channels):
                    wanted[int(one["channelId"])] = int(one["id"]) % 2**32
        elif asked["op"] == "unsubscribe":
            ended = set(asked["subscriptionIds"])
            for channel in [c for c, number in wanted.items() if number in ended]:
                del wanted[channel]

    def _advertise(self, channel: dict[str, Any]) -> None:
        self._channels.append(channel)
        self._tell(list(self._viewers), {"op": "advertise", "channels": [channel]})

    def _send(self, channel: int, at: int, message: bytes) -> None:
        for viewer, wanted in self._viewers.items():
            if channel in wanted and not viewer.transport.is_closing():
                broadcast([viewer], struct.pack("<BIQ", 1, wanted[channel], at) + message)
                if viewer.transport.get_write_buffer_size() > BEHIND:
                    viewer.transport.abort()

    def _tell(self, viewers: list[ServerConnection], document: dict[str, Any]) -> None:
        broadcast(viewers, json.dumps(document))
