"""Complete commands: hostile options, and files that are missing, damaged, foreign, or no files."""

import contextlib
import io
import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from unittest import mock

from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import rig_text
from tests.fuzz import mutate
from tests.fuzz.recordings import pressed
from tests.fuzz.run import Wrong
from tests.presses import MUTE_TEXT, QUICK

COMMANDS = (
    "phases MCAP", "phases MCAP MCAP --plot PNG", "phases MCAP --at TEXT", "compare MCAP",
    "compare MCAP --rig RIG --level LEVEL --plot PNG", "compare MCAP --against MCAP",
    "identify MCAP --free NAMES --starts N --out TOML", "identify MCAP --free NAMES --prior PRIOR",
    "transient MCAP --known TEXT", "info MCAP", "recover MCAP", "recover MCAP --out NEW",
    "split MCAP --out FOLDER", "export MCAP --to FORMAT --out FOLDER", "export MCAP --to FORMAT",
    "import CSV --out NEW --rig RIG --measured --column.velocity NAME --unit.velocity UNIT"
    " --without force --rate RATE --started DATE --trigger TIME",
    "import CSV --out NEW --rig RIG --time NAME --time-unit UNIT --profile TOML --notes TEXT",
    "report FOLDER --out HTML", "report FOLDER", "campaign FOLDER --out PARQUET --processes 1",
    "touch PARQUET --labels CSV", "survey RIG CSV --level LEVEL", "survey TOML",
    "animate MCAP --out GIF --since TIME --until TIME --slow NUMBER",
    "listen RIG --out WAV --duration TIME --held TIME --quality NUMBER --level LEVEL",
    "plan RIG --out JSON --plot PNG --bench PNG", "plan RIG", "plan RIG --learned JSON",
    "mount RIG --touches CSV",
    "predict RIG --level LEVEL", "init TOML", "doctor RIG", "setup RIG port", "setup RIG home",
    "setup RIG home --answers TOML",
    "press RIG --scene SCENE -n N --out FOLDER --notes TEXT --rest TIME --warm-up N",
    "press RIG --scene SCENE --table CSV --learned JSON --out FOLDER",
    "press RIG --scene SCENE --feed-forward MCAP --out FOLDER --seed N",
    "press RIG --out FOLDER", "replay MCAP RIG --scene SCENE --out FOLDER",
    "learn RIG --scene SCENE -n 1 --out FOLDER --notes TEXT",
    "acquire RIG --sim --duration TIME --out NEW --notes TEXT", "acquire RIG --out NEW",
)  # fmt: skip
"""Commands with placeholders, each replaced by a hostile value, or by one that works."""
ANY_FILE = (
    "missing", "folder", "empty", "pipe", "dangling", "loop", "binary", "huge", "/dev/zero",
    "/dev/null", "~nosuchuser/x", "a" * 300, "", ".", "..", "/", "-", "--", "*", "[", "x/" * 2000,
    "\udcff", "folder/\udcff.mcap", "link.mcap",
)  # fmt: skip
GOOD = {
    "MCAP": ("good.mcap", "session", "session/*.mcap"),
    "RIG": ("rig.toml", "paper"),
    "SCENE": ("bare.toml", "ideal"),
    "CSV": ("table.csv", "plan.csv"),
    "JSON": ("new.json",),
    "TOML": ("new.toml", "rig.toml"),
    "FOLDER": ("new", "session"),
    "NEW": ("new.mcap",),
    **{kind: (f"new.{kind.lower()}",) for kind in ("PNG", "HTML", "PARQUET", "GIF", "WAV")},
    "LEVEL": ("elastica", "rods", "two-beam"),
    "NAMES": ("plectrum.overlap", "key.inertia,plectrum.overlap"),
    "PRIOR": ("key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2", "plectrum.overlap=0.1 mm to 0.5 mm"),
    "FORMAT": ("csv", "parquet", "wav", "h5", "tdms", "urdf"),
    "N": ("1", "2"),
    "NUMBER": ("20", "1500"),
    "TIME": ("1 ms", "0.05 s", "50 ms"),
    "RATE": ("1 kHz", "51.2 kHz"),
    "UNIT": ("m/s", "ms", "V"),
    "NAME": ("v", "t", "1"),
    "DATE": ("2026-02-03T04:05:06+01:00", "modified"),
    "TEXT": ("a note", "52.1 ms +- 0.3 ms to 72.05 ms +- 0.05 ms", "none", "jack=300 Hz"),
}
FILES = {"MCAP", "RIG", "SCENE", "CSV", "JSON", "TOML", "FOLDER", "NEW", "PNG", "HTML", "PARQUET"}
CHANGED = ("good.mcap", "rig.toml", "bare.toml", "table.csv", "plan.csv", "session/session.json")
SHARE = 0.25  # Dimensionless fraction of the values that are hostile
LONGEST_PRESS = 0.2  # s, of a time: a session rests for it, and an acquisition lasts it


