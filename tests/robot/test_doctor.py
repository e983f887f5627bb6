"""The findings of the doctor on a good machine and on faulty ones."""

import os
import sys
import time

import pytest

from sautereau import doctor
from sautereau.doctor import clock, disk_room, disk_speed, examine
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers import serial_port
from sautereau.robot.drivers.serial_port import latency

RIG = load_rig()


def found(rig, folder):
    return {finding.name: finding for finding in examine(rig, folder)}


def test_every_fault_says_how_to_fix_it(tmp_path):
    findings = found(with_values(RIG, {"controller.port": "/dev/nowhere"}), tmp_path)
    assert not findings["controller"].ok
    assert "/dev/nowhere does not exist" in findings["controller"].detail
    assert {"python", "nidaqmx", "daq", "disk", "disk speed", "clock"} <= set(findings)
    assert all(finding.ok or finding.how_to_fix for finding in findings.values())
    assert not list(tmp_path.iterdir())


def test_every_package_of_the_installation_is_checked(tmp_path, monkeypatch):
    monkeypatch.setattr(
        doctor.metadata,
        "requires",
        lambda _: [
            "numpy<3,>=1.26",
            "no-such_thing[grpc]>=2; python_version > '3'",
            "x; extra == 'y'",
        ],
    )
    findings = found(RIG, tmp_path)
    assert findings["numpy"].ok
    assert not findings["no-such_thing"].ok
    assert 'install "no-such_thing[grpc]>=2"' in findings["no-such_thing"].how_to_fix
    assert "x" not in findings


def test_a_stand_in_that_is_not_installed_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "sautereau.sim_backend.bench", None)
    finding = doctor._stand_in()
    assert not finding.ok
    assert "sim_backend" in finding.detail


@pytest.mark.skipif(sys.platform == "win32", reason="ports of Windows have no permissions")
def test_a_port_without_permission_is_reported_with_its_group(tmp_path, monkeypatch):
    port = tmp_path / "ttyUSB9"
    port.touch()
    # Who runs the tests may be root, who may open everything.
    monkeypatch.setattr(os, "access", lambda *_: False)
    finding = found(with_values(RIG, {"controller.port": str(port)}), tmp_path)["controller"]
    assert not finding.ok
    assert f"usermod -aG {port.group()}" in finding.how_to_fix


def test_a_slow_adapter_and_a_missing_portaudio_are_named(tmp_path, monkeypatch):
    port = tmp_path / "ttyUSB9"
    port.touch()
    (tmp_path / "devices" / port.name).mkdir(parents=True)
    (tmp_path / "devices" / port.name / "latency_timer").write_text("16\n")
    assert latency(str(port), tmp_path / "devices") == 0.016
    assert latency("/dev/nowhere", tmp_path / "devices") is None
    monkeypatch.setattr(serial_port, "latency", lambda _: 0.016)
    finding = found(with_values(RIG, {"controller.port": str(port)}), tmp_path)["controller"]
    assert "for 16 ms" in finding.detail
    assert "ttyUSB9/latency_timer" in finding.detail
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    monkeypatch.setattr(doctor.metadata, "requires", lambda _: ["numpy; extra == 'sound'"])
    detail = found(RIG, tmp_path)["extras"].detail
    assert "installed: none; not installed: sound" in detail
    assert "libportaudio2" in detail


def test_a_folder_that_cannot_be_written_is_reported(tmp_path):
    finding = disk_speed(tmp_path / "none", RIG.daq)
    assert not finding.ok
    assert "no file can be written" in finding.detail
    assert finding.how_to_fix


def test_a_disk_slower_than_the_channels_is_reported(tmp_path, monkeypatch):
    assert disk_speed(tmp_path, RIG.daq).ok
    monkeypatch.setattr(doctor, "DISK_MARGIN", 1e9)
    finding = disk_speed(tmp_path, RIG.daq)
    assert not finding.ok
    assert "need 0.819 MB/s" in finding.detail


def test_a_full_disk_is_reported(tmp_path, monkeypatch):
    assert disk_room(tmp_path).detail.endswith(str(tmp_path.resolve()))
    monkeypatch.setattr(doctor, "LEAST_SPACE", 1e18)
    assert not disk_room(tmp_path).ok


def test_a_clock_before_the_program_is_wrong():
    assert not clock(now=0.0).ok
    assert "1970-01-01" in clock(now=0.0).detail


@pytest.mark.skipif(sys.platform == "win32", reason="a script stands in for timedatectl")
@pytest.mark.parametrize(
    ("script", "ok", "words"),
    [
        ("echo yes", True, "synchronised with network time"),
        ("echo no", False, "not synchronised with network time"),
        ("exit 1", True, "network synchronisation unknown"),
    ],
)
def test_the_state_of_the_clock_is_reported(tmp_path, monkeypatch, script, ok, words):
    asked = tmp_path / "timedatectl"
    asked.write_text(f"#!/bin/sh\n{script}\n")
    asked.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    finding = clock(now=time.time())
    assert finding.ok is ok
    assert words in finding.detail
