"""Recordings of several presses: where each is, and that `split` writes all that it shows."""

import itertools
import json
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from benchmarks.simulated import as_recorded
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import load_press, press_of
from sautereau.analysis.loading.presses import AGAIN, NO_END, REST, presses_of
from sautereau.analysis.phases import find_phases
from sautereau.analysis.session.analysed import analyse_file, analyse_partial
from sautereau.analysis.text import WIDTH
from sautereau.commands.app import app
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import SPLIT, Block, Event, SessionInfo
from sautereau.daq.file.recording import Recording
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import with_values
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.sensors.chain import SensorChain

RATE = 25_600.0
CONTACT, RELEASE = 0.052, 0.072  # s after the start of a press of `make_press`
SESSIONS = Path(__file__).parents[1] / "data/written_by_0.1/session"


@pytest.fixture(scope="module")
def one(make_press):
    """Velocity and force of a press with its way back; 25 ms of rest at the start."""
    press = make_press(rate=RATE)
    velocity, force = press.samples["velocity"], press.samples["force"]
    fade = 0.5 + 0.5 * np.cos(np.linspace(0, np.pi, len(force)))
    return np.concatenate([velocity, -velocity]), np.concatenate([force, force[-1] * fade])


def joined(parts, pauses):
    """Return velocity and force of parts with pauses [s] before, between and after them.

    Also the samples at which each part starts.
    """
    rows, starts, n = [], [], 0
    for part, pause in zip([*parts, np.zeros((2, 0))], pauses, strict=True):
        rest = np.zeros((2, round(pause * RATE)))
        starts.append(n + rest.shape[1])
        rows += [rest, part]
        n += rest.shape[1] + np.shape(part)[1]
    return np.concatenate(rows, 1), starts[:-1]


def sensed(rig, signals, seed=0):
    """Return the volts of the simulated sensors, with the noise of the scene `paper`."""
    sensors, rows = load_scene("paper").sensors, []
    times = np.arange(signals.shape[1]) / RATE
    for i, (channel, signal) in enumerate(zip(rig.daq.channels, signals, strict=True)):
        random = np.random.default_rng([seed, i])
        chain = SensorChain(channel, sensors, RATE, float(signal[0]), random)
        chain.input.extend(times, signal)
        rows.append(chain.volts(0, len(signal)))
    return np.stack(rows)


@pytest.fixture
def record(paper, tmp_path):
    """Write what the sensors show of velocity and force; return the recording's path."""

    def write(signals, without=None, name="long.mcap", events=(), first=0, rig=paper, joints=None):
        volts = sensed(rig, signals)
        kept = [i for i, channel in enumerate(rig.daq.channels) if channel.name != without]
        rig = rig.replaced({"daq.channels": tuple(rig.daq.channels[i] for i in kept)})
        session = SessionInfo(1, "2026-02-03T04:05:06+01:00", True, "none", "none", notes="monday")
        path = tmp_path / name
        with Recording(path, rig, session=session, rate=RATE, t0_ns=10**18) as recording:
            recording.write_block(Block(first, volts[kept]))
            for event in events:
                recording.event(event.kind, event.text, event.time)
            if joints is not None:
                recording.write_plan(*joints)
        return path

    return write


def found_in(path):
    return presses_of(read_recording(path))


def run(*words):
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


@pytest.mark.parametrize("without", [None, "force", "velocity"])
def test_every_press_is_found_with_its_rests(one, record, without):
    signals, starts = joined([one] * 4, [0.2, 0.45, 2.0, 0.6, 0.3])
    found = found_in(record(signals, without))
    motions = [(start + 0.025 * RATE, start + one[0].size) for start in starts]
    assert len(found.presses) == 4
    for i, (span, (first, last)) in enumerate(zip(found.presses, motions, strict=True)):
        assert first - (REST + 0.01) * RATE <= span.start <= first - 0.2 * RATE
        assert last + 0.2 * RATE <= span.stop <= last + (REST + 0.01) * RATE
        assert i == 0 or motions[i - 1][1] - 0.05 * RATE < span.start
        assert i == 3 or span.stop < motions[i + 1][0] + 0.005 * RATE
        assert span.doubts == ()
    assert found.others == ()


