"""Files that the commands work on, made when they are first used, and the commands' answers."""

import contextlib
import io
import json
import os
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Block, Recorded
from sautereau.daq.file.recording import Recording
from sautereau.rig.errors import SautereauError
from sautereau.rig.text import rig_text
from tests.golden.commands import COMMANDS, ON_BENCH
from tests.golden.files import contents, invariable, signals_of
from tests.golden.foreign import FOREIGN
from tests.golden.plain import lines_of, plain
from tests.golden.presses import carved_rig
from tests.presses import MUTE_TEXT, QUICK_TEXT
from tests.recordings import write_recording
from tests.sessions import session_writer

DATA = Path(__file__).parents[1] / "data"
DAY = 1_770_087_906_000_000_000  # ns since 1970, of the presses that are written without devices
CUT = 300_000  # Bytes of a truncated recording


class Corpus:
    """A working folder. `corpus[NAME]` makes an input and returns its path in the folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._answers: dict[tuple[str, bool], dict[str, Any]] = {}
        self._one: Recorded | None = None

    @contextlib.contextmanager
    def inside(self) -> Iterator[None]:
        """Work in the folder, so that no text contains its path; with caches of its own."""
        own = {"XDG_CACHE_HOME": str(self.folder / "cache"), "NO_COLOR": "1", "COLUMNS": "80"}
        with contextlib.chdir(self.folder), mock.patch.dict(os.environ, own):
            yield

    def __getitem__(self, name: str) -> str:
        made = f"json/{name}" if name in COMMANDS else None
        if made:
            self.answer(name, as_json=True)
            return made
        path = self.folder / INPUTS[name][0]
        if not path.exists():
            INPUTS[name][1](self, path)
        return path.relative_to(self.folder).as_posix()

    def write_presses(
        self, folder: Path, first: int = 1, scale: float = 1.0, session: str = ""
    ) -> None:
        """Write three noisy presses of the scene `ideal`, without the devices, on a fixed day."""
        self._one = one = self._one or session_writer().one
        volts = np.stack([one.volts[channel.name] for channel in one.rig.daq.channels])
        folder.mkdir()
        for number in range(first, first + 3):
            noise = 1e-3 * np.random.default_rng(number).standard_normal(volts.shape)
            about = replace(one.session, press=number, item=number, session=session)
            path = folder / f"press-{number:04}.mcap"
            with Recording(path, one.rig, session=about, rate=one.rate, t0_ns=DAY) as recording:
                recording.write_block(Block(one.first_sample, scale * volts + noise))
                recording.event("trigger", "edge on PFI0", 0.0)

    def answer(self, name: str, as_json: bool) -> dict[str, Any]:
        """Run a command once, and return what it prints, and what the files contain it writes."""
        if (name, as_json) not in self._answers:
            self._answers[name, as_json] = self._run(name, as_json)
        return self._answers[name, as_json]

    def _run(self, name: str, as_json: bool) -> dict[str, Any]:
        out = "json" if as_json else "text"
        (self.folder / out).mkdir(exist_ok=True)
        given = _Given(self, f"{out}/{name}")
        words = shlex.split(COMMANDS[name].format_map(given))
        before = _files(self.folder / out)
        status, printed, error = run(*words, *["--json"] * as_json)
        result: dict[str, Any] = {"status": status} | ({"error": error} if error else {})
        if not as_json:
            return result | {"text": lines_of(printed)}
        result["json"] = plain(invariable(json.loads(printed))) if printed else None
        new = [path for path in _files(self.folder / out) if path not in before]
        written = {path.relative_to(self.folder / out).as_posix(): contents(path) for path in new}
        on_bench = name in ON_BENCH  # where other samples are a changed stand-in
        pressed = [path for path, one in written.items() if on_bench and "sampled" in one]
        sampled = given.samples | {path: written[path]["sampled"] for path in pressed}
        result |= {"files": written} if written else {}
        return {"sampled": sampled} | result if sampled else result


class _Given(dict[str, str]):
    """Inputs by their names, and the checksums of those that are recordings."""

    def __init__(self, corpus: Corpus, out: str):
        super().__init__(o=shlex.quote(out))
        self._corpus, self.samples = corpus, {}

    def __missing__(self, name: str) -> str:
        path = self._corpus[name.replace("_", " ")]
        found = self._corpus.folder / path
        for each in sorted(found.rglob("*.mcap")) if found.is_dir() else [found]:
            if each.suffix == ".mcap":
                self.samples[each.relative_to(self._corpus.folder).as_posix()] = signals_of(each)
        return shlex.quote(path)


def run(*words: str) -> tuple[int, str, list[str]]:
    """Run a command in this process; return its status, output, and lines of errors."""
    out, err = io.StringIO(), io.StringIO()
    streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with streams[0], streams[1], mock.patch.object(sys, "argv", ["sautereau", *words]):
        try:
            status = app(list(words), print_error=False, exit_on_error=False) or 0
        except SautereauError as error:
            status = 1
            err.write(f"{type(error).__name__}: {error}")
    return status, out.getvalue(), lines_of(err.getvalue())


def _files(folder: Path) -> list[Path]:
    known = (".mcap", ".csv", ".parquet", ".h5", ".tdms", ".wav", ".html", ".json", ".toml",
             ".urdf", ".png", ".gif")  # fmt: skip
    return sorted(path for path in folder.rglob("*") if path.suffix in known)


def _cut(corpus: Corpus, path: Path) -> None:
    whole = (corpus.folder / corpus["presses"] / "press-0002.mcap").read_bytes()
    path.write_bytes(whole[:CUT])


def _long(corpus: Corpus, path: Path) -> None:
    """Write a recording of three presses with rests between them."""
    one = read_recording(corpus.folder / corpus["presses"] / "press-0001.mcap")
    volts = np.stack([one.volts[channel.name] for channel in one.rig.daq.channels])
    rest = np.repeat(volts[:, :1], round(0.2 * one.rate), 1)
    several = np.concatenate([rest, *[volts, rest] * 3], 1)
    write_recording(path, one.rig, several, session=one.session, rate=one.rate, t0_ns=one.t0_ns)


def _text(text: str) -> Callable[[Corpus, Path], object]:
    return lambda corpus, path: path.write_text(text, encoding="utf-8")


KEYS = "key,overlap [mm],string.tension [N],recordings\n" + "".join(
    f"k{k},{0.3 - 0.004 * k + 0.04 * (k == 4)},{60 + k},{'presses' * (k == 2)}\n" for k in range(7)
)
"""Table of seven keys, of which one is uneven and one has recordings."""
INPUTS: dict[str, tuple[str, Callable[[Corpus, Path], object]]] = {
    "rig": ("my-rig.toml", _text(QUICK_TEXT)),
    "carved": ("carved.toml", lambda _, path: path.write_text(rig_text(carved_rig()), "utf-8")),
    "mute": ("mute.toml", _text(f'{MUTE_TEXT}truth = {{ "arm.base_z" = "171.12 mm" }}\n')),
    "keys": ("keys.csv", _text(KEYS)),
    "presses": ("presses", lambda corpus, path: corpus.write_presses(path, session="one")),
    "others": ("others", lambda corpus, path: corpus.write_presses(path, scale=0.9, first=4)),
    "old": ("old", lambda _, path: shutil.copytree(DATA / "written_by_0.1" / "session", path)),
    "old table": (
        "old.parquet",
        lambda _, path: shutil.copy(DATA / "written_by_0.1" / "table.parquet", path),
    ),
    "format 1": ("format-1.mcap", lambda _, path: shutil.copy(DATA / "format_1.mcap", path)),
    "cut": ("cut-off.mcap.part", _cut),
    "long": ("long.mcap", _long),
    **{
        f"foreign {kind}": (f"foreign.{kind}", lambda _, path, write=write: write(path))
        for kind, (write, _) in FOREIGN.items()
    },
}
"""Name in the folder and maker of each input; results of commands are inputs as well."""
