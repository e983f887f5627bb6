"""The cards that the stand-in may be: their delays are in the data, and the client undoes them."""

from datetime import UTC, datetime

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.report.facts import corrections
from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import SessionInfo
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.card import BenchCard
from sautereau.sim_backend.clock import FairLock
from sautereau.sim_backend.device_types import DEVICE_TYPES
from sautereau.sim_backend.devices.daqmx.runs import Wiring
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_injection import FaultInjection
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.scene import load_scene, parse_scene
from sautereau.trajectory.press import plan_press
from tests.presses import QUICK

FREQUENCY, DURATION = 200.0, 0.12  # Hz and s, of a motion whose force and velocity are in phase
STEP, WIDTH = 0.1012345, 1e-3  # s, middle and width of a step of both, after which they stay at 1
CASES = [
    ("NI 9234", "51.2 kHz", "cDAQ1Mod1", "/cDAQ1/PFI0", 38.4 / 51_200 + 3.2e-6, 0.0),
    ("NI 9239", "50 kHz", "cDAQ1Mod1", "/cDAQ1/PFI0", (40 + 5 / 512) / 50e3 + 3.3e-6, 0.0),
    ("USB-6009", "24 kHz", "Dev1", "/Dev1/PFI0", 0.0, 1 / 48e3),
    ("PCI-6251", "20 kHz", "Dev1", "/Dev1/PFI0", 0.0, 11e-6),
    ("PCI-6251", "51.2 kHz", "Dev1", "/Dev1/PFI0", 0.0, 1 / (2 * 20e6 / 390)),
]
"""Card, rate, device, terminal of the trigger, filter delay and skew [s]."""


class Unmoved:
    """A plant without an arm."""

    joints = ()


def described(product, rate="20 kHz", device="Dev1", **more):
    rig = with_values(
        load_rig(),
        {
            "daq.sample_rate": rate,
            "daq.device": device,
            "daq.channels.0.range": "5 V",
            "daq.channels.1.range": "5 V",
        }
        | {f"daq.channels.{key}": value for key, value in more.items()},
    )
    scene = load_scene("ideal").model_copy(update={"card": product})
    rig = scene.true_rig(scene.as_wired(rig))
    return rig, bench_card(rig, product)


def bench_card(rig, product):
    scene = load_scene("ideal").model_copy(update={"card": product})
    injection = FaultInjection(None, Unmoved(), lambda: 0.0)
    return BenchCard(Wiring(rig, scene, 0, FairLock()), injection, lambda: 0.0)


def vibrating():
    """A sine and then a step, every 5 us; linear interpolation errs by 1e-5 of them."""
    time = np.arange(0, DURATION + 0.01, 5e-6)
    sine = np.sin(2 * np.pi * FREQUENCY * time) * (time < 0.09)
    both = sine + (1 + np.sin(np.pi * np.clip((time - STEP) / WIDTH, -0.5, 0.5))) / 2
    still = np.zeros_like(time)
    return Motions(time, still, both, still, both, still, still)


def phase(time, values):
    """Return the phase of a sine at 0 s, rad, by least squares."""
    angle = 2 * np.pi * FREQUENCY * time
    columns = np.stack([np.sin(angle), np.cos(angle), np.ones_like(time)], axis=1)
    (sine, cosine, _), *_ = np.linalg.lstsq(columns, values, rcond=None)
    return np.arctan2(cosine, sine)


@pytest.mark.parametrize(("product", "rate", "device", "terminal", "delay", "skew"), CASES)
def test_both_sensors_are_aligned(tmp_path, product, rate, device, terminal, delay, skew):
    rig, card = described(product, rate, device)
    path = tmp_path / "press-0001.mcap"
    settings = recorded(rig, card, path)
    assert settings.device.startswith(product)
    assert settings.trigger == terminal
    assert [one.delay for one in settings.channels] == pytest.approx([delay, delay - skew])
    bits = 24 if product.startswith("NI") else 14 if product == "USB-6009" else 16
    counts = read_recording(path).volts["force"] / (2 * 5.0 / 2**bits)
    np.testing.assert_array_equal(counts, np.rint(counts))
    kind = read_recording(path).channels["/daq"]["type"]
    assert kind == ("int32" if bits == 24 else "int16")
    must_be_aligned(path)
    for channel in read_recording(path).rig.daq.channels:
        said = corrections(channel)
        assert (f"{channel.input_delay * 1e6:.4g} µs" in said) == bool(channel.input_delay)