def test_presses_without_a_pause_are_divided_where_the_key_is_highest(one, record, tmp_path):
    """As in a trill; each part has the pluck of its press, and the division is said.

    The free phase is short, so that the contact is uncertain.
    """
    cut = 0.024
    fast = np.stack(one)[:, round(cut * RATE) : -round(0.049 * RATE)]  # all of it is motion
    signals, starts = joined([fast] * 6, [0.2, 0.06, 0.3, 0.02, 0.01, 0.005, 0.2])
    path = record(signals)
    spans = found_in(path).presses
    assert [span.doubts for span in spans] == [(), (), *[(AGAIN,)] * 4]
    for before, after in itertools.pairwise(spans[2:]):
        assert before.stop == after.start
    assert run("split", path, "--out", tmp_path / "presses") == 0
    for file, start in zip(sorted((tmp_path / "presses").iterdir()), starts, strict=True):
        (pluck,) = analyse_file(file).phases.plucks
        offset = _start(file) - start / RATE + cut
        assert 0.05e-3 < pluck.contact_std < 0.3e-3
        assert pluck.contact + offset == pytest.approx(CONTACT, abs=2 * pluck.contact_std)
        assert pluck.release + offset == pytest.approx(RELEASE, abs=0.05e-3)


@pytest.mark.parametrize(("seed", "cut"), [(3, 0.020), (5, 0.028)])
def test_a_press_of_a_trill_has_no_growth_beside_its_pluck(one, paper, seed, cut):
    """Presses that start in the ringing of the one before, on a key that is rigid."""
    fast = np.stack(one)[:, round(cut * RATE) : -round(0.049 * RATE)]
    signals, _ = joined([fast] * 6, [0.2, 0.02, 0.01, 0.005, 0.0, 0.003, 0.2])
    volts = dict(
        zip((c.name for c in paper.daq.channels), sensed(paper, signals, seed), strict=True)
    )
    recorded = as_recorded(paper, volts, RATE, 0, "trill.mcap", seed)
    for number, span in enumerate(presses_of(recorded).presses, 1):
        part = {name: values[span.start : span.stop] for name, values in volts.items()}
        cut_out = as_recorded(paper, part, RATE, 0, "part.mcap", seed)
        session = replace(cut_out.session, press=number)
        after = (Event(span.start / RATE, SPLIT, "one of several"),)
        phases = find_phases(press_of(replace(cut_out, session=session, events=after)))
        assert len(phases.plucks) == 1
        assert not phases.missed, phases.warnings
        assert phases.fit.model == "rigid"


def test_a_key_that_is_held_down_is_no_pause(one, record):
    middle = one[0].size // 2
    hold = np.array([[0.0], [one[1][middle]]]) * np.ones(round(RATE))
    held = np.concatenate([np.stack(one)[:, :middle], hold, np.stack(one)[:, middle:]], 1)
    signals, starts = joined([held, one], [0.4, 0.4, 0.4])
    for without in (None, "force", "velocity"):
        found = found_in(record(signals, without, f"{without}.mcap"))
        assert len(found.presses) == 2
        assert found.presses[0].stop > starts[0] + held.shape[1] - 0.05 * RATE


def test_a_force_that_is_back_at_rest_within_a_press_is_no_pause(paper, one, record):
    """With the finger's force alone: a release, 0.2 s of next to nothing, then the front felt."""
    time = np.arange(round(0.3 * RATE)) / RATE
    pluck = np.clip(time / 0.02, 0, 1) * (time < 0.02)
    felt = np.clip((time - 0.22) / 0.02, 0, 1) * np.clip((0.3 - time) / 0.02, 0, 1)
    press = np.stack([0 * time, pluck + felt])
    signals, _ = joined([press, press], [0.5, 0.5, 0.5])
    found = found_in(record(signals, "velocity"))
    assert found.pause == pytest.approx(2 * paper.press.jack_rise / paper.press.jack_speed)
    assert len(found.presses) == 2


def test_offset_and_drift_of_the_force_do_not_matter(paper, one, record):
    """0.2 N/s without AC coupling, over 3 times a press."""
    direct = with_values(paper, {"daq.channels.1.high_pass": "0 Hz"})
    signals, _ = joined([one] * 6, [0.3] + [2.0] * 5 + [0.5])
    signals[1] += 1.0 + 0.2 * np.arange(signals.shape[1]) / RATE
    assert signals[1, -1] > 3 * one[1].max()
    for without in (None, "velocity"):
        assert len(found_in(record(signals, without, f"{without}.mcap", rig=direct)).presses) == 6


