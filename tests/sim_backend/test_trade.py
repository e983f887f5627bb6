import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.base import steps_in_sample
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.scene import load_scene, packaged_scenes, parse_scene
from sautereau.sim_backend.trade import refinement, study
from sautereau.sim_backend.trade.refinement import stepped
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
from tests.budget import slow

POINT = Point("a push", 1e-4, "rigid", "elastica", "spring", 1e-6, 1e-4, 10.0)
US10 = Accuracy(1e-5, None)
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
    assert recommended(points, US10) == 1
    assert recommended(points, Accuracy(1e-7, None)) is None


def test_a_simpler_model_is_not_recommended_for_the_noise_of_a_clock():
    """Nor a less accurate step whose speed is within the margin."""
    points = [
        replace(POINT, error=2e-8, real_time_factor=100.0),
        replace(POINT, error=8.8e-6, level="rods", real_time_factor=125.0),
        replace(POINT, error=5e-6, real_time_factor=109.0),
    ]
    assert recommended(points, US10, 0.1) == 0
    points[1] = replace(points[1], real_time_factor=250.0)
    assert recommended(points, US10, 0.1) == 1
    assert recommended(points[2:], US10, 0.1) == 0


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
    assert chosen.error <= trade.requested.time == 0.5 / load_rig().daq.sample_rate
    best = trade.points[trade.pareto[0]]
    assert best.error == min(p.error for p in trade.points)


def test_an_engine_that_fails_is_not_fast(monkeypatch):
    monkeypatch.setattr(study, "first_runs", lambda rig, ways, drive: ["it diverged"] * len(ways))
    monkeypatch.setattr(study, "store_trade", lambda *args: None)
    trade = run_trade(load_rig(), load_scene("pluck"), fresh=True)
    assert {p.failed for p in trade.points} == {"it diverged"}
    assert trade.pareto == ()
    assert trade.recommended is None
    assert "failed: it diverged" in "\n".join(trade_text(trade))


def test_missing_events_are_a_failure(monkeypatch):
    def clear(rig, ways, drive):
        runs = real(rig, ways, drive)
        for one in runs:
            one.found.events.releases.clear()
        return runs

    real = study.first_runs
    monkeypatch.setattr(study, "first_runs", clear)
    monkeypatch.setattr(study, "store_trade", lambda *args: None)
    monkeypatch.setattr(study, "STEPS", {"rigid": (8,), "exact": (1,)})
    monkeypatch.setattr(study, "RUNS", (1, 1))
    trade = run_trade(load_rig(), load_scene("pluck"), fresh=True)
    assert all("are missing" in p.failed for p in trade.points)


def made(*points):
    good = [i for i, p in enumerate(points) if not p.failed]
    chosen = good[0] if good else None
    return Trade("a push", "a machine", "the exact solution", US10, points, tuple(good), chosen)


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


PUSHED = """
finger = "push"
plectrum = "elastica"
string = "{string}"
friction = true
felt = false
{choice}
[push]
force = "1.2 N"
duration = "15 ms"
"""
BENDING = '[bending]\nfrequency = "400 Hz"\ndamping = 0.01'
PLAY = '[play]\nstiffness = "1e5 N/m"\ndamping = "5 N s/m"'
UNSOLVED = [("modal", BENDING), slow("modal", ""), slow("spring", BENDING), slow("spring", PLAY)]


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(study, "STEPS", {"rigid": (1, 4, 16), "exact": (1, 8)})
    monkeypatch.setattr(refinement, "TRUTH_STEPS", 64)
    monkeypatch.setattr(study, "RUNS", (1, 1))
    monkeypatch.setattr(study, "store_trade", lambda *args: None)


@pytest.mark.parametrize(("string", "part"), UNSOLVED)
def test_a_scene_without_an_exact_solution_is_compared_with_its_refinement(quick, string, part):
    """Stated errors are 0.5 to 5 times the distance from a solution 16 times as fine."""
    rig, scene = (
        load_rig(),
        parse_scene(PUSHED.format(string=string, choice='step = "50 us"') + part),
    )
    trade = run_trade(rig, scene, fresh=True)
    assert "halving the step" in trade.truth
    assert "of the exact solution" in trade.truth
    assert {p.engine for p in trade.points if p.string == string and p.level == "elastica"} == {
        "rigid"
    }
    drive = drive_of(rig, scene)
    finest = observe(rig, stepped(rig, scene, 1024, engine="rigid"), drive)
    for point in trade.points:
        assert not point.failed
        if point.string == string:
            way = scene.model_copy(update={"step": point.dt, "plectrum": point.level})
            true = errors(observe(rig, way, drive), finest)
            assert 0.5 * true.time < point.error < 5 * true.time + 1e-7
    if string == "modal":
        simpler = [p for p in trade.points if p.string == "spring"]
        assert {p.engine for p in simpler} == ({"rigid"} if part else {"rigid", "exact"})
        assert min(p.error for p in simpler) > max(
            p.error for p in trade.points if (p.string, p.level) == ("modal", "elastica")
        )


