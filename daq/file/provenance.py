"""The metadata at the start of a recording: topics, rig, software, session, schemas."""

import base64
import json
import platform
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

from mcap.records import Channel, Schema

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import McapWriter
from sautereau.daq.file.container.records import LARGEST_DEFINITIONS
from sautereau.daq.file.log_order import ATTENUATION, PASS_BAND, Decimator
from sautereau.daq.file.recorded import SessionInfo
from sautereau.daq.file.samples import TOPIC, SampleLayout, sample_layout
from sautereau.daq.file.schemas import (
    FORMAT_1,
    LOG,
    MOTION,
    PACKAGE,
    SCENE,
    TRANSFORMS,
    schema_data,
    schema_of,
)
from sautereau.rig.document import rig_document, rig_json
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import shown
from sautereau.rig.version import made_by

PROFILE = "sautereau"  # Profile in the header of sautereau's MCAP files
HEAD = ("channels", "rig", "software", "session", "schemas")
"""Metadata records at the start of a recording."""
LARGEST_HEAD = LARGEST_DEFINITIONS // 2
"""Limit in bytes for one copy of them. The rest of what readers accept is for the metadata at the
end: those of a recovery list what is missing."""
LIBRARIES = ("sautereau", "numpy", "scipy", "nidaqmx", "grpcio", "pyserial", "mcap", "protobuf")
"""Distributions whose versions are recorded."""


FORMAT = "2"
"""Format of the recordings that are written. Recordings of format 1 do not state a format."""


class Head(NamedTuple):
    """What the start of a recording says."""

    metadata: dict[str, dict[str, str]]
    """Entries of the Metadata records, by their names."""
    topics: dict[str, int]
    """Number of the MCAP channel, by topic."""


def check_recordable(rig: Rig, notes: str, scene: str = "") -> None:
    """Refuse a press whose recording could not be read, before it is made.

    Raises:
        RecordingError: As `head_of`.
    """
    names = [channel.name for channel in rig.daq.channels]
    session = SessionInfo(1, "", False, "", "", scene, notes=notes)
    head_of(rig, session, rig.daq.sample_rate, sample_layout(names, None))


def head_of(rig: Rig, session: SessionInfo, rate: float, layout: SampleLayout) -> Head:
    """Return the metadata of a recording.

    Channel and Schema records are only in the first chunk and in the summary, so the Metadata
    records `channels` and `schemas` repeat them for the recovery of a damaged file.

    Raises:
        RecordingError: They are longer than `LARGEST_HEAD`, or a text is not UTF-8.
    """
    topics = list(enumerate(_topics(rig, rate, layout), 1))
    rows = {"Preview": layout.names, "Motion": MOTION}
    head = {
        "channels": {
            topic: json.dumps({"id": id_, "schema": message, "metadata": metadata})
            for id_, (topic, message, metadata) in topics
        },
        "rig": {"name": rig.name, "json": rig_json(rig)},
        "software": software(),
        "session": session.to_metadata(),
        "schemas": {
            "format": FORMAT,
            "names": " ".join(dict.fromkeys(message for _, (_, message, _) in topics)),
            "protobuf": base64.b64encode(schema_data(rows)).decode("ascii"),
        },
    }
    if faults := list(_head_faults(head)):
        raise RecordingError(fault_list("recording", faults))
    return Head(head, {topic: id_ for id_, (topic, _, _) in topics})


