"""The records of a recording, all its checksums verified before or while they are read."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, DamageError, Record
from sautereau.daq.file.integrity import Section, check_data, check_summary, corrupted, data_crc


def verified(file: BufferedReader) -> Iterator[Record]:
    """Yield the records of the data section, after verifying all checksums of the file.

    The body of a record is valid until the next one is requested.
    """
    end, _ = check_summary(file)
    check_data(file, end)
    yield from Section(file, 0, end).records(len(MAGIC))


@contextmanager
def verifying(file: BufferedReader) -> Iterator[Iterator[Record]]:
    """Yield the records of the data section, and verify all checksums by the end of the context.

    The file is read once. The body of a record is valid until the next one is requested; what is
    made of the records may be used only after the context.

    Raises:
        DamageError: A checksum does not match, also where that led to another error.
    """
    end, _ = check_summary(file)
    data = Section(file, 0, end)
    try:
        yield data.records(len(MAGIC))
        if data.crc != data_crc(file, end):
            raise DamageError(corrupted("its data"))
    except RecordingError:
        check_data(file, end)
        raise
