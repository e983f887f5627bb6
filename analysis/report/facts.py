"""The report's texts: warnings, conditions of the presses, software; and how texts are cleaned."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.report.contents import Contents, PressRecord
from sautereau.analysis.text import visible
from sautereau.daq.file.provenance import software as software_here
from sautereau.rig.acquisition import Channel
from sautereau.rig.capabilities import capabilities_of
from sautereau.rig.document import rig_document
from sautereau.rig.schema import Rig
from sautereau.rig.units import readable_quantity

MOST_LISTED = 40  # Entries of one list on the page
MOST_EVENTS = 10  # Events of one recording on the page

Facts = list[tuple[str, str]]


def cleaned(value: Any, most: int = 500) -> Any:
    """Return a text with invisible characters written out, and shortened if it is too long.

    The template escapes it. Markup, and values that are not texts, are returned unchanged.
    """
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    kept = visible(value[:most], "\n\t")
    return kept if len(value) <= most else f"{kept} … ({len(value):,} characters in total)"


def warnings(contents: Contents, of_session: Sequence[str]) -> Facts:
    """Return all warnings, of the session, of unreadable recordings and of presses.

    Each has the text of the presses that it applies to, which is empty for the session.
    """
    found = [(text, "") for text in of_session]
    found += [
        (f"{path.name} could not be read: {why}", "") for path, why in contents.unread.items()
    ]
    for number, condition in enumerate(contents.conditions, 1):
        where = f"condition {number}" if len(contents.conditions) > 1 else ""
        found += [(text, where) for text in condition.warnings]
    same: dict[str, list[int]] = {}
    for record in contents.presses:
        for text in record.warnings:
            same.setdefault(text, []).append(record.number)
    return found + [(text, f"press {_numbers(n)}") for text, n in same.items()]


def how_pressed(contents: Contents, warm_ups: int = 0) -> Facts:
    """Return how the presses of the first condition were made.

    Args:
        warm_ups: Warm-up presses that are not on the page.
    """
    presses = contents.presses
    rig, first = contents.conditions[0].rig, presses[0].session
    document = rig_document(rig)
    press = "replay of a recorded gesture"
    if rig.press.gesture is None:
        names = ("jack_speed", "jack_rise", "hold", "run_up_acceleration", "settle")
        press = _listed(document["press"], names)
    warm_up = sum(record.session.warm_up for record in presses)
    made = f"{len(presses)}" + (f", {warm_up} of them warm-up" if warm_up else "")
    made += f", and {warm_ups} for warm-up that are not on this page" if warm_ups else ""
    dates = sorted(record.session.started for record in presses if record.session.started)
    facts = [
        ("rig", rig.name),
        ("presses", made),
        ("date", " to ".join(dict.fromkeys([*dates[:1], *dates[-1:]]))),
        ("press", press),
        ("key", _listed(document["key"], ("press_arm", "laser_arm", "jack_arm", "inertia"))),
        *_strings(rig, document),
        ("controller", _different(record.session.controller for record in presses)),
        ("motion", _moved(rig) if any(record.press.motion for record in presses) else ""),
        ("acquisition", _different(record.session.daq for record in presses)),
        ("rate", f"{presses[0].press.rate:g} Hz"),
    ]
    for channel in rig.daq.channels[:MOST_LISTED]:
        facts.append((f"channel {channel.name}", channel.sensor))
        facts.append((f"corrected in {channel.name}", corrections(channel)))
    facts += [
        ("session", _different(record.session.session for record in presses)),
        ("notes", _different(record.session.notes for record in presses)),
    ]
    if first.seed is not None:
        facts.append(("seed", _different(str(record.session.seed) for record in presses)))
    return [(name, value) for name, value in facts if value]


def _strings(rig: Rig, document: Mapping[str, Any]) -> Facts:
    """Return plectrum and string of every jack; of several strings with the string's name."""
    found, names = [], string_names(rig)
    for name, of in zip(names, [document, *document.get("more_choirs", ())], strict=True):
        which = ("plectrum", "string") if len(names) == 1 else (f"plectrum of {name}", name)
        arm = _listed(of, ("jack_arm",)) + ", " if "jack_arm" in of else ""
        plectrum = _listed(of["plectrum"], ("length", "width", "thickness", "overlap"))
        string = _listed(of["string"], ("frequency", "tension", "length", "diameter"))
        found += zip(which, (arm + plectrum, string), strict=True)
    return found


