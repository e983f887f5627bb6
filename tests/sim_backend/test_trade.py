import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.trade import study
from sautereau.sim_backend.trade.results import (
    Point,
    Trade,
    pareto_front,
    recommended,
    trade_document,
    trade_figure,
    trade_text,
)
from sautereau.sim_backend.trade.study import run_trade, store_trade, stored_trade

POINT = Point("a push", 1e-4, "rigid", "elastica", "spring", 1e-6, 1e-4, 10.0)
FAILED = replace(POINT, error=None, force_error=None, real_time_factor=None, failed="it diverged")

few = st.lists(st.tuples(st.integers(0, 5), st.integers(1, 5)), max_size=12)


@given(few)
def test_a_point_is_kept_if_it_is_pareto_optimal(points):
    errors, speeds = [p[0] for p in points], [p[1] for p in points]
    kept = pareto_front(errors, speeds)
    for i, (error, speed) in enumerate(points):
        better = [
            j
            for j, (e, s) in enumerate(points)
            if e <= error and s >= speed and (e, s) != (error, speed)
        ]
        assert bool(better) == (points[i] not in [points[k] for k in kept])
    assert [errors[i] for i in kept] == sorted({errors[i] for i in kept})


def test_the_fastest_point_within_the_requested_error_is_recommended():
    points = [
        replace(POINT, error=1e-6, real_time_factor=10.0),
        replace(POINT, error=5e-6, real_time_factor=20.0),
        replace(POINT, error=5e-5, real_time_factor=90.0),
        FAILED,
    ]
    assert recommended(points, 1e-5) == 1
    assert recommended(points, 1e-7) is None


def test_a_simpler_model_is_not_recommended_for_the_noise_of_a_clock():
    """Nor a less accurate step whose speed is within the margin."""
    points = [
        replace(POINT, error=2e-8, real_time_factor=100.0),
        replace(POINT, error=8.8e-6, level="rods", real_time_factor=125.0),
        replace(POINT, error=5e-6, real_time_factor=109.0),
    ]
    assert recommended(points, 1e-5, 0.1) == 0
    points[1] = replace(points[1], real_time_factor=250.0)
    assert recommended(points, 1e-5, 0.1) == 1
    assert recommended(points[2:], 1e-5, 0.1) == 0


@pytest.fixture(scope="module")
def trade(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patched.setattr(study, "STEPS", {"rigid": (1, 8), "exact": (1, 8)})
        patched.setattr(study, "RUNS", (1, 3))
        first = run_trade(load_rig(), load_scene("pluck"))
        assert not first.cached
        again = run_trade(load_rig(), load_scene("pluck"))
        assert again == replace(first, cached=True)
        fresh = run_trade(load_rig(), load_scene("pluck"), fresh=True)
        assert not fresh.cached
        return fresh


def test_every_way_is_compared_with_the_reference(trade):
    by = {(p.engine, p.level, round(p.dt * 1e6)): p for p in trade.points}
    assert by["rigid", "elastica", 122].error < 2e-6
    assert by["exact", "elastica", 977].error < 1e-6
    assert by["rigid", "beam", 122].error > 1e-4
    assert by["rigid", "rods", 122].force_error < 1e-3 < by["rigid", "beam", 122].force_error
    simulated = trade.points[0].real_time_factor * _spent(trade.points[0])
    assert all(p.real_time_factor * _spent(p) == pytest.approx(simulated) for p in trade.points)


def _spent(point):
    return point.build_time + point.run_time


def test_the_recommended_point_is_accurate_and_the_front_starts_with_the_best(trade):
    chosen = trade.points[trade.recommended]
    assert chosen.error <= trade.requested == 0.5 / load_rig().daq.sample_rate
    best = trade.points[trade.pareto[0]]
    assert best.error == min(p.error for p in trade.points)


def test_an_engine_that_fails_is_not_fast(monkeypatch):
    def fail(rig, scene, drive):
        raise SceneError("it diverged")

    monkeypatch.setattr(study, "timed", fail)
    monkeypatch.setattr(study, "store_trade", lambda *args: None)
    trade = run_trade(load_rig(), load_scene("pluck"), fresh=True)
    assert {p.failed for p in trade.points} == {"it diverged"}
    assert trade.pareto == ()
    assert trade.recommended is None
    assert "failed: it diverged" in "\n".join(trade_text(trade))


def test_missing_events_are_a_failure(monkeypatch):
    def clear(rig, scene, drive):
        found, *times = real(rig, scene, drive)
        found.events.releases.clear()
        return found, *times

    real = study.timed
    monkeypatch.setattr(study, "timed", clear)
    monkeypatch.setattr(study, "store_trade", lambda *args: None)
    monkeypatch.setattr(study, "STEPS", {"rigid": (8,), "exact": (1,)})
    monkeypatch.setattr(study, "RUNS", (1, 1))
    trade = run_trade(load_rig(), load_scene("pluck"), fresh=True)
    assert all("are missing" in p.failed for p in trade.points)


def made(*points):
    good = [i for i, p in enumerate(points) if not p.failed]
    return Trade("a push", "a machine", 1e-5, points, tuple(good), good[0] if good else None)


def test_a_document_is_json_with_the_points_of_the_contract():
    document = json.loads(json.dumps(trade_document(made(POINT, FAILED)), allow_nan=False))
    assert {"scene", "dt", "error", "real_time_factor"} <= set(document["points"][0])
    assert document["points"][1]["failed"] is True
    assert document["points"][1]["error"] is None
    assert document["pareto"] == [document["points"][0]]
    assert document["recommended"] == document["points"][0]


def test_a_picture_is_labelled_and_logarithmic(tmp_path):
    peer = replace(POINT, engine="mujoco RK4", error=0.0)
    axes = trade_figure(made(POINT, peer, FAILED)).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert "(s)" in axes.get_ylabel()
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "mujoco RK4, elastica, spring" in names
    assert all(np.all(np.asarray(line.get_ydata()) > 0) for line in axes.lines)
    trade_figure(made(FAILED)).savefig(tmp_path / "trade.png")
    assert (tmp_path / "trade.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"points": 3}', '{"points": [{}]}', "\0"])
def test_a_damaged_cache_is_ignored(monkeypatch, tmp_path, damage):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    rig, scene = load_rig(), load_scene("pluck")
    store_trade(rig, scene, made(POINT))
    assert stored_trade(rig, scene) == replace(made(POINT), cached=True)
    (path,) = tmp_path.rglob("*.json")
    path.write_text(damage)
    assert stored_trade(rig, scene) is None


def test_without_a_cache_it_is_only_slower(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    store_trade(load_rig(), load_scene("pluck"), made(POINT))
    assert stored_trade(load_rig(), load_scene("pluck")) is None


def test_the_text_says_that_close_speeds_count_as_equal():
    """Otherwise a point that no other dominates would be unmarked without a reason."""
    assert "less than 10 % count as equal" in "\n".join(trade_text(made(POINT)))


def test_speeds_within_the_margin_count_as_equal():
    assert pareto_front([1.0, 2.0], [10.0, 10.5], 0.1) == [0]
    assert pareto_front([1.0, 2.0], [10.0, 11.5], 0.1) == [0, 1]
