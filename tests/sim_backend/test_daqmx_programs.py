"""What programs of NI-DAQmx users ask of the stand-in: sensors, counts, events, properties."""

import threading

import numpy as np
import pytest
from nidaqmx import DaqError, Scale, Task
from nidaqmx.constants import (
    READ_ALL_AVAILABLE,
    AcquisitionType,
    Coupling,
    ExcitationSource,
    ForceIEPESensorSensitivityUnits,
    ForceUnits,
    LoggingMode,
    LoggingOperation,
    ReadRelativeTo,
    ScaleType,
    Signal,
    SoundPressureUnits,
    TaskMode,
    TerminalConfiguration,
    VoltageUnits,
)
from nidaqmx.system import Device, PhysicalChannel
from nptdms import TdmsFile
from numpy.polynomial.polynomial import polyval

from sautereau.sim_backend.device_types import DEVICE_TYPES
from tests.cards import Card, code_of

G = 9.80665


def ramp(first, n, channels):
    """Counts in steps of 1 mV."""
    return np.tile(np.arange(first, first + n) / 1000, (channels, 1))


def ramp_card(product="NI 9234", ready=None):
    """Return a card of a product that measures a ramp, all there at once."""
    return Card(4, ready=ready, paced=False, device=DEVICE_TYPES[product], measured=ramp)


@pytest.fixture
def task(serve):
    with Task(grpc_options=serve(ramp_card())) as task:
        yield task


def finite(task, rate=51_200):
    task.timing.cfg_samp_clk_timing(rate, sample_mode=AcquisitionType.FINITE, samps_per_chan=100)


IEPE = {"current_excit_val": 0.002, "current_excit_source": ExcitationSource.INTERNAL}


@pytest.mark.parametrize(
    ("add", "settings", "volts_per_unit"),
    [
        ("add_ai_force_iepe_chan", {"sensitivity": 2.25}, 2.25e-3),
        (
            "add_ai_force_iepe_chan",
            {
                "sensitivity": 10.0,
                "min_val": -100.0,
                "max_val": 100.0,
                "sensitivity_units": ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_POUND,
                "units": ForceUnits.POUNDS,
            },
            10e-3,
        ),
        ("add_ai_accel_chan", {"sensitivity": 100.0}, 0.1),
        ("add_ai_velocity_iepe_chan", {"min_val": -40.0, "max_val": 40.0}, 0.1),
        ("add_ai_microphone_chan", {"mic_sensitivity": 10.0, "units": SoundPressureUnits.PA}, 0.01),
    ],
)
def test_a_sensor_is_read_in_its_unit(task, add, settings, volts_per_unit):
    channel = getattr(task.ai_channels, add)("cDAQ1Mod1/ai0", **settings, **IEPE)
    task.timing.cfg_samp_clk_timing(51_200, samps_per_chan=100)
    np.testing.assert_allclose(task.read(10), np.arange(10) / 1000 / volts_per_unit, rtol=1e-12)
    assert channel.ai_excit_val == 0.002
    assert channel.ai_coupling == Coupling.AC
    assert channel.ai_term_cfg == TerminalConfiguration.PSEUDO_DIFF
    assert (channel.ai_rng_low, channel.ai_rng_high) == (-5.0, 5.0)


