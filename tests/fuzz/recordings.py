"""Recordings and exports: damaged as disks do, and changed with their checksums made right."""

import contextlib
import io
import json
import random
from pathlib import Path

import numpy as np

from benchmarks.simulated import acquired
from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.results.press import press_summary
from sautereau.commands.output import json_text
from sautereau.daq.convert.export import export
from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import (
    read_parts,
    read_recording,
    read_session,
    read_window,
    stream,
)
from sautereau.daq.file.recorded import Block, Joints, SessionInfo
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.samples import Scaling
from sautereau.daq.file.survey import describe
from sautereau.rig.load import load_rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.fuzz import mcap, mutate
from tests.fuzz.run import Wrong

OLD = Path(__file__).parents[1] / "data" / "written_by_0.1" / "session" / "press-0001.mcap"
SESSION = SessionInfo(
    press=1, started="2026-02-03T04:05:06+01:00", simulated=True, controller="DMC-4123",
    daq="sautereau stand-in", scene="finger = 'ideal'\n", seed=11, notes="é\x1b[2J",
)  # fmt: skip


def small(path: Path) -> Path:
    """Write a recording of the counts of noise with everything in it, in several chunks."""
    rig, t = load_rig(), np.linspace(0, 0.14, 30)
    counts = np.random.default_rng(3).integers(-30_000, 30_000, (2, 6000)).astype(np.int16)
    scaling = Scaling("int16", np.array([[1e-3, 3e-4, 1e-12], [0.0, 2e-4, 0.0]]))
    clock = iter(range(1_700_000_000_000_000_000, 2**63, 20_000_000)).__next__
    with Recording(path, rig, session=SESSION, scaling=scaling, clock=clock) as recording:
        recording.write_plan(t, t + 1, t + 2, t + 3)
        for first in range(0, 6000, 1000):
            recording.write_block(Block(first, counts[:, first : first + 1000]))
            recording.flush()
        recording.event("trigger", "PFI0 rose", 0.0)
        recording.write_joints(Joints(t, t + 4, t + 5))
    return path


def pressed(path: Path) -> Path:
    """Write the recording of a simulated press, of which the analysis finds phases."""
    rig, scene = load_rig(), load_scene("ideal")
    one = acquired(rig, scene, observe(rig, scene))[0]
    with Recording(path, rig, session=SESSION, rate=one.rate) as recording:
        volts = np.stack([one.volts[channel.name] for channel in rig.daq.channels])
        recording.write_block(Block(one.first_sample, volts))
        recording.event("trigger", "edge on PFI0", 0.0)
    return path


class Recordings:
    """Read, described, recovered and, where it can be, analysed."""

    def __init__(self, folder: Path):
        self._folder = folder
        paths = [small(folder / "a.mcap"), pressed(folder / "b.mcap"), OLD]
        self._intact = [path.read_bytes() for path in paths]
        self._truth = [read_recording(path) for path in paths]

    def case(self, dice: random.Random) -> str:
        index = dice.choice((0, 0, 0, 0, 1, 2))
        intact, truth = self._intact[index], self._truth[index]
        harmed, data = self.damaged(intact, dice)
        path, out = self._folder / "case.mcap", self._folder / "out.mcap"
        path.write_bytes(data)
        out.unlink(missing_ok=True)
        outcome = "refused"
        with contextlib.suppress(RecordingError):
            read_session(path)
        with contextlib.suppress(RecordingError):
            json_text(dict(describe(path)))
        with contextlib.suppress(RecordingError):
            found = read_recording(path)
            _check([found], truth if harmed else None)
            outcome = "read"
            list(stream(path, 0.05))
            read_window(path, 0.0, 0.01)
        with contextlib.suppress(RecordingError):
            recover(path, out)
            outcome += ", recovered"
            _check(read_parts(out), truth if harmed else None)
        return outcome

    def damaged(self, intact: bytes, dice: random.Random) -> tuple[bool, bytes]:
        """Return another file; and whether its samples, if it has any, must be the true ones."""
        harmed = dice.random() < 0.25
        return harmed, mutate.of_bytes(intact, dice) if harmed else mcap.mutated(intact, dice)


class Lengths(Recordings):
    """Recordings with lengths without sense, or with much in a small file."""

    def damaged(self, intact: bytes, dice: random.Random) -> tuple[bool, bytes]:
        return True, dice.choice((mcap.oversized, mcap.bomb))(intact, dice)


class Analysis:
    """A press with other volts, or with another rig in its metadata."""

    def __init__(self, folder: Path):
        self._path = folder / "case.mcap"
        self._intact = [pressed(folder / "b.mcap").read_bytes(), OLD.read_bytes()]

    def case(self, dice: random.Random) -> str:
        parts = mcap.records(dice.choice(self._intact)[len(mcap.MAGIC) : -len(mcap.MAGIC)])
        if dice.random() < 0.5:
            mcap.change_metadata(parts, dice, "rig")
        else:
            mcap.change_volts(parts, dice)
        self._path.write_bytes(mcap.together(parts))
        press = load_press(self._path)
        json_text(press_summary(press, find_phases(press)))
        return "analysed"


def _check(parts, truth) -> None:
    for part in parts:
        if not (0 < part.rate < np.inf and part.n_samples):
            raise Wrong(f"rate {part.rate}, {part.n_samples} samples")
        time = part.time
        if not np.isfinite(time).all():
            raise Wrong("times are not finite")
        first, stop = part.first_sample, part.first_sample + part.n_samples
        for name, volts in truth.volts.items() if truth else ():
            true = volts[first - truth.first_sample : stop - truth.first_sample].view(np.uint64)
            if not np.array_equal(part.volts[name].view(np.uint64), true):
                raise Wrong(f"wrong samples of {name}")


class Exports:
    """Exported tables with their document: restored exactly, or refused."""

    def __init__(self, folder: Path):
        self._folder = folder
        path = small(folder / "a.mcap")
        self._truth = read_recording(path)
        export(path, "csv", folder / "a.csv")
        export(path, "parquet", folder / "a.parquet")
        self._table = (folder / "a.csv").read_text()
        self._document = (folder / "a.csv.json").read_text()
        self._parquet = (folder / "a.parquet").read_bytes()

    def case(self, dice: random.Random) -> str:
        out = self._folder / "out.mcap"
        out.unlink(missing_ok=True)
        match dice.randrange(3):
            case 0:
                path = self._write("case.csv", self._table.encode())
                self._write("case.csv.json", mutate.of_json(self._document, dice))
            case 1:
                path = self._write("case.csv", mutate.of_text(self._table, dice).encode())
                self._write("case.csv.json", self._document.encode())
            case _:
                path = self._write("case.parquet", self._changed(dice))
        import_file(path, out, rig=None, options=ImportOptions())
        found = read_recording(out)
        for name, volts in found.volts.items():
            if not np.array_equal(volts, self._truth.volts.get(name)):
                raise Wrong(f"wrong samples of {name}")
        return "restored"

    def _write(self, name: str, data: bytes) -> Path:
        path = self._folder / name
        path.write_bytes(data)
        return path

    def _changed(self, dice: random.Random) -> bytes:
        import pyarrow.parquet as pq

        if dice.random() < 0.3:
            return mutate.of_bytes(self._parquet, dice)
        table = pq.read_table(io.BytesIO(self._parquet))
        document = json.loads(table.schema.metadata[b"sautereau"])
        changed = mutate.json_text(mutate.of_tree(document, dice)).encode()
        file = io.BytesIO()
        pq.write_table(table.replace_schema_metadata({b"sautereau": changed}), file)
        return file.getvalue()
