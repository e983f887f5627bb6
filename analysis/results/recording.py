"""The description of a recording as text."""

import json
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime

from sautereau.analysis.text import counted, rounded
from sautereau.daq.file.recorded import UNCHECKED
from sautereau.daq.file.survey import Description
from sautereau.rig.units import readable_quantity

_NO_VALUES = ("what", "unit", "rate", "type", "channels", "channel")
"""First words of the keys of a topic that are not names of its values."""


def recording_lines(found: Description) -> list[str]:
    """Return a recording as text: a line for each fact, then its channels, topics and events."""
    lines = [f"{'SIMULATED' if found['simulated'] else 'measured'}: {found['path']}"]
    lines += [f"{name + ':':<12} {text}" for name, text in _facts(found)]
    lines += ["channels:", *(f"  {text}" for text in _channels(found["channels"]))]
    lines += ["topics:"]
    for topic, about in found["channels"].items():
        if not found["messages"][topic]:
            continue
        values = [f"{n} [{v}]" for n, v in about.items() if n.split()[0] not in _NO_VALUES]
        texts = [counted(found["messages"][topic], "message"), about.get("what", "")]
        lines.append(f"  {topic}: {'; '.join(filter(None, [*texts, ', '.join(values)]))}")
    return [*lines, "events:", *(f"  {event}" for event in found["events"] or ["none"])]


def _facts(found: Description) -> Iterator[tuple[str, str]]:
    """Yield name and text of each fact that is known."""
    session = found["session"]
    yield "file", f"{_short(found['size'], 'B')}, {'' if found['complete'] else 'in'}complete"
    if found["damage"]:
        yield "damage", found["damage"]
    if not found["checked"]:
        yield "checksums", UNCHECKED
    if found["recovered"]:
        yield "recovered", f"from {found['recovered']['from']}; {found['recovered']['damage']}"
    yield "rig", found["rig"]
    for name in ("started", "press", "session", "item", "controller", "daq", "seed", "notes"):
        if session[name] not in ("", "0"):
            yield name, session[name]
    if session["warm_up"] == "true":
        yield "warm-up", "excluded from all results"
    if session["scene"]:
        about = "not readable"
        with suppress(ValueError, AttributeError):
            about = json.loads(session["scene"]).get("description") or "without description"
        yield "scene", f"{about}; --json shows all its settings"
    if found["rate"] is not None and found["t0_ns"] is not None:
        first = found["first_sample"] / found["rate"]
        yield (
            "samples",
            f"{found['n_samples']} of each channel at {found['rate']:.9g} Hz,"
            f" {_short(found['duration'], 's')}; the first is {_short(first, 's')} after the"
            " trigger",
        )
        date = datetime.fromtimestamp(found["t0_ns"] * 1e-9, UTC).isoformat(timespec="milliseconds")
        std = found["t0_std"]
        spread = "" if std is None else f", standard uncertainty {_short(std, 's', 2)}"
        yield "trigger", f"{date} by the clock of the computer{spread}"
    for gap in found["missing"]:
        end = "an unknown end" if gap["stop"] is None else f"{gap['stop'] * 1e3:.6g} ms"
        yield "missing", f"{gap['channel']}, {gap['start'] * 1e3:.6g} ms to {end} after the trigger"
    yield "software", ", ".join(f"{name} {version}" for name, version in found["software"].items())
    yield "layout", f"{found['layout']} (for Foxglove)"


def _short(value: float, unit: str, digits: int = 4) -> str:
    return readable_quantity(float(f"{value:.{digits}g}"), unit)


def _channels(topics: dict[str, dict[str, str]]) -> Iterator[str]:
    """Yield sensor and settings of each channel, except settings of which nothing is stated."""
    for about in topics.values():
        for key, text in about.items():
            if key.startswith("channel "):
                facts = json.loads(text)
                name, sensor = facts.pop("name", key), facts.pop("sensor", "unknown sensor")
                settings = [
                    f"{setting.replace('_', ' ')} {rounded(value)}"
                    for setting, value in facts.items()
                    if value not in ("", "default")
                ]
                yield f"{name}: {sensor}; {', '.join(settings)}"
