"""Commands with hostile names, environments, clocks, system calls that fail, and full disks."""

import errno
import os
import re
import shutil
import sys

import pytest

from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from tests.budget import amount, slow
from tests.cards import Card
from tests.fuzz.surroundings import CODES, EVERYWHERE, NAMES, Surroundings
from tests.fuzz.targets import SURROUNDINGS
from tests.fuzz.test_fuzz import fuzzed
from tests.kills.commands import COMMANDS

# The date is set back between two calls of the DAQ server at the given address.
DATED_BACK = """
import os, sys
from nidaqmx.system import System
from sautereau.daq.source.connection import connect
from sautereau.rig.load import load_rig, with_values
rig = with_values(load_rig(), {"daq.address": sys.argv[1]})
with connect(rig.daq, 0.0) as (options, _):
    for clock in ("0 0 0", "-3600 0 0"):
        os.environ["FAULTS_CLOCK"] = clock
        assert list(System.remote(options).devices.device_names) == ["Dev1"]
"""
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="it reads /proc, and loads a library first"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler"),
]


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Commands that need no inputs."""
    made = Surroundings(tmp_path_factory.mktemp("s"), "calls", imports=False)
    yield made
    made.close()


def test_system_calls_of_a_command_may_fail(bare):
    """One site of each operation fails; a wide run takes all commands, sites and codes."""
    sites, codes, outcomes = dict(bare.known("init").sites), list(CODES), {}
    for n, (operation, site) in enumerate(sites.items()):
        outcomes[operation] = bare.fault("init", f"{operation} {site} {codes[n % len(codes)]} 0")
    assert set(outcomes) >= {"open", "write", "fsync", "link", "close", "unlink"}
    assert outcomes["write"]


@pytest.mark.parametrize("fail", [EVERYWHERE[0], *map(slow, EVERYWHERE[1:])])
def test_a_file_system_without_such_calls_is_no_fault(bare, fail):
    assert bare.fault("init", f"{fail} 0") == ""


def test_a_date_set_back_is_no_fault_of_the_server(bare, tmp_path):
    with DaqmxServer(Card()) as server:
        done = bare.server.run("-c", DATED_BACK, server.address, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", [NAMES[4], NAMES[6], *map(slow, NAMES)])
def test_a_file_may_have_any_name(bare, name):
    bare.named("init OUT.toml", "", name)


@pytest.mark.parametrize("where", ["umask 0777", "ascii", "no streams", "no folder"])
def test_a_command_starts_in_any_environment(bare, where):
    bare.situation("init", where)


@pytest.mark.parametrize("ending", ["pdf", slow("png"), slow("svg")])
def test_a_plot_that_has_no_room_is_named(bare, tmp_path, ending):
    words = "predict", "--level", "elastica", "--plot", f"pluck.{ending}"
    done = bare.server.run(*words, folder=tmp_path, largest_file=3000)
    assert done.returncode == 1
    assert re.match(rf"sautereau: pluck.{ending}: .*raise the limit", done.stderr)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    """Commands on disks that are mounted for this process alone, and end with it."""
    if os.geteuid():
        pytest.skip("only root mounts a small disk")
    made = Surroundings(tmp_path_factory.mktemp("d"), "disks")
    yield made
    made.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_without_links_and_on_a_full_disk(full, name):
    for code in (errno.EPERM, errno.EOPNOTSUPP):
        full.fault(name, f"link any {code} 0")
    for share in (0.0, 0.4):
        full.disk(name, share)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", SURROUNDINGS)
def test_a_wide_run(kind):
    if kind == "disks" and os.geteuid():
        pytest.skip("only root mounts a small disk")
    count = amount(20, 200)
    said = fuzzed(kind, "--first", "0", "--count", str(count), "--seconds", "3000")
    assert f"{count} cases, 0 failed" in said
