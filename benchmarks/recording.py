"""Speed and memory of recordings, compared with a raw file, h5py, npTDMS and the Foxglove SDK.

An instant is two channels of float64, 16 bytes; a block has 1024 instants of a 16-bit
converter. Every file is read back and compared.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, median_time
from sautereau.daq.file.container.writer import McapWriter
from sautereau.daq.file.reading import read_recording, stream
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording, SessionInfo
from sautereau.daq.file.schemas import encode, schema_data
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

INSTANTS = 2_048_000
BLOCK = 1024
RUNS = 5
CHUNK = 256 * 1024
SIXTEEN = 16
"""Channels of a continuous recording."""
HOUR = 3600
"""Duration over which its memory is measured, s; with previews."""
SESSION = SessionInfo(1, "2026-01-01T00:00:00Z", True, "none", "none")

Volts = np.ndarray


def run() -> list[Figure]:
    """Return rates of writing and reading, and the cost of a long recording."""
    volts = np.round(np.random.default_rng(0).standard_normal((2, INSTANTS)) * 3000) * 20 / 65536
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rates = _rates(folder, volts)
        figures = [*_written(rates), _read(folder, volts), *_described(folder)]
    return [*figures, *_continuous()]


def _rates(folder: Path, volts: Volts) -> dict[str, float]:
    """Return 1e6 instants per second of each way to write; they alternate, sharing the disk."""
    ways: dict[str, Callable[[Path, Volts], None]] = {
        "raw": _raw,
        "blocks": lambda path, v: _blocks(path, v, compress=False),
        "blocks, zstd": lambda path, v: _blocks(path, v, compress=True),
        "recording": _recording,
        "foxglove": lambda path, v: _foxglove(path, v, compress=False),
        "foxglove, zstd": lambda path, v: _foxglove(path, v, compress=True),
        "h5py": _h5py,
        "nptdms": _nptdms,
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(RUNS):
        for name, way in ways.items():
            path = folder / "file"
            start = time.perf_counter()
            way(path, volts)
            with path.open("rb+") as file:
                os.fsync(file.fileno())
            times[name].append(time.perf_counter() - start)
            assert path.stat().st_size > 1e6
            path.unlink()
    return {name: INSTANTS / statistics.median(t) / 1e6 for name, t in times.items()}


def _written(rates: dict[str, float]) -> list[Figure]:
    plain, blocks = "blocks written, uncompressed", rates["blocks"]
    packed, sdk = rates["blocks, zstd"], "foxglove-sdk"
    rows = (
        (f"{plain}, beside half the rate of a raw file", blocks, "at least", 0.5 * rates["raw"]),
        (plain, blocks, sdk, rates["foxglove"]),
        ("blocks written, zstd", packed, sdk, rates["foxglove, zstd"]),
        (plain, blocks, "h5py", rates["h5py"]),
        (plain, blocks, "npTDMS", rates["nptdms"]),
        ("complete recording, previews, zstd", rates["recording"], "the card's rate", 0.0512),
    )
    return [Figure(what, rate, "M instants/s", *peer) for what, rate, *peer in rows]


def _pieces(volts: Volts):
    return ((at, volts[:, at : at + BLOCK]) for at in range(0, volts.shape[1], BLOCK))


def _raw(path: Path, volts: Volts) -> None:
    with path.open("wb") as file:
        for _, piece in _pieces(volts):
            file.write(piece.tobytes())


def _blocks(path: Path, volts: Volts, *, compress: bool) -> None:
    from mcap.records import Channel, Schema

    with path.open("wb") as file:
        writer = McapWriter(file, path.parent, compress=compress)
        schema = Schema(1, schema_data(), "protobuf", "sautereau.Samples")
        writer.start("", [schema, *(Channel(n, f"/daq/{n}", "protobuf", {}, 1) for n in (1, 2))])
        for at, piece in _pieces(volts):
            for number, row in enumerate(piece, 1):
                data = encode("Samples", t0=0, first_sample=at, rate=51_200.0, volts=row)
                writer.add_message(number, at, data)
            writer.close_chunk()
        writer.finish()
        writer.close()


def _recording(path: Path, volts: Volts) -> None:
    with Recording(path, load_rig(), session=SESSION) as recording:
        for at, piece in _pieces(volts):
            recording.write_block(Block(at, piece))


def _foxglove(path: Path, volts: Volts, *, compress: bool) -> None:
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
        schema = foxglove.Schema(name="sautereau.Samples", encoding="protobuf", data=schema_data())
        channels = [
            foxglove.Channel(
                f"/daq/{n}", schema=schema, message_encoding="protobuf", context=context
            )
            for n in (1, 2)
        ]
        for at, piece in _pieces(volts):
            for channel, row in zip(channels, piece, strict=True):
                data = encode("Samples", t0=0, first_sample=at, rate=51_200.0, volts=row)
                channel.log(data, log_time=at)
        writer.close()


def _h5py(path: Path, volts: Volts) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_dataset(
            "v", (2, 0), maxshape=(2, None), chunks=(2, 8 * BLOCK), dtype="<f8"
        )
        for at, piece in _pieces(volts):
            data.resize(at + piece.shape[1], axis=1)
            data[:, at:] = piece


def _nptdms(path: Path, volts: Volts) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for _, piece in _pieces(volts):
            writer.write_segment(
                [ChannelObject("daq", name, row) for name, row in zip("ab", piece, strict=True)]
            )


def _read(folder: Path, volts: Volts) -> Figure:
    import pandas as pd

    path = folder / "read.mcap"
    _recording(path, volts)

    def read() -> pd.DataFrame:
        recorded = read_recording(path)
        return pd.DataFrame(recorded.volts, index=recorded.time, copy=False)

    assert np.array_equal(read().to_numpy().T, volts)
    rate = INSTANTS / median_time(read, RUNS) / 1e6
    return Figure("read into a DataFrame, verified", rate, "M instants/s", "at least", 20.0)


def _described(folder: Path) -> list[Figure]:
    """Describe 2 GB in a separate process, and measure its memory."""
    path = folder / "large.mcap"
    block = np.random.default_rng(1).standard_normal((2, 512_000))
    with Recording(path, load_rig(), session=SESSION, compress=False) as recording:
        while recording.n_samples * 16 < 2e9:
            recording.write_block(Block(recording.n_samples, block))
    start = time.perf_counter()
    peak, n = _in_a_child(f"describe({str(path)!r})['n_samples']")
    elapsed = time.perf_counter() - start
    assert n == recording.n_samples
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
    status = status or Path("/proc/self/status").read_text()
    line = next(x for x in status.splitlines() if name in x)
    return int(line.split()[1]) / 1024


def _sixteen(rig: Rig) -> Rig:
    force = rig.daq.channel("force")
    assert force is not None
    channels = tuple(
        force.model_copy(update={"name": f"c{n}", "terminal": f"ai{n}"}) for n in range(SIXTEEN)
    )
    return rig.model_copy(update={"daq": rig.daq.model_copy(update={"channels": channels})})


def _continuous() -> list[Figure]:
    """Write an hour of 16 channels as fast as possible.

    The samples are zeros, so that an hour is not 24 GB on the disk; the CPU load is measured
    with 60 s of a converter's noise.
    """
    rig = _sixteen(load_rig())
    rate = rig.daq.sample_rate
    noise = (
        np.round(np.random.default_rng(2).standard_normal((SIXTEEN, 51_200)) * 3000) * 20 / 65536
    )
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "minute.mcap"
        start = time.process_time()
        with Recording(path, rig, session=SESSION) as recording:
            for number in range(round(60 * rate / BLOCK)):
                at = number * BLOCK % (51_200 - BLOCK)
                recording.write_block(Block(recording.n_samples, noise[:, at : at + BLOCK]))
        load = (time.process_time() - start) / 60
        first = next(stream(path, BLOCK / rate))
        assert np.array_equal(np.stack(list(first.volts.values())), noise[:, :BLOCK])
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
        assert recording.n_samples == round(HOUR * rate)
    return [
        Figure("16 channels at 51.2 kHz: fraction of a core", load * 100, "%", "limit", 40.0),
        Figure("16 channels, an hour: memory grows by", peaks[1] - peaks[0], "MiB", "limit", 10.0),
    ]
