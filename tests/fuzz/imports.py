"""Files of other programs, changed in their structure or in their bytes."""

import io
import json
import random
import struct
import wave
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import soundfile
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig
from tests.daq import test_convert_libraries as libraries
from tests.fuzz import mutate
from tests.fuzz.run import Wrong

PAPER = load_rig()
ROWS = 400
VALUES = np.sin(np.arange(ROWS) / 5)
RATED = ("wav", "tdms", "flac", "lvm", "uff")
WAV_FIELDS = ((20, 2), (22, 2), (24, 4), (28, 4), (32, 2), (34, 2), (16, 4), (40, 4))
"""Offset and width of tag, channels, rate, bytes per second, block, bits, and two lengths."""
DTYPES = ("<f8", ">f8", "<f4", "<i2", ">i4", "u1", "?", "<c16", "<U3", "<M8[ns]", "O", "<f2", "V8")


def of_csv(dice: random.Random) -> bytes:
    comma = dice.random() < 0.3
    sign, mark = (";", ",") if comma else (dice.choice(",;\t"), ".")
    head = dice.choice(("", "Model,X\nPoints,400\n", "# a = 1\n", "x-axis,1\nsecond,Volt\n"))
    rows = "".join(
        f"{f'{n / 1e3:.3f}{sign}{float(v)!r}'.replace('.', mark)}\n" for n, v in enumerate(VALUES)
    )
    return f"{head}t (s){sign}v\n{rows}".encode()


def of_parquet(dice: random.Random) -> bytes:
    values = _array(dice)
    try:
        column = pa.array(values)
    except (pa.ArrowException, TypeError, ValueError):
        column = pa.array(VALUES)
    texts = {"unit": dice.choice(("V", "mV", *mutate.UNITS)).encode() + b"\xff" * dice.randrange(2)}
    kinds = (pa.list_(pa.float64()), pa.decimal128(9, 2), pa.float16(), pa.string(), pa.bool_())
    if dice.random() < 0.2:
        kind = dice.choice(kinds)
        made: list[Any] = [None] * ROWS
        column = pa.array(made, kind)
    if dice.random() < 0.2:
        column = pa.array(column.to_pylist()).dictionary_encode()
    field = pa.field("v", column.type, metadata=texts)
    table = pa.Table.from_arrays([column], schema=pa.schema([field]))
    file = io.BytesIO()
    try:
        pq.write_table(table, file, compression=dice.choice(("zstd", "none", "snappy")))
    except pa.ArrowNotImplementedError:
        pq.write_table(pa.table({"v": VALUES}), file := io.BytesIO())
    return file.getvalue()


def of_wav(dice: random.Random) -> bytes:
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        channels, width = dice.choice((1, 1, 2, 7)), dice.choice((1, 2, 3, 4))
        writer.setnchannels(channels)
        writer.setsampwidth(width)
        writer.setframerate(dice.choice((48_000, 1, 10**8)))
        writer.writeframes(dice.randbytes(ROWS * channels * width))
    data = bytearray(file.getvalue())
    for _ in range(dice.choice((0, 1, 2))):
        at, width = dice.choice(WAV_FIELDS)
        value = dice.choice((0, 1, 2, 3, 7, 8, 24, 64, 255, 0xFFFE, 65535, 2**31, 2**32 - 1))
        data[at : at + width] = (value % 256**width).to_bytes(width, "little")
    if dice.random() < 0.2:
        name = dice.choice((b"LIST", b"fact", b"data", b"fmt ", b"RIFF", b"\0\0\0\0"))
        extra = name + struct.pack("<I", dice.choice((0, 1, 4, 2**31, 2**32 - 1))) + b"abcd"
        at = dice.choice((12, 36, len(data)))
        data[at:at] = extra
    return bytes(data)


