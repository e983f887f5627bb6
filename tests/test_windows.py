"""What differs in Windows, simulated as Microsoft and Python document it.

Nothing here has run in Windows (docs/ci.md): `windows` has its rules of files (an open file is
neither removed nor renamed, a rename never replaces, folders cannot be opened, paths end at 260
characters), its lack of POSIX's modules and signals, and `msvcrt.locking`.
"""

import errno
import io
import ntpath
import os
import signal
import sys
import time
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path, PureWindowsPath
from types import ModuleType

import filelock
import pytest
import serial
from serial.tools import list_ports

from examples import session as example
from sautereau import doctor
from sautereau.analysis.campaign import workers
from sautereau.commands.app import GROUPS, app
from sautereau.commands.common import Dated
from sautereau.commands.live import LiveError, process
from sautereau.commands.press import _pausing
from sautereau.commands.running import signals_stop
from sautereau.daq.convert.readers.__main__ import limit
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.recovery import recover
from sautereau.rig import disk
from sautereau.rig.disk import hold, make_folder, need_open_files, new_file, write_durably
from sautereau.rig.load import load_rig
from sautereau.rig.lock import Taken, locked
from sautereau.robot.drivers.serial_port import Wire, open_port, port_errors
from sautereau.robot.errors import LineLost, PortUnavailable
from sautereau.robot.experiment.monitor import Control

POSIX_ONLY = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
IN_USE = "The process cannot access the file because it is being used by another process"
pytestmark = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="it reads /proc")


class System:
    """The module `os` of Windows, in front of that of POSIX."""

    name = "nt"

    def __getattr__(self, name: str):
        if name in ("O_NONBLOCK", "nice", "openpty", "set_blocking"):
            raise AttributeError(name)
        return getattr(os, name)

    @staticmethod
    def open(path, *others):
        if Path(path).is_dir():
            raise refused(errno.EACCES, "Permission denied", path)
        return os.open(path, *others)


def refused(number: int, text: str, path: object) -> OSError:
    return OSError(number, text, str(path))  # a PermissionError, and so on, by its number


def of_windows(call, *, moves="", removes=False, most=259):
    """Return a function of `os` with the rules of Windows for the paths that it is given.

    Args:
        moves: Whether it is `rename`, which never replaces, or `replace`.
    """

    def ruled(path, *others, **options):
        if "dir_fd" in options and options["dir_fd"] is not None:
            return call(path, *others, **options)
        paths = [each for each in (path, *others) if isinstance(each, str | Path)]
        for each in map(os.path.abspath, paths):
            if len(each) > most:
                raise refused(errno.ENOENT, "The system cannot find the path specified", each)
        if moves == "rename" and os.path.lexists(paths[1]):
            raise refused(errno.EEXIST, "Cannot create a file when it already exists", paths[1])
        for each in filter(os.path.isfile, paths if moves or removes else ()):
            if is_open(each):
                raise refused(errno.EACCES, IN_USE, each)
            if not Path(each).stat().st_mode & 0o200 and (removes or each == paths[-1]):
                raise refused(errno.EACCES, "Access is denied", each)
        return call(path, *others, **options)

    return ruled


def is_open(path) -> bool:
    """Return whether this process has a file open."""
    there = Path(path).stat()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            if os.path.samestat(entry.stat(), there):
                return True
    return False


class WindowsLock(filelock.FileLock):
    """Removes its file when it is released, as `filelock` does in Windows."""

    def _release(self):
        super()._release()
        with suppress(OSError):
            Path(self.lock_file).unlink()


