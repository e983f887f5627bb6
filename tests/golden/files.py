"""What files contain: recordings, tables of other programs, pages."""

import hashlib
import io
import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tests.golden.commands import VARIABLE
from tests.golden.plain import checksum, normal, plain

_SHORT = 60  # Characters of a text that is stored as it is; of a longer one only a hash is
_UNSTORED = ("crc32", "started", "session", "daq")  # Metadata that differ between two runs
_BLOCKS = "/daq"
"""Topic whose number of messages depends on when the host reads the card, in real time."""
_UNIX = 1e9  # s, above which a time is a date


def contents(path: Path) -> Any:
    """Return what a file contains, by its extension; of a picture only that it exists."""
    return plain(_READERS.get(path.suffix, lambda _: "exists")(path))


def shape_of(frame: pd.DataFrame) -> dict[str, Any]:
    """Return names, dtypes and units of a table's columns, and a checksum of its numbers."""
    numbers = frame.select_dtypes("number")
    return {
        "columns": {str(name): _dtype(dtype) for name, dtype in frame.dtypes.items()},
        "index": [str(frame.index.name), _dtype(frame.index.dtype)],
        "rows": len(frame),
        "attrs": plain(frame.attrs),
        "numbers": {str(name): checksum(numbers[name]) for name in numbers},
    }


def _dtype(dtype: Any) -> str:
    return "object" if dtype == "str" else str(dtype)  # as pandas 2 holds texts


def invariable(value: Any) -> Any:
    """Return a document without the keys that depend on the machine, or on versions."""
    if isinstance(value, dict):
        return {name: invariable(each) for name, each in value.items() if name not in VARIABLE}
    return [invariable(each) for each in value] if isinstance(value, list) else value


def signals_of(path: Path) -> dict[str, Any]:
    """Return checksums of the volts of a recording."""
    from sautereau.daq.file.reading import read_recording

    return {name: checksum(volts) for name, volts in read_recording(path).volts.items()}


def recording(path: Path) -> dict[str, Any]:
    """Return the content of a recording without dates, versions and random identifiers."""
    from mcap.reader import make_reader

    from sautereau.daq.file.reading import read_recording

    found = read_recording(path)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError(f"{path}: no summary")
        counts = summary.statistics.channel_message_counts
        topics = {c.topic: counts.get(i, 0) for i, c in sorted(summary.channels.items())}
        topics |= dict.fromkeys({_BLOCKS} & topics.keys(), "some")
        metadata = {
            one.name: {k: _short(v) for k, v in one.metadata.items() if k not in _UNSTORED}
            for one in reader.iter_metadata()
            # A copy repeats one of these.
            if one.name not in ("software", "end") and not one.name.endswith(" (copy)")
        }
    parts = {"plan": found.plan, "joints": found.joints}
    return {
        "sampled": {name: checksum(volts) for name, volts in found.volts.items()},
        "time": checksum(found.time),
        "topics": topics,
        "metadata": metadata,
        "events": [[event.kind, event.text, event.time] for event in found.events],
        **{
            name: {key: checksum(value) for key, value in vars(part).items() if np.ndim(value)}
            for name, part in parts.items()
            if part is not None
        },
        "complete": found.complete,
    }


def _short(text: str) -> str:
    text = normal(text)
    return text if len(text) <= _SHORT else hashlib.sha256(text.encode()).hexdigest()[:16]


def _csv(path: Path) -> Any:
    return shape_of(pd.read_csv(path))


def _parquet(path: Path) -> Any:
    import pyarrow.parquet as pq

    frame = pq.read_table(path).to_pandas()
    dates = [name for name in frame if frame[name].dtype.kind == "M"]
    return shape_of(frame.drop(columns=[*dates, *_dated(frame), *({*VARIABLE} & {*frame})]))


def _dated(frame: pd.DataFrame) -> list[str]:
    """Return the columns of numbers that are dates, in s or ns."""
    numbers = frame.select_dtypes("number")
    return [name for name in numbers if len(numbers) and numbers[name].abs().min() > _UNIX]


def _hdf5(path: Path) -> Any:
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            numbers = checksum(item[()]) if item.dtype.kind in "fiu" else ""
            found[name] = [str(item.dtype), list(item.shape), numbers]

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def _tdms(path: Path) -> Any:
    from nptdms import TdmsFile

    channels = [c for group in TdmsFile.read(path).groups() for c in group.channels()]
    return {c.path: checksum(c[:]) for c in channels if np.asarray(c[:]).dtype.kind in "fiu"}


def _wav(path: Path) -> Any:
    from scipy.io import wavfile

    rate, samples = wavfile.read(io.BytesIO(path.read_bytes()))
    return {"rate": rate, "dtype": str(samples.dtype), "values": checksum(samples)}


class _Rows(HTMLParser):
    """The rows of the tables of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.rows: list[list[str]] = []
        self._cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag == "tr":
            self.rows.append([])
        self._cell = tag in ("td", "th") or (self._cell and tag not in ("tr", "table"))
        if tag in ("td", "th") and self.rows:
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        self._cell &= tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if self._cell and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


def _page(path: Path) -> Any:
    """Return the rows of the tables of a page but the versions, which are the last table."""
    rows = [row for row in _Rows(path.read_text(encoding="utf-8")).rows if row]
    versions = rows.index(["name", "version, recordings", "version, this page"])
    return [" | ".join(map(_short_cell, row)) for row in rows[: versions + 1]]


def _short_cell(text: str) -> str:
    return text if len(text) <= 3 * _SHORT else _short(text)


def _json(path: Path) -> Any:
    found = json.loads(path.read_text(encoding="utf-8"))
    return _condensed(invariable({k: v for k, v in found.items() if k not in _UNSTORED}))


def _condensed(value: Any) -> Any:
    """Return a document with checksums instead of long lists of numbers."""
    if isinstance(value, dict):
        return {name: _condensed(each) for name, each in value.items()}
    if isinstance(value, list) and len(value) > 8 and np.asarray(value, object).size:
        try:
            return checksum(value)
        except (TypeError, ValueError):
            return [_condensed(each) for each in value]
    return _short(value) if isinstance(value, str) else value


def _text(path: Path) -> Any:
    return {"lines": path.read_text("utf-8").count("\n"), "sha": _short(path.read_text("utf-8"))}


_READERS: dict[str, Callable[[Path], Any]] = {
    ".mcap": recording, ".csv": _csv, ".parquet": _parquet, ".h5": _hdf5, ".tdms": _tdms,
    ".wav": _wav, ".html": _page, ".json": _json, ".toml": _text, ".urdf": _text,
}  # fmt: skip