@pytest.mark.parametrize(("slope", "intercept"), [(50.0, -3.0), (-2.0, 0.5)])
def test_a_channel_is_read_in_a_custom_scale(serve, slope, intercept):
    options = serve(ramp_card())
    scale = Scale.create_lin_scale(
        "of load", slope, intercept, scaled_units="N", grpc_options=options
    )
    assert (scale.lin_slope, scale.lin_y_intercept) == (slope, intercept)
    assert (scale.scaled_units, scale.scale_type) == ("N", ScaleType.LINEAR)
    low, high = sorted((slope * -5 + intercept, slope * 5 + intercept))
    settings = {"units": VoltageUnits.FROM_CUSTOM_SCALE, "min_val": low, "max_val": high}
    with Task(grpc_options=options) as task:
        add = task.ai_channels.add_ai_voltage_chan
        assert code_of(add, "cDAQ1Mod1/ai0", custom_scale_name="none", **settings) == -200378
        channel = add("cDAQ1Mod1/ai0", custom_scale_name="of load", **settings)
        assert channel.ai_custom_scale.name == "of load"
        assert (channel.ai_min, channel.ai_max) == pytest.approx((low, high))
        assert (channel.ai_rng_low, channel.ai_rng_high) == (-5.0, 5.0)
        task.timing.cfg_samp_clk_timing(51_200, samps_per_chan=100)
        read = slope * np.arange(10) / 1000 + intercept
        np.testing.assert_allclose(task.read(10), read, rtol=1e-12)
        task.stop()
        del channel.ai_custom_scale
        channel.ai_voltage_units = VoltageUnits.VOLTS
        channel.ai_min, channel.ai_max = -5.0, 5.0
        np.testing.assert_allclose(task.read(10), np.arange(10) / 1000, rtol=1e-12)
    scale.lin_slope = 0.0
    with Task(grpc_options=options) as task:
        add = task.ai_channels.add_ai_voltage_chan
        assert code_of(add, "cDAQ1Mod1/ai0", custom_scale_name="of load", **settings) == -200409


def test_a_channel_is_read_in_a_polynomial_scale(serve):
    """A thermistor's curve, say: its inverse is fitted, and checked at the volts in use."""
    options = serve(ramp_card())
    forward = [1.0, 20.0, 0.5, 0.1]
    reverse = Scale.calculate_reverse_poly_coeff(forward, -5.0, 5.0, 1000, 7, grpc_options=options)
    volts = np.linspace(-5, 5, 50)
    back = polyval(polyval(volts, forward), reverse)
    np.testing.assert_allclose(back, volts, atol=2e-3)
    scale = Scale.create_polynomial_scale("curve", forward, reverse, grpc_options=options)
    assert scale.scale_type == ScaleType.POLYNOMIAL
    assert scale.poly_forward_coeff == forward
    assert code_of(getattr, scale, "lin_slope") == -200601
    line = Scale.create_lin_scale("line", 2.0, grpc_options=options)
    assert code_of(getattr, line, "poly_forward_coeff") == -200601
    assert code_of(setattr, line, "poly_forward_coeff", [1.0]) == -200601
    settings = {"units": VoltageUnits.FROM_CUSTOM_SCALE, "min_val": -80.0, "max_val": 110.0}
    with Task(grpc_options=options) as task:
        channel = task.ai_channels.add_ai_voltage_chan(
            "cDAQ1Mod1/ai0", custom_scale_name="curve", **settings
        )
        low, high = polyval([-5.0, 5.0], forward)
        assert (channel.ai_min, channel.ai_max) == pytest.approx((low, high))
        task.timing.cfg_samp_clk_timing(51_200, samps_per_chan=100)
        expected = polyval(np.arange(10) / 1000, forward)
        np.testing.assert_allclose(task.read(10), expected, rtol=1e-12)
    make = Scale.create_polynomial_scale
    for bad, code in (([], -200405), ([0.0], -200407)):
        make("bad", bad, reverse, grpc_options=options)
        with Task(grpc_options=options) as task:
            add = task.ai_channels.add_ai_voltage_chan
            assert code_of(add, "cDAQ1Mod1/ai0", custom_scale_name="bad", **settings) == code
    find = Scale.calculate_reverse_poly_coeff
    for wrong, code in (((1000, 0), -200402), ((3, 3), -200403), ((10**9, 3), -200403)):
        assert code_of(find, forward, -1.0, 1.0, *wrong, grpc_options=options) == code
    table = Scale.create_table_scale
    assert code_of(table, "t", [0.0, 1.0], [0.0, 2.0], grpc_options=options) == -200077


