"""First steps: a new rig file, completion, with a terminal and without."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from types import ModuleType

import pytest

from examples import session
from sautereau.__main__ import main
from sautereau.commands.app import app
from sautereau.commands.running import signals_stop
from sautereau.rig.load import load_rig, with_values
from tests import forked
from tests.budget import slow

ESCAPE = "\x1b["
COLOUR = re.compile(r"\x1b\[[0-9;]*\b(?:3[0-79]|9[0-7]|38|48)[0-9;]*m")
posix = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX's")


def test_init_writes_a_rig_that_plans(sautereau, tmp_path):
    for name, shown in (("a rig.toml", "'a rig.toml'"), ("-rig.toml", "./-rig.toml")):
        assert f"sautereau plan {shown}\n" in sautereau("init", "--", name).stdout
    made = sautereau("init", "rigs/mine.toml", "--json")
    assert json.loads(made.stdout)["path"] == "rigs/mine.toml"
    run_up = dict.fromkeys(("press.run_up_acceleration", "press.run_up_jerk"))
    assert load_rig(tmp_path / "rigs/mine.toml") == with_values(load_rig(), run_up)
    assert sautereau("plan", "rigs/mine.toml").returncode == 0


@pytest.mark.parametrize(
    ("words", "meant", "status"),
    [
        (["pres", "--sim"], "press", 2),
        (["press", "--sm", "--out", "x"], "--sim", 2),
        (["setup", "hom"], "home", 2),
        (["plan", "papr"], "paper", 1),
        (["press", "--scene", "idea", "--out", "x"], "ideal", 1),
    ],
)
def test_the_nearest_name_is_suggested(refusal, words, meant, status):
    done = refusal(*words)
    assert done.returncode == status
    assert re.search(rf"[Dd]id you mean ['\"]?{meant}", done.stderr)


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
def test_bash_completes(tmp_path):
    (tmp_path / "completion").write_text(app.generate_completion(shell="bash"))
    typed = {"pre": "press predict", "press --sc": "--scene", "setup --step ho": "home"}
    for words, offered in typed.items():
        script = (
            f". ./completion; COMP_WORDS=(sautereau {words}); COMP_CWORD={len(words.split())};"
            ' _sautereau; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run(
            ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert set(offered.split()) <= set(done.stdout.split())


@pytest.mark.parametrize("shell", [slow("zsh"), slow("fish"), slow("powershell")])
def test_completion_exists_for_other_shells(shell):
    assert "stand-in" in app.generate_completion(shell=shell)


def test_pipes_get_no_colour(sautereau):
    for words in (["--help"], ["press", "--help"], ["doctor"], ["pres"]):
        done = sautereau(*words)
        assert ESCAPE not in done.stdout + done.stderr


@posix
def test_terminals_get_colour_unless_it_is_declined(command_server):
    start = [sys.executable, "-S", forked.__file__, "run", command_server.path]
    assert COLOUR.search(on_terminal(start, TERM="xterm-256color"))
    assert not COLOUR.search(on_terminal(start, TERM="xterm-256color", NO_COLOR="1"))
    assert not COLOUR.search(on_terminal(start, TERM="dumb"))


def on_terminal(start: list[str], **environment: str) -> str:
    """Return what the help prints on a terminal."""
    master, slave = os.openpty()
    plain = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    with os.fdopen(master, "rb", buffering=0) as terminal:
        command = [*start, "press", "--help"]
        with subprocess.Popen(command, stdout=slave, stderr=slave, env=plain | environment):
            os.close(slave)
            printed = b""
            try:
                while part := terminal.read(4096):
                    printed += part
            except OSError:  # the last writer has closed it
                pass
    return printed.decode()


def test_an_interrupt_while_importing_ends_with_130(monkeypatch):
    class Interrupted(ModuleType):
        def __getattr__(self, name):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "sautereau.commands.app", Interrupted("app"))
    with pytest.raises(SystemExit, match="130"):
        main()


@posix
@pytest.mark.parametrize("name", ["SIGTERM", "SIGUSR1", "SIGUSR2", "SIGXCPU"])
def test_a_signal_that_would_end_the_program_stops_it_like_ctrl_c(name):
    before = signal.getsignal(getattr(signal, name))
    with signals_stop(), pytest.raises(KeyboardInterrupt, match=name):
        os.kill(os.getpid(), getattr(signal, name))
    assert signal.getsignal(getattr(signal, name)) == before


@posix
def test_a_closed_terminal_that_is_ignored_from_the_start_stays_ignored():
    """As nohup starts a command."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with signals_stop():
            os.kill(os.getpid(), signal.SIGHUP)
            with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
                os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.slow
def test_the_stand_in_needs_no_pseudo_terminal(monkeypatch):
    monkeypatch.delattr(os, "openpty", raising=False)  # as on Windows
    studied = session.study(n=1, scene="ideal")
    error = studied.compare().document["duration_error"]["value"]
    assert error == pytest.approx(0, abs=5e-3)
