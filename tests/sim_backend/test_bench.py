"""The bench in this process: choices, truth, and memory."""

import pytest

from sautereau.rig.load import load_rig
from sautereau.sim_backend.bench import Bench
from sautereau.sim_backend.devices.daqmx.card import TaskSetup
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents, StringEvent, truths
from sautereau.sim_backend.scene import load_scene
from tests.presses import mute_scene


def event(time, choir=0, force=0.0):
    return StringEvent(time, choir, force)


def test_truth_is_given_from_each_edge_to_the_next():
    events = PluckEvents(
        contacts=[event(0.5), event(1.1), event(1.2, 1), event(2.5)],
        releases=[event(1.3, 0, 0.4), event(1.35, 1, 0.6)],
        returns=[event(1.9)],
    )
    first, second = truths(events, [1.0, 2.0])
    assert first.contacts == pytest.approx((0.1, 0.2))
    assert first.releases == pytest.approx((0.3, 0.35))
    assert first.returns == pytest.approx((0.9,))
    assert [e.force for e in first.release_events] == [0.4, 0.6]
    assert [e.choir for e in first.contact_events] == [0, 1]
    assert second.contacts == (0.5,)
    assert second.releases == second.returns == ()


def test_without_an_edge_there_is_no_truth():
    assert truths(PluckEvents([event(0.1)], [], []), []) == []


def test_an_event_on_the_edge_belongs_to_the_press_that_it_starts():
    one, other = truths(PluckEvents([event(1.0), event(2.0)], [], []), [1.0, 2.0])
    assert one.contacts == other.contacts == (0.0,)


def test_an_acquisition_that_is_over_is_not_kept():
    """So that memory and time do not grow in a long session."""
    bench = Bench(load_rig(), mute_scene())
    for _ in range(50):
        run = bench.card.start(TaskSetup(("Dev1/ai0", "Dev1/ai1"), 51_200.0, 10, None))
        while bench.busy:
            bench.tick()
        assert run.read(0, 10).shape == (2, 10)
    assert len(bench.card.runs) == 1
    assert len(bench.truth()) == 50


NOISY = mute_scene(sensors=load_scene("paper").sensors)


def toy_rig():
    rig = load_rig()
    return rig.replaced({"controller.kind": "toy"})


def test_a_controller_without_an_emulator_is_refused_by_its_name():
    with pytest.raises(SceneError, match="emulated controller 'toy' is unknown; known: galil, odr"):
        Bench(toy_rig(), NOISY)


def test_another_package_adds_the_emulator_of_a_controller(tmp_path, install):
    points = {"sautereau.emulators": {"toy": "toy_emulator:emulate"}}
    install(tmp_path, {"name": "toy", "version": "1.0", "entry-points": points})
    (tmp_path / "toy_emulator.py").write_text(
        "from sautereau.sim_backend.parts import ControllerUnit\n"
        "from sautereau.sim_backend.devices.galil.firmware import GalilFirmware\n"
        "def emulate(rig, plant, on_output, paced):\n"
        "    return GalilFirmware(plant, ControllerUnit(serial_number=77), on_output=on_output)\n"
    )
    bench = Bench(toy_rig(), NOISY)
    assert b" 77.0000" in bench.receive(b"MG _BN\r")