@pytest.fixture
def windows(monkeypatch):
    import fcntl

    held = []

    def locking(entry, mode, count):
        place = os.lseek(entry, 0, os.SEEK_CUR)
        if mode != msvcrt.LK_NBLCK or place + count > 2**31 - 1:
            raise OSError(errno.EINVAL, "Invalid argument")
        try:
            fcntl.flock(entry, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise PermissionError(errno.EACCES, "Permission denied") from error
        held.append(place)

    msvcrt = ModuleType("msvcrt")
    msvcrt.LK_NBLCK, msvcrt.locking, msvcrt.held = 2, locking, held
    monkeypatch.setitem(sys.modules, "msvcrt", msvcrt)
    for name in POSIX_ONLY:
        monkeypatch.setitem(sys.modules, name, None)
    for name in ("SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGXCPU"):  # pytest uses SIGALRM
        monkeypatch.delattr(signal, name)
    monkeypatch.setattr(signal, "SIGBREAK", signal.SIGTTIN, raising=False)  # 21 in both
    for name, module in list(sys.modules.items()):
        if name.startswith("sautereau") and getattr(module, "os", None) is os:
            monkeypatch.setattr(module, "os", System())
    monkeypatch.setattr(os, "mkdir", of_windows(os.mkdir, most=247))
    monkeypatch.setattr(os, "unlink", of_windows(os.unlink, removes=True))
    monkeypatch.setattr(os, "rename", of_windows(os.rename, moves="rename"))
    monkeypatch.setattr(os, "replace", of_windows(os.replace, moves="replace"))
    monkeypatch.setattr(io, "open", of_windows(io.open))
    monkeypatch.delattr(os, "openpty")
    monkeypatch.setattr(filelock, "FileLock", WindowsLock)
    return msvcrt


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("windows")
def test_a_file_is_written_and_replaced_and_what_a_killed_process_left_is_removed(tmp_path):
    path = tmp_path / "sub" / "file.txt"
    make_folder(path.parent)
    write_durably(path, "a\r\n")
    with pytest.raises(FileExistsError):
        write_durably(path, "b")
    (path.parent / ".file.txt.00.new").touch()
    with (path.parent / ".file.txt.11.new").open("wb") as other:
        assert hold(other)
        write_durably(path, "b\n", replace=True)
        assert names(path.parent) == [".file.txt.11.new", "file.txt"]
    assert path.read_bytes() == b"b\n"


@pytest.mark.usefixtures("windows")
def test_a_name_that_another_program_gives_meanwhile_is_kept(tmp_path):
    path = tmp_path / "file.txt"
    with pytest.raises(FileExistsError), new_file(path) as file:  # noqa: PT012
        file.write(b"mine")
        path.write_bytes(b"other")
    assert (path.read_bytes(), names(tmp_path)) == (b"other", ["file.txt"])


@pytest.mark.usefixtures("windows")
def test_a_file_that_another_program_has_open_or_that_is_read_only_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    path = tmp_path / "table.csv"
    write_durably(path, "old")
    with path.open("rb"), pytest.raises(PermissionError, match="used by another process") as error:
        write_durably(path, "new", replace=True)
    assert error.value.filename == str(path)
    path.chmod(0o444)
    with pytest.raises(PermissionError):
        write_durably(path, "new", replace=True)
    assert (path.read_text(), names(tmp_path)) == ("old", ["table.csv"])


@pytest.mark.usefixtures("windows")
def test_a_scanner_that_opens_every_new_file_is_waited_for(tmp_path, monkeypatch):
    scanned = []

    def scan(beside, path, replace):
        if not scanned:
            scanned.append(beside.open("rb"))
        return rename(beside, path, replace)

    rename = disk._rename
    monkeypatch.setattr(disk, "_rename", scan)
    monkeypatch.setattr(time, "sleep", lambda seconds: scanned[0].close())
    write_durably(tmp_path / "file.txt", "a")
    assert (scanned[0].closed, names(tmp_path)) == (True, ["file.txt"])


def test_a_file_in_use_is_held_once_without_keeping_others_from_its_content(windows, tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"content")
    with path.open("rb") as first, path.open("rb") as second:
        assert hold(first)
        assert not hold(second)
        assert (first.read(), second.read()) == (b"content", b"content")
    assert windows.held[0] > 2_000_000_000


def test_a_recording_is_written_and_not_recovered_meanwhile(windows, tmp_path, write_session):
    (path,) = write_session(tmp_path / "done", 1)
    assert path.is_file()
    rig = load_rig()
    recording = Recording(tmp_path / "press.mcap", rig, session=write_session.one.session)
    with recording:
        with pytest.raises(RecordingError, match="another process is writing it"):
            recover(recording.part_path, tmp_path / "copy.mcap")
        assert windows.held
    assert "press.mcap" in names(tmp_path)


@pytest.mark.usefixtures("windows")
def test_a_lock_is_removed_after_its_release(tmp_path):
    with (
        locked(tmp_path / "a.lock", "a session"),
        pytest.raises(Taken, match="for a session"),
        locked(tmp_path / "a.lock"),
    ):
        pass
    assert names(tmp_path) == []


DEVICES = [
    "nul",
    "NUL.txt",
    "con.mcap",
    "Aux",
    "COM1.toml",
    "lpt9",
    "prn .csv",
    "COM\xb9",
    "conin$",
]
CHANGED = ["2026-11-28T10:00.mcap", "a?", "a|b", "press.", "a ", 'a"b', "<a>"]
GOOD = ["console.mcap", "COM10.csv", "press-0001.mcap.part", ".rig.toml.0a1b2c3d.new", "nul-1"]


@pytest.mark.parametrize("name", [*DEVICES, *CHANGED])
def test_names_that_windows_has_not_are_refused_there(name, tmp_path, request):
    write_durably(tmp_path / name, "elsewhere")
    folder = tmp_path / "windows"
    folder.mkdir()
    request.getfixturevalue("windows")
    for write in (
        lambda: write_durably(folder / name, "a"),
        lambda: make_folder(folder / name / "y"),
    ):
        with pytest.raises(OSError, match="Windows has no file called") as caught:
            write()
        assert repr(name) in str(caught.value)
    with pytest.raises(RecordingError, match="Windows has no file called"):
        DurableFile(folder / name)
    assert names(folder) == []


def test_the_names_are_those_that_python_knows(windows):
    assert windows
    known = getattr(ntpath, "isreserved", lambda name: PureWindowsPath(name).is_reserved())
    for name in (*DEVICES, *GOOD, "..", "a.b"):
        try:
            disk.refuse_name(Path("folder") / name)
        except OSError:
            assert known(name), name
        else:
            assert not known(name) or name == "..", name


def test_names_that_the_program_gives_are_good_in_windows(windows):
    assert windows
    defaults = [
        value
        for commands in GROUPS.values()
        for command in commands
        for value in (command.__kwdefaults__ or {}).values()
        if isinstance(value, Dated)
    ]
    assert len(defaults) > 5
    for default in defaults:
        disk.refuse_name(default.today())


@pytest.mark.usefixtures("windows")
def test_a_path_that_is_too_long_is_named(tmp_path):
    path = tmp_path / ("a" * (240 - len(str(tmp_path)))) / "press-0001-of-the-key-c.txt"
    make_folder(path.parent)
    with pytest.raises(OSError, match="LongPathsEnabled is 1; give a shorter"):
        write_durably(path, "a")
    with pytest.raises(OSError, match="cannot find the path") as caught:
        make_folder(path.parent / "deeper")
    assert "Windows takes 259" in disk.why_unreadable(caught.value)


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_rig_with_line_ends_and_mark_of_windows_is_the_same(tmp_path, end, mark):
    own = Path(disk.__file__).with_name("paper.toml").read_bytes().replace(b"\r\n", b"\n")
    path = tmp_path / "rig.toml"
    path.write_bytes(mark + own.replace(b"\n", end))
    assert load_rig(path) == load_rig()


def test_a_text_in_the_code_page_of_windows_is_refused(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_bytes('name = "clavecin \xe0 deux claviers"\n'.encode("cp1252"))
    with pytest.raises(Exception, match="not a text in UTF-8"):
        load_rig(path)


def test_every_help_fits_into_the_code_page_of_windows(monkeypatch):
    """As where the output goes to a file or a pipe."""
    for command in (command for commands in GROUPS.values() for command in commands):
        out = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
        monkeypatch.setattr(sys, "stdout", out)
        app([command.__name__.strip("_").replace("_", "-"), "--help"])
        monkeypatch.undo()
        out.flush()
        assert b"Usage: sautereau" in out.buffer.getvalue()


@pytest.mark.usefixtures("windows")
def test_ctrl_break_pauses_a_session_and_stops_every_other_command():
    control = Control()
    with pytest.raises(KeyboardInterrupt), signals_stop():  # noqa: PT012
        with _pausing(control):
            signal.raise_signal(signal.SIGBREAK)
            assert control.paused
            signal.raise_signal(signal.SIGBREAK)
            assert not control.paused
        signal.raise_signal(signal.SIGBREAK)
    signal.signal(signal.SIGBREAK, signal.SIG_DFL)


DENIED = "could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)"
MISSING = (
    "could not open port 'COM3': FileNotFoundError(2, 'The system cannot find the file specified.',"
    " None, 2)"
)
GONE = "ClearCommError failed (PermissionError(13, 'The device does not recognize it.', None, 22))"


@pytest.mark.usefixtures("windows")
@pytest.mark.parametrize(("text", "fix"), [(DENIED, "end that program"), (MISSING, "plug the")])
def test_a_port_that_cannot_be_opened(monkeypatch, text, fix):
    """With the texts of pyserial's serialwin32, which have no number."""

    def refuse(*_, **__):
        raise serial.SerialException(text)

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortUnavailable, match=fix) as caught:
        open_port("COM3", 115_200, 0.1)
    assert "dialout" not in str(caught.value)


@pytest.mark.usefixtures("windows")
def test_a_refused_connection_has_the_text_of_windows(monkeypatch):
    """`os.strerror` has none for the numbers of its sockets."""
    said = "No connection could be made because the target machine actively refused it"

    def refuse(*_, **__):
        try:
            raise OSError(10061, said)
        except OSError as error:
            raise serial.SerialException(f"Could not open port: {error}")  # noqa: B904

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortUnavailable, match=f"cannot be opened: {said};"):
        open_port("socket://127.0.0.1:1", 115_200, 0.1)


