"""What a recording says of its press, from its head alone."""

from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, Opcode, unsealed
from sautereau.daq.file.integrity import opened, records, size_of
from sautereau.daq.file.session_info import SessionInfo, session_from_metadata


def read_session(path: str | Path) -> SessionInfo:
    """Read what a recording says of its press, and nothing of its samples.

    The file took its name when it was whole; whether it still is, `read_recording` tells.

    Raises:
        RecordingError: It is missing, not ours, or its head is damaged.
    """
    with opened(Path(path)) as file:
        for opcode, body in records(file, len(MAGIC), size_of(file)):
            if opcode == Opcode.CHUNK:
                break
            if opcode == Opcode.METADATA and (record := unsealed(body)).name == "session":
                return session_from_metadata(record.metadata)
        raise RecordingError("its head does not say what it is of; give a recording of a press")
