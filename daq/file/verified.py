"""The records of a recording, all its checksums verified before or while they are read."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, Record
from sautereau.daq.file.integrity import Section, check_data, check_summary, head


def verified(file: BufferedReader) -> Iterator[Record]:
    """Yield the records of the data section, after verifying all checksums of the file.

    Metadata that follow messages come first, and again in their place. The body of a record is
    valid until the next one is requested.
    """
    end, _ = check_summary(file)
    check_data(file, end)
    yield from _in_order(file, Section(file, 0, end), end)


@contextmanager
def verifying(file: BufferedReader) -> Iterator[Iterator[Record]]:
    """Yield the records as `verified` does, and verify all checksums by the end of the context.

    The file is read once. The body of a record is valid until the next one is requested; what is
    made of the records may be used only after the context.

    Raises:
        DamageError: A checksum does not match, also where that led to another error.
    """
    end, _ = check_summary(file)
    data = Section(file, 0, end)
    try:
        yield _in_order(file, data, end)
        check_data(file, end, data.crc)
    except RecordingError:
        check_data(file, end)
        raise


def _in_order(file: BufferedReader, data: Section, end: int) -> Iterator[Record]:
    first, late = head(file, end)
    yield from first if late else ()
    yield from data.records(len(MAGIC))
