"""Speed and memory of recordings, compared with a raw file, h5py, npTDMS and the Foxglove SDK.

An instant is a sample of each of 2 or 16 channels of a 16-bit converter; a block that the device
gives has 1024. The raw file has float64. Every file is read back and compared.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.figures import LOWER, Figure, check, timed
from sautereau.daq.file.container.durable import McapWriter
from sautereau.daq.file.reading import read_recording, stream
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording, SessionInfo
from sautereau.daq.file.samples import Scaling, block_head
from sautereau.daq.file.schemas import schema_data
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

SAMPLES = 8_192_000  # Of all channels together: 64 MiB as float64
BLOCK = 1024
HELD = 10 * BLOCK  # Samples of each channel in one message of our own
RUNS = 5
CHUNK = 256 * 1024
SIXTEEN = 16  # Channels of a continuous recording
LEAST = {2: 20.0, SIXTEEN: 5.0}
"""Limits of writing, dimensionless multiples of real time, by the number of channels."""
STEP = 20 / 65536  # V per count
HOUR = 3600  # Duration over which its memory is measured, s; with previews
INDEX = 20.0
"""Limit: MiB by which the memory grows with each hour; the index of 18,000 chunks takes 12."""
SESSION = SessionInfo(1, "2026-01-01T00:00:00Z", True, "none", "none")

Array = np.ndarray[Any, Any]


def run() -> list[Figure]:
    """Return rates of writing and reading, and the cost of a long recording."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rigs = load_rig(), sixteen(load_rig())
        compared = [figure for rig in rigs for figure in _compared(folder, rig)]
        return [*compared, *_described(folder), *_continuous()]


