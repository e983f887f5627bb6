"""The table of faults, and each fault by itself against its definition."""

import contextlib

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import Bench
from sautereau.sim_backend.devices.ports import PortGone
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_injection import BadLine, disturbed
from sautereau.sim_backend.fault_tables import Drift, Faults, Overload, Speckle
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.sim_backend.scene import Scene, load_scene, parse_scene
from sautereau.sim_backend.sensors.chain import SensorChain
from sautereau.sim_backend.sensors.simulated import Drifting, DropOuts, Overloading
from tests.presses import MUTE_TEXT

IDEAL = MUTE_TEXT.replace("1 ms", "500 us")


def faults(**tables) -> Faults:
    return Faults.model_validate(tables)


def scene_with(**tables) -> Scene:
    return load_scene("ideal").model_copy(update={"faults": faults(**tables)})


# The table.


def test_a_table_is_read_with_its_units():
    found = parse_scene(
        IDEAL
        + """
[faults.slip]
joint = 2
counts = -40
press = 3
at = "30 ms"
[faults.speckle]
rate = "5 Hz"
duration = "2 ms"
spike = "20 mm/s"
"""
    ).faults
    assert found is not None
    assert found.slip is not None
    assert (found.slip.press, found.slip.at, found.slip.counts) == (3, 0.03, -40)
    assert found.speckle is not None
    assert (found.speckle.rate, found.speckle.spike, found.speckle.level) == (5, 0.02, 0)
    assert found.line is None


def test_every_fault_of_a_table_is_reported_at_once():
    with pytest.raises(SceneError) as caught:
        parse_scene(
            IDEAL
            + """
[faults.line]
press = 2
[faults.cable_out]
at = "3 ms"
[faults.overrun]
sample = -1
[faults.speckle]
rate = "0 Hz"
duration = "3 N"
[faults.stall]
joint = 3
[faults.sleep]
"""
        )
    text = str(caught.value)
    for part in (
        "faults.line: it has no effect without dropped other than 0",
        "faults.cable_out: after_bytes, press: neither is given",
        "faults.overrun.sample: -1 is refused",
        "faults.speckle.rate",
        "faults.speckle.duration",
        "faults.stall.joint",
        "faults.sleep: unknown key",
    ):
        assert part in text, text


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({}, "the table is empty"),
        ({"slip": {"joint": 1, "counts": 0}}, "slip\n.*it has no effect without counts other"),
        ({"drift": {"rate": "0 N/s"}}, "drift\n.*without rate other than 0; set that"),
        (
            {"speckle": {"rate": "5 Hz", "duration": "1 ms", "level": 1.0}},
            "speckle\n.*without level other than 1 or spike other than 0",
        ),
        (
            {"overrun": {"press": 2, "sample": 5}, "trigger_missing": {"press": 2}},
            "press 2 has trigger_missing already",
        ),
        (
            {"server_gone": {"press": 1, "sample": 5}, "overrun": {"press": 2, "sample": 5}},
            "the card is gone after server_gone in press 1",
        ),
    ],
)
def test_faults_that_cannot_all_occur_are_refused(tables, said):
    with pytest.raises(ValueError, match=said):
        faults(**tables)


def test_a_fault_of_an_absent_part_is_refused():
    rig = load_rig()
    (velocity,) = (c for c in rig.daq.channels if c.quantity == "velocity")
    rig = rig.replaced({"daq.channels": (velocity,)})
    tables = {"stall": {"joint": 1}, "drift": {"rate": "1 N/s"}, "index_missing": {"joint": 1}}
    tables |= {"switches_swapped": {"switch": "limit"}}
    with pytest.raises(SceneError) as caught:
        Bench(rig, scene_with(**tables))
    said = str(caught.value)
    assert 'faults.stall: it has no effect without scene.finger = "servo"' in said
    assert "faults.index_missing: it has no effect without rig.controller.home_index = true" in said
    assert "faults.switches_swapped: it has no effect without scene.controller.limit_s" in said
    assert "faults.drift: the rig has no channel that measures force" in said
    wired = scene_with(**tables).model_copy(
        update={"controller": ControllerUnit(limit_switches=True), "finger": "servo"}
    )
    assert not wired.faults.conflicts(
        wired, with_values(load_rig(), {"controller.home_index": True})
    )


def test_a_push_is_no_scene_for_a_controller():
    scene = parse_scene(IDEAL.replace("ideal", "push") + '[push]\nforce="1 N"\nduration="1 s"\n')
    with pytest.raises(SceneError, match="no arm"):
        Bench(load_rig(), scene)


# The serial line.

DATA = bytes(range(256)) * 200


def test_bytes_are_lost_and_changed_with_their_probabilities():
    n = len(DATA)
    lost = disturbed(DATA, 0.01, 0.0, np.random.default_rng(1))
    assert len(lost) == pytest.approx(0.99 * n, abs=4 * np.sqrt(0.01 * n))
    changed = disturbed(DATA, 0.0, 0.02, np.random.default_rng(1))
    difference = np.frombuffer(changed, np.uint8) ^ np.frombuffer(DATA, np.uint8)
    bits = np.unpackbits(difference[:, None], axis=1).sum(axis=1)
    assert set(bits) == {0, 1}
    assert np.count_nonzero(bits) == pytest.approx(0.02 * n, abs=4 * np.sqrt(0.02 * n))
    flipped = difference[difference > 0]
    assert set(flipped) == {1 << i for i in range(8)}


