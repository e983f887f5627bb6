"""Commands in hostile surroundings: names, environment, failing system calls, clocks, full disks.

Each case runs a command of tests/kills there. It ends with its result, or with a message that says
what is wrong; then the same command, undisturbed, ends with its result.
"""

import contextlib
import ctypes
import errno
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from sautereau.daq.file.reading import read_recording
from tests.forked import ROOT, CommandServer, unwrapped
from tests.fuzz.run import Wrong
from tests.kills.commands import COMMANDS, LEFT_OVER, Lost, fresh, make_inputs

CODES = {errno.EIO: "EIO", errno.EINVAL: "EINVAL", errno.ENOSPC: "ENOSPC", errno.EPERM: "EPERM"}
EVERYWHERE = ("link any 1", "link any 95", "flock any 37", "chmod any 1")
"""Calls that a file system does not have: operation and error at every site."""
CENTURY = 36525 * 86400.0  # s
LONG = "x" * 250  # a name of 255 bytes, with its extension
NAMES = (
    "a b", "a\nb", "-x", "--out", "\udcff", LONG, "\u202eabc", "עברית", "con", "nul.x", "%s", "{0}",
    "$HOME", "~", "#1", "it's", 'a"b', "[1]", "*", "?", "a\tb", "\x1b[2J", ".hidden", "a.", "é",
    "e\u0301", "a&b;c|d", "<b>", "\\", "$_$", "a,b", "=1+1", "press-0001.mcap.part", "1e5",
)  # fmt: skip
NAMED = (
    "init OUT.toml", "plan IN.toml --out OUT.json --plot OUT.png", "info IN.mcap",
    "press IN.toml --scene ../inputs/bare.toml -n 1 --out OUT", "phases IN.mcap --plot OUT.png",
    "export IN.mcap --to csv --out OUT", "export IN.mcap --to parquet", "export IN.mcap --to h5",
    "report IN --out OUT.html", "report IN", "campaign IN --out OUT.parquet --processes 1",
    "identify IN.mcap --free plectrum.overlap --starts 1 --out OUT.toml --plot OUT.png",
    "import IN.csv --out OUT.mcap", "recover IN.mcap.part", "recover IN.mcap.part --out OUT.mcap",
    "split IN.long.mcap --out OUT", "package IN --out OUT.zip", "compare IN.mcap --plot OUT.svg",
    "animate IN.mcap --since 50ms --until 52ms --slow 80 --out OUT.gif", "predict IN.toml",
    "listen IN.toml --duration 1s --out OUT.wav", "phases IN --log OUT.log",
)  # fmt: skip
"""Commands whose files get a hostile name: IN those they read, OUT those they write."""


