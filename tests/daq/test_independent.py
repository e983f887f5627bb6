"""A reader that is not ours, of another language and another protobuf, gets the same bits.

It needs node and `npm ci` in tests/daq/mcap_core; without them it is skipped.
"""

import hashlib
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from sautereau.daq.file.recording import Block, Recording
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.samples import Scaling
from tests.daq.damage import chunks, corrupt

FOLDER = Path(__file__).with_name("mcap_core")

pytestmark = pytest.mark.skipif(
    shutil.which("node") is None or not (FOLDER / "node_modules").is_dir(),
    reason="needs node, and `npm ci` in tests/daq/mcap_core",
)


def by_mcap_core(path):
    done = subprocess.run(
        ["node", FOLDER / "read.mjs", path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def digests(*rows):
    names = ("velocity", "force")
    return {n: hashlib.sha256(r.tobytes()).hexdigest() for n, r in zip(names, rows, strict=True)}


def test_a_recording(tmp_path, record):
    """Bits of every kind of number but nan, whose payload JavaScript does not promise to keep."""
    bits = np.random.default_rng(6).integers(0, 2**64, (2, 30_000), dtype=np.uint64)
    volts = bits.view(np.float64)
    volts[np.isnan(volts)] = -0.0
    volts[:, :2] = np.inf, 5e-324
    path = record(tmp_path / "press.mcap", volts, block=1000, t0_ns=1_700_000_000 * 10**9)
    found = by_mcap_core(path)
    assert found["digests"] == digests(*volts)
    assert found["counts"] == {"/daq": 3, "/preview": 565}


def test_counts_and_events(tmp_path, paper, session):
    counts = np.random.default_rng(6).integers(-(2**15), 2**15, (2, 30_000)).astype(np.int16)
    scaling = Scaling("int16", np.array([[0.0, 1e-4], [1e-3, 2e-4]]))
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, scaling=scaling) as recording:
        for at in range(0, 30_000, 1000):
            recording.write_block(Block(at, counts[:, at : at + 1000]))
        recording.event("aborted", "the lid was open", 0.5)
    found = by_mcap_core(path)
    assert found["digests"] == digests(*counts)
    assert found["events"] == [["aborted", "the lid was open", 4]]


def test_a_recovered_one(tmp_path, record):
    volts = np.random.default_rng(6).standard_normal((2, 40_960))
    path = record(tmp_path / "press.mcap", volts)
    corrupt(path, chunks(path)[0][0] + 99)
    assert by_mcap_core(recover(path).path)["digests"] == digests(*volts[:, 10_240:])