@pytest.mark.usefixtures("windows")
def test_a_port_that_is_unplugged_is_a_lost_line():
    class Port:
        @property
        def in_waiting(self):
            raise serial.SerialException(GONE)

        def reset_input_buffer(self):
            raise serial.SerialException("PurgeComm failed")

    assert port_errors() == (OSError,)
    with pytest.raises(LineLost, match="PurgeComm"):
        Wire(Port(), "COM3", 0.1)._freshen()


@pytest.mark.usefixtures("windows")
def test_doctor_looks_for_a_port_by_its_name(monkeypatch):
    port = ModuleType("port")
    port.device = "COM3"
    monkeypatch.setattr(list_ports, "comports", lambda: [port])
    assert doctor._serial("COM3").ok
    missing = doctor._serial("COM4")
    assert not missing.ok
    assert "COM4 does not exist; serial ports: COM3" in missing.detail


def test_a_view_that_has_ended_breaks_its_pipe(monkeypatch):
    """There `poll` raises BrokenPipeError; elsewhere it says that there is an end to read."""
    views = process.ViewProcess("rig", ["view"])

    class Pipe:
        def poll(self, timeout):
            raise BrokenPipeError(errno.EPIPE, "The pipe has been ended")

        def close(self):
            views_pipe.close()

    views_pipe, views._pipe = views._pipe, Pipe()
    monkeypatch.setattr(views._process, "_target", int)
    with pytest.raises(LiveError, match="ended at the start"):
        views.__enter__()