def test_a_task_exports_signals_to_terminals_that_exist(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    exported = task.export_signals
    assert exported.samp_clk_output_term == exported.start_trig_output_term == ""
    exported.export_signal(Signal.SAMPLE_CLOCK, "/cDAQ1/PFI0")
    assert exported.samp_clk_output_term == "/cDAQ1/PFI0"
    task.control(TaskMode.TASK_VERIFY)
    exported.start_trig_output_term = "RTSI"
    assert code_of(task.control, TaskMode.TASK_VERIFY) == -89121
    del exported.start_trig_output_term
    task.control(TaskMode.TASK_VERIFY)
    assert code_of(exported.export_signal, Signal.COUNTER_OUTPUT_EVENT, "PFI0") == -200077
    assert code_of(getattr, exported, "hshk_event_delay") == -200197


def test_a_device_gives_its_calibration(serve):
    device = Device("cDAQ1Mod1", grpc_options=serve(ramp_card()))
    assert device.device_supports_cal
    assert device.self_cal_supported
    before = device.self_cal_last_date_and_time
    assert before == device.ext_cal_last_date_and_time
    device.self_cal()
    assert device.self_cal_last_date_and_time >= before
    assert device.ext_cal_recommended_interval == 24
    device.cal_user_defined_info = "abcd"
    assert device.cal_user_defined_info == "abcd"
    assert device.cal_user_defined_info_max_size == 4
    assert code_of(setattr, device, "cal_user_defined_info", "abcde") == -201245
    assert code_of(getattr, device, "cal_acc_connection_count") == -200197
    assert code_of(setattr, device, "cal_acc_connection_count", 1) == -200197


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("teds_mfg_id", -200741),
        ("teds_template_ids", -200741),
        ("teds_bit_stream", -200741),
        ("ai_power_control_enable", -200197),
        ("di_change_detect_supported", -200197),
    ],
)
def test_what_an_input_does_not_have_is_refused(serve, name, code):
    channel = PhysicalChannel("cDAQ1Mod1/ai0", grpc_options=serve(ramp_card()))
    assert code_of(getattr, channel, name) == code


def test_what_the_device_cannot_supply_is_refused(task):
    add = task.ai_channels.add_ai_accel_chan
    assert code_of(add, "cDAQ1Mod1/ai0", current_excit_val=0.004) == -200077
    channel = task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    channel.ai_term_cfg = TerminalConfiguration.RSE
    assert code_of(task.control, TaskMode.TASK_VERIFY) == -200077


def test_counts_and_their_polynomial_are_the_volts(serve):
    with Task(grpc_options=serve(ramp_card("PCI-6251"))) as task:
        channel = task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-2, max_val=1.5)
        task.timing.cfg_samp_clk_timing(1000, sample_mode=AcquisitionType.FINITE, samps_per_chan=50)
        task.ai_channels.add_ai_voltage_chan("Dev1/ai1", min_val=-2, max_val=2)
        counts = task.in_stream.read(50).reshape(50, 2).T
        assert counts.dtype == np.int16
        assert channel.ai_rng_high == 2.0
        volts = polyval(counts[0], channel.ai_dev_scaling_coeff)
        np.testing.assert_allclose(volts, np.arange(50) / 1000, atol=0.5 * 4 / 2**16 + 1e-12)
        task.ai_channels["Dev1/ai1"].ai_max = 10
        assert code_of(lambda: task.ai_channels.all.ai_rng_high) == -200428


def test_single_ended_inputs_have_one_range_and_fewer_bits(serve):
    with Task(grpc_options=serve(ramp_card("USB-6009"))) as task:
        channel = task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-1, max_val=1)
        assert (channel.ai_rng_high, channel.ai_resolution) == (1.0, 14)
        channel.ai_term_cfg = TerminalConfiguration.RSE
        assert (channel.ai_rng_high, channel.ai_resolution) == (10.0, 13)