def test_drop_outs_and_spikes_do_not_matter(one, record):
    signals, _ = joined([one] * 3, [0.3, 0.5, 0.5, 0.3])
    for at in (0.1, 0.45, 0.9, 1.3):
        signals[0, round(at * RATE) : round((at + 0.0015) * RATE)] = 0.2
        signals[1, round(at * RATE) : round((at + 0.0005) * RATE)] = 8.0
    assert len(found_in(record(signals)).presses) == 3


def test_smaller_motion_is_reported_and_ends_are_said(one, record):
    """A touch of a quarter of the way, then a press, then one that is not finished."""
    small, start = 0.25 * np.stack(one), np.stack(one)[:, : one[0].size // 2]
    signals, starts = joined([small, one, start], [0.5, 0.5, 0.5, 0.0])
    found = found_in(record(signals))
    assert [span.doubts for span in found.presses] == [(), (NO_END,)]
    (other,) = found.others
    assert starts[0] - RATE * 0.01 < other.start < other.stop < starts[1]
    assert found.presses[0].start > other.stop
    assert found.presses[-1].stop == signals.shape[1]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda s: 0 * s, "no press"),
        (lambda s: -s, "opposite sign"),
        (lambda s: s[:, round(0.285 * RATE) :], "held down"),
        (lambda s: s + 0.02 * np.sin(np.arange(s.shape[1]) / 300), "nowhere at rest for 40 ms"),
        (lambda s: s[:, :20], "nowhere at rest"),
    ],
)
def test_what_shows_no_separate_presses_is_refused(one, record, change, why):
    signals, _ = joined([one, one], [0.1, 0.1, 0.1])
    with pytest.raises(AnalysisError, match=why):
        found_in(record(change(signals)))