def recorded(rig, card, path):
    """Record what moves at the inputs of a card; return the settings of the acquisition."""
    with DaqmxServer(card) as server:
        rig = with_values(rig, {"daq.address": server.address})
        with Acquisition(rig.daq, DURATION) as acquisition:
            settings = acquisition.settings()
            acquisition.start()
            card.edge()
            card.feed(vibrating())
            session = SessionInfo(1, datetime.now(UTC).isoformat(), True, "none", "none", seed=0)
            with Recording(
                path,
                acquisition.of_device(rig),
                session=session,
                rate=acquisition.rate,
                scaling=acquisition.scaling,
            ) as recording:
                for block in acquisition.blocks():
                    recording.write_block(block)
    return settings


def must_be_aligned(path):
    """Compare phase and step of each signal with those at the inputs, to 1 us and 10 us."""
    data = load_press(path).data
    time = data.index.to_numpy()
    inner, rise = (time > 0.005) & (time < 0.085), abs(time - STEP) < WIDTH / 3
    before, after = abs(time - STEP + 5e-3) < 2e-3, abs(time - STEP - 5e-3) < 2e-3
    for name in ("force", "velocity"):
        late = -phase(time[inner], data[name].to_numpy()[inner]) / (2 * np.pi * FREQUENCY)
        assert late == pytest.approx(0.0, abs=1e-6)
        values = data[name].to_numpy()
        half = (values[before].mean() + values[after].mean()) / 2
        assert np.interp(half, values[rise], time[rise]) == pytest.approx(STEP, abs=10e-6)


CHASSIS = {"cDAQ1Mod1": "NI 9215", "cDAQ1Mod2": "NI 9234", "cDAQ1Mod3": "NI 9205"}
"""The vibrometer's module, that of the force with IEPE, and a multiplexer."""
IEPE = 38.4 / 51_200 + 3.2e-6  # s, delay of a 9234's filter


def of_chassis(**more):
    modules = {"0.device": "cDAQ1Mod1", "1.device": "cDAQ1Mod2", "1.excitation": "2 mA"}
    return described(
        CHASSIS, "51.2 kHz", "cDAQ1Mod1", **{"1.input_coupling": "ac"} | modules | more
    )


def test_three_modules_of_a_chassis_are_aligned(tmp_path):
    rig, _ = of_chassis()
    velocity, force = rig.daq.channels
    again = [
        channel.model_copy(
            update={"name": name, "device": "cDAQ1Mod3", "terminal": terminal, "excitation": 0.0}
            | {"input_coupling": "default"}
        )
        for name, channel, terminal in (("v", velocity, "ai4"), ("f", force, "ai9"))
    ]
    rig = rig.replaced({"daq.channels": (velocity, again[0], force, again[1])})
    card = bench_card(rig, CHASSIS)
    settings = recorded(rig, card, path := tmp_path / "press-0001.mcap")
    assert settings.trigger == "/cDAQ1/PFI0"
    assert all(f"{product}, " in settings.device for product in CHASSIS.values())
    found = {one.name: (one.terminal, one.delay) for one in settings.channels}
    assert found["velocity"] == ("cDAQ1Mod1/ai0", 0.0)
    assert found["force"] == ("cDAQ1Mod2/ai1", pytest.approx(IEPE))
    assert found["v"] == ("cDAQ1Mod3/ai4", 0.0)
    # The multiplexer is alone with its two inputs: 4 us and the settling time apart.
    assert found["f"] == ("cDAQ1Mod3/ai9", pytest.approx(-min(14e-6, 1 / 102.4e3)))
    assert {one.excitation for one in settings.channels} == {None, 0.002}
    assert {one.coupling for one in settings.channels} == {"dc", "ac"}
    must_be_aligned(path)
    press = read_recording(path)
    for channel in press.rig.daq.channels:
        volts = press.volts[channel.name]
        times = np.arange(len(volts)) / settings.rate - channel.input_delay
        inner = (times > 0.005) & (times < 0.085)
        late = -phase(times[inner], volts[inner]) / (2 * np.pi * FREQUENCY)
        assert late == pytest.approx(0.0, abs=10e-6), channel.name


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"1.device": "cDAQ1Mod7"}, ["daq.channels.force", "cDAQ1Mod7", "cDAQ1Mod2"]),
        ({"0.terminal": "ai4"}, ["daq.channels.velocity.terminal", "ai4", "NI 9215"]),
    ],
)
def test_a_chassis_that_the_rig_does_not_fit_is_refused(more, words):
    with pytest.raises(SceneError) as caught:
        of_chassis(**more)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"1.device": "cDAQ1Mod7"}, ['daq.channels.force.device = "cDAQ1Mod7"', "cDAQ1Mod2"]),
        ({"1.terminal": "ai4"}, ["cDAQ1Mod2/ai4", "daq.channels.*.terminal", "cDAQ1Mod1/ai0"]),
        ({"0.excitation": "2 mA"}, ["daq.channels.velocity", "AI_EXCIT_SRC"]),
        ({"0.input_coupling": "ac"}, ["daq.channels.velocity", "AI_COUPLING"]),
        ({"1.range": "9 V"}, ["AI.Max", "cDAQ1Mod2/ai1"]),
    ],
)
def test_a_fault_of_one_module_names_its_key(more, words):
    rig, card = of_chassis()
    rig = with_values(rig, {f"daq.channels.{key}": value for key, value in more.items()})
    with DaqmxServer(card) as server, pytest.raises(DaqError) as caught:
        Acquisition(rig.replaced({"daq.address": server.address}).daq, 0.1).__enter__()
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_press_on_modules_of_a_chassis_and_on_an_ideal_card():
    modules = {"daq.device": "cDAQ1Mod1", "daq.channels.1.device": "cDAQ1Mod2"}
    rig = with_values(load_rig(), modules)
    with (
        StandIn(rig, load_scene("ideal")) as stand_in,
        Acquisition(stand_in.rig.daq, 0.1, triggered=False) as acquisition,
    ):
        terminals = [one.terminal for one in acquisition.settings().channels]
        assert terminals == ["cDAQ1Mod1/ai0", "cDAQ1Mod2/ai1"]
        acquisition.start()
        assert sum(block.n_samples for block in acquisition.blocks()) == acquisition.n_samples