def _head_faults(head: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Yield why readers would refuse metadata."""
    sizes = Counter[str]()
    for name, values in head.items():
        for key, text in values.items():
            try:
                # Each channel has a record of its own besides the metadata.
                sizes[f"{name} {key}"] = len(text.encode()) * (2 if name == "channels" else 1)
            except UnicodeEncodeError as error:
                yield (
                    f"{name} {key}: {shown(text)} is not UTF-8 at character"
                    f" {error.start + 1}; write it in UTF-8"
                )
    if (size := sizes.total()) > LARGEST_HEAD:
        largest = ", ".join(f"{name} {n} bytes" for name, n in sizes.most_common(2))
        yield (
            f"its metadata have {size} bytes ({largest}), more than LARGEST_HEAD ="
            f" {LARGEST_HEAD}; shorten the notes, or give press.gesture fewer points"
        )


def start_head(writer: McapWriter, head: dict[str, dict[str, str]]) -> None:
    """Start a file with Metadata records and the definitions that they repeat."""
    data = base64.b64decode(head["schemas"]["protobuf"])
    names = head["schemas"].get("names", " ".join(f"{PACKAGE}.{name}" for name in FORMAT_1))
    schemas = {name: number for number, name in enumerate(names.split(), 1)}
    channels = []
    for topic, text in head["channels"].items():
        number, _, metadata = channel_from_json(topic, text)
        schema = schemas[json.loads(text)["schema"]]
        channels.append(Channel(number, topic, "protobuf", metadata, schema))
    writer.begin(
        PROFILE,
        [
            *(Schema(n, schema_of(name, data), "protobuf", name) for name, n in schemas.items()),
            *channels,
        ],
    )
    for copy in (False, True):  # one survives damage to the other
        for name, values in head.items():
            writer.add_metadata(name, values, copy=copy)


@lru_cache(maxsize=64)
def channel_from_json(topic: str, text: str) -> tuple[int, str, dict[str, str]]:
    """Return number, topic and metadata of a channel from its entry in the record `channels`.

    The last ones are kept, as by `read_metadata`.

    Raises:
        ValueError: It is not such an entry.
    """
    try:
        values = json.loads(text)
        number, metadata = values["id"], values["metadata"]
        texts = all(isinstance(value, str) for value in metadata.values())
        if texts and type(number) is int and 0 <= number < 2**16:
            return number, topic, metadata
    except (KeyError, TypeError, AttributeError, RecursionError):
        pass
    raise ValueError(f"{shown(text)} does not describe the channel {shown(topic)}")


@cache
def software() -> dict[str, str]:
    """Return the versions of Python, of sautereau with its code, and of the libraries in use."""
    versions = {"python": platform.python_version()}
    for name in LIBRARIES:
        try:
            versions[name] = made_by() if name == "sautereau" else version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _topics(
    rig: Rig, rate: float, layout: SampleLayout
) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Yield topic, message and metadata of every topic."""
    calibrations = [
        {key: "" if value is None else str(value) for key, value in document.items()}
        for document in rig_document(rig.daq)["channels"]
    ]
    samples = {
        "unit": "V",
        "rate": f"{rate!r} Hz",
        "what": "samples of one channel after the other",
    }
    yield TOPIC, f"{PACKAGE}.Block", {**samples, **layout.metadata(calibrations)}
    preview = Decimator(rate, len(rig.daq.channels))
    half = rate / preview.factor / 2
    what = (
        f"low-pass filtered, decimated by {preview.factor}, scaled: accurate to 0.2 % up to"
        f" {2 * PASS_BAND * half:.4g} Hz, {ATTENUATION:g} dB attenuation from {half:.4g} Hz up; it"
        f" starts and ends {preview.margin / rate * 1e3:.3g} ms inside the recording; neither the"
        " AC coupling nor the delay is corrected"
    )
    units = {channel.name: channel.unit for channel in rig.daq.channels}
    yield "/preview", f"{PACKAGE}.Preview", {"what": what, **units}
    yield "/events", LOG, {"time": "s after the trigger", "std": "s", "what": "what happened"}
    angles = {"t": "s", "q1": "rad", "q2": "rad"}
    captured = {**angles, "e1": "rad", "e2": "rad", "m1": "N m", "m2": "N m"}
    yield "/plan", f"{PACKAGE}.Plan", {**angles, "jack_rise": "m", "what": "planned motion"}
    yield "/joints", f"{PACKAGE}.Joints", {**captured, "what": "on the controller's clock"}
    yield "/motion", f"{PACKAGE}.Motion", {**captured, "what": "the joints, for viewers"}
    yield "/scene", SCENE, {"what": "arm, key and jack, for viewers"}
    yield "/transforms", TRANSFORMS, {"what": "links of the URDF of the rig, for viewers"}