def limited(what: int, most: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(what, (most, most))


def closing(*streams: int) -> Callable[[], None]:
    return lambda: [os.close(stream) for stream in streams] and None


@dataclass(frozen=True)
class Situation:
    """What a process finds when it starts."""

    change: Callable[[], object] = lambda: None
    """Called in it."""
    environment: dict[str, str | None] = field(default_factory=dict)
    fails: str = "(?!)"
    """What the message says where a command may fail; none may, by default."""
    before: tuple[str, ...] = ()
    """Words before the command."""
    silent: bool = False
    """Whether no message can be seen."""


NO_FOLDER = "/nowhere/at/all"
PLAIN = ("setpriv", "--bounding-set", "-dac_override,-dac_read_search")
"""Starts a program for which root's rights to all files are gone."""
SITUATIONS = {
    "umask 0777": Situation(lambda: os.umask(0o777)),
    "umask 0777, not root": Situation(
        lambda: os.umask(0o777), fails="ermission", before=PLAIN
    ),
    "umask 0": Situation(lambda: os.umask(0)),
    **{
        f"{name}={value}": Situation(environment={name: value})
        for name, value in (
            ("LC_ALL", "C"), ("LC_ALL", "xx_YY.UTF-8"), ("LC_ALL", "de_DE.ISO-8859-1"),
            ("PYTHONIOENCODING", "ascii"), ("PYTHONUTF8", "0"), ("PYTHONOPTIMIZE", "1"),
            ("HOME", NO_FOLDER), ("HOME", "/dev/null"), ("HOME", None),
            ("TMPDIR", NO_FOLDER), ("MPLCONFIGDIR", NO_FOLDER), ("TERM", None), ("PATH", None),
            ("COLUMNS", "1"), ("TZ", "nowhere"), ("PYTHONUNBUFFERED", "1"),
        )
    },
    "no cache": Situation(  # where the locks of devices are
        environment={"XDG_CACHE_HOME": "/proc"}, fails=r"/proc/.*\(XDG_CACHE_HOME\)"
    ),
    # What chooses the kernels of BLAS changes last digits.
    "bare": Situation(
        environment=dict.fromkeys(name for name in os.environ if "BLAS" not in name)
    ),
    "ascii": Situation(environment={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
    "no input": Situation(closing(0)),
    "no output": Situation(closing(1)),
    "no errors": Situation(closing(2), silent=True),
    "no streams": Situation(closing(0, 1, 2), silent=True),
    "full output": Situation(
        lambda: os.dup2(os.open("/dev/full", os.O_WRONLY), 1), fails="standard output"
    ),
    "12 files": Situation(limited(resource.RLIMIT_NOFILE, 12), fails="open files"),
    "20 files": Situation(limited(resource.RLIMIT_NOFILE, 20), fails="open files"),
    "files of 3 kB": Situation(limited(resource.RLIMIT_FSIZE, 3000), fails="raise the limit"),
    "files of 0": Situation(limited(resource.RLIMIT_FSIZE, 0), fails="raise the limit"),
    "read-only": Situation(lambda: Path().chmod(0o555), fails="ermission", before=PLAIN),
    "no folder": Situation(lambda: shutil.rmtree(Path.cwd()), fails="working folder was removed"),
}  # fmt: skip


@dataclass(frozen=True)
class Known:
    """What an undisturbed run has shown."""

    folder: Path
    seconds: float
    sites: tuple[tuple[str, str], ...]
    """Operation and site of its system calls about its files, each once."""


class Surroundings:
    """Runs commands in a place of its own, in surroundings of one kind.

    Args:
        imports: Whether the server of commands imports all; without, it starts sooner.
    """

    def __init__(self, folder: Path, kind: str, imports: bool = True):
        self._place = folder.resolve()
        self._case: Callable[[random.Random], str] = getattr(self, f"_{kind}")
        library = compiled(folder)
        if kind == "disks":  # mounts that end with this process; the server sees them, too
            if ctypes.CDLL(None).unshare(0x20000):
                raise RuntimeError("no mounts: the user is not root")
            subprocess.run(["mount", "--make-rprivate", "/"], check=True)
        self.server = CommandServer(str(folder / "socket"), imports, LD_PRELOAD=str(library))
        self.server.__enter__()
        self._references: dict[str, Known] = {}
        self._printed = ""  # By the last command

    def close(self) -> None:
        self.server.__exit__()

    @cached_property
    def _inputs(self) -> Path:
        """Folder of what the commands work on."""
        inputs = self._place / "inputs"
        inputs.mkdir()
        make_inputs(self.server, inputs)
        return inputs

    def case(self, dice: random.Random) -> str:
        try:
            return self._case(dice)
        except Lost as lost:
            raise Wrong(str(lost)) from lost

    def known(self, name: str) -> Known:
        """Run a command undisturbed, once."""
        if name not in self._references:
            folder, log = self._place / f"reference-{name}", self._place / "log"
            log.unlink(missing_ok=True)
            self._fresh(name, folder)
            start = time.monotonic()
            status, text = self._run(name, folder, FAULTS_IN=str(folder), FAULTS_LOG=str(log))
            if status:
                raise RuntimeError(f"{name}: undisturbed, it ended with {status}: {text}")
            # What fails on standard error cannot be said.
            noted = r"(?m)^@ (\w+) (\w+) 0 (?!.*/\.error$)"
            notes = re.findall(noted, log.read_text(errors="replace"))
            seconds = time.monotonic() - start
            self._references[name] = Known(folder, seconds, tuple(dict.fromkeys(notes)))
        return self._references[name]

    def fault(self, name: str, fail: str) -> str:
        """Run a command of which system calls fail, as faults.c describes; return its message."""
        known, folder, log = self.known(name), self._fresh(name), self._place / "log"
        log.unlink(missing_ok=True)
        status, text = self._run(
            name, folder, FAULTS_IN=str(folder), FAULTS_FAIL=fail, FAULTS_LOG=str(log)
        )
        notes = log.read_text(errors="replace") if log.exists() else ""
        failed = [Path(path) for path in re.findall(r"(?m)^@ \w+ \w+ 1 (.*)$", notes)]
        named = {part for path in failed for part in (final_name(path), path.parent.name)}
        for path in failed:  # of a folder the message may name the file in it
            named.update(each.name for each in (path.iterdir() if path.is_dir() else ()))
            named.update(each.name for each in known.folder.iterdir() if path.is_dir())
        partly = fail.startswith(("read", "open"))  # an input that is omitted is reported
        self._judge(name, folder, known, status, text, f"{name}, {fail}", named, partly)
        return text

    def _calls(self, dice: random.Random) -> str:
        name = dice.choice(list(COMMANDS))
        operation, site = dice.choice(self.known(name).sites)
        fail = f"{operation} {site} {dice.choice(list(CODES))} {dice.choice((0, 1))}"
        if dice.random() < 0.1:
            fail = f"{dice.choice(EVERYWHERE)} 0"
        return "failed" if self.fault(name, fail) else "tolerated"

    def _clocks(self, dice: random.Random) -> str:
        name = dice.choice(list(COMMANDS))
        known, folder, now = self.known(name), self._fresh(name), time.time()
        # Python's own clock ends in 2262.
        offset = dice.choice((0.0, 100 - now, -100 - now, -CENTURY, CENTURY * 0.74, 2 * CENTURY))
        clock = f"{offset} {dice.uniform(0, known.seconds)} {dice.choice((0, -3600, 3600, -1, 1))}"
        status, text = self._run(name, folder, FAULTS_CLOCK=clock)
        self._judge(name, folder, known, status, text, f"{name}, {clock}", {"clock", "date"})
        return "failed" if status else "done"

    def _disks(self, dice: random.Random) -> str:
        return self.disk(dice.choice(list(COMMANDS)), dice.random() ** 2)

    def disk(self, name: str, share: float) -> str:
        """Run a command on a disk that has room for a fraction of what it writes."""
        known, mount = self.known(name), self._place / "disk"
        mount.mkdir(exist_ok=True)
        subprocess.run(["mount", "-t", "tmpfs", "none", mount], check=True)
        try:
            folder = self._fresh(name, mount / "work")
            need = sum(path.stat().st_size for path in known.folder.rglob("*"))
            room = _used(mount) + 4096 * (1 + int(share * need / 4096))
            what = f"{name}, {room} bytes"
            subprocess.run(["mount", "-o", f"remount,size={room}", mount], check=True)
            status, text = self._run(name, folder, self._place)  # what it prints is not on the disk
            more = ["mount", "-o", "remount,size=50%", mount]
            subprocess.run(more, check=True)
            self._judge(name, folder, known, status, text, what, {"disk is full"})
        finally:
            # Lazily: the process of the command says its status just before it ends.
            subprocess.run(["umount", "--lazy", mount], check=True)
        return "full" if status else "done"

    def _names(self, dice: random.Random) -> str:
        return self.named(dice.choice(NAMED), dice.choice(NAMES), dice.choice(NAMES))

    def named(self, command: str, name: str, written: str) -> str:
        """Run one of `NAMED` with the name of what it reads, and of what it writes."""
        folder = self._place / "named"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        words, files = [], []
        for word in command.split():
            kind, _, ending = word.partition(".")
            base = {"IN": name, "OUT": written}.get(kind)
            if kind == "IN":
                self._lay(folder, name, ending)
            if base is not None:
                word = "./" + (f"{base}.{ending}" if ending else base)
            if kind == "OUT":
                files.append(word)
            words.append(word)
        done = self.server.run(*words, "--json", folder=folder)
        there = [path.name for path in folder.iterdir()]
        what = f"{words}: status {done.returncode}: {done.stderr[-2000:]}"
        if "Traceback" in done.stderr or done.returncode not in (0, 1, 2):
            raise Wrong(what)
        why = "too long" if LONG in (name, written) else "has the file extension"
        if done.returncode and why not in done.stderr:
            raise Wrong(what)
        if done.returncode == 0 and not isinstance(json.loads(done.stdout), dict):
            raise Wrong(f"{what}: {done.stdout[:200]}")
        if missing := [file for file in files if not done.returncode and file[2:] not in there]:
            raise Wrong(f"{words}: {missing} is missing of {there}")
        if any(map(LEFT_OVER.search, there)):
            raise Wrong(f"{words}: left behind: {there}")
        return "refused" if done.returncode else "done"

    def _lay(self, folder: Path, name: str, ending: str) -> None:
        """Copy an input under a hostile name."""
        sources = {
            "": "session", "toml": "rig.toml", "mcap": "session/press-0001.mcap",
            "csv": "press-0001.csv", "mcap.part": "cut-off.mcap.part", "long.mcap": "long.mcap",
        }  # fmt: skip
        source = self._inputs / sources[ending]
        target = folder / (f"{name}.{ending}" if ending else name)
        with contextlib.suppress(OSError):  # a name that is too long
            if source.is_dir():
                shutil.copytree(source, target)
            else:
                shutil.copy(source, target)
            if ending == "csv":
                shutil.copy(f"{source}.json", f"{target}.json")

    def _environment(self, dice: random.Random) -> str:
        name, where = dice.choice(list(COMMANDS)), dice.choice(list(SITUATIONS))
        self.situation(name, where)
        return where

    def situation(self, name: str, where: str) -> None:
        """Run a command in one of the `SITUATIONS`."""
        situation, known, folder = SITUATIONS[where], self.known(name), self._fresh(name)
        given = os.environ | {"PYTHONPATH": str(ROOT)} | situation.environment
        command = [*situation.before, sys.executable, "-W", "error", "-m", "sautereau"]
        if situation.before and not shutil.which(situation.before[0]):
            return
        done = subprocess.run(
            [*command, *COMMANDS[name].words.split()],
            cwd=folder,
            env={key: value for key, value in given.items() if value is not None},
            preexec_fn=situation.change,
            capture_output=True,
            text=True,
            errors="backslashreplace",
            stdin=subprocess.DEVNULL,
            check=False,
        )
        if not folder.exists():  # nothing of it is left to be judged
            self._fresh(name, folder)
        folder.chmod(0o755)
        text = "sautereau: " if situation.silent else unwrapped(done.stderr)
        what = f"{name}, {where}"
        if done.returncode and not re.search(situation.fails, text):
            raise Wrong(f"{what}: status {done.returncode}: {text[-2000:]}")
        self._judge(name, folder, known, done.returncode, text, what, set())

    def _fresh(self, name: str, folder: Path | None = None) -> Path:
        folder, command = folder or self._place / "work", COMMANDS[name]
        shutil.rmtree(folder, ignore_errors=True)
        if "inputs/" not in command.words and not command.prepare:
            folder.mkdir()
            return folder
        fresh(command, self._inputs, folder)
        if not (folder.parent / "inputs").exists():
            (folder.parent / "inputs").symlink_to(self._inputs)
        return folder

    def _run(
        self, name: str, folder: Path, streams: Path | None = None, **environment: str
    ) -> tuple[int, str]:
        words, environment = COMMANDS[name].words.split(), os.environ | environment
        done = self.server.run(*words, folder=folder, streams=streams, environment=environment)
        self._printed = unwrapped(done.stdout + done.stderr)
        return done.returncode, done.stderr

    def _judge(
        self,
        name: str,
        folder: Path,
        known: Known,
        status: int,
        text: str,
        what: str,
        named: set[str],
        partly: bool = False,
    ) -> None:
        """Judge how a command has ended and what it has left, and repeat it undisturbed."""
        command = COMMANDS[name]
        check_message(what, status, text, named)
        for left in folder.rglob("*.mcap"):
            if not left.name.startswith("cut-off") and not read_recording(left).complete:
                raise Wrong(f"{what}: {left.name} is not complete")
        omitted = partly and named and any(each in self._printed for each in named)
        try:
            if status == 0 and not omitted:
                command.check(folder, known.folder)
            if not partly:
                command.check_broken(folder, known.folder)
            again, more = self._run(name, folder)
            if again:
                raise Lost(f"repeated, it ended with {again}: {more[-500:]}")
            command.check(folder, known.folder)
        except Lost as lost:
            raise Wrong(f"{what}: {lost}; it had ended with {status}: {text[-500:]}") from lost
        if left := [path.name for path in folder.rglob("*") if LEFT_OVER.search(path.name)]:
            raise Wrong(f"{what}: left behind: {', '.join(left)}")


def check_message(what: str, status: int, text: str, named: set[str]) -> None:
    """Refuse a traceback, another status than 0 and 1, and an error without a name of these."""
    if status not in (0, 1) or "Traceback" in text:
        raise Wrong(f"{what}: status {status}: {text[-2000:]}")
    if status and "sautereau:" not in text:
        raise Wrong(f"{what}: no message: {text[-500:]}")
    if status and named and not any(each in text for each in named):
        raise Wrong(f"{what}: none of {sorted(named)} is named: {text[-500:]}")


def compiled(folder: Path) -> Path:
    """Return the library of faults.c, compiled into a folder."""
    library = folder / "faults.so"
    source = Path(__file__).with_name("faults.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return library


def final_name(path: Path) -> str:
    """Return the name that a file is to get, which a message names."""
    name = path.name.removesuffix(" (deleted)")
    if name == ".out":  # of the server of commands
        return "standard output"
    hidden = re.fullmatch(r"\.(.+)\.[0-9a-f]{8}\.new", name)
    return (
        hidden[1]
        if hidden
        else re.sub(r"(\.(import|export|recover)ing|\.parquet)?\.part$", "", name)
    )


def _used(folder: Path) -> int:
    found = os.statvfs(folder)
    return (found.f_blocks - found.f_bfree) * found.f_frsize