@pytest.mark.parametrize(
    "products",
    [
        {"cDAQ1Mod1": "NI 9239", "cDAQ2Mod1": "NI 9239"},
        {"Dev1": "USB-6009", "Dev2": "PCI-6251"},
        {"cDAQ1Mod1": "NI 9239", "Dev2": "PCI-6251"},
        dict.fromkeys(["cDAQ1Mod1", "cDAQ2Mod1"], "sautereau stand-in"),
        dict.fromkeys(["Dev1", "Dev2"], "sautereau stand-in"),
    ],
)
def test_one_task_has_one_clock(products):
    """Two chassis or cards are refused, as by NI-DAQmx; a task of the second one is not."""
    first, second = products
    rate = "24 kHz" if first == "Dev1" else "50 kHz"
    rig, card = described(products, rate, first, **{"1.device": second})
    alone = with_values(rig, {"daq.channels.0.device": second, "daq.device": second})
    if "cDAQ2Mod1" in products and products[second] == "NI 9239":
        with DaqmxServer(bench_card(alone, products)) as server:
            daq = with_values(alone, {"daq.address": server.address}).daq
            with Acquisition(daq, 0.1) as acquisition:
                assert acquisition.settings().trigger == "/cDAQ2/PFI0"
    with DaqmxServer(card) as server, pytest.raises(DaqError) as caught:
        Acquisition(with_values(rig, {"daq.address": server.address}).daq, 0.1).__enter__()
    assert all(word in str(caught.value) for word in ["-200558", *products, ".device"])


def release(path):
    """Return the time of the largest fall of the force, s after the trigger."""
    force = load_press(path).data["force"]
    return force.index[np.argmin(np.diff(force.to_numpy()))]


@pytest.mark.slow
@pytest.mark.parametrize("product", ["NI 9239", "PCI-6251"])
def test_a_press_on_a_described_card_has_its_release_at_the_true_time(tmp_path, product):
    rig = with_values(load_rig(), QUICK | {"daq.sample_rate": "50 kHz"})
    scene = load_scene("ideal").model_copy(update={"card": product})
    with StandIn(rig, scene) as stand_in:
        wired = stand_in.rig
        presses = [Item(wired, plan_press(wired))]
        (path,) = make_presses(GalilController(wired), tmp_path, presses)
        (truth,) = stand_in.truth()
    assert release(path) == pytest.approx(truth.releases[0], abs=1 / 50e3)


@pytest.mark.parametrize(
    ("product", "asked", "answered"),
    [
        ("NI 9234", 40_000.0, 51_200.0),
        ("NI 9234", 25_600.0, 25_600.0),
        ("NI 9234", 10.0, 51_200 / 31),
        ("NI 9239", 17_000.0, 25_000.0),
        ("PCI-6251", 51_200.0, 20e6 / 390),
        ("PCI-6251", 1e6, 1e6),
        ("sautereau stand-in", 12_345.6, 12_345.6),
    ],
)
def test_a_rate_is_coerced_to_the_next_one_above(product, asked, answered):
    assert DEVICE_TYPES[product].coerced(asked) == pytest.approx(answered, rel=1e-12)


def test_a_scene_names_a_card_that_has_the_inputs_of_the_rig():
    rig = with_values(load_rig(), {"daq.channels.0.terminal": "ai9"})
    scene = load_scene("ideal").model_copy(update={"card": "NI 9234"})
    with pytest.raises(SceneError, match="4 inputs from ai0 on"):
        scene.true_rig(rig)
    with pytest.raises(SceneError, match='one of "sautereau stand-in", "NI 9215"'):
        parse_scene('card = "NI 1234"')
