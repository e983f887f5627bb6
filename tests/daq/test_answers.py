"""Answers of a device server that are short, long, late or not finite: no sample is invented."""

import math
import re

import numpy as np
import pytest

from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.acquisition import Acquisition
from sautereau.daq.source.driver_faults import KNOWN
from sautereau.sim_backend.device_types import DEVICE_TYPES, IDEAL
from sautereau.sim_backend.devices.daqmx.card import DaqmxError
from sautereau.sim_backend.devices.daqmx.server import Servicer
from tests.cards import Card, volts

BLOCK = 1024


@pytest.fixture
def answering(monkeypatch):
    """Change every answer to a call from the second one on."""

    def install(call, change):
        original, asked = getattr(Servicer, call), []

        def changed(self, request, context):
            asked.append(request)
            if len(asked) == 1:
                return original(self, request, context)
            return change(original(self, request, context), context)

        monkeypatch.setattr(Servicer, call, changed)

    return install


def record(rig, session, path):
    """Return the message of the fault of an acquisition, and the recorded samples."""
    part = path.with_name(f"{path.name}.part")
    with pytest.raises(DaqError) as caught:
        acquire(rig, session, path)
    return str(caught.value), read_recording(part).volts


def acquire(rig, session, path):
    with (
        Acquisition(rig.daq, 0.1) as source,
        Recording(path, rig, session=session, scaling=source.scaling) as recording,
    ):
        source.start()
        for block in source.blocks():
            recording.write_block(block)


def shortened(answer, context):
    del answer.read_array[700:]
    return answer


def lengthened(answer, context):
    answer.read_array.extend([1] * 50)
    return answer


def without_numbers(answer, context):
    """As NI's server answers an error: the number of samples, and none of them."""
    context.set_trailing_metadata((("ni-error", "-200284"), ("ni-samps-per-chan-read", "700")))
    context.abort(2, "Some or all of the samples requested have not yet been acquired.")


def beyond(answer, context):
    answer.samps_per_chan_read = 5000
    return answer


def partial(answer, context):
    answer.samps_per_chan_read = 300
    return answer


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (partial, "300 of each were read"),
        (shortened, "1024 of each were read, and has 700 numbers instead of 2048"),
        (lengthened, "1024 of each were read, and has 2098 numbers instead of 2048"),
        (without_numbers, "-200284 .* 700 of each were read, and has 0 numbers instead of 2048"),
        (beyond, "5000 of each were read, and has 2048 numbers"),
    ],
)
@pytest.mark.parametrize(
    ("device", "call"), [(IDEAL, "ReadAnalogF64"), ("PCI-6251", "ReadBinaryI16")]
)
def test_what_did_not_arrive_is_not_recorded(
    bench, session, tmp_path, answering, change, said, device, call
):
    """The block before is complete, of the answer nothing is kept, and what it was is said."""
    device = DEVICE_TYPES.get(device, device)
    answering(call, change)
    _, _, rig = bench(Card(device=device))
    message, found = record(rig, session, tmp_path / "a.mcap")
    low, high = -abs(found["force"]).max(), abs(found["force"]).max()  # of a card with a range
    np.testing.assert_allclose(found["force"], volts(0, BLOCK, 2)[1].clip(low, high), atol=1e-3)
    assert re.search(said, message)


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_ends_the_recording_before_it(
    bench, session, tmp_path, answering, odd
):
    def changed(answer, context):
        answer.read_array[BLOCK + 17] = odd
        return answer

    answering("ReadAnalogF64", changed)
    _, _, rig = bench()
    message, found = record(rig, session, tmp_path / "a.mcap")
    assert f"{odd} V of force at sample {BLOCK + 17}" in message
    assert np.array_equal(found["force"], volts(0, BLOCK + 17, 2)[1])


def test_any_source_is_held_to_finite_numbers(paper, session, tmp_path):
    """At the first sample too: nothing is recorded."""
    with (
        pytest.raises(DaqError, match="nan V of velocity at sample -3"),
        Recording(tmp_path / "a.mcap", paper, session=session) as recording,
    ):
        recording.write_block(Block(-3, np.array([[math.nan, 1.0], [0.0, 2.0]])))
    with pytest.raises(DaqError, match="no samples"):
        read_recording(recording.part_path)
    with pytest.raises(DaqError, match="nan Hz"):
        Recording(tmp_path / "b.mcap", paper, session=session, rate=math.nan)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("GetTimingAttributeDouble", "runs at nan Hz"),
        ("GetChanAttributeDouble", "device_low = nan"),
        ("GetReadAttributeUInt64", "samples were lost"),
    ],
)
def test_no_property_that_is_no_number_passes(bench, monkeypatch, call, said):
    original = getattr(Servicer, call)

    def changed(self, request, context):
        answer = original(self, request, context)
        answer.value = math.nan if "Double" in call else 2**40
        return answer

    monkeypatch.setattr(Servicer, call, changed)
    _, _, rig = bench()
    with pytest.raises(DaqError, match=said):
        read_three(rig)


def read_three(rig):
    with Acquisition(rig.daq, None, triggered=False) as source:
        source.start()
        blocks = source.blocks()
        for _ in range(3):
            next(blocks)


@pytest.mark.parametrize("code", [*sorted(KNOWN), -200999, -1])
def test_each_code_of_the_driver_says_what_it_means(bench, monkeypatch, code):
    """And a code that is not in the table brings the driver's text, without a cause or advice."""

    def refuse(self):
        raise DaqmxError(code, "First line of the driver.\nSecond line.")

    monkeypatch.setattr("sautereau.sim_backend.devices.daqmx.progress.CardTask.start", refuse)
    _, _, rig = bench()
    with pytest.raises(DaqError) as caught, Acquisition(rig.daq, 0.1) as source:
        source.start()
    message = str(caught.value)
    assert f"Dev1: the driver ended arming with {code}: " in message
    assert "{" not in message
    if code in KNOWN:
        assert message.endswith(KNOWN[code][1])
    else:
        assert message.endswith("First line of the driver. Second line")


@pytest.mark.parametrize(
    ("codes", "advice"),
    [
        ((-50405, -200983, -200088, -88709), "press again"),
        ((-50405, -201003), "plug"),
        ((-50152, -88709), "reset"),
        ((-200714, -200279, -200361), "lower daq.sample_rate"),
        ((-201003,), "cannot be accessed"),
    ],
)
def test_advice_is_about_what_the_code_means(codes, advice):
    for code in codes:
        assert advice in "; ".join(KNOWN[code])
        assert "setting" not in "; ".join(KNOWN[code])


def test_the_table_names_codes_of_the_driver():
    from nidaqmx.error_codes import DAQmxErrors

    assert [code for code in KNOWN if code not in {one.value for one in DAQmxErrors}] == []
    assert len(KNOWN) <= 45