class Commands:
    """Runs a command in a folder of its own, in this process."""

    def __init__(self, folder: Path):
        self._kept, self._work = folder / "kept", folder / "work"
        self._kept.mkdir(parents=True)
        (self._kept / "session").mkdir()
        pressed(self._kept / "good.mcap")
        shutil.copy(self._kept / "good.mcap", self._kept / "session" / "press-0001.mcap")
        (self._kept / "session" / "session.json").write_text('{"version": 1}')
        (self._kept / "rig.toml").write_text(rig_text(with_values(load_rig(), QUICK)))
        (self._kept / "bare.toml").write_text(MUTE_TEXT)
        rows = "".join(f"{i},{i * 1e-3:.6f}\n" for i in range(40))
        (self._kept / "table.csv").write_text(f"t (ms),v\n{rows}")
        (self._kept / "plan.csv").write_text("press.jack_speed,repeats\n0.07 m/s,1\n")
        (self._kept / "binary").write_bytes(random.Random(0).randbytes(3000))
        (self._kept / "empty").touch()
        (self._kept / "folder").mkdir()

    def case(self, dice: random.Random) -> str:
        self._lay(dice)
        words = [self._word(word, dice) for word in dice.choice(COMMANDS).split()]
        words += [word for word in ("--json", "--force", "-v", "-q") if dice.random() < 0.2]
        if dice.random() < 0.1:
            words += ["--log", dice.choice(("new.log", *ANY_FILE[:12]))]
        status, out, err = self._run(words)
        if status not in (0, 1, 2) or "Traceback" in err:
            raise Wrong(f"{words}: status {status}: {err[-2000:]}")
        if status and "sautereau:" not in err and '"error"' not in err:
            raise Wrong(f"{words}: no message: {err[-500:]}")
        options = words[: words.index("--")] if "--" in words else words
        if "--json" in options and status == 0 and not isinstance(json.loads(out), dict):
            raise Wrong(f"{words}: no JSON object: {out[:200]}")
        if (self._work / "victim").read_text() != "precious":
            raise Wrong(f"{words}: wrote through a link")
        return words[0]

    def _lay(self, dice: random.Random) -> None:
        """Make the folder of the command, sometimes with one file changed."""
        subprocess.run(["rm", "-rf", self._work], check=True)  # rmtree does not reach all depths
        shutil.copytree(self._kept, self._work)
        os.mkfifo(self._work / "pipe")
        (self._work / "victim").write_text("precious")
        for name, target in (("dangling", "nowhere"), ("loop", "loop"), ("new.png", "victim")):
            if name != "new.png" or dice.random() < 0.2:
                (self._work / name).symlink_to(target)
        (self._work / "link.mcap").symlink_to("good.mcap")
        with (self._work / "huge").open("wb") as file:
            file.truncate(10**10)
        if dice.random() < 0.3:
            path = self._work / dice.choice(CHANGED)
            data = path.read_bytes()
            binary = path.suffix == ".mcap"
            changed = None if binary else mutate.of_text(data.decode(), dice)
            path.write_bytes(
                mutate.of_bytes(data, dice) if changed is None else mutate.as_bytes(changed, dice)
            )

    def _word(self, word: str, dice: random.Random) -> str:
        if word not in GOOD:
            return word
        if dice.random() > SHARE:
            return dice.choice(GOOD[word])
        if word in FILES:
            return dice.choice(ANY_FILE)
        number = dice.choice(mutate.NUMBERS)
        if word in ("N", "TIME") and _large(number):
            number = "1e-9"
        unit = dice.choice(("", " s", " ms", f" {dice.choice(mutate.UNITS)}"))
        texts = (f"{number}{unit}", dice.choice(mutate.TEXTS).replace("\0", ""), "\udcff", number)
        return dice.choice(texts)

    def _run(self, words: list[str]) -> tuple[int, str, str]:
        from sautereau.commands.app import main

        out, err, status = io.StringIO(), io.StringIO(), 0
        before = Path.cwd()
        os.chdir(self._work)
        try:
            with (
                mock.patch.object(sys, "argv", ["sautereau", *words]),
                contextlib.redirect_stdout(out),
                contextlib.redirect_stderr(err),
            ):
                try:
                    main()
                except SystemExit as end:
                    status = end.code if isinstance(end.code, int) else 1
        finally:
            os.chdir(before)
        return status, out.getvalue(), err.getvalue()


def _large(number: str) -> bool:
    """Return whether a wait or a count of this number would take long, rightly so."""
    try:
        return float(number) > LONGEST_PRESS
    except ValueError:
        return True
