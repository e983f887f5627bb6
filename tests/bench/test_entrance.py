"""The Python entrance: the README's snippet, plans as programs, and how sessions end."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sautereau as st
from sautereau.analysis.errors import AnalysisError
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import RigError, SautereauError
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.monitor import Made, Stage
from sautereau.robot.experiment.session_folder import read_manifest
from sautereau.sim_backend.scene import load_scene
from tests.pages import read_page
from tests.plots import texts


@pytest.fixture
def quick(bare, quick_rig):
    """The bench of a key without strings."""
    return st.stand_in(quick_rig, bare, seed=1)


@pytest.mark.slow
def test_the_snippet_of_the_readme_runs(rig_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig_file().rename("my-rig.toml")
    snippet = read_page("../README.md").bodies("python")[0]
    assert snippet.count("import") == 1
    assert len(snippet.splitlines()) <= 30  # rig, plan, presses, features, comparison, fit, model
    names = {}
    quicker = {"press(5": "press(2", '"paper"': '"ideal"', 'overlap"])': 'overlap"], starts=1)'}
    for shown, short in quicker.items():
        assert snippet.count(shown) == 1
        snippet = snippet.replace(shown, short)
    exec(snippet, names)
    session, fit, plan = names["session"], names["fit"], names["plan"]
    assert len(session) == 2
    assert plan.checks["holds"].all()
    assert session.features.attrs["units"]["release_force"] == "N"
    assert fit.identifiable == {"plectrum.overlap": True}
    assert st.Rig("fit.toml").values.plectrum.overlap == pytest.approx(0.3e-3, rel=0.02)
    assert fit.mixed == ()
    other = replace(session[1].info, started="2020-01-01", session="another")
    session[1].__dict__["analysed"] = replace(session[1].analysed, session=other)
    mixed = session.identify(["plectrum.overlap"], starts=1)
    assert "although the presses differ in day" in str(mixed)
    assert [len(c.presses) for c in session.compare().found.conditions] == [1, 1]
    assert session.report().path == Path("monday/report.html")
    assert (session.report("page.html").presses, session.folder) == (2, Path("monday"))
    with pytest.raises(SautereauError, match="not given as one folder"):
        session[:1].report()
    assert session.plot()._repr_png_().startswith(b"\x89PNG")
    both = texts(session.compare().plot())
    assert [sum(f"condition {n} of 2, day" in text for text in both) for n in (1, 2)] == [1, 1]
    alone = texts(session.compare().plot(2))
    assert [sum(f"condition {n} of 2, day" in text for text in alone) for n in (1, 2)] == [0, 1]
    against = texts(session[:1].compare(session[1:]).plot())
    assert any("1 press against 1 press, SIMULATED" in text for text in against)
    assert {"first set: simulated, 1 press", "second set: simulated, 1 press"} <= set(against)
    assert len(repr(session[0].phases)) < 100
    shown = [names["rig"], plan, session, session[0], session.compare(), fit]
    shown += [names["rig"].predict(), names["rig"].sweep(overlap=...)]
    for one in shown:
        assert len(repr(one)) < 200
        assert "<table" in one._repr_html_()
        assert len(one.to_frame()) > 0
    assert session[0].to_xarray()["velocity"].attrs["units"] == "m/s"
    assert shown[-1].to_xarray()["pluck_duration"].attrs == {"units": "s"}
    assert shown[-1].plot().axes


def test_names_of_values_are_short_where_they_are_unique():
    rig = st.Rig().with_values(overlap=0.3e-3, jack_speed="0.1 m/s")
    assert (rig.values.plectrum.overlap, rig.values.press.jack_speed) == (0.3e-3, 0.1)
    with pytest.raises(RigError) as caught:
        rig.with_values({"length": "1 mm"}, overlapp="1 mm")
    assert "plectrum.length or string.length" in str(caught.value)
    assert "overlapp: unknown quantity" in str(caught.value)
    with pytest.raises(AttributeError, match="no attribute 'Rigg'"):
        _ = st.Rigg
    assert {"Rig", "open", "stand_in"} <= set(dir(st))


def test_a_sweep_is_a_grid_of_predictions():
    rig = st.Rig()
    found = rig.sweep(overlap=["0.2 mm", "0.3 mm"], jack_speed=[0.05, 0.1, 0.2])
    alone = rig.predict(overlap=0.3e-3, jack_speed=0.1).press.pluck_duration
    frame = found.to_frame()
    assert frame.loc[(0.3e-3, 0.1), "pluck_duration"] == pytest.approx(alone, rel=1e-3)
    assert frame["pluck_duration"].shape == (6,)
    with pytest.raises(SautereauError, match=r"key\.dip has no assumed range|give its values"):
        rig.sweep(jack_speed=...)


def test_questions_of_a_plan_are_answered_in_advance(quick, tmp_path, capsys):
    """By a mapping or, on the stand-in without a terminal, by the plan itself."""

    def plan():
        first = yield from st.ask("Its name?", stand_in="quill")
        second = yield from st.ask("Its name?")
        yield from st.press(notes=f"{first}, {second}")

    def answered(out):
        *questions, press = read_manifest(out).plan["presses"]
        assert press["notes"] == ", ".join(row["answer"] for row in questions)
        return [(row["answer"], row["by"]) for row in questions]

    quick.press(plan, warm_up=0, out=tmp_path / "a")
    assert answered(tmp_path / "a") == [("quill", "the stand-in"), ("", "the stand-in")]
    assert "Its name? quill (by the stand-in)" in capsys.readouterr().err
    for _ in range(2):  # the second time, the session has noted them
        quick.press(plan, warm_up=0, out=tmp_path / "b", answers={"Its": ["delrin", "other"]})
    assert answered(tmp_path / "b") == [("delrin", "answers"), ("other", "answers")]
    assert capsys.readouterr().err.count("delrin (by answers)") == 1
    with pytest.raises(RobotError, match=r'presses\.2\.answer: "other" then, "more" now'):
        quick.press(plan, warm_up=0, out=tmp_path / "b", answers={"Its": ["delrin", "more"]})
    with pytest.raises(RobotError, match=r"question 2 of 'Its'[\s\S]*'Which\?': no such question"):
        quick.press(
            plan, warm_up=0, out=tmp_path / "c", answers={"Its": ["delrin"], "Which?": "this"}
        )
    with pytest.raises(RobotError, match=r"'Which\?': no such question"):
        quick.press(
            plan, warm_up=0, out=tmp_path / "d", answers={"Its": "delrin", "Which?": "this"}
        )


@pytest.mark.slow
def test_a_plan_as_a_program_continues_after_a_kill(bare, quick_rig, tmp_path):
    """Each press is made once, over TCP, with the answers that were given before the kill."""
    bare.write_text(bare.read_text() + '\n[controller]\ninterface = "ethernet"\n')
    quick = st.stand_in(quick_rig, bare, seed=1)
    asked, runs = [], []

    def plan():
        made = yield from st.scan("jack_speed", ["0.05 m/s", 0.08], 1)
        assert [len(one) for one in made] == [1, 1]
        name = yield from st.ask("Which plectrum?")
        presses = yield from st.repeat_until(lambda made: len(made) == 2, 5, notes=name)
        runs.append([press.info.item for press in presses])

    def answer(text):
        asked.append(text)
        return "delrin"

    def kill(seen):
        if isinstance(seen, Made):
            raise KeyboardInterrupt

    quick.ask = answer
    for made in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            quick.press(plan, out=tmp_path / "out", watch=kill)
        assert len(list((tmp_path / "out").glob("*.mcap"))) == made
    session = quick.press(plan, out=tmp_path / "out")
    assert len(session) == len(list((tmp_path / "out").glob("press-*.mcap"))) == 4
    assert asked == ["Which plectrum?"]
    assert runs == [[3, 4]]
    assert list(session.features["jack_speed"]) == [0.05, 0.08, 0.072, 0.072]
    assert session[3].info.notes == "delrin"
    rows = read_manifest(tmp_path / "out").plan["presses"]
    assert [row["repeats"] for row in rows] == [1, 1, 0, 1, 1]
    with pytest.raises(RobotError, match=r"presses\.1[\s\S]*another plan|another plan[\s\S]*1"):
        quick.press(lambda: st.press(2), out=tmp_path / "out")


@pytest.mark.slow
def test_learning_continues_with_its_engine(bare, quick_rig, tmp_path):
    """The engine of version 0.1, where `auto` is another one now."""
    rigid = load_scene(str(bare)).model_copy(update={"engine": "rigid"})
    st.stand_in(quick_rig, rigid, seed=1).learn(1, out=tmp_path)
    session = st.stand_in(quick_rig, bare, seed=1).learn(2, out=tmp_path).session
    assert {json.loads(press.info.scene)["engine"] for press in session} == {"rigid"}


@pytest.mark.slow
def test_pause_resume_and_abort_from_another_thread(quick, tmp_path):
    """A pause ends with the motors off at home; an aborted session continues."""
    off, stages = threading.Event(), []

    def watch(seen):
        if isinstance(seen, Made) and seen.press == 1:
            quick.pause()
        if isinstance(seen, Stage):
            stages.append(seen.arm)
            if seen.arm == "motors off" and len(stages) > 2:
                off.set()

    errors = []

    def run():
        try:
            quick.press(3, out=tmp_path, watch=watch)
        except RobotError as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    assert off.wait(60)
    assert stages[-1] == "motors off"
    assert len(list(tmp_path.glob("*.mcap"))) == 1
    quick.abort()
    thread.join(60)
    assert "aborted by the operator" in errors[0]
    with quick as bench:
        assert len(bench.press(3, out=tmp_path)) == 3
    for call in (bench.press, bench.learn):
        with pytest.raises(RobotError, match="bench: its `with` block has ended"):
            call(4, out=tmp_path / "after")


@pytest.mark.slow
def test_an_abort_from_another_thread_ends_learning(quick, tmp_path):
    """It continued to its last press, with the motors on."""
    errors = []

    def run():
        try:
            quick.learn(20, out=tmp_path)
        except RobotError as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("*.mcap")) and time.monotonic() < deadline:
        time.sleep(0.01)
    quick.abort()
    thread.join(60)
    assert errors
    assert "aborted by the operator" in errors[0]
    assert len(list(tmp_path.glob("press-*.mcap"))) < 20


def test_a_plan_that_needs_an_operator_says_so(quick, rig_file, tmp_path):
    hardware = st.bench(rig_file())
    hardware.ask = lambda text: None
    with pytest.raises(RobotError, match=r"needs an operator: Look at the jack"):
        hardware.press(lambda: st.ask("Look at the jack"), out=tmp_path)
    with pytest.raises(RobotError, match="is no plan"):
        quick.press([1, 2], out=tmp_path)


@pytest.mark.parametrize("rest", ["2", "2 m", -1.0, float("nan"), None])
def test_a_wrong_time_between_presses_is_named(quick, tmp_path, rest):
    with pytest.raises(RobotError, match=r"^rest: "):
        quick.press(2, out=tmp_path, rest=rest)


def test_names_may_be_one_text():
    """It was read letter by letter."""
    session = st.open(Path(__file__).parents[1] / "data/written_by_0.1/session")
    with pytest.raises(
        AnalysisError, match=r"plectrum\.overlapp: no parameter.*plectrum\.overlap'"
    ):
        session.identify("key.inertia, plectrum.overlapp")


@pytest.mark.slow
def test_a_replay_presses_what_was_pressed(quick, quick_rig, tmp_path):
    fast = st.Rig(quick_rig).with_values(jack_speed="0.09 m/s")
    (first,) = st.stand_in(fast, quick.scene, 1).press(1, out=tmp_path / "first")
    (again,) = quick.replay(first.path, out=tmp_path / "again")
    one, two = (read_recording(press.path) for press in (first, again))
    np.testing.assert_array_equal(one.plan.jack_rise, two.plan.jack_rise)
    assert again.info.notes == "replay of press-0001.mcap"
    assert np.ptp(one.plan.jack_rise - two.plan.jack_rise) == 0


def test_learning_is_a_call_of_the_bench(quick_rig, tmp_path):
    learned = st.stand_in(quick_rig, "ideal", seed=1).learn(1, out=tmp_path)
    assert list(learned.to_frame()["rms_speed_error"]) == list(learned.errors)
    assert learned.errors[0] < 1e-3
    assert (learned.path, len(learned.session), learned.simulated) == (None, 1, True)
    assert len(repr(learned)) < 200
