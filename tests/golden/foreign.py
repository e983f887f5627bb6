"""Files of other programs with the same 400 values, one of each format that `import` reads."""

import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

RATE = 1000
VALUES = np.sin(np.arange(400) / 5)
_SAMPLES = {"v": VALUES, "w": VALUES[::-1] / 2}
_ANSWERS = (
    '--rig paper --trigger "0 s" --started 2026-02-03T04:05:06+01:00 --measured'
    " --unit.velocity V --unit.force V"
)
_NAMED = f"{_ANSWERS} --column.velocity v --column.force w"
_RATED = f'{_NAMED} --rate "1 kHz"'


def _csv(path: Path) -> None:
    rows = zip(np.arange(400) / RATE, *_SAMPLES.values(), strict=True)
    text = "".join(f"{t:.3f};{v:.9f};{w:.9f}\n".replace(".", ",") for t, v, w in rows)
    path.write_text(f"Model;X\nPoints;400\nt (s);v;w\n{text}", encoding="utf-8")


def _tsv(path: Path) -> None:
    rows = zip(np.arange(400), *_SAMPLES.values(), strict=True)
    text = "".join(f"{t}\t{v:.9e}\t{w:.9e}\n" for t, v, w in rows)
    path.write_text(f"# a logger\nt [ms]\tv [V]\tw [V]\n{text}", encoding="utf-8")


def _parquet(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(_SAMPLES), path)


def _wav(path: Path) -> None:
    from scipy.io import wavfile

    both = np.stack(list(_SAMPLES.values()), axis=1)
    wavfile.write(path, RATE, np.round(30_000 * both).astype(np.int16))


def _tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        timing = {"wf_increment": 1 / RATE, "unit_string": "V"}
        writer.write_segment([ChannelObject("a", n, x, timing) for n, x in _SAMPLES.items()])


def _npz(path: Path) -> None:
    np.savez(path, **_SAMPLES)


def _mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, _SAMPLES)
    text = b"MATLAB 5.0 MAT-file".ljust(116)  # instead of the date
    path.write_bytes(text + path.read_bytes()[len(text) :])


def _hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in _SAMPLES.items():
            file[name] = values
            file[name].attrs["unit"] = "V"


def _mf4(path: Path) -> None:
    from asammdf import MDF, Signal

    mdf = MDF(version="4.10")
    mdf.start_time = datetime(2026, 2, 3, tzinfo=UTC)
    times = np.arange(400) / RATE
    mdf.append([Signal(v, times, unit="V", name=name) for name, v in _SAMPLES.items()])
    mdf.save(path, overwrite=True)


def _db3(path: Path) -> None:
    """Messages of ROS 2, packed by hand: four bytes for little endian, and a double."""
    messages = [
        (topic, 1_770_000_000 * 10**9 + n * 10**6, b"\0\1\0\0" + struct.pack("<d", value))
        for topic, values in enumerate(_SAMPLES.values(), 1)
        for n, value in enumerate(values)
    ]
    with closing(sqlite3.connect(path)) as bag, bag:
        bag.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format,"
            " offered_qos_profiles)"
        )
        bag.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
            " data BLOB)"
        )
        for name in _SAMPLES:
            kind = (f"/{name}", "std_msgs/msg/Float64", "cdr", "")
            bag.execute("INSERT INTO topics VALUES (NULL, ?, ?, ?, ?)", kind)
        bag.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", messages)


FOREIGN: dict[str, tuple[Callable[[Path], None], str]] = {
    "csv": (_csv, f'{_NAMED} --time "t (s)"'),
    "tsv": (_tsv, f'{_ANSWERS} --column.velocity "v [V]" --column.force "w [V]" --time "t [ms]"'),
    "parquet": (_parquet, _RATED),
    "wav": (
        _wav,
        '--rig paper --trigger "0 s" --started 2026-02-03T04:05:06+01:00 --measured'
        ' --column.velocity 1 --column.force 2 --full-scale.velocity "4 V"'
        ' --full-scale.force "10 V"',
    ),
    "tdms": (_tdms, _NAMED),
    "npz": (_npz, _RATED),
    "mat": (_mat, _RATED),
    "h5": (_hdf5, _RATED),
    "mf4": (_mf4, f"{_NAMED} --time time"),
    "db3": (
        _db3,
        f"{_ANSWERS} --column.velocity /v/data --column.force /w/data --time /v/times",
    ),
}
"""What writes a file, and the options of its import, by the file extension."""