def of_tdms(dice: random.Random) -> bytes:
    values: Any = dice.choice((1e-3, 0.0, -1.0, 1e-320, float("nan"), float("inf"), "x", 7, True))
    properties = {"wf_increment": values if dice.random() < 0.5 else 1e-3}
    for name in ("wf_start_offset", "wf_start_time", "unit_string", "NI_UnitDescription"):
        if dice.random() < 0.3:
            properties[name] = dice.choice((values, "V", "\x1b", np.datetime64("2026-01-01T00:00")))
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        for _ in range(dice.choice((1, 1, 2, 30))):
            data = _array(dice) if dice.random() < 0.3 else VALUES
            try:
                channel = ChannelObject("a", "v", np.atleast_1d(data), properties)
                writer.write_segment([RootObject({}), channel])
            except (TypeError, ValueError, KeyError, AttributeError):
                writer.write_segment([ChannelObject("a", "v", VALUES, {"wf_increment": 1e-3})])
    return file.getvalue()


def _array(dice: random.Random) -> Any:
    shape = dice.choice(((ROWS,), (ROWS, 1), (1, ROWS), (ROWS, 3), (2, 2, 100), (0,), (), (5,)))
    values = np.resize(VALUES, shape)
    for _ in range(dice.choice((0, 0, 1))):
        if values.size:
            values.flat[dice.randrange(values.size)] = float(dice.choice(mutate.NUMBERS[:23]))
    try:
        with np.errstate(all="ignore"):
            return values.astype(dice.choice((DTYPES[0], *DTYPES)))
    except (TypeError, ValueError):
        return values


def of_mat(dice: random.Random) -> bytes:
    file = io.BytesIO()
    inner: Any = {"w": VALUES}
    for _ in range(dice.choice((0, 1, 19, 60))):
        inner = {"s": inner}
    try:
        found = {"v": _array(dice), "s": inner, "c": np.array([1, "x"], object)}
        savemat(file, found, do_compression=dice.random() < 0.5)
    except (TypeError, ValueError, RecursionError, KeyError):
        savemat(file, {"v": VALUES})
    return file.getvalue()


def of_npz(dice: random.Random) -> bytes:
    file = io.BytesIO()
    if dice.random() < 0.5:
        np.savez(file, v=_array(dice), w=VALUES)
        return file.getvalue()
    shape = dice.choice(("(400,)", "(-1,)", "(10**18,)", f"({10**18},)", "(400, 0)", "()", "x"))
    kind = dice.choice(DTYPES)
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    data = b"\x93NUMPY\x01\0" + struct.pack("<H", len(head)) + head + VALUES.tobytes()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(dice.choice(("v.npy", "../../v.npy", "v", "a\0.npy", "v.npy\x1b")), data)
        if dice.random() < 0.2:
            archive.writestr("w.npy", bytes(50_000_000))
    return file.getvalue()


def of_h5(dice: random.Random) -> bytes:
    import h5py

    file = io.BytesIO()
    with h5py.File(file, "w") as writer:
        try:
            writer["v"] = _array(dice)
        except (TypeError, ValueError):
            writer["v"] = VALUES
        writer["v"].attrs["unit"] = dice.choice(("V", b"\xff", 1.0, np.zeros(3), ""))
        match dice.randrange(6):
            case 0:
                writer["g"] = h5py.SoftLink("/g")
            case 1:
                writer["e"] = h5py.ExternalLink("/etc/passwd", "/")
            case 2:
                writer.create_dataset("big", (10**12,), chunks=(1000,))
            case 3:
                writer.create_dataset("w", (50_000_000,), chunks=True, compression="gzip")
            case 4:
                writer.create_group("/".join("g" * dice.choice((5, 500))))["v"] = VALUES
    return file.getvalue()


def of_lvm(dice: random.Random) -> bytes:
    return libraries.lvm(dice.choice(("No", "One", "Multi")), dice.choice(".,")).encode()


def of_uff(dice: random.Random) -> bytes:
    return libraries.uff(binary=dice.random() < 0.5, spacing=dice.choice((0, 1, 1)))


def of_xlsx(dice: random.Random) -> bytes:
    file = io.BytesIO()
    libraries.workbook(file)
    with zipfile.ZipFile(file) as book:
        parts = {name: book.read(name) for name in book.namelist()}
    name = dice.choice(list(parts))
    parts[name] = mutate.as_bytes(mutate.of_text(parts[name].decode(), dice), dice)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as book:
        for each, part in parts.items():
            book.writestr(each, part)
    return file.getvalue()


