"""Locks of folders and devices: who may take one again, and what is left."""

import errno
import os
import threading

import pytest

from sautereau.rig.lock import Taken, device_lock, locked


def refused(path):
    with pytest.raises(Taken) as caught, locked(path, "another"):
        pass
    return str(caught.value)


def test_a_shared_lock_is_taken_once_more_by_its_own_thread_only(tmp_path):
    path, found = tmp_path / "a.lock", []
    with locked(path, "a session", shared=True):
        for _ in range(2):
            with locked(path, "an acquisition"):
                found.append(refused(path))
        other = threading.Thread(target=lambda: found.append(refused(path)))
        other.start()
        other.join(60)
    assert len(found) == 3
    assert all(f"process {os.getpid()} on " in text for text in found)
    assert all(text.endswith(", for a session") for text in found)
    assert not list(tmp_path.iterdir())
    with locked(path), locked(tmp_path / "b.lock"):
        assert "process" in refused(path)


def test_a_lock_that_the_system_does_not_free_hides_no_fault_of_the_block(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    path, flock = tmp_path / "a.lock", fcntl.flock

    def keep(entry, how):
        if how == fcntl.LOCK_UN:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        flock(entry, how)

    def fail():
        with monkeypatch.context() as patched, locked(path):
            patched.setattr(fcntl, "flock", keep)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    with locked(path):
        assert "process" in refused(path)


def test_devices_have_locks_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    names = [("daq", "", "Dev1"), ("daq", "", "Dev2"), ("port", "/dev/ttyUSB0")]
    assert len({device_lock(*name) for name in names}) == 3
    assert device_lock(*names[0]) == device_lock(*names[0])
