"""The commands that are killed: what each works on, and how its result is judged."""

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.micrographs import Camera, carved, draw
from sautereau.analysis.campaign.table import read_campaign
from sautereau.daq.file.reading import read_recording, read_session
from sautereau.rig.disk import unchanged
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import rig_text
from tests.forked import CommandServer
from tests.fuzz.tables import campaign_of
from tests.presses import MUTE_TEXT, QUICK
from tests.recordings import write_recording

PRESSES, RECORDINGS = 4, 300
PIXEL = 9e-3  # mm, of a photograph
LEFT_OVER = re.compile(r"\.new$|ing\.part$|\.parquet\.part$")
"""Names of files that only exist while something is written."""


class Lost(Exception):  # noqa: N818
    """Something announced is lost, or the result is not that of an undisturbed run."""


@dataclass(frozen=True)
class Command:
    """A command that runs in a folder beside `inputs`."""

    words: str
    check: Callable[[Path, Path], None]
    """Compares a folder with that of an undisturbed run; raises Lost."""
    prepare: tuple[str, ...] = ()
    """Files and folders of `inputs` that are copied into its folder."""

    def check_broken(self, folder: Path, reference: Path) -> None:
        """Check that no file of a broken run has its final name and not its content."""
        if self.check is _same:
            _same(folder, reference, ended=False)