def of_flac(dice: random.Random) -> bytes:
    file = io.BytesIO()
    kinds = ("FLAC", "W64", "CAF", "AIFF")
    soundfile.write(file, VALUES, dice.choice((8_000, 48_000)), "PCM_24", format=dice.choice(kinds))
    return file.getvalue()


def of_npy(dice: random.Random) -> bytes:
    file = io.BytesIO()
    np.save(file, np.stack([VALUES, VALUES], axis=1))
    return file.getvalue()


def written(write: Callable[[Path], object], ending: str) -> bytes:
    """Return what a library writes that writes files only."""
    with TemporaryDirectory() as folder:
        write(path := Path(folder) / f"made.{ending}")
        return path.read_bytes()


def of_mf4(dice: random.Random) -> bytes:
    version, packed = dice.choice(("4.10", "4.10", "3.30")), dice.choice((0, 1, 2))
    conversion = dice.choice(({}, {"a": 1e-3, "b": 1.0}, {"formula": "X * 2"}))
    return written(lambda path: libraries.mdf(path, version, packed, **conversion), "mf4")


def of_bag(dice: random.Random) -> bytes:
    text, kind = "float64 data\n", "std_msgs/msg/Float64"
    text = mutate.of_text(text, dice) if dice.random() < 0.3 else text
    kind = mutate.of_text(kind, dice) if dice.random() < 0.2 else kind
    return written(lambda path: libraries.bag(path, text.encode("utf-8", "replace"), kind), "mcap")


def of_db3(dice: random.Random) -> bytes:
    return written(libraries.bag, "db3")


MAKERS: dict[str, tuple[Callable[[random.Random], bytes], str]] = {
    "csv": (of_csv, "v"),
    "parquet": (of_parquet, "v"),
    "wav": (of_wav, "1"),
    "tdms": (of_tdms, "v"),
    "mat": (of_mat, "v"),
    "npz": (of_npz, "v"),
    "npy": (of_npy, "data(1)"),
    "h5": (of_h5, "v"),
    "lvm": (of_lvm, "vel"),
    "uff": (of_uff, "1Z"),
    "xlsx": (of_xlsx, "vel (mm/s)"),
    "flac": (of_flac, "1"),
    "mf4": (of_mf4, "vel"),
    "mcap": (of_bag, "/laser/data"),
    "db3": (of_db3, "/laser/data"),
}
"""What makes a file of a kind, and the column of its velocity."""


class Imports:
    """Files of one kind."""

    def __init__(self, folder: Path, kind: str):
        self._kind, self._folder = kind, folder

    def case(self, dice: random.Random) -> str:
        kind, out = self._kind, self._folder / "out.mcap"
        out.unlink(missing_ok=True)
        data = MAKERS[kind][0](dice)
        cut = None
        if kind == "csv" and dice.random() < 0.3:
            cut = dice.randrange(len(data))
            data = data[:cut]
        elif kind in ("csv", "lvm") and dice.random() < 0.7:
            data = mutate.as_bytes(mutate.of_text(data.decode(), dice, (",", ";", "\t")), dice)
        elif dice.random() < 0.6:
            data = mutate.of_bytes(data, dice)
        path = self._folder / f"case.{kind}"
        path.write_bytes(data)
        import_file(path, out, rig=PAPER, options=self._options(dice))
        found = read_recording(out)
        volts = found.volts["velocity"]
        if not (np.isfinite(volts).all() and np.isfinite(found.time).all()):
            raise Wrong("samples or times that are not finite")
        if cut is not None and not np.array_equal(volts, VALUES[: len(volts)]):
            raise Wrong("wrong samples of a file that was cut")
        json.dumps(found.session.to_metadata())
        return "imported"

    def _options(self, dice: random.Random) -> ImportOptions:
        wav = self._kind in ("wav", "flac")
        time = self._kind == "csv" and dice.random() < 0.5
        scale: Any = {"full_scale": {"velocity": "1 V"}} if wav else {"unit": {"velocity": "V"}}
        return ImportOptions(
            column={"velocity": MAKERS[self._kind][1]},
            without=("force",),
            rate=None if self._kind in RATED or time else "1 kHz",
            time="t (s)" if time else None,
            trigger="0.5 s" if self._kind in ("lvm", "uff") else "0 s",
            started="2026-02-03T04:05:06+01:00",
            simulated=False,
            **scale,
        )