def corrections(channel: Channel) -> str:
    """Return what a loaded press no longer has of a channel: its delays and its AC coupling."""
    delays = {
        "sensor": channel.delay,
        "input": channel.input_delay,
        "low-pass": channel.lag - channel.delay - channel.input_delay,
    }
    found = [f"delay of the {of} {value * 1e6:.4g} µs" for of, value in delays.items() if value]
    if channel.high_pass:
        found.append(f"AC coupling of {channel.high_pass:.3g} Hz")
    return ", ".join(found)


def _moved(rig: Rig) -> str:
    """Return how the controller moves the arm and records it."""
    can = capabilities_of(rig)
    return (
        f"{'played by the controller' if can.preloaded else 'streamed by the computer'},"
        f" {rig.arm.resolution * 1e6:.3g} µm at the fingertip for each count of the encoders, up to"
        f" {can.capture_rate(rig.controller.sample_period):.4g} of their readings per second;"
        f" {'an edge at its start' if can.trigger_output else 'its start found in the samples'}"
    )


def of_recording(record: PressRecord) -> Facts:
    """Return the facts about one recording."""
    session = record.session
    events = [
        f"{e.time * 1e3:.3f}{f' +- {e.std * 1e3:.3f}' if e.std else ''} ms {e.kind}: {e.text}"
        for e in record.events
    ]
    listed = events[:MOST_EVENTS]
    if len(events) > MOST_EVENTS:
        listed.append(f"and {len(events) - MOST_EVENTS} more")
    facts = [
        ("start", session.started),
        ("made by", "the stand-in: SIMULATED" if session.simulated else "the hardware"),
        ("notes", session.notes),
        *(("event", text) for text in listed),
        *(("warning", text) for text in record.warnings[:MOST_EVENTS]),
        *(("remark", text) for text in record.remarks[:MOST_EVENTS]),
        ("SHA-256", record.digest),
    ]
    return [(name, value) for name, value in facts if value]


def software(presses: Sequence[PressRecord]) -> list[tuple[str, str, str]]:
    """Return name, versions of the recordings, and version that generated this page."""
    here = software_here()
    names = dict.fromkeys([*here, *(name for record in presses for name in record.software)])
    rows = [
        (name, _different(record.software.get(name, "") for record in presses), here.get(name, ""))
        for name in list(names)[:MOST_LISTED]
    ]
    if len(names) > MOST_LISTED:
        rows.append((f"and {len(names) - MOST_LISTED} more", "", ""))
    return rows


def _listed(values: Mapping[str, Any], names: Iterable[str]) -> str:
    given = [name for name in names if values.get(name) is not None]
    return ", ".join(f"{name.replace('_', ' ')} {_read(values[name])}" for name in given)


def _read(quantity: object) -> str:
    """Return a quantity with readable digits and unit; the rig file has all digits."""
    number, _, unit = str(quantity).partition(" ")
    try:
        return readable_quantity(float(number), unit)
    except ValueError:
        return str(quantity)


def _different(values: Iterable[str]) -> str:
    """Return the distinct values."""
    found = list(dict.fromkeys(value for value in values if value))
    more = f"; and {len(found) - MOST_EVENTS} more" if len(found) > MOST_EVENTS else ""
    return "; ".join(found[:MOST_EVENTS]) + more


def _numbers(numbers: list[int]) -> str:
    """Return numbers as a list of ranges: 1 to 4, 7."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        elif not runs or number != runs[-1][1]:
            runs.append([number, number])
    return ", ".join(f"{a}" if a == b else f"{a} to {b}" for a, b in runs)
