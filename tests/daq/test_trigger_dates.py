"""The date of the trigger's edge, on the stand-in in real time, over the real nidaqmx."""

import time

import pytest

from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.survey import describe
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import StandIn
from tests.budget import amount, slow
from tests.presses import QUICK, mute_scene, press_on

WAIT = 0.2  # s, from arming to the edge
PERCENT_95 = 1.96


class Edges:
    """Dates of the edges at a stand-in's card, s since 1970."""

    def __init__(self, card):
        self.dates, self._edge, self._card = [], card.edge, card
        card.edge = self._note

    def _note(self, delay=0.0, *, falling=False):
        now, before = time.time_ns() / 1e9, len(self._card.starts)
        self._edge(delay, falling=falling)
        self.dates += [now + delay] * (len(self._card.starts) - before)


def at_real_time(before):
    values = QUICK | {"daq.pre_trigger": f"{before} s", "daq.trigger_timeout": "20 s"}
    return StandIn(with_values(load_rig(), values), mute_scene(), paced=True)


def record(stand_in, path, session, duration=0.1):
    """Record the samples around an edge that comes ``WAIT`` s after arming."""
    rig, bench = stand_in.rig, stand_in.bench
    output = rig.controller.trigger_output
    bench.receive(f"CB {output}\r".encode())
    with (
        Acquisition(rig.daq, duration) as source,
        Recording(path, rig, session=session, rate=source.rate, scaling=source.scaling) as made,
    ):
        source.start()
        time.sleep(WAIT)
        made.before_trigger()
        bench.receive(f"SB {output}\r".encode())
        for block in source.blocks():
            made.write_block(block)


def errors(stand_in, folder, session, n):
    """Return error and standard uncertainty of the dates of n edges, s."""
    edges, found = Edges(stand_in.bench.card), []
    for number in range(n):
        record(stand_in, path := folder / f"{number}.mcap", session)
        read = read_recording(path)
        found.append((read.t0_ns / 1e9 - edges.dates[-1], read.t0_std))
        assert describe(path)["t0_std"] == read.t0_std
    return found


@pytest.mark.parametrize("n", [3, slow(amount(20, 100))])
@pytest.mark.parametrize("before", [0.0, 0.05])
def test_95_of_100_edges_are_within_the_stated_interval(tmp_path, session, before, n):
    """On a busy machine the interval is wider."""
    with at_real_time(before) as stand_in:
        found = errors(stand_in, tmp_path, session, n)
    assert sum(abs(error) <= PERCENT_95 * std for error, std in found) >= 0.95 * n


@pytest.mark.slow
@pytest.mark.parametrize("before", [0.0, 0.05])
def test_a_press_is_dated_by_its_edge(tmp_path, before):
    """Which the controller raises about a second after the command that starts the press."""
    with at_real_time(before) as stand_in:
        edges = Edges(stand_in.bench.card)
        (path,) = press_on(stand_in, tmp_path)
    found = read_recording(path)
    (date,) = edges.dates
    assert abs(found.t0_ns / 1e9 - date) <= PERCENT_95 * found.t0_std


def test_an_acquisition_that_no_edge_starts_is_dated_by_its_command(tmp_path, session):
    with at_real_time(0.0) as stand_in:
        rig = stand_in.rig
        with (
            Acquisition(rig.daq, 0.1, triggered=False) as source,
            Recording(
                tmp_path / "a.mcap", rig, session=session, rate=source.rate, scaling=source.scaling
            ) as made,
        ):
            dates = [time.time_ns() / 1e9]
            made.before_trigger()
            source.start()
            dates.append(time.time_ns() / 1e9)
            for block in source.blocks():
                made.write_block(block)
    found = read_recording(tmp_path / "a.mcap")
    assert dates[0] <= found.t0_ns / 1e9
    assert found.t0_ns / 1e9 - PERCENT_95 * found.t0_std <= dates[1]


@pytest.mark.parametrize(
    ("before", "duration", "triggered", "n"),
    [(0.05, 0.1, True, 8000), (0.0, None, False, 8000), (0.0, 0.1, False, 5120)],
)
def test_a_card_in_real_time_acquires_while_nobody_reads_it(before, duration, triggered, n):
    """Also while it waits for an edge, longer than the samples before it."""
    with (
        at_real_time(before) as stand_in,
        Acquisition(stand_in.rig.daq, duration, triggered=triggered) as source,
    ):
        source.start()
        (run,) = stand_in.bench.card.runs
        until = time.monotonic() + 60
        while run.acquired < n and time.monotonic() < until:
            time.sleep(0.01)
        assert run.acquired >= n
