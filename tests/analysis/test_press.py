"""Recordings loaded as presses: scale, AC coupling, delay, quality flags, drift."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import UNITS, load_press, partial_press_of
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import with_values
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.sensors.chain import SensorChain
from tests.recordings import SESSION, write_recording

RATE = 51_200.0


@pytest.fixture
def record(tmp_path):
    def write(rig, volts, simulated=True, first=0):
        session = replace(SESSION, simulated=simulated)
        return write_recording(tmp_path / "press-0001.mcap", rig, volts, first, session=session)

    return write


def ideal(paper, **values):
    plain = {
        f"daq.channels.{i}.{name}": zero
        for i in (0, 1)
        for name, zero in (("delay", "0 s"), ("high_pass", "0 Hz"), ("low_pass", "0 Hz"))
    }
    return with_values(paper, plain | values)


def test_columns_units_and_origin(paper, record):
    path = record(ideal(paper), np.ones((2, 2000)))
    press = load_press(path)
    assert list(press.data.columns) == list(UNITS)
    assert press.data.attrs["units"] == UNITS
    assert press.data.attrs["simulated"] is True
    assert press.simulated
    assert press.rate == RATE
    assert press.path == path
    assert press.data.index.name == "time"
    np.testing.assert_allclose(press.data.index, np.arange(2000) / RATE, rtol=1e-12)


def test_constant_speed_through_the_lever(paper, record):
    """1 V is 25 mm/s at the laser; the angle is its integral over the laser's arm."""
    press = load_press(record(ideal(paper), np.stack([np.ones(2000), np.full(2000, 0.5)]), False))
    assert not press.simulated
    time, key = press.data.index.to_numpy(), paper.key
    np.testing.assert_allclose(press.data["velocity"], 0.025, rtol=1e-12)
    np.testing.assert_allclose(press.data["force"], 0.5, rtol=1e-12)
    np.testing.assert_allclose(press.data["deflection"], 0.025 * time, rtol=1e-9, atol=1e-15)
    angle = 0.025 * time / key.laser_arm
    rise = key.jack_arm * np.tan(angle) + key.jack_surface_height * (1 / np.cos(angle) - 1)
    np.testing.assert_allclose(press.data["jack_rise"], rise, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(
        press.data["jack_speed"], np.gradient(rise, time, edge_order=2), rtol=1e-6
    )


def sines(rig, record):
    """Return a press of sines of 200 Hz with the lags of the rig's channels, and the true one."""
    time = np.arange(4000) / RATE
    volts = [np.sin(2 * np.pi * 200 * (time - channel.lag)) for channel in rig.daq.channels]
    press = load_press(record(rig, np.stack(volts)))
    return press, np.sin(2 * np.pi * 200 * press.data.index.to_numpy())


@pytest.mark.parametrize("delay", ["0 s", "10 us", "19.53125 us", "1.1 ms"])
def test_every_delay_is_corrected(paper, record, delay):
    """A sine with a calibrated delay is shifted back, also by fractions of a sample."""
    rig = ideal(paper, **{"daq.channels.0.delay": delay})
    late = rig.daq.channels[0].delay
    press, expected = sines(rig, record)
    np.testing.assert_allclose(press.data["velocity"] / 0.025, expected, atol=8e-5)
    np.testing.assert_allclose(
        press.data["velocity"].iloc[16:-16] / 0.025, expected[16:-16], atol=1e-9
    )
    np.testing.assert_allclose(press.data["force"], expected, atol=1e-12)
    assert len(press.data) == 4000 - int(np.ceil(late * RATE - 1e-9))


@pytest.mark.parametrize("early", ["-4.8 us", "-19.53125 us", "-30 us"])
def test_an_input_that_a_multiplexer_samples_later(paper, record, early):
    """Its samples are of later instants than its rows say; the first rows have no sample of it."""
    rig = ideal(paper, **{"daq.channels.1.input_delay": early})
    late = rig.daq.channels[1].lag
    press, expected = sines(rig, record)
    np.testing.assert_allclose(press.data["velocity"] / 0.025, expected, atol=1e-12)
    np.testing.assert_allclose(press.data["force"], expected, atol=8e-5)
    skipped = int(np.ceil(-late * RATE - 1e-9))
    assert (press.data.index[0], len(press.data)) == (skipped / RATE, 4000 - skipped)


@pytest.mark.parametrize(("n", "left"), [(70, 13), (57, 0), (56, 0), (20, 0), (1, 0)])
def test_too_short_for_its_delay(paper, record, n, left):
    """1.1 ms are 56.3 samples."""
    with pytest.raises(
        AnalysisError, match=rf"0001\.mcap: only {left} samples remain after the correction"
    ):
        load_press(record(paper, np.ones((2, n))))


@pytest.mark.parametrize("kept", ["velocity", "force"])
def test_both_quantities_are_needed(paper, record, kept):
    rig = paper.replaced({"daq.channels": (paper.daq.channel(kept),)})
    missing = {"velocity": "force", "force": "velocity"}[kept]
    with pytest.raises(
        AnalysisError, match=f"it has no {missing} channel, .* quantity = '{missing}'"
    ):
        load_press(record(rig, np.ones((1, 3000))))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        load_press(tmp_path / "none.mcap")


def sensed(rig, signals, seed=0, until=0.5, silent=False):
    """Return the volts of the simulated sensors of a rig for functions of time."""
    sensors = load_scene("paper").sensors
    if silent:
        quiet = {"velocity_noise": 0.0, "force_noise": 0.0, "hum": 0.0}
        sensors = sensors.model_copy(update=quiet)
    rows = []
    fine = np.arange(1, round(until * 20 * RATE)) / (20 * RATE)
    for i, (channel, function) in enumerate(zip(rig.daq.channels, signals, strict=True)):
        random = np.random.default_rng([seed, i])
        chain = SensorChain(channel, sensors, RATE, float(function(np.zeros(1))[0]), random)
        chain.input.extend(fine, function(fine))
        rows.append(chain.volts(0, round(until * RATE)))
    return np.stack(rows)


def stroke(time):
    """Velocity at the laser, m/s: 3.8 mm down and back between 20 and 470 ms."""
    down, up = (np.clip((time - at) / length, 0, 1) for at, length in ((0.02, 0.15), (0.2, 0.27)))
    return 3.8e-3 / 0.15 * (1 - np.cos(2 * np.pi * down)) * (down < 1) - 3.8e-3 / 0.27 * (
        1 - np.cos(2 * np.pi * up)
    ) * (up < 1)


@pytest.mark.parametrize("silent", [True, False])
def test_a_step_of_both_sensors_is_at_one_time(paper, record, silent):
    """Of velocity and force at 123.4567 ms, to 10 us, as either reaches half its height."""
    at = 0.1234567
    heights = (0.02, 0.5)
    volts = sensed(paper, [lambda t, h=h: h * (t > at) for h in heights], until=0.2, silent=silent)
    press = load_press(record(paper, volts))
    time = press.data.index.to_numpy()
    near = (time > at - 1e-4) & (time < at + 1e-4)
    found = []
    for column, height in zip(("velocity", "force"), heights, strict=True):
        signal = press.data[column].to_numpy()[near]
        after = int(np.argmax(signal > height / 2))
        part = (height / 2 - signal[after - 1]) / (signal[after] - signal[after - 1])
        found.append(time[near][after - 1] + part / RATE)
    assert found == pytest.approx([at, at], abs=10e-6)
    assert abs(found[0] - found[1]) < 5e-6


def test_the_delay_of_a_slow_low_pass_is_corrected_by_its_order(paper, record):
    """Of 1 kHz, 159 us: the middle of a ramp of force agrees with that of velocity to 10 us."""
    slow = {"daq.channels.1.low_pass": "1 kHz", "daq.channels.1.low_pass_order": 1}
    rig = with_values(paper, slow)

    def ramp(height):
        return lambda t: height * np.clip((t - 0.1) / 0.01, 0, 1)

    volts = sensed(rig, [ramp(0.02), ramp(0.5)], until=0.2, silent=True)
    press = load_press(record(rig, volts))
    time = press.data.index.to_numpy()
    halves = [
        np.interp(
            height / 2,
            press.data[column][(time > 0.1) & (time < 0.11)],
            time[(time > 0.1) & (time < 0.11)],
        )
        for column, height in (("velocity", 0.02), ("force", 0.5))
    ]
    assert halves == pytest.approx([0.105, 0.105], abs=10e-6)


def test_the_inertia_of_the_fixture_is_subtracted(paper, record):
    """Of 20 g on a key that moves as `stroke`: the force on the key remains, here 0.3 N."""
    rig = with_values(paper, {"arm.fixture_mass": "20 g"})
    lever = rig.key.press_arm / rig.key.laser_arm

    def held(t):
        return 0.3 * (t > 0.03)

    def measured(t):
        step = 1e-6
        return held(t) + 20e-3 * lever * (stroke(t + step) - stroke(t - step)) / (2 * step)

    volts = sensed(rig, [stroke, measured], until=0.54)
    inertia = np.ptp(measured(np.linspace(0.02, 0.47, 1000)))
    assert inertia > 0.05
    force = load_press(record(rig, volts)).data["force"].loc[0.031:0.53].to_numpy()
    means = force[: 24 * 1024].reshape(24, 1024).mean(axis=1)
    np.testing.assert_allclose(means, 0.3, atol=0.02 * inertia)
    assert np.diff(force, 2).std() / np.sqrt(6) < 1.3 * load_scene("paper").sensors.force_noise


def test_without_a_velocity_the_inertia_of_the_fixture_is_named(paper, record):
    rig = with_values(paper, {"arm.fixture_mass": "20 g"})
    (row,) = sensed(rig, [stroke, lambda t: 0.3 * (t > 0.01)])[1:]
    alone = rig.replaced({"daq.channels": rig.daq.channels[1:]})
    press = partial_press_of(read_recording(record(alone, row[None])))
    assert any("the inertia of the fixture, 20 g, is contained" in w for w in press.warnings)


@pytest.mark.parametrize("corner", ["0.1 Hz", "0.5 Hz", "1 Hz"])
def test_ac_coupling_is_inverted_to_two_thousandths_over_500_ms(paper, record, corner):
    """A step of 1 N, in the simulated chain with all its noise: the mean over each 20 ms."""
    rig = with_values(paper, {"daq.channels.1.high_pass": corner})
    volts = sensed(rig, [stroke, lambda t: 1.0 * (t > 0.03)], until=0.54)
    press = load_press(record(rig, volts))
    assert abs(volts[1, -1000:].mean()) < 0.8
    force = press.data["force"].loc[0.031:0.531].to_numpy()
    means = force[: 25 * 1024].reshape(25, 1024).mean(axis=1)
    np.testing.assert_allclose(means, 1.0, atol=2e-3)


def test_an_offset_does_not_become_a_ramp(paper, record):
    """4 mV after the coupling are 4 mN of force: 1.3 mN more after 0.5 s if not subtracted."""
    offsets = np.array([[0.0005], [0.004]])
    volts = offsets + sensed(paper, [stroke, lambda t: 0.5 * (t > 0.03)])
    press = load_press(record(paper, volts))
    assert press.drift.force == pytest.approx(4e-3, abs=0.5e-3)
    assert press.data["force"].iloc[-1000:].mean() == pytest.approx(0.5, abs=1e-3)
    assert press.drift.velocity == pytest.approx(0.0005 * 0.025, rel=2)
    assert abs(press.data["deflection"].iloc[-1]) < 5e-6
    assert press.drift.after is not None
    assert press.warnings == ()


@pytest.mark.parametrize("gain_std", [1e-3, 1e-2])
def test_a_doubtful_offset_is_a_warning_above_the_uncertainty_of_the_gain(paper, record, gain_std):
    """12 mN at rest: 4 mN of 1 N at the end are wrong if they were no offset, 0.4 %."""
    channels = tuple(c.model_copy(update={"gain_std": gain_std}) for c in paper.daq.channels)
    rig = paper.model_copy(update={"daq": paper.daq.model_copy(update={"channels": channels})})
    volts = np.array([[0.0005], [0.012]]) + sensed(paper, [stroke, lambda t: 2 * t * (t > 0.03)])
    press = load_press(record(rig, volts))
    said = press.warnings + press.remarks
    assert len(said) == 1
    assert "count as an offset of the sensor" in said[0]
    assert len(press.warnings) == (gain_std == 1e-3)


def resting(text):
    """Return the force [N] at rest after the press, as a text states it."""
    return float(text.removeprefix("force: ").split(" mN at rest after the press")[0]) / 1e3


@pytest.mark.parametrize(("slope", "doubt"), [(0.1, None), (-0.01, False), (-0.1, True)])
def test_a_finger_does_not_pull_at_a_resting_key(paper, record, slope, doubt):
    """A zero that drifts, in N/s, over 490 ms; without AC coupling, a peak of 0.5 N."""
    volts = np.zeros((2, round(0.5 * RATE)))
    time = np.arange(volts.shape[1]) / RATE
    volts[0] = stroke(time) / paper.daq.channels[0].scale
    volts[1] = 0.5 * ((time > 0.05) & (time < 0.07)) + slope * time
    press = load_press(record(ideal(paper), volts))
    said = press.warnings + press.remarks
    assert [text for text in said if "a finger cannot pull" in text] == list(said)
    assert len(said) == (doubt is not None)
    assert len(press.warnings) == bool(doubt)
    if said:
        assert resting(said[0]) == pytest.approx(slope * 0.485, rel=0.01)


def test_an_ac_coupling_that_the_rig_does_not_state(paper, record):
    """A force of 0.3 N for 0.4 s leaves -0.18 N behind 0.5 Hz, by its closed form."""
    coupled, stated = (
        with_values(paper, {"daq.channels.1.high_pass": corner}) for corner in ("0.5 Hz", "0 Hz")
    )
    volts = sensed(coupled, [stroke, lambda t: 0.3 * ((t > 0.03) & (t < 0.43))])
    (text,) = load_press(record(stated, volts)).warnings
    left = -0.3 * (1 - np.exp(-np.pi * 0.4)) * np.exp(-np.pi * (0.485 - 0.43))
    assert resting(text) == pytest.approx(left, rel=0.03)
    assert "state `high_pass`" in text


def test_a_clean_press_has_no_quality_flags_and_no_warnings(paper, record):
    for seed in range(5):
        volts = sensed(paper, [stroke, lambda t: 0.5 * ((t > 0.05) & (t < 0.07))], seed)
        press = load_press(record(paper, volts))
        assert press.quality_flags == press.warnings == ()
        press.path.unlink()


def test_quality_flags_are_at_the_time_of_the_motion(paper, record):
    volts = sensed(paper, [stroke, lambda t: 20.0 * ((t > 0.05) & (t < 0.06))])
    lost = slice(round(0.1 * RATE), round(0.1005 * RATE))
    volts[0, lost] = 0.0
    press = load_press(record(paper, volts))
    force, velocity = sorted(press.quality_flags, key=lambda mark: mark.channel)
    assert (force.kind, velocity.kind) == ("clipped", "drop-out")
    assert (force.start, force.stop) == pytest.approx((0.05, 0.06), abs=1e-3)
    assert (velocity.start, velocity.stop) == pytest.approx((0.0989, 0.0994), abs=7e-5)
    assert any("force: clipped" in remark for remark in press.remarks)
    assert any("velocity: drop-out" in remark for remark in press.remarks)
    # They are flagged, not replaced: 0 V differ only by the inverted coupling.
    assert press.data["velocity"].loc[0.09895:0.09935].mean() < 0.4 * stroke(np.array(0.099))


def test_rows_before_the_trigger_have_negative_times(paper, record):
    volts = sensed(paper, [stroke, lambda t: 0.0 * t])
    press = load_press(record(paper, volts, first=-5120))
    assert press.data.index[0] == -0.1
    assert press.data.index[5120] == 0.0
    assert press.drift.before[0] == -0.1
    assert press.drift.before[1] == pytest.approx(-0.08, abs=5e-3)


@pytest.mark.parametrize(
    ("calibrated", "count", "remarks"),
    [(None, 0, 2), (date(2025, 6, 1), 0, 0), (date(2024, 6, 1), 2, 0)],
)
def test_old_calibrations_of_measured_presses(paper, record, calibrated, count, remarks):
    channels = tuple(
        channel.model_copy(update={"calibrated": calibrated}) for channel in paper.daq.channels
    )
    rig = paper.replaced({"daq.channels": channels})
    volts = sensed(paper, [stroke, lambda t: 0.0 * t])
    press = load_press(record(rig, volts, simulated=False))
    assert len(press.warnings) == count
    assert all("calibrat" in warning for warning in press.warnings)
    assert sum("calibrat" in text for text in press.remarks) == remarks
    press.path.unlink()
    assert load_press(record(rig, volts)).warnings == ()


def test_the_table_has_the_samples(paper, record):
    press = load_press(record(paper, np.stack([np.linspace(0, 0.02, 2000), np.full(2000, 0.5)])))
    assert list(press.samples) == list(press.data)
    for name, signal in press.samples.items():
        np.testing.assert_array_equal(signal, press.data[name])


def test_nothing_is_filled_in(paper, record):
    press = load_press(record(paper, np.random.default_rng(0).standard_normal((2, 3000))))
    assert np.isfinite(press.data.to_numpy()).all()


def test_a_slow_low_pass_of_unknown_order_gives_a_warning(paper, record):
    """225 us at 1 kHz for second order; none at 22 kHz, with an order, or without the filter."""

    def warnings(low_pass, order=0):
        values = {"daq.channels.1.low_pass": low_pass, "daq.channels.1.low_pass_order": order}
        path = record(with_values(paper, values), np.zeros((2, 4000)), simulated=False)
        found = [w for w in load_press(path).warnings if "low_pass_order" in w]
        path.unlink()
        return found

    (warning,) = warnings("1 kHz")
    assert warning.startswith("force: `low_pass` is 1000 Hz without `low_pass_order`")
    assert "0.23 ms (second order)" in warning
    assert warnings("22 kHz") == warnings("1 kHz", 2) == warnings("0 Hz") == []


def test_imported_values_are_corrected_once_if_the_rig_says_so(paper, record, tmp_path):
    """SI values of an export: with the rig of the sensors twice, with zeros as they are."""
    from sautereau.daq.convert.importing import import_file
    from sautereau.daq.convert.options import ImportOptions

    volts = sensed(paper, [stroke, lambda t: 1.0 * (t > 0.03)], until=0.5, silent=True)
    true = load_press(record(paper, volts))
    rows = slice(0, len(true.time))
    np.savez(tmp_path / "lab.npz", velocity=true.samples["velocity"], force=true.samples["force"])
    options = ImportOptions(
        unit={"velocity": "m/s", "force": "N"},
        rate=f"{RATE} Hz",
        trigger="0 s",
        started="2026-02-03T04:05:06+01:00",
        simulated=True,
    )

    def loaded(rig, name):
        import_file(tmp_path / "lab.npz", tmp_path / name, rig=rig, options=options)
        return load_press(tmp_path / name)

    for name, once in loaded(ideal(paper), "once.mcap").samples.items():
        size = np.abs(true.samples[name]).max()
        np.testing.assert_allclose(once, true.samples[name][rows], atol=2e-3 * size)
    twice = loaded(paper, "twice.mcap")
    assert len(twice.time) < len(true.time)  # by the delay
    late = true.time > 0.4
    assert true.samples["force"][late].mean() == pytest.approx(1.0, abs=5e-3)
    assert twice.samples["force"][twice.time > 0.4].mean() > 1.2  # 0.1 Hz inverted again
