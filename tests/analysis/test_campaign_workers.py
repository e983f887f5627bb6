"""The same results in this process, on two processes and on a cluster."""

import operator
import signal
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from distributed import Client

from benchmarks.campaign import OTHER, cluster
from sautereau.analysis.campaign import run as campaign_run
from sautereau.analysis.campaign import workers
from sautereau.analysis.campaign.row import Source, read_batch
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.workers import run_over
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.batch import predict_many
from sautereau.rig.load import load_rig
from sautereau.rig.progress import progress_to
from tests.budget import slow

OVERLAPS = np.array([0.2e-3, 0.32e-3])
NOWHERE = "tcp://127.0.0.1:1"


@pytest.fixture(scope="module")
def address():
    with cluster(1) as (address, _):
        yield address


@pytest.mark.slow
@pytest.mark.parametrize("where", [2, slow("the cluster")])
def test_sweeps_of_the_model_are_the_same_everywhere(request, where):
    function = partial(predict_many, load_rig())
    calls = [partial(function, {"plectrum.overlap": piece}) for piece in np.split(OVERLAPS, 2)]

    def results(where):
        found = dict(run_over(operator.call, calls, where))
        return [np.ravel(found[i].pluck_duration) for i in range(2)]

    here = results(1)
    at_once = np.ravel(function({"plectrum.overlap": OVERLAPS}).pluck_duration)
    np.testing.assert_allclose(np.concatenate(here), at_once, rtol=1e-9)
    there = results(request.getfixturevalue("address") if where == "the cluster" else where)
    for one, other in zip(there, here, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("where", [1, 2, "the cluster"])
def test_all_items_and_a_fault_of_the_function(address, where):
    where = address if where == "the cluster" else where
    assert list(run_over(abs, [], where)) == []
    assert sorted(run_over(abs, range(-50, 0), where)) == [(i, 50 - i) for i in range(50)]
    with pytest.raises(OSError, match="nothing-is-here"):
        list(run_over(Path.stat, [Path("nothing-is-here")], where))


@pytest.mark.parametrize("where", [1, 2, "the cluster"])
def test_closing_the_generator_stops_the_work(address, where):
    results = run_over(abs, range(10_000), address if where == "the cluster" else where)
    next(results)
    results.close()
    assert list(results) == []


def test_a_killed_process_is_reported():
    with pytest.raises(AnalysisError, match="one of 2 processes was killed"):
        list(run_over(signal.raise_signal, [signal.SIGKILL], 2))


def test_no_processes_are_refused():
    with pytest.raises(AnalysisError, match="0 is less than 1"):
        list(run_over(abs, [1], 0))


def test_an_unreachable_cluster_is_reported(monkeypatch):
    monkeypatch.setattr(workers, "TIMEOUT", 0.5)
    with pytest.raises(AnalysisError, match=r"no scheduler answered within 0\.5 s"):
        list(run_over(abs, [1], NOWHERE))
    with pytest.raises(AnalysisError, match="no scheduler answered"):
        list(run_over(abs, [1], "not an address"))


@pytest.mark.slow
def test_a_cluster_without_workers_is_reported(monkeypatch):
    monkeypatch.setattr(workers, "TIMEOUT", 2)
    with cluster(0) as (address, _), pytest.raises(AnalysisError, match="dask worker"):
        list(run_over(abs, [1], address))


def test_without_dask_the_message_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(AnalysisError, match=r"pip install 'sautereau\[cluster\]'"):
        list(run_over(abs, [1], NOWHERE))


@pytest.mark.slow
def test_a_killed_worker_changes_no_table(campaign_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_run, "BATCH", 1)
    here = run_campaign(campaign_folder, tmp_path / "here.parquet").campaign
    with cluster(2) as (address, processes):

        def kill(fraction):
            if fraction >= 0.5 and processes[0].poll() is None:
                processes[0].kill()

        out = tmp_path / "there.parquet"
        with progress_to(kill):
            there = run_campaign(campaign_folder, out, address).campaign
        assert processes[0].wait() == -signal.SIGKILL
    assert there.table.equals(here.table)
    assert not there.faults


@pytest.mark.slow
def test_a_cluster_without_the_folder_is_reported(address, tmp_path):
    read = partial(read_batch, tmp_path / "elsewhere")
    with pytest.raises(AnalysisError, match="does not exist on a worker"):
        list(run_over(read, [[Source("a.mcap", 1, 1)]], address))


@pytest.mark.slow
def test_workers_of_another_version_are_refused_by_name(address, monkeypatch):
    monkeypatch.setattr(workers, "LIBRARIES", ("pandas",))
    workers.computed_by.cache_clear()
    try:
        with pytest.raises(
            AnalysisError, match=r"\n  tcp://127\.0\.0\.1:\d+: .*, numpy .*, scipy "
        ):
            list(run_over(abs, [1], address))
    finally:
        workers.computed_by.cache_clear()


@pytest.mark.slow
def test_a_mixed_cluster_writes_no_mixed_table(campaign_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_run, "BATCH", 1)
    (tmp_path / "other.py").write_text(OTHER)
    here = run_campaign(campaign_folder, tmp_path / "here.parquet").campaign
    out = tmp_path / "there.parquet"
    with cluster(2, "--preload", str(tmp_path / "other.py")) as (address, processes):
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        with pytest.raises(AnalysisError, match=r"0\.1 \(code 123\)"):
            run_campaign(campaign_folder, out, address)
        assert not out.exists()
        # Of a worker that comes later, the first result is refused.
        monkeypatch.setattr(workers, "_workers", lambda client, address: 2)
        with pytest.raises(AnalysisError, match="a worker that has come since"):
            run_campaign(campaign_folder, out, address)
        processes[1].kill()
        monkeypatch.undo()
        there = run_campaign(campaign_folder, out, address).campaign
    assert there.table.equals(here.table)