def test_a_string_left_to_the_accuracy_is_compared_with_the_modal_one(quick):
    text = PUSHED.format(string="auto", choice='engine = "auto"\naccuracy = "200 us"')
    trade = run_trade(load_rig(), parse_scene(text), fresh=True)
    assert {p.string for p in trade.points} == {"modal", "spring"}
    assert trade.points[trade.recommended].error < 200e-6


def test_an_accuracy_of_forces_is_recommended_by_errors_of_forces(quick, tmp_path):
    """The beam's force is 20 % off, that of rods 0.03 %."""
    rig = load_rig()
    for asked, allowed in (("0.001 %", 1e-5), ("0.1 %", 1e-3)):
        text = PUSHED.format(string="spring", choice=f'engine = "auto"\naccuracy = "{asked}"')
        trade = run_trade(rig, parse_scene(text), fresh=True)
        assert trade.points[trade.recommended].force_error <= allowed
        assert asked in "\n".join(trade_text(trade))
        document = trade_document(trade)
        assert document["requested_error"] is None
        assert document["requested_force_error"] == pytest.approx(allowed)
    trade_figure(trade).savefig(tmp_path / "trade.png")
    points = [
        replace(POINT, error=1e-4, force_error=1e-6, real_time_factor=10.0),
        replace(POINT, error=1e-9, force_error=1e-2, real_time_factor=99.0),
    ]
    assert recommended(points, Accuracy(None, 1e-3)) == 0


@pytest.mark.slow
def test_steps_that_the_engine_divides_alike_appear_once(quick):
    """While a hard fingertip presses, the engine's own steps are shorter than those given."""
    text = PUSHED[: PUSHED.index("[push]")].format(string="spring", choice='step = "100 us"')
    pad = '[fingertip]\nstiffness = "300 kN/m"\ndamping = "15 N s/m"\n'
    text = text.replace('"push"', '"ideal"') + pad + BENDING
    trade = run_trade(load_rig(), parse_scene(text), fresh=True)
    steps = [p.dt for p in trade.points if (p.engine, p.level) == ("rigid", "elastica")]
    assert trade.same > 0
    assert len(steps) < 3
    assert "omitted" in "\n".join(trade_text(trade))


def test_the_recommended_lines_make_the_scene_that_was_measured(trade):
    lines = trade_text(trade)
    start = next(i for i, line in enumerate(lines) if line.startswith("  engine ="))
    chosen = trade.points[trade.recommended]
    text = "\n".join(lines[start : start + 4])
    scene = load_scene("pluck")
    named = parse_scene(
        f'finger = "push"\nfriction = false\nfelt = false\n{text}\n'
        '[push]\nforce = "1.2 N"\nduration = "15 ms"'
    )
    rig = load_rig()
    assert (named.engine, named.plectrum, named.string) == (
        chosen.engine,
        chosen.level,
        chosen.string,
    )
    assert steps_in_sample(rig, named.step) == steps_in_sample(rig, chosen.dt)
    assert scene.push == named.push


def test_a_busy_machine_is_stated():
    calm = made(*(replace(POINT, spread=0.05) for _ in range(3)))
    busy = made(*(replace(POINT, spread=0.6) for _ in range(3)))
    assert "busy" not in "\n".join(trade_text(calm))
    assert "varied by 60 %" in "\n".join(trade_text(busy))


@pytest.mark.parametrize("asked", ["3.21 us", "9.99 us", "10 us", "0.0123 %", "8 %"])
def test_an_accuracy_is_rounded_upwards_to_two_digits(asked):
    one = Accuracy.parse(asked)
    more = one.rounded_up()
    value, rounded = (each.time or each.force for each in (one, more))
    assert value <= rounded * (1 + 1e-12) < value * 1.1
    assert (Accuracy.parse(str(more)).time or Accuracy.parse(str(more)).force) >= value * (1 - 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", packaged_scenes())
def test_every_packaged_scene_has_a_study(quick, name):
    trade = run_trade(load_rig(), load_scene(name), fresh=True)
    assert trade.points[trade.recommended].error <= trade.requested.time
    assert not any(point.failed for point in trade.points)


def test_a_jump_of_another_controller_sample_is_no_error_of_time():
    """Of the scene paper the rods' events are within 10 us, and a servo's jumps differ in size."""
    scene = load_scene("paper").model_copy(update={"engine": "exact", "accuracy": None})
    drive = drive_of(load_rig(), scene)
    found, true = (
        observe(load_rig(), scene.model_copy(update={"plectrum": level, "step": step}), drive)
        for level, step in (("rods", 122e-6), ("elastica", 61e-6))
    )
    assert 5e-6 < errors(found, true).time < 20e-6


def test_the_error_of_a_scene_without_a_string_is_that_of_its_motion():
    """Twice the step is four times the error of a leap-frog scheme at the ends of its steps."""
    scene = load_scene("free-key").model_copy(update={"engine": "rigid"})
    true = reference(load_rig(), scene)
    off = [
        errors(observe(load_rig(), scene.model_copy(update={"step": step})), true).time
        for step in (976.5625e-6, 244.140625e-6)
    ]
    assert 0 < off[1] < off[0] < 5e-6
