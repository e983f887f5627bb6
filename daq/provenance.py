"""What stands at the head of a recording: topics, rig, software, session, schemas."""

import base64
import json
import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version

from mcap.writer import Writer

from daq.preview import Decimator
from daq.schemas import FIELDS, PACKAGE, schema_data
from daq.session_info import SessionInfo
from rig.load import rig_document, rig_json
from rig.schema import Rig

PROFILE = "sautereau"
"""Profile in the header of our MCAP files."""
LIBRARIES = ("sautereau", "numpy", "scipy", "nidaqmx", "grpcio", "pyserial", "mcap", "protobuf")
"""Distributions whose versions are written."""


def write_head(writer: Writer, rig: Rig, session: SessionInfo, rate: float) -> dict[str, int]:
    """Write the header and the Metadata records, and register the topics.

    Channel and schema records stand only in the first chunk and in the summary, so the
    Metadata records `channels` and `schemas` repeat them for a damaged file.

    Returns:
        The MCAP channel's number of each topic.
    """
    writer.start(profile=PROFILE)
    data = schema_data()
    schemas = {
        name: writer.register_schema(f"{PACKAGE}.{name}", "protobuf", data) for name in FIELDS
    }
    numbers: dict[str, int] = {}
    definitions: dict[str, str] = {}
    for topic, message, metadata in _topics(rig, rate):
        numbers[topic] = writer.register_channel(topic, "protobuf", schemas[message], metadata)
        definition = {"id": numbers[topic], "schema": f"{PACKAGE}.{message}", "metadata": metadata}
        definitions[topic] = json.dumps(definition)
    writer.add_metadata("channels", definitions)
    writer.add_metadata("rig", {"name": rig.name, "json": rig_json(rig)})
    writer.add_metadata("software", software())
    writer.add_metadata("session", session.to_metadata())
    writer.add_metadata("schemas", {"protobuf": base64.b64encode(data).decode("ascii")})
    return numbers


def software() -> dict[str, str]:
    """Return the versions of python and of the libraries that made the recording."""
    versions = {"python": platform.python_version()}
    for name in LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _topics(rig: Rig, rate: float) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Yield topic, message and metadata of every topic."""
    documents = rig_document(rig)["daq"]["channels"]
    for channel, document in zip(rig.daq.channels, documents, strict=True):
        chart = {key: "" if value is None else str(value) for key, value in document.items()}
        yield (
            f"/daq/{channel.name}",
            "Samples",
            {"unit": "V", "rate": f"{rate!r} Hz", "what": "raw volts", **chart},
        )
    for channel in rig.daq.channels:
        what = (
            f"mean of {Decimator(rate).factor} samples, scale applied; neither the AC"
            " coupling nor the delay is corrected, and a last group cut short is left out"
        )
        yield f"/preview/{channel.name}", "Scalar", {"unit": channel.unit, "what": what}
    angles = {"t": "s", "q1": "rad", "q2": "rad"}
    yield "/plan", "Plan", {**angles, "jack_rise": "m", "what": "planned motion"}
    yield "/joints", "Joints", {**angles, "what": "encoders, on the controller's clock"}
    yield "/events", "Event", {"time": "s", "what": "what happened, from the trigger on"}
