"""Work in this process, on two processes and on a cluster comes to the same."""

import signal
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.campaign import cluster, write_presses
from sautereau.analysis.campaign import run as campaign_run
from sautereau.analysis.campaign import workers
from sautereau.analysis.campaign.row import Batch, Source, read_batch
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.workers import run_over
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.pluck.batch import predict_many
from sautereau.rig.load import load_rig
from sautereau.sim_backend.physics.reduced.sweep import sweep
from sautereau.sim_backend.scene import load_scene

OVERLAPS = np.linspace(0.2e-3, 0.32e-3, 24)
PIECES = [{"plectrum.overlap": piece} for piece in np.array_split(OVERLAPS, 6)]
NOWHERE = "tcp://127.0.0.1:1"


@pytest.fixture(scope="module")
def address():
    with cluster(2) as (address, _):
        yield address


def joined(function, where, field):
    """Return one result of all pieces, in their order."""
    found = dict(run_over(function, PIECES, where))
    return np.concatenate([getattr(found[i], field) for i in range(len(PIECES))], axis=-1)


def test_a_sweep_of_the_model_is_the_same_everywhere(address):
    rig = load_rig()
    whole = predict_many(rig, {"plectrum.overlap": OVERLAPS}).pluck_duration
    here = joined(partial(predict_many, rig), 1, "pluck_duration")
    np.testing.assert_allclose(here, whole, rtol=1e-9)
    for where in (2, address):
        assert np.array_equal(joined(partial(predict_many, rig), where, "pluck_duration"), here)


def test_a_sweep_of_the_stand_in_is_the_same_everywhere(address):
    rig, scene = load_rig(), load_scene("ideal")
    whole = sweep(rig, scene, {"plectrum.overlap": OVERLAPS}).release
    here = joined(partial(sweep, rig, scene), 1, "release")
    np.testing.assert_allclose(here, whole, rtol=1e-9)
    for where in (2, address):
        assert np.array_equal(joined(partial(sweep, rig, scene), where, "release"), here)


@pytest.mark.parametrize("where", [1, 2, "the cluster"])
def test_many_items_and_none(address, where):
    where = address if where == "the cluster" else where
    assert list(run_over(abs, [], where)) == []
    assert sorted(run_over(abs, range(-100, 0), where)) == [(i, 100 - i) for i in range(100)]


@pytest.mark.parametrize("where", [1, 2, "the cluster"])
def test_what_the_function_raises_is_raised(address, where):
    where = address if where == "the cluster" else where
    with pytest.raises(OSError, match="nothing-is-here"):
        list(run_over(Path.stat, [Path("nothing-is-here")], where))


@pytest.mark.parametrize("where", [1, 2, "the cluster"])
def test_who_stops_listening_stops_the_work(address, where):
    where = address if where == "the cluster" else where
    results = run_over(abs, range(10_000), where)
    next(results)
    results.close()
    assert list(results) == []


def test_a_process_that_is_ended_is_told():
    with pytest.raises(AnalysisError, match="one of 2 processes was ended from outside"):
        list(run_over(signal.raise_signal, [signal.SIGKILL], 2))


def test_no_processes_are_refused():
    with pytest.raises(AnalysisError, match="0 cannot work"):
        list(run_over(abs, [1], 0))


def test_a_cluster_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr(workers, "PATIENCE", 0.5)
    with pytest.raises(AnalysisError, match=r"no scheduler answered within 0\.5 s"):
        list(run_over(abs, [1], NOWHERE))
    with pytest.raises(AnalysisError, match="no scheduler answered"):
        list(run_over(abs, [1], "not an address"))


def test_a_cluster_without_workers_is_told(monkeypatch):
    monkeypatch.setattr(workers, "PATIENCE", 0.5)
    with cluster(0) as (address, _), pytest.raises(AnalysisError, match="dask worker"):
        list(run_over(abs, [1], address))


def test_without_dask_the_way_to_it_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(AnalysisError, match=r"pip install 'sautereau\[cluster\]'"):
        list(run_over(abs, [1], NOWHERE))


def test_a_worker_killed_half_way_changes_no_table(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_run, "BATCH", 1)
    folder = tmp_path / "recordings"
    write_presses(folder, 2, 2, 4)
    here = run_campaign(folder, tmp_path / "here.parquet").campaign
    with cluster(2) as (address, processes):

        def kill(done, total):
            if done == total // 2:
                processes[0].kill()

        there = run_campaign(folder, tmp_path / "there.parquet", address, on_read=kill).campaign
        assert processes[0].wait() == -signal.SIGKILL
    assert there.table.equals(here.table)
    assert not there.faults


def test_a_cluster_that_does_not_see_the_folder_is_told(address, tmp_path):
    batch = Batch(tmp_path / "elsewhere", (Source("a.mcap", 1, 1),))
    with pytest.raises(AnalysisError, match="a worker does not see that folder"):
        list(run_over(read_batch, [batch], address))