def test_split_writes_every_sample_of_each_press(one, record, tmp_path, capsys):
    signals, _ = joined([one] * 3, [0.3, 0.2, 1.5, 0.1])
    events = [
        Event(0.0, "warning", "velocity: seems inverted"),
        Event(0.5, "note", "first"),
        Event(1.0, "note", "second"),
        Event(1.9, "note", "in the long pause"),
    ]
    path = record(signals, events=events, first=-1000)
    before = path.read_bytes()
    assert run("split", path, "--out", tmp_path / "presses", "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert path.read_bytes() == before
    names = [Path(name).name for name in result["recordings"]]
    assert names == ["long-0001.mcap", "long-0002.mcap", "long-0003.mcap"]
    whole, parts = read_recording(path), [read_recording(p) for p in result["recordings"]]
    for number, (part, at) in enumerate(zip(parts, result["presses"], strict=True), 1):
        first = round(at["start"] * RATE) + 1000
        assert round(at["stop"] * RATE) + 1000 == first + part.n_samples
        for name, volts in whole.volts.items():
            assert np.array_equal(part.volts[name], volts[first : first + part.n_samples])
        assert part.first_sample == 0
        assert part.t0_ns == pytest.approx(whole.t0_ns + at["start"] * 1e9, abs=1)
        assert part.rig == whole.rig
        assert part.simulated
        assert part.session.press == number
        assert f"of long.mcap: time 0 is {at['start']:.9g} s" in part.session.notes
        assert part.session.notes.startswith("monday\nsamples ")
        kinds = {event.kind: event for event in part.events}
        assert kinds["warning"].time == 0.0
        assert kinds["split"].text in part.session.notes
    notes = [[e for e in part.events if e.kind == "note"] for part in parts]
    assert [[e.text for e in each] for each in notes] == [["first"], ["second"], []]
    assert notes[1][0].time == pytest.approx(1.0 - result["presses"][1]["start"])
    started = datetime.fromisoformat(parts[1].session.started)
    later = started - datetime.fromisoformat(whole.session.started)
    assert later.total_seconds() == pytest.approx(result["presses"][1]["start"], abs=1e-6)
    with pytest.raises(SautereauError, match=r"long-0001\.mcap already exists"):
        run("split", path, "--out", tmp_path / "presses")
    assert run("split", path, "--out", tmp_path / "presses", "--force") == 0
    shown = capsys.readouterr().out
    assert "3 presses, separated by pauses of 40 ms or more" in shown
    assert all(len(line) <= WIDTH or "/" in line for line in shown.splitlines())


def test_a_press_of_an_arm_is_not_split(one, record, tmp_path):
    time = np.linspace(0, 1, 20)
    path = record(joined([one], [0.2, 0.2])[0], joints=[time, time, time, time])
    with pytest.raises(RecordingError, match="the motion of an arm"):
        run("split", path, "--out", tmp_path)


def test_a_table_of_presses_becomes_recordings_that_are_analysed(paper, one, tmp_path, capsys):
    """From the file of another program to contact and release of every press."""
    signals, starts = joined([one] * 3, [0.1, 0.3, 1.0, 0.1])
    np.savez(tmp_path / "lab.npz", v=(volts := sensed(paper, signals))[0], f=volts[1])
    words = ["import", tmp_path / "lab.npz", "--out", tmp_path / "lab.mcap", "--rig", "paper"]
    words += ["--rate", f"{RATE} Hz", "--trigger", "0 s", "--simulated"]
    words += ["--started", "2026-02-03T04:05:06+01:00"]
    words += ["--column.velocity", "v", "--unit.velocity", "V"]
    words += ["--column.force", "f", "--unit.force", "V"]
    assert run(*words) == 0
    (warning,) = [w for w in analyse_file(tmp_path / "lab.mcap").warnings if "goes down" in w]
    assert "`sautereau split`" in warning
    assert run("split", tmp_path / "lab.mcap", "--out", tmp_path / "presses") == 0
    capsys.readouterr()
    assert run("phases", tmp_path / "presses", "--json") == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert len(files) == 3
    for file, start in zip(files, starts, strict=True):
        (pluck,), at = file["plucks"], _start(file["path"])
        for name, truth in (("contact", CONTACT), ("release", RELEASE)):
            found = pluck[name] + at - start / RATE
            assert found == pytest.approx(truth, abs=3 * pluck[f"{name}_std"])
        assert not [w for w in file["warnings"] if "goes down" in w or "rest" in w]
    assert run("compare", tmp_path / "presses", "--json") == 0
    assert run("campaign", tmp_path / "presses", "--out", tmp_path / "c.parquet") == 0


@pytest.mark.slow
def test_several_presses_in_the_force_alone_are_said(one, record):
    signals, _ = joined([one] * 2, [0.2, 0.6, 0.3])
    path = record(signals, "velocity")
    (warning,) = [w for w in analyse_partial(path).warnings if "goes down" in w]
    assert "`sautereau split`" in warning
    single = record(joined([one], [0.2, 0.3])[0], "velocity", "single.mcap")
    assert not any("goes down" in w for w in analyse_partial(single).warnings)


def test_a_long_recording_is_that_of_its_first_press(paper, one, record):
    """An offset that wanders by 0.4 mm/s moves the key by 20 mm in a minute."""
    direct = with_values(paper, {"daq.channels.0.high_pass": "0 Hz"})
    signals, (start, *_) = joined([one] * 3, [0.5, 30.0, 30.0, 0.5])
    signals[0] += 0.2e-3 * (1 - np.cos(np.linspace(0, 2 * np.pi, signals.shape[1])))
    found = analyse_file(record(signals, rig=direct))
    assert any("`sautereau split`" in warning for warning in found.warnings)
    (held,) = found.phases.plucks
    assert held.release == pytest.approx(start / RATE + RELEASE, abs=3 * held.release_std)
    assert found.press.samples["jack_rise"].max() < 11e-3


def test_joined_recordings_of_the_stand_in_are_separated(record, tmp_path):
    """With its plucks, its ringing and its motion; each release is where it was before."""
    presses = [load_press(path) for path in sorted(SESSIONS.glob("*.mcap"))[:2]]
    parts = [
        [np.interp(np.arange(0, p.time[-1] - p.time[0], 1 / RATE), p.time - p.time[0], p.samples[n])
         for n in ("velocity", "force")]
        for p in presses
    ]  # fmt: skip
    signals, starts = joined([*parts, *parts], [0.2, 0.2, 0.7, 0.2, 0.2])
    path = record(signals)
    assert len(found_in(path).presses) == 4
    assert run("split", path, "--out", tmp_path / "presses") == 0
    made = sorted((tmp_path / "presses").iterdir())
    for i, (file, start) in enumerate(zip(made, starts, strict=True)):
        (was,) = analyse_file(presses[i % 2].path).phases.plucks
        (found,) = analyse_file(file).phases.plucks
        release = found.release + _start(file) - start / RATE + presses[i % 2].time[0]
        assert release == pytest.approx(was.release, abs=3 * found.release_std)


def _start(path):
    """Return the time [s] of a part in the file that it is from."""
    text = next(e.text for e in read_recording(path).events if e.kind == "split")
    return float(text.split("time 0 is ")[1].split(" s ")[0])