def test_how_bytes_are_grouped_changes_none():
    whole = disturbed(DATA, 0.05, 0.05, np.random.default_rng(3))
    random = np.random.default_rng(3)
    parts = [disturbed(DATA[i : i + 7], 0.05, 0.05, random) for i in range(0, len(DATA), 7)]
    assert b"".join(parts) == whole


def echo_line(past=lambda press, at: False, seed=0, **tables) -> BadLine:
    return BadLine(faults(**tables), seed, past)


def test_the_two_directions_are_independent():
    """What the host hears does not depend on how often it asks."""
    tables = {"line": {"dropped": 0.2, "towards": "host"}}
    one, other = echo_line(**tables), echo_line(**tables)
    assert one.carry(DATA, lambda data: data) == other.carry(b"short", lambda data: DATA)


@pytest.mark.parametrize("towards", ["controller", "host"])
def test_only_the_direction_asked_for_is_bad(towards):
    heard = []
    line = echo_line(line={"dropped": 1.0, "towards": towards})
    assert line.carry(b"TP\r", lambda data: heard.append(data) or b"x") == (
        b"x" if towards == "controller" else b""
    )
    assert heard == [b"" if towards == "controller" else b"TP\r"]


@pytest.mark.parametrize("port_closes", [True, False])
def test_a_cable_that_is_disconnected_ends_the_command_after_some_bytes(port_closes):
    line, heard = echo_line(cable_out={"after_bytes": 2, "port_closes": port_closes}), []
    gone = pytest.raises(PortGone) if port_closes else contextlib.nullcontext()
    with gone:
        assert line.carry(b"TP\r", lambda data: heard.append(data) or b"x") == b""
    assert heard == [b"TP"]


# The sensors.

RATE = 51_200.0
TIMES = np.arange(102_400) / RATE


def dropouts(seed=0, **fault) -> DropOuts:
    fault = {"rate": "20 Hz", "duration": "1 ms", **fault}
    return DropOuts(Speckle.model_validate(fault), np.random.default_rng(seed))


def test_drop_outs_have_their_rate_and_duration():
    """Poisson's drop-outs, each after the other's end: dark for r d / (1 + r d) of the time."""
    shown = dropouts(rate="200 Hz").disturb(TIMES, np.ones_like(TIMES))
    assert set(shown) == {0.0, 1.0}
    edges = np.flatnonzero(np.diff(shown))
    lengths = np.diff(edges)[::2]
    assert lengths.min() >= 51
    assert np.median(lengths) in (51, 52)
    number = 200 / 1.2 * 2
    assert np.mean(shown == 0) == pytest.approx(0.2 / 1.2, rel=4 / np.sqrt(number))


def test_a_drop_out_scales_and_offsets_the_velocity():
    shown = dropouts(level=0.25, spike="0.5 m/s").disturb(TIMES, np.ones_like(TIMES))
    false = np.unique(shown[shown != 1.0]) - 0.25
    assert len(false) > 10
    assert np.abs(false).max() <= 0.5
    assert false.min() < -0.1 < 0.1 < false.max()


@pytest.mark.parametrize("block", [1, 13, 999])
def test_blocks_do_not_change_a_drop_out(block):
    times = TIMES[:8000]
    values = np.sin(40 * times)
    fault = {"rate": "300 Hz", "level": 0.1, "spike": "1 m/s", "duration": "0.3 ms"}
    whole, parts = dropouts(**fault).disturb(times, values), dropouts(**fault)
    found = [
        parts.disturb(times[i : i + block], values[i : i + block]) for i in range(0, 8000, block)
    ]
    np.testing.assert_array_equal(np.concatenate(found), whole)


@pytest.mark.parametrize("block", [1, 97, 5120])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_overload_holds_until_it_has_recovered(block, sign):
    """A triangle of 2 N over 100 ms: from 0.5 N at 25 ms to 75 ms, and 10 ms more."""
    times = TIMES[:5120]
    force = sign * 2 * (1 - np.abs(times - 0.05) / 0.05)
    amplifier = Overloading(Overload.model_validate({"force": "1 N", "recovery": "10 ms"}))
    shown = np.concatenate(
        [
            amplifier.disturb(times[i : i + block], force[i : i + block])
            for i in range(0, 5120, block)
        ]
    )
    held = (times > 0.025 - 1e-9) & (times < 0.085 - 1 / RATE)
    free = (times < 0.025 - 1e-9) | (times > 0.085)
    np.testing.assert_array_equal(shown[held], sign * 1.0)
    np.testing.assert_array_equal(shown[free], force[free])


def test_ac_coupling_turns_a_drift_into_an_offset():
    """A ramp r through a first-order high-pass of w: r / w (1 - exp(-w t))."""
    channel = load_rig().daq.channel("force")
    assert channel is not None
    channel = channel.model_copy(update={"low_pass": 0.0, "high_pass": 0.5, "delay": 0.0})
    drift = Drifting(Drift.model_validate({"rate": "0.2 N/s"}))
    chain = SensorChain(channel, None, RATE, 0.0, np.random.default_rng(0), [drift])
    chain.input.extend(TIMES[1:], 0 * TIMES[1:])
    w = 2 * np.pi * 0.5
    expected = 0.2 / w * (1 - np.exp(-w * TIMES))
    np.testing.assert_allclose(chain.volts(0, len(TIMES)), expected, atol=1e-6)