def test_ranges_of_channels_in_properties(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:3")
    channels = task.ai_channels["cDAQ1Mod1/ai0:3"]
    channels.ai_coupling = Coupling.AC
    assert channels.ai_coupling == task.ai_channels["cDAQ1Mod1/ai2"].ai_coupling == Coupling.AC
    del channels.ai_coupling
    assert channels.ai_coupling == Coupling.DC


def test_the_filter_delay_can_be_removed(serve):
    card = ramp_card("NI 9239")
    with Task(grpc_options=serve(card)) as task:
        channel = task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        finite(task, 20_000)
        assert task.timing.samp_clk_rate == 25_000
        assert channel.ai_filter_delay == pytest.approx((40 + 5 / 512) / 25e3 + 3.3e-6)
        assert code_of(getattr, task.timing, "ai_conv_rate") == -200452
        task.start()
        assert card.setups[-1].lags == (channel.ai_filter_delay,)
        task.stop()
        channel.ai_remove_filter_delay = True
        task.start()
        assert card.setups[-1].lags == pytest.approx((0.0,), abs=1e-12)


def test_the_chassis_has_the_terminals(serve):
    options = serve(ramp_card())
    module, chassis = (Device(name, grpc_options=options) for name in ("cDAQ1Mod1", "cDAQ1"))
    assert module.compact_daq_chassis_device.name == "cDAQ1"
    assert chassis.chassis_module_devices[0].name == "cDAQ1Mod1"
    assert chassis.terminals == ["/cDAQ1/PFI0", "/cDAQ1/PFI1"]
    with Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(51_200)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1Mod1/PFI0")
        assert code_of(task.control, TaskMode.TASK_VERIFY) == -89120
        task.triggers.start_trigger.dig_edge_src = "PFI0"
        assert task.triggers.start_trigger.dig_edge_src == "/cDAQ1/PFI0"
        task.control(TaskMode.TASK_VERIFY)


def test_the_highest_rate_is_shared_by_multiplexed_channels(serve):
    with Task(grpc_options=serve(ramp_card("USB-6009"))) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1")
        task.timing.cfg_samp_clk_timing(24_001)
        assert code_of(getattr, task.timing, "samp_clk_rate") == -200077
        task.timing.samp_clk_rate = 24_000
        assert (task.timing.samp_clk_rate, task.timing.ai_conv_rate) == (24_000, 48_000)


def test_events_of_every_n_samples_and_of_the_end(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    finite(task)
    # Each kind of event comes through its own stream: their order is not defined.
    seen, every = [], threading.Event()

    def note(value):
        seen.append(value)
        if len(seen) == 5:
            every.set()
        return 0

    task.register_every_n_samples_acquired_into_buffer_event(
        25, lambda handle, kind, n, data: note(n)
    )
    task.register_done_event(lambda handle, status, data: note(status))
    task.start()
    assert every.wait(5), seen
    task.register_done_event(None)
    task.register_every_n_samples_acquired_into_buffer_event(25, None)
    assert sorted(seen) == [0, 25, 25, 25, 25]


def test_each_sample_is_an_event_of_the_sample_clock(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    finite(task)
    seen, every = [], threading.Event()

    def note(handle, signal, data):
        seen.append(signal)
        if len(seen) == 100:
            every.set()
        return 0

    task.register_signal_event(Signal.SAMPLE_CLOCK, note)
    assert code_of(task.register_signal_event, Signal.SAMPLE_COMPLETE, note) == -200949
    task.start()
    assert every.wait(5)
    task.register_signal_event(Signal.SAMPLE_CLOCK, None)
    assert seen == [Signal.SAMPLE_CLOCK.value] * 100
    assert code_of(task.register_signal_event, Signal.CHANGE_DETECTION_EVENT, note) == -200987


def test_a_limit_that_was_reset_must_be_set_again(task):
    channel = task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    del channel.ai_max
    assert code_of(getattr, channel, "ai_max") == -200695
    assert code_of(task.control, TaskMode.TASK_VERIFY) == -200695
    channel.ai_max = 5
    task.control(TaskMode.TASK_VERIFY)


def test_reading_relative_to_the_first_and_the_latest_sample(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    finite(task)
    task.start()
    task.in_stream.relative_to, task.in_stream.offset = ReadRelativeTo.MOST_RECENT_SAMPLE, -10
    assert task.read(10) == list(np.arange(90, 100) / 1000)
    task.in_stream.relative_to, task.in_stream.offset = ReadRelativeTo.FIRST_SAMPLE, 3
    assert task.read(2) == task.read(2) == [0.003, 0.004]


def test_what_would_not_be_followed_is_refused(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    task.timing.cfg_samp_clk_timing(51_200)
    task.triggers.start_trigger.delay = 1e-3
    with pytest.raises(DaqError, match="START_TRIG_DELAY"):
        task.start()
    assert code_of(task.ai_channels.add_ai_thrmcpl_chan, "cDAQ1Mod1/ai1") == -200431


def test_every_edge_starts_a_finite_acquisition(serve):
    card = ramp_card("PCIe-6363", ready=lambda n: n)
    with Task(grpc_options=serve(card)) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
        finite(task)
        task.triggers.start_trigger.retriggerable = True
        assert code_of(task.start) == -201320
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
        task.start()
        assert (card.setups[-1].per_trigger, card.setups[-1].trigger) == (100, "/Dev1/PFI0")
        assert task.read(70) == list(np.arange(70) / 1000)
        assert task.read(READ_ALL_AVAILABLE) == list(np.arange(70, 100) / 1000)
        assert len(task.read(250)) == 250
        assert not task.is_task_done()


def test_only_an_x_series_card_can_be_retriggered(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    finite(task)
    task.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/PFI0")
    task.triggers.start_trigger.retriggerable = True
    assert code_of(task.start) == -200452


def test_a_current_flows_through_a_shunt(task):
    channel = task.ai_channels.add_ai_current_chan(
        "cDAQ1Mod1/ai0", max_val=0.05, ext_shunt_resistor_val=100
    )
    assert (channel.ai_current_shunt_resistance, channel.ai_rng_high) == (100, 5)
    finite(task)
    np.testing.assert_allclose(task.read(100), np.arange(100) / 1e5)


def logged(path):
    return {
        group.name: [channel[:] for channel in group.channels()]
        for group in TdmsFile.read(path).groups()
    }


def test_a_task_is_logged_while_it_is_read(task, tmp_path):
    path = tmp_path / "log.tdms"
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1")
    finite(task)
    task.in_stream.configure_logging(path, LoggingMode.LOG_AND_READ, "press")
    for _ in range(2):
        task.start()
        task.read(30)
        task.read(READ_ALL_AVAILABLE)
        task.stop()
    ramp = np.arange(100) / 1000
    found = logged(path)
    assert list(found) == ["press", "press #1"]
    for channels in found.values():
        np.testing.assert_array_equal(channels, [ramp, ramp])
    properties = TdmsFile.read(path)["press"].channels()[0].properties
    assert properties["wf_increment"] == 1 / 51_200
    again = tmp_path / "next.tdms"
    task.start()
    task.read(30)
    task.in_stream.start_new_file(again)
    task.in_stream.logging_pause = True
    task.read(20)
    task.in_stream.logging_pause = False
    task.read(50)
    np.testing.assert_array_equal(logged(again)["press"], [ramp[50:], ramp[50:]])


def test_a_task_that_only_logs_cannot_be_read(task, tmp_path):
    path = tmp_path / "log.tdms"
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    finite(task)
    task.in_stream.configure_logging(path, LoggingMode.LOG, operation=LoggingOperation.CREATE)
    assert code_of(task.read, 10) == -201301
    task.start()
    task.wait_until_done(5)
    task.stop()
    (found,) = logged(path).values()
    np.testing.assert_array_equal(found, [np.arange(100) / 1000])
    assert code_of(task.start) == -201309  # it exists
    task.in_stream.logging_file_path = tmp_path / "none" / "log.tdms"
    assert code_of(task.start) == -201304
    other = tmp_path / "other.txt"
    other.write_text("precious")
    task.in_stream.logging_file_path = other
    task.in_stream.logging_tdms_operation = LoggingOperation.CREATE_OR_REPLACE
    assert code_of(task.start) == -201309  # it is no TDMS file
    assert other.read_text() == "precious"


def test_one_task_reserves_the_card_until_it_releases_it(serve):
    options = serve(ramp_card())
    with Task(grpc_options=options) as first, Task(grpc_options=options) as second:
        for task in (first, second):
            task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
            finite(task)
        first.control(TaskMode.TASK_RESERVE)
        first.start()
        first.stop()  # back to reserved, where it was before
        assert code_of(second.control, TaskMode.TASK_RESERVE) == -50103
        assert code_of(second.read, 10) == -50103
        first.control(TaskMode.TASK_UNRESERVE)
        assert len(second.read(10)) == 10
        device = Device("cDAQ1Mod1", grpc_options=options)
        device.self_cal()
        device.restore_last_ext_cal_const()
        device.reset_device()
        first.start()


def test_a_waveform_has_interval_and_name(task):
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0", "key")
    finite(task)
    waveform = task.read_waveform(10)
    assert waveform.channel_name == "key"
    assert waveform.timing.sample_interval.total_seconds() == pytest.approx(1 / 51_200)
    np.testing.assert_array_equal(waveform.scaled_data, np.arange(10) / 1000)
