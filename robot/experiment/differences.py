"""Compare what a session started with to what is requested now."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sautereau.robot.errors import RobotError

MOST_LISTED = 8  # Differences that one message lists
_ABSENT = "nothing"


def check_same(folder: Path, started: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Refuse another plan than that with which a session started.

    Raises:
        RobotError: Names the differences, and the way out.
    """
    found = list(differences(started, asked))
    if not found:
        return
    more = f"\n  and {len(found) - MOST_LISTED} more" if len(found) > MOST_LISTED else ""
    raise RobotError(
        f"session folder {folder}: its session was started with another plan\n  "
        + "\n  ".join(found[:MOST_LISTED])
        + more
        + "\nto continue that session, give its original command; for a new session, another --out"
    )


def differences(started: Any, asked: Any, at: str = "") -> Iterator[str]:
    """Yield the differences of two JSON documents, by dotted key, with both values.

    A key that is missing is one without a value.
    """
    if isinstance(started, list) and isinstance(asked, list):
        started, asked = (dict(enumerate(values, 1)) for values in (started, asked))
    if isinstance(started, Mapping) and isinstance(asked, Mapping):
        for key in dict.fromkeys([*started, *asked]):
            place = f"{at}.{key}" if at else str(key)
            yield from differences(started.get(key, _ABSENT), asked.get(key, _ABSENT), place)
    elif started != asked and not (_is_missing(started) and _is_missing(asked)):
        yield f"{at}: {_shown(started)} then, {_shown(asked)} now"


def _is_missing(value: Any) -> bool:
    return value is None or value is _ABSENT


def _shown(value: Any) -> str:
    text = value if value is _ABSENT else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
