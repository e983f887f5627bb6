"""The bytes between host and emulated controller, as `--log` of a command writes them."""

import ast
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.golden.corpus import Corpus

FIRST = 20  # Messages that are stored as they are; of all messages there is a hash
_TRAFFIC = re.compile(r"serial_port: \S+ (sent|received) (b['\"].*)$")
_KEEP_ALIVE = re.compile(rb"MG wsign,")
"""Start of the renewal of the watchdog, which a thread sends by the clock of this machine."""


def traffic(corpus: Corpus, command: str) -> dict[str, Any]:
    """Return the messages in both directions of a command on the bench, without keep-alive.

    How many bytes the system passes at once varies, so what is received between two sent messages
    is one message. Renewals of the watchdog are counted by the real clock: their number is not
    stored, but their text.
    """
    corpus.answer(command, as_json=True)
    messages, renewals, skipping = [], set(), False
    for sent, data in _messages(corpus.folder / "json" / command / "log.txt"):
        skipping = bool(_KEEP_ALIVE.match(data)) if sent else skipping
        if skipping and sent:
            renewals.add(data.decode("latin-1"))
        elif not skipping:
            messages.append(f"{'>' if sent else '<'} {data.decode('latin-1')}")
    text = "\n".join(messages)
    return {
        "messages": len(messages),
        "bytes": len(text) - 3 * len(messages) + 1,
        "sha": hashlib.sha256(text.encode("latin-1")).hexdigest(),
        "keep-alive": sorted(renewals),
        "first": messages[:FIRST],
    }


def _messages(path: Path) -> Iterator[tuple[bool, bytes]]:
    """Yield whether the host sent a message, and its bytes."""
    received = b""
    for line in path.read_text(encoding="utf-8").splitlines():
        if found := _TRAFFIC.search(line):
            data = ast.literal_eval(found[2])
            if found[1] == "received":
                received += data
                continue
            if received:
                yield False, received
                received = b""
            yield True, data
    if received:
        yield False, received