@pytest.mark.usefixtures("windows")
@pytest.mark.parametrize(("asked", "started"), [(4, 4), (64, 61)])
def test_no_more_processes_than_windows_waits_for(monkeypatch, asked, started):
    made = []

    class Pool:
        def __init__(self, processes, **_):
            made.append(processes)

        def submit(self, function, item):
            done = Future()
            done.set_result(function(item))
            return done

        def shutdown(self, **_):
            pass

    monkeypatch.setattr(workers, "ProcessPoolExecutor", Pool)
    assert sorted(workers.run_over(abs, [-1, 2], asked)) == [(0, 1), (1, 2)]
    assert made == [started]


def test_no_clock_with_steps_of_16_ms_is_used():
    """`time.monotonic` has them there before Python 3.13; `time.perf_counter` has not."""
    root = Path(disk.__file__).parents[1]
    for room in ("rig", "trajectory", "daq", "analysis", "sim_backend", "robot", "sautereau"):
        for path in (root / room).rglob("*.py"):
            assert "time.monotonic()" not in path.read_text(encoding="utf-8"), path


@pytest.mark.usefixtures("windows")
def test_limits_that_windows_has_not_are_not_set():
    need_open_files()
    limit(1e9, 60)


@pytest.mark.usefixtures("windows")
def test_a_press_from_plan_to_comparison(tmp_path, monkeypatch):
    """On the line `socket://`, into files as Windows keeps them."""
    monkeypatch.chdir(tmp_path)
    studied = example.study(n=1, scene="ideal")
    error = studied.compare().document["duration_error"]["value"]
    assert error == pytest.approx(0, abs=5e-3)