def _compared(folder: Path, rig: Rig) -> list[Figure]:
    """Return the figures of one number of channels."""
    n = len(rig.daq.channels)
    noise = np.random.default_rng(0).standard_normal((n, SAMPLES // n)) * 3000
    counts = np.round(noise).astype(np.int16)
    scaling = Scaling("int16", np.tile([0.0, STEP], (n, 1)))
    volts = counts * STEP
    ways: dict[str, Callable[[Path], None]] = {
        "float64": lambda path: _blocks(path, volts, compress=False),
        "counts, previews": lambda path: _recording(path, rig, counts, scaling),
        "float64, previews": lambda path: _recording(path, rig, volts, None, compress=False),
        "zstd, previews": lambda path: _recording(path, rig, volts, None),
        "zstd": lambda path: _blocks(path, volts, compress=True),
        "foxglove": lambda path: _foxglove(path, volts, compress=False),
        "foxglove, zstd": lambda path: _foxglove(path, volts, compress=True),
        "h5py": lambda path: _h5py(path, volts),
        "nptdms": lambda path: _nptdms(path, volts),
        "nptdms, int16": lambda path: _nptdms(path, counts),
    }
    rates, bits = _rates(folder / "file", ways, SAMPLES // n)
    what = f"{n} channels, written:"
    real_time = rig.daq.sample_rate / 1e6
    peers = (
        ("float64", "float64", "foxglove-sdk", "foxglove"),
        ("float64, zstd", "zstd", "foxglove-sdk", "foxglove, zstd"),
        ("float64 with previews", "float64, previews", "h5py", "h5py"),
        ("float64 with previews", "float64, previews", "npTDMS", "nptdms"),
        ("counts with previews", "counts, previews", "npTDMS", "nptdms, int16"),
    )
    return [
        *(
            Figure(f"{what} {name}, times real time", rates[name] / real_time, "", LOWER, LEAST[n])
            for name in ("counts, previews", "float64, previews", "zstd, previews")
        ),
        *(
            Figure(f"{what} {name}", rates[own], "M instants/s", peer, rates[key])
            for name, own, peer, key in peers
        ),
        *(
            Figure(f"{what} {name}", bits[name], "bit/sample", "float64", 64.0)
            for name in ("counts, previews", "zstd, previews")
        ),
        *_read(folder, rig, volts, (counts, scaling)),
    ]


def _rates(
    path: Path, ways: dict[str, Callable[[Path], None]], instants: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Return 1e6 instants per second and bits per sample of each way to write.

    The ways alternate, so that they share the conditions of the disk.
    """
    times: dict[str, list[float]] = {name: [] for name in ways}
    bits = {}
    for _ in range(RUNS):
        for name, way in ways.items():
            times[name].append(timed(_written, way, path)[0])
            bits[name] = 8 * path.stat().st_size / SAMPLES
            check(bits[name] > 8, f"{name}: {bits[name]:.3g} bits for a sample")
            path.unlink()
    return {name: instants / statistics.median(t) / 1e6 for name, t in times.items()}, bits


def _written(way: Callable[[Path], None], path: Path) -> None:
    way(path)
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _pieces(samples: Array, size: int = BLOCK):
    return ((at, samples[:, at : at + size]) for at in range(0, samples.shape[1], size))


def _blocks(path: Path, samples: Array, *, compress: bool) -> None:
    """Write the blocks of a recording alone, from pieces as the device gives them."""
    from mcap.records import Channel, Schema

    with path.open("wb") as file:
        writer = McapWriter(file, compress=compress)
        schema = Schema(1, schema_data({}), "protobuf", "sautereau.Block")
        writer.begin("", [schema, Channel(1, "/daq", "protobuf", {}, 1)])
        held = np.empty((len(samples), HELD), samples.dtype)
        for at, pieces in _pieces(samples, HELD):
            for start, piece in _pieces(pieces):
                held[:, start : start + piece.shape[1]] = piece
            data = held[:, : pieces.shape[1]].tobytes()
            head = block_head(0, at, 51_200.0, 0, len(data))
            writer.add_message(1, at, head + data, at)
            writer.flush()
        writer.finish()


def _recording(
    path: Path, rig: Rig, samples: Array, scaling: Scaling | None, *, compress: bool | None = None
) -> None:
    with Recording(path, rig, session=SESSION, scaling=scaling, compress=compress) as recording:
        for at, piece in _pieces(samples):
            recording.write_block(Block(at, piece))


def _foxglove(path: Path, volts: Array, *, compress: bool) -> None:
    import foxglove
    from foxglove.mcap import MCAPCompression, MCAPWriteOptions

    context = foxglove.Context()
    options = MCAPWriteOptions(
        compression=MCAPCompression.Zstd if compress else None,
        chunk_size=CHUNK,
        calculate_chunk_crcs=True,
        calculate_data_section_crc=True,
        compression_threads=0,
    )
    with path.open("wb") as file:
        writer = foxglove.open_mcap(file, context=context, writer_options=options)
        schema = foxglove.Schema(name="sautereau.Block", encoding="protobuf", data=schema_data({}))
        channel = foxglove.Channel(
            "/daq", schema=schema, message_encoding="protobuf", context=context
        )
        for at, piece in _pieces(volts):
            head = block_head(0, at, 51_200.0, 0, piece.size * 8)
            channel.log(head + piece.tobytes(), log_time=at)
        writer.close()


def _h5py(path: Path, volts: Array) -> None:
    import h5py

    n = len(volts)
    with h5py.File(path, "w") as file:
        data = file.create_dataset(
            "v", (n, 0), maxshape=(n, None), chunks=(n, 8 * BLOCK), dtype="<f8"
        )
        for at, piece in _pieces(volts):
            data.resize(at + piece.shape[1], axis=1)
            data[:, at:] = piece


def _nptdms(path: Path, samples: Array) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for _, piece in _pieces(samples):
            rows = enumerate(piece)
            writer.write_segment([ChannelObject("daq", f"c{i}", row) for i, row in rows])


def _read(folder: Path, rig: Rig, volts: Array, of_counts: tuple[Array, Scaling]) -> list[Figure]:
    """Read counts and float64 to volts with all checks, beside a raw file of float64."""
    raw, counts, floats = (folder / name for name in ("raw", "counts.mcap", "floats.mcap"))
    volts.tofile(raw)
    _recording(counts, rig, *of_counts)
    _recording(floats, rig, volts, None, compress=False)
    ways: dict[str, Callable[[], object]] = {
        "raw": lambda: np.fromfile(raw),
        "counts": lambda: read_recording(counts),
        "float64": lambda: read_recording(floats),
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(3 * RUNS):
        for name, way in ways.items():
            times[name].append(timed(way)[0])
    for path in (counts, floats):
        read = read_recording(path).volts
        same = all(np.array_equal(a, b) for a, b in zip(read.values(), volts, strict=True))
        check(same, f"{path.name}: a sample differs")
    for path in (raw, counts, floats):
        path.unlink()
    n, median = len(volts), {name: statistics.median(t) for name, t in times.items()}
    rate = volts.shape[1] / 1e6
    unit, peer = "M instants/s", rate / median["raw"]
    what = f"{n} channels, read to volts, verified:"
    figures = []
    for name in ("counts", "float64"):
        fraction = median["raw"] / median[name]
        figures += [
            Figure(f"{what} {name}, fraction of fromfile", fraction, "", LOWER, 0.6),
            Figure(f"{what} {name}", rate / median[name], unit, "fromfile", peer),
        ]
    return figures


def _described(folder: Path) -> list[Figure]:
    """Describe 2 GB in a separate process, and measure its memory."""
    path = folder / "large.mcap"
    block = np.random.default_rng(1).standard_normal((2, 512_000))
    with Recording(path, load_rig(), session=SESSION, compress=False) as recording:
        while recording.n_samples * 16 < 2e9:
            recording.write_block(Block(recording.n_samples, block))
    elapsed, (peak, n) = timed(_in_a_child, f"describe({str(path)!r})['n_samples']")
    check(n == recording.n_samples, f"{n} of {recording.n_samples} samples are described")
    size = path.stat().st_size
    path.unlink()
    return [
        Figure(f"info of {size / 1e9:.3g} GB, memory", peak, "MiB", "limit", 500.0),
        Figure(f"info of {size / 1e9:.3g} GB", elapsed, "s", "limit", 60.0),
    ]


def _in_a_child(expression: str) -> tuple[float, int]:
    """Return the peak memory [MiB] of a process that evaluates, and the integer it finds."""
    read = "open('/proc/self/status').read()"
    code = f"from sautereau.daq.file.survey import describe; print({expression}); print({read})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    number, _, status = done.stdout.partition("\n")
    return memory("VmHWM", status), int(number)


def memory(name: str, status: str | None = None) -> float:
    """Return a process's memory [MiB] from /proc: VmRSS is the current, VmHWM the peak.

    Not ru_maxrss, which starts at the value of the parent process.
    """
    status = status or Path("/proc/self/status").read_text(encoding="utf-8")
    line = next(x for x in status.splitlines() if name in x)
    return int(line.split()[1]) / 1024


def sixteen(rig: Rig) -> Rig:
    """Return a rig with sixteen channels."""
    channels = tuple(
        rig.daq.channels[-1].model_copy(update={"name": f"c{n}", "terminal": f"ai{n}"})
        for n in range(SIXTEEN)
    )
    return rig.replaced({"daq.channels": channels})


def _continuous() -> list[Figure]:
    """Write an hour of 16 channels as fast as possible.

    The samples are zeros, so that an hour is not 24 GB on the disk; the CPU load is measured
    with 60 s of a converter's noise.
    """
    rig = sixteen(load_rig())
    rate = rig.daq.sample_rate
    noise = np.round(np.random.default_rng(2).standard_normal((SIXTEEN, 51_200)) * 3000) * STEP
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "minute.mcap"
        start = time.process_time()
        with Recording(path, rig, session=SESSION) as recording:
            for number in range(round(60 * rate / BLOCK)):
                at = number * BLOCK % (51_200 - BLOCK)
                recording.write_block(Block(recording.n_samples, noise[:, at : at + BLOCK]))
        load = (time.process_time() - start) / 60
        first = next(stream(path, BLOCK / rate))
        same = np.array_equal(np.stack(list(first.volts.values())), noise[:, :BLOCK])
        check(same, f"{path.name}: a sample differs")
        path.unlink()
        path = Path(name) / "hour.mcap"
        block = np.zeros((SIXTEEN, 5120))
        peaks = []
        with Recording(path, rig, session=SESSION) as recording:
            for second in range(HOUR):
                for _ in range(10):
                    recording.write_block(Block(recording.n_samples, block))
                if second in (HOUR // 60, HOUR - 1):
                    peaks.append(memory("VmRSS"))
        n = recording.n_samples
        check(n == round(HOUR * rate), f"{n} of {HOUR * rate:.0f} samples are recorded")
    return [
        Figure("16 channels at 51.2 kHz: fraction of a core", load * 100, "%", "limit", 40.0),
        Figure("16 channels, an hour: memory grows by", peaks[1] - peaks[0], "MiB", "limit", INDEX),
    ]