def make_inputs(server: CommandServer, folder: Path) -> None:
    """Make what the commands work on."""
    rig = with_values(load_rig(), QUICK).model_copy(update={"assumed": {}})  # all is measured
    text = rig_text(rig)
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    (folder / "bare.toml").write_text(MUTE_TEXT, encoding="utf-8")

    def run(words: str) -> None:
        done = server.run(*words.split(), folder=folder)
        if done.returncode:
            raise RuntimeError(f"sautereau {words}: {done.stderr}")

    run("press rig.toml --scene paper --seed 1 -n 2 --out session")
    run("export session/press-0001.mcap session/press-0002.mcap --to csv --out .")
    (folder / "plan.csv").write_text("press.jack_speed,repeats\n0.06 m/s,2\n0.07 m/s,2\n")
    run("press rig.toml --scene ideal --seed 1 --table plan.csv --out speeds")
    (folder / "keys.csv").write_text("key,string.length [mm]\na,600\nb,700\n")
    campaign_of(folder / "campaign.parquet")
    draw(carved(np.random.default_rng(3)), Camera(pixel=PIXEL)).save(folder / "photo.png")
    many = folder / "recordings"
    many.mkdir()
    for number in range(RECORDINGS):
        (many / f"{number:04}.mcap").hardlink_to(folder / "session" / "press-0001.mcap")
    whole = (folder / "session" / "press-0002.mcap").read_bytes()
    (folder / "cut-off.mcap.part").write_bytes(whole[: 2 * len(whole) // 3])
    for path in (folder / "session").glob("*.png"):
        path.unlink()
    one = read_recording(folder / "session" / "press-0001.mcap")
    volts = np.stack([one.volts[channel.name] for channel in one.rig.daq.channels])
    rest = np.repeat(volts[:, :1], round(0.2 * one.rate), 1)
    several = np.concatenate([rest, *[volts, rest] * PRESSES], 1)
    write_recording(
        folder / "long.mcap",
        one.rig,
        several,
        session=one.session,
        rate=one.rate,
        t0_ns=one.t0_ns,
    )


def presses_once(folder: Path, n: int | None) -> None:
    """Check that a session has every press once, complete."""
    found: Counter[int | None] = Counter()
    for path in sorted((folder / "out").glob("press-*.mcap")):
        if not read_recording(path).complete:
            raise Lost(f"{path.name} is not complete")
        found[read_session(path).item] += 1
    if found != Counter(range(1, (n or len(found)) + 1)):
        raise Lost(f"the presses in the folder are {dict(found)}")


def _pressed(folder: Path, reference: Path) -> None:
    presses_once(folder, PRESSES)


def _pressed_once(folder: Path, reference: Path) -> None:
    presses_once(folder, 1)


def _learned(folder: Path, reference: Path) -> None:
    presses_once(folder, None)
    if not json.loads((folder / "out" / "learned.json").read_bytes())["rise"]:
        raise Lost("learned.json is empty")


def _acquired(folder: Path, reference: Path) -> None:
    found = sorted(folder.glob("acquire-*.mcap"))
    if not found or not all(read_recording(path).complete for path in found):
        raise Lost(f"of {len(found)} recordings one is not complete, or there is none")


def _drawn(folder: Path, reference: Path) -> None:
    """Without a cache the times are measured again, and differ."""
    if not (folder / "plot.png").read_bytes().endswith(b"IEND\xaeB`\x82"):
        raise Lost("the picture is not complete")


def _saved(folder: Path, reference: Path) -> None:
    if _undated(folder / "rig.toml") != _undated(reference / "rig.toml"):
        raise Lost("the rig differs from that of an undisturbed run")


def _same(folder: Path, reference: Path, ended: bool = True) -> None:
    """Compare all files with those of the undisturbed run, or those that a broken one has left."""
    for path in reference.rglob("*"):
        name = path.relative_to(reference)
        found = folder / name
        if not path.is_file() or not (ended or found.exists()):
            continue
        if not found.is_file() or _undated(found) != _undated(path):
            raise Lost(f"{name} is missing, or differs from that of an undisturbed run")


def _undated(path: Path) -> bytes:
    """Return the content of a file without dates, which differ from run to run."""
    return re.sub(rb"\d{4}-\d\d-\d\d", b"DATE", path.read_bytes())


def _campaign(folder: Path, reference: Path) -> None:
    found, expected = (read_campaign(f / "table.parquet") for f in (folder, reference))
    if found.faults or not found.table.equals(expected.table):
        raise Lost("the table differs from that of an undisturbed run")


def _report(folder: Path, reference: Path) -> None:
    page, expected = (f / "session" / "report.html" for f in (folder, reference))
    size, right = (path.stat().st_size for path in (page, expected))
    if abs(size - right) > 100 or not unchanged(page):
        raise Lost(f"the page has {size} bytes, not about {right}, or another SHA-256 than it says")


_CSV = "press-0001.csv", "press-0001.csv.json", "press-0002.csv", "press-0002.csv.json"
COMMANDS = {
    "press": Command(
        f"press ../inputs/rig.toml --scene ../inputs/bare.toml -n {PRESSES} --out out", _pressed
    ),
    "learn": Command("learn ../inputs/rig.toml --sim --seed 1 -n 4 --out out --force", _learned),
    "campaign": Command(
        "campaign ../inputs/recordings --out table.parquet --processes 1", _campaign
    ),
    "export": Command(
        "export session/press-0001.mcap session/press-0002.mcap --to csv --force",
        _same,
        ("session",),
    ),
    "identify": Command(
        "identify ../inputs/session --free plectrum.overlap --starts 1 --out fitted.toml"
        " --plot fitted.png --force",
        _same,
    ),
    "plan": Command("plan ../inputs/rig.toml --out plan.json --plot plan.png --force", _same),
    "listen": Command("listen ../inputs/rig.toml --duration 1s --out pluck.wav --force", _same),
    "animate": Command(
        "animate ../inputs/session/press-0001.mcap --since 50ms --until 52ms --slow 80"
        " --out pluck.gif --force",
        _same,
    ),
    "import": Command("import press-0001.csv press-0002.csv --out . --force", _same, _CSV),
    "report": Command("report session --force", _report, ("session",)),
    "split": Command("split long.mcap --out parts --force", _same, ("long.mcap",)),
    "init": Command("init my-rig.toml", _same),
    "phases": Command("phases ../inputs/session --plot phases.png --force", _same),
    "package": Command("package session --out archive.zip --force", _same, ("session",)),
    "voice": Command(
        "voice ../inputs/rig.toml --like paper --out carved.csv --plot cut.png --force", _same
    ),
    "predict": Command("predict ../inputs/rig.toml --map map.csv --force", _same),
    "table": Command(
        "export session/press-0001.mcap --to parquet --out table.parquet --force",
        _same,
        ("session",),
    ),
    "acquire": Command(
        "acquire ../inputs/rig.toml --sim --seed 1 --duration 0.1s",
        _acquired,
    ),
    "replay": Command(
        "replay ../inputs/session/press-0001.mcap ../inputs/rig.toml --scene ../inputs/bare.toml"
        " --out out",
        _pressed_once,
    ),
    "setup": Command(
        "setup rig.toml loops --recording ../inputs/session/press-0001.mcap"
        " --recording ../inputs/session/press-0002.mcap --save",
        _saved,
        ("rig.toml",),
    ),
    "outline": Command(
        f"outline ../inputs/photo.png --pixels-per-mm {1 / PIXEL} --out carved.csv"
        " --plot photo.png --force",
        _same,
    ),
    **{
        words.split()[0]: Command(f"{words} --plot plot.png --force", _same)
        for words in (
            "compare ../inputs/session",
            "transient ../inputs/session",
            "mount ../inputs/rig.toml",
            "effects ../inputs/speeds",
            "survey ../inputs/rig.toml ../inputs/keys.csv",
            "touch ../inputs/campaign.parquet",
        )
    },
    "trade": Command("trade ../inputs/rig.toml --scene ideal --plot plot.png --force", _drawn),
    "recover": Command("recover cut-off.mcap.part --force", _same, ("cut-off.mcap.part",)),
}


def fresh(command: Command, inputs: Path, folder: Path) -> None:
    """Make the folder in which a command runs."""
    folder.mkdir()
    for name in command.prepare:
        source = inputs / name
        if source.is_dir():
            shutil.copytree(source, folder / name)
        else:
            shutil.copy2(source, folder / name)
