"""No sample is invented, whatever a card answers, at whichever call.

The real nidaqmx client speaks to a fake server whose samples are a known ramp. Each case answers
one call of an acquisition otherwise. A recording is read as docs/recordings.md describes it, by
MCAP's own library.
"""

import json
import math
import random
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import grpc
import numpy as np
import pytest
from mcap.reader import make_reader
from nidaqmx._stubs import nidaqmx_pb2 as messages

from sautereau.daq.source.source import open_source
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig_to_acquire
from tests.budget import amount, slow
from tests.daq.declared import declared_class
from tests.daq.fake_server import OFFSET, STEP, Act, Call, Coded, FakeServer

RATE, BLOCK, N = 20_000, 256, 1000
"""Hz, and samples of each channel: the acquisition takes 50 ms, in four reads."""
BOUND = 60.0  # s, in which a command ends: far over the 5 s for which it waits for samples
RIG = """
[daq]
address = "{address}"
device = "Dev1"
sample_rate = "20 kHz"
trigger_source = "PFI0"
trigger_timeout = "5 s"
pre_trigger = "{pre_trigger}"
tail = "20 ms"
block = 256
"""
CHANNEL = """
[[daq.channels]]
name = "{name}"
terminal = "{terminal}"
sensor = "none"
range = "10 V"
delay = "0 s"
low_pass = "0 Hz"
high_pass = "0 Hz"
quantity = "voltage"
scale = "1 V/V"
"""


@pytest.fixture(scope="module")
def shared():
    with FakeServer() as server:
        yield server


@pytest.fixture(scope="module")
def command_server(command_server, tmp_path_factory):
    """The server of commands, after it has imported everything: then the time is bounded."""
    folder = tmp_path_factory.mktemp("version")
    for _ in range(4):  # minutes, on a machine that is very busy
        with suppress(TimeoutError):
            command_server.run("--version", folder=folder)
            return command_server
    raise TimeoutError("the server of commands did not start")


@pytest.fixture
def card(shared):
    """The fake server; `set` gives it its fault."""
    shared.set()
    yield shared
    shared.released.set()


def rig_file(folder: Path, address: str, pre_trigger: str = "0 s") -> Path:
    channels = [CHANNEL.format(name=n, terminal=t) for n, t in (("a", "ai0"), ("b", "ai1"))]
    path = folder / "rig.toml"
    path.write_text(RIG.format(address=address, pre_trigger=pre_trigger) + "".join(channels))
    return path


# Recordings, as docs/recordings.md describes them


@dataclass
class File:
    """What a recording says."""

    first: int
    volts: np.ndarray
    """Shape (n_channels, n)."""
    rate: float
    begin: float
    """Date of sample 0, s since 1970."""
    std: float
    """Of this date, s; NaN if it is not stated."""
    delays: list[float]
    """Of the inputs, s."""


def read(path: Path) -> File | None:
    """Read a recording; None if it has no samples."""
    first, expected, parts = None, None, []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        ends = [m.metadata for m in reader.iter_metadata() if m.name == "end"]
        for schema, channel, message in reader.iter_messages(["/daq"]):
            block = declared_class(schema.data, schema.name).FromString(message.data)
            if expected is None:
                first = expected = block.first_sample
                assert first == block.begin, "samples are missing at the start"
            assert block.first_sample == expected, "samples are missing between others"
            parts.append(volts(block.data, channel.metadata))
            expected += parts[-1].shape[1]
    if first is None:
        return None
    names = json.loads(channel.metadata["channels"])
    inputs = [json.loads(channel.metadata[f"channel {name}"]) for name in names]
    delays = [float(i["input_delay"].removesuffix(" s")) for i in inputs]
    std = float(ends[0]["t0_std"]) if ends and "t0_std" in ends[0] else math.nan
    together = np.concatenate(parts, axis=1)
    return File(first, together, block.rate, block.t0 / 1e9, std, delays)


def volts(data: bytes, metadata: dict[str, str]) -> np.ndarray:
    """Return the samples of a block, shape (n_channels, n), V."""
    types = {"int16": "<i2", "int32": "<i4", "float64": "<f8"}
    names = json.loads(metadata["channels"])
    samples = np.frombuffer(data, types[metadata["type"]]).reshape(len(names), -1)
    if metadata["type"] == "float64":
        return samples
    polynomials = json.loads(metadata["scaling"])
    return np.array([scaled(x, polynomials[name]) for x, name in zip(samples, names, strict=True)])


def scaled(counts: np.ndarray, coefficients: list[float]) -> np.ndarray:
    """Return c0 + x (c1 + x (c2 + ...)), V."""
    value = np.zeros(counts.shape)
    for c in reversed(coefficients):
        value = c + counts * value
    return value


def right(n: int) -> np.ndarray:
    """Return the first samples of the ramp, V."""
    return np.array([(np.arange(n) + OFFSET * c) * STEP for c in range(2)])


# Faults


def coded(code: int, n_read: int | None = None):
    """An error of the driver."""

    def act(server, context, request, make):
        raise Coded(code, n_read=n_read)

    return act


def status(code: int):
    """A complete answer that says that there was an error or, above 0, a warning."""

    def act(server, context, request, make):
        answer = make()
        answer.status = code
        return answer

    return act


def broken(code: grpc.StatusCode):
    """An error of the connection or the server."""

    def act(server, context, request, make):
        context.abort(code, "")

    return act


def empty(server, context, request, make):
    """A message of the right type, without content."""
    return type(make())()


def after(seconds: float):
    """The right answer, late."""

    def act(server, context, request, make):
        answer = make()
        server.released.wait(seconds)
        return answer

    return act


CODES = (
    -50405, -50152, -200714, -88709, -200983, -200088, -201003, -200279, -200284, -50103, -200220,
    200010, -999999,
)  # fmt: skip
ANYWHERE = {
    **{f"code {code}": coded(code) for code in CODES},
    **{f"status {code}": status(code) for code in (-201003, 200010, -999999)},
    **{f"gRPC {c.name}": broken(c) for c in (
        grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN,
    )},
    "empty": empty,
    "0.3 s late": after(0.3),
    "7 s late": after(7),
    "never": after(1e6),
}  # fmt: skip


def array(edit, n=None):
    """An answer to a read whose samples, or their number, are changed."""

    def act(server, context, request, make):
        answer = make()
        samples = edit(list(answer.read_array))
        del answer.read_array[:]
        answer.read_array.extend(samples)
        if n is not None:
            answer.samps_per_chan_read = n
        return answer

    return act


def partial(n: int, kept: int, size: int, code: int):
    """An error after n samples of each channel, in an answer of `kept` of them and then zeros.

    As of the driver, the samples of all channels are together at its start.
    """

    def act(server, context, request, make):
        request.num_samps_per_chan = n
        answer = make()
        del answer.read_array[kept:]
        answer.read_array.extend([0] * (min(size, request.array_size_in_samps) - kept))
        answer.status = code
        return answer

    return act


def with_value(index: int, value):
    """An answer with one sample that is changed."""
    return array(lambda samples: [*samples[:index], value, *samples[index + 1 :]])


WHOLE = 2 * BLOCK
READS = {
    "one short": array(lambda s: s[:-1]),
    "half": array(lambda s: s[:BLOCK]),
    "no array": array(lambda s: []),
    "no array, says 0": array(lambda s: [], 0),
    "one long": array(lambda s: [*s, 7]),
    "double": array(lambda s: s * 2),
    "three channels": array(lambda s: [*s, *s[:BLOCK]]),
    **{f"says {n}": array(lambda s: s, n) for n in (0, -1, -(2**31), 1, 255, 257, 512, 2**31 - 1)},
    "half, says half": array(lambda s: s[:BLOCK], BLOCK // 2),
    **{f"{code} after 128, {kept} of {size} numbers": partial(128, kept, size, code)
       for code in (-200284, -200279)
       for kept, size in ((256, WHOLE), (256, 256), (128, 128), (0, 0))},
    "-200284 after 0, zeros": partial(0, 0, WHOLE, -200284),
    "-200284 after 0": partial(0, 0, 0, -200284),
    **{f"ni-error {code} after {n}": coded(code, n)
       for code in (-200284, -200279, -201003) for n in (0, 100, BLOCK, -5, 10**9)},
}  # fmt: skip
FLOATS = {
    f"{value} at {k}": with_value(k, value)
    for value in (math.nan, math.inf, -math.inf)
    for k in (0, WHOLE - 1)
}
INTEGERS = {f"{value} at 3": with_value(3, value) for value in (32768, -32769, 2**31 - 1, -(2**31))}


def value(given):
    """An answer with another value, also where the device has none."""

    def act(server, context, request, make):
        kind = getattr(messages, request.DESCRIPTOR.name.replace("Request", "Response"))
        raw = "value_raw" if "value_raw" in kind.DESCRIPTOR.fields_by_name else "value"
        return kind(**{raw: given})

    return act


def values(*given):
    """Faults of a property, by the value that it has."""
    return {f"is {str(v)[:30]}": value(v) for v in given}


def counts_down():
    """A number of acquired samples that goes backwards."""
    left = [BLOCK * 3]

    def act(server, context, request, make):
        left[0] = max(0, left[0] - BLOCK)
        return value(left[0])(server, context, request, make)

    return act


PROPERTIES = {
    "Double": values(math.nan, math.inf, -math.inf, 0.0, -1.0, -0.1, 1e-300, 1e300),
    "DoubleArray": values([], [math.nan], [math.inf], [0.0], [1e300] * 4, [0.0, math.nan],
                          [0.0, 0.0], [0.0, -STEP], [0.0, STEP, math.inf], [1.0], [0.0] * 1000),
    "UInt32": values(0, 1, 3, 2**32 - 1),
    "UInt64": values(0, 1, 2**53 + 1, 2**63 - 1, 2**64 - 1),
    "Int32": values(0, -1, 99999, 2**31 - 1),
    "String": values("", "Dev1, Dev2", "Dev2", "\x1b[31m\n", "x" * 100_000),
    "Bool": values(True, False),
}  # fmt: skip


def faults_of(call: Call) -> dict[str, Act]:
    """Return all faults of a call, by name."""
    found = dict(ANYWHERE)
    method, _, attribute = call.name.partition(" ")
    if method.startswith("Read"):
        found |= READS | (FLOATS if "F64" in method else INTEGERS)
    if method.startswith("Get"):
        found |= PROPERTIES[method.partition("Attribute")[2]]
    if attribute == "TOTAL_SAMP_PER_CHAN_ACQUIRED":
        found["goes backwards"] = counts_down()
    return found


# Commands


@dataclass
class Run:
    """What a command did, and what is wrong with its file."""

    status: int | None
    error: str
    n: int
    """Samples of each channel in the file."""
    wrong: tuple[str, ...]

    def verdict(self, server: FakeServer, n: int = N) -> list[str]:
        """Return all that is wrong."""
        return [*self.wrong, *filter(None, self._faults(server, n))]

    def _faults(self, server: FakeServer, n: int) -> Iterator[str | bool]:
        if self.status is None:
            yield f"does not end within {BOUND:g} s"
        elif self.status == 0:
            yield self.n != n and f"exit 0 with {self.n} of {n} samples"
            yield from text_faults(self.error)
        else:
            before = min(server.before_fault, n)
            yield self.n < before and f"{self.n} samples are safe, of {before} before the fault"
            yield self.status != 1 and f"exit status {self.status}"
            yield from text_faults(self.error)
            yield from message_faults(self.error, server.address)
            said = "a.mcap" in self.error and "no sample was recorded" not in self.error
            yield (said != (self.n > 0) and f"{self.n} samples are kept: {self.error!r}")


def text_faults(text: str) -> Iterator[str | bool]:
    """Yield what nobody should read."""
    for word in ("Traceback", "bug:", "AssertionError", "UnboundLocal", ".py:", "Reinstall"):
        yield word in text and f"{word}: {text!r}"


def message_faults(text: str, address: str) -> Iterator[str | bool]:
    """Yield what is wrong with an error's message."""
    yield text.count("sautereau: ") != 1 and f"not one message: {text!r}"
    yield not ("Dev1" in text or address in text) and f"names no device: {text!r}"
    yield "setting it names" in text and f"names no setting: {text!r}"
    yield "no such device (-201003)" in text and f"the driver lists Dev1: {text!r}"


def file_faults(file: File, server: FakeServer, end: bool) -> Iterator[str | bool]:
    """Yield what is wrong with a recording, beside missing samples."""
    yield file.first != 0 and f"its first sample is {file.first}"
    bad = np.flatnonzero((file.volts != right(file.volts.shape[1])).any(axis=0))
    if bad.size:
        k = int(bad[0])
        yield f"INVENTED: sample {k} is {file.volts[:, k]}, not {right(k + 1)[:, k]}"
    yield file.rate != RATE and f"its rate is {file.rate} Hz"
    for delay in file.delays:
        # A multiplexer samples the channels within one period; a filter delays by a few.
        yield not (-1 / RATE <= delay <= 0.01) and f"the delay of an input is {delay} s"
    if end:
        # Without a stated uncertainty the date is the latest one that the arrival allows.
        known = not math.isnan(file.std)
        early = server.edge - 4 * np.nan_to_num(file.std) - 1e-3
        late = server.first_read - BLOCK / RATE + 4 * file.std + 1e-3 if known else math.inf
        yield not (early <= file.begin <= late) and (
            f"begins {file.begin - server.edge:.4f} s after the edge, with {file.std} s stated"
        )


def command(command_server, folder: Path, *words: object) -> tuple[int | None, str]:
    """Run a command of bounded time; the status is None if it was killed."""
    process = command_server.start(
        *words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        return_code, error = None, process.communicate(timeout=BOUND)[1]
        return_code = process.returncode
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        error = process.communicate(timeout=10)[1]
    return return_code, " ".join(error.split())


def acquire(command_server, folder: Path, server: FakeServer, *more: str) -> Run:
    """Run `acquire` for 50 ms, recover what it left, and compare this with the truth."""
    path, part = folder / "a.mcap", folder / "a.mcap.part"
    for old in (path, part):
        old.unlink(missing_ok=True)
    words = ["acquire", rig_file(folder, server.address), "--out", path, "--duration", "50 ms"]
    status, error = command(command_server, folder, *words, *more)
    if status == 0 and not path.exists():
        return Run(status, error, 0, ("exit 0 without a recording",))
    if not path.exists() and part.exists():
        ended, why = command(command_server, folder, "recover", part, "--out", path)
        if ended != 0 and server.before_fault:
            return Run(status, error, 0, (f"recover ends with {ended}: {why}",))
    file = read(path) if path.exists() else None
    if file is None:
        return Run(status, error, 0, ())
    faults = file_faults(file, server, end=status == 0)
    return Run(status, error, file.volts.shape[1], tuple(f for f in faults if f))


# Acquisitions by the command

NO_COUNTS = {"AI_DEV_SCALING_COEFF": []}
MODES = {"counts": ({}, ()), "volts": (NO_COUNTS, ()), "triggered": ({}, ("--triggered",))}
CALLS = {
    "GetSystemInfoAttributeUInt32 NIDAQ_MAJOR_VERSION": 1,
    "GetSystemInfoAttributeUInt32 NIDAQ_MINOR_VERSION": 1,
    "GetSystemInfoAttributeUInt32 NIDAQ_UPDATE_VERSION": 1,
    "GetDeviceAttributeInt32 PRODUCT_CATEGORY": 1,
    "CreateTask": 1,
    "GetTaskAttributeString NAME": 1,
    "CreateAIVoltageChan": 2,
    "CfgSampClkTiming": 1,
    "CfgDigEdgeStartTrig": 1,
    "SetBufferAttributeUInt32 INPUT_BUF_SIZE": 1,
    "GetTimingAttributeDouble SAMP_CLK_RATE": 1,
    "TaskControl": 2,
    "GetTaskAttributeString DEVICES": 2,
    "GetDeviceAttributeBool AI_SIMULTANEOUS_SAMPLING_SUPPORTED": 1,
    "GetTimingAttributeDouble AI_CONV_RATE": 1,
    "GetChanAttributeInt32 CHAN_TYPE": 2,
    "GetChanAttributeInt32 AI_TERM_CFG": 2,
    "GetChanAttributeInt32 AI_COUPLING": 2,
    "GetChanAttributeString PHYSICAL_CHAN_NAME": 2,
    "GetChanAttributeDouble AI_RNG_LOW": 2,
    "GetChanAttributeDouble AI_RNG_HIGH": 2,
    "GetChanAttributeDouble AI_FILTER_DELAY": 2,
    "GetChanAttributeUInt32 AI_RAW_SAMP_SIZE": 2,
    "GetChanAttributeDouble AI_RESOLUTION": 2,
    "GetChanAttributeDoubleArray AI_DEV_SCALING_COEFF": 2,
    "GetChanAttributeInt32 AI_RAW_SAMP_JUSTIFICATION": 2,
    "GetDeviceAttributeBool IS_SIMULATED": 1,
    "GetDeviceAttributeString PRODUCT_TYPE": 1,
    "GetDeviceAttributeUInt32 SERIAL_NUM": 1,
    "StartTask": 1,
    "ReadBinaryI16": 2,
    "ReadAnalogF64": 2,
    "GetReadAttributeUInt64 TOTAL_SAMP_PER_CHAN_ACQUIRED": 2,
    "GetReadAttributeUInt64 CURR_READ_POS": 2,
    "StopTask": 1,
    "ClearTask": 1,
}
"""How many calls of each name are tried: two stand for all, of channels and of blocks."""


def mode_of(name: str) -> str:
    """Return a mode in which a call of this name is made."""
    if name in ("GetDeviceAttributeInt32 PRODUCT_CATEGORY", "CfgDigEdgeStartTrig"):
        return "triggered"
    return "volts" if name == "ReadAnalogF64" else "counts"


@pytest.mark.parametrize("mode", MODES)
def test_without_a_fault(command_server, card, tmp_path, mode):
    values, more = MODES[mode]
    card.set(**values)
    run = acquire(command_server, tmp_path, card, *more)
    assert (run.status, run.verdict(card)) == (0, [])
    assert not card.card.tasks, "the task stays on the server"
    assert {call.name for call in card.calls} <= CALLS.keys(), "a call that no fault is tried at"


def judged(command_server, card: FakeServer, folder: Path, call: Call, fault: str) -> list[str]:
    """Return what is wrong about a run with a fault."""
    values, more = MODES[mode_of(call.name)]
    card.set(call, faults_of(call)[fault], **values)
    run = acquire(command_server, folder, card, *more)
    card.released.set()
    found = run.verdict(card)
    if card.at_fault is None and not fault.startswith("is"):
        found.append("the call is not made")
    return [f"{call}, {fault}: {what}" for what in found]


# The number of a call: 1 the first one, 0 each of that name. Some reads are tested quickly below.
QUICK = [
    ("ReadBinaryI16", 2, "one short"),
    slow("ReadBinaryI16", 2, "one long"),
    ("ReadBinaryI16", 2, "status 200010"),
    ("ReadBinaryI16", 2, "code 200010"),
    ("ReadBinaryI16", 2, "code -50405"),
    ("ReadBinaryI16", 2, "-200284 after 128, 256 of 512 numbers"),
    slow("ReadAnalogF64", 2, "nan at 511"),
    ("GetTimingAttributeDouble SAMP_CLK_RATE", 0, "is nan"),
    ("GetChanAttributeDouble AI_RNG_LOW", 0, "is nan"),
    ("GetChanAttributeDouble AI_FILTER_DELAY", 0, "is nan"),
    ("GetReadAttributeUInt64 TOTAL_SAMP_PER_CHAN_ACQUIRED", 0, "goes backwards"),
    ("CreateTask", 1, "gRPC UNAVAILABLE"),
    ("StopTask", 1, "code -201003"),
]


@pytest.mark.parametrize(("name", "number", "fault"), QUICK)
def test_a_fault(command_server, card, tmp_path, name, number, fault):
    assert not judged(command_server, card, tmp_path, Call(name, number), fault)


FAULTS_OF_A_CALL = amount(3, 60)
"""Faults that are tried at a call, drawn from the 20 to 60 there are: all take an hour."""


@pytest.mark.slow
@pytest.mark.timeout(1800)  # a hundred commands, two of which wait
@pytest.mark.parametrize(
    ("name", "number"),
    [
        (name, number)
        for name, n in CALLS.items()
        for number in (*range(1, n + 1), *[0] * name.startswith("Get"))
    ],
)
def test_every_fault_at_every_call(command_server, card, tmp_path, name, number):
    faults = faults_of(Call(name))
    if number == 0:  # of a device that always answers so
        faults = [fault for fault in faults if fault not in ANYWHERE]
    found = []
    if len(faults) > FAULTS_OF_A_CALL:
        faults = random.Random(f"{name} {number}").sample(list(faults), FAULTS_OF_A_CALL)
    for fault in faults:
        found += judged(command_server, card, tmp_path, Call(name, number), fault)
    assert not found, "\n".join(found)


# Acquisitions in Python, of the kinds that the command does not have


def collect(folder: Path, server: FakeServer, pre_trigger: str = "0 s", **options):
    """Return the volts that a source gives, shape (2, n), the first index, and its error."""
    rig = load_rig_to_acquire(str(rig_file(folder, server.address, pre_trigger)))
    blocks, error = [], None
    try:
        with open_source(rig.daq, N / RATE, **options) as source:
            source.start()
            for block in source.blocks():
                blocks.append((block.first_sample, block.volts.copy()))
    except SautereauError as fault:
        error = str(fault)
    server.released.set()
    for (first, samples), (following, _) in pairwise(blocks):
        assert first + samples.shape[1] == following, "samples are missing between others"
    found = [samples for _, samples in blocks]
    return np.concatenate(found, axis=1) if found else np.empty((2, 0)), error


KINDS = {
    "pre-trigger": {"pre_trigger": "20 ms", "triggered": True},
    "triggered": {"triggered": True},
    "immediate": {"triggered": False},
}


@pytest.mark.parametrize("counts", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_a_source_without_a_fault(card, tmp_path, kind, counts):
    card.set(**({} if counts else NO_COUNTS))
    found, error = collect(tmp_path, card, **KINDS[kind])
    assert error is None
    n = N + 400 * (kind == "pre-trigger")
    np.testing.assert_array_equal(found[:, :n], right(n))


def check_source(card: FakeServer, folder: Path, kind: str, fault: str, number: int) -> None:
    card.set(Call("ReadBinaryI16", number), faults_of(Call("ReadBinaryI16"))[fault])
    found, error = collect(folder, card, **KINDS[kind])
    n = N + 400 * (kind == "pre-trigger")
    np.testing.assert_array_equal(found, right(found.shape[1]))
    if error is None:
        assert found.shape[1] >= n
    else:
        assert found.shape[1] >= min(card.before_fault, n)
        assert [*filter(None, message_faults(f"sautereau: {error}", card.address))] == []


# Warnings of the driver are errors here, and are tested with the command.
@pytest.mark.slow
@pytest.mark.parametrize("fault", [f for f in (ANYWHERE | READS | INTEGERS) if "20001" not in f])
def test_every_read_of_a_source(card, tmp_path, fault):
    """The first, the second or the last of one kind, or of all kinds."""
    cases = [(kind, number) for kind in KINDS for number in (1, 2, 4)]
    for kind, number in random.Random(fault).sample(cases, amount(1, len(cases))):
        card.set()
        check_source(card, tmp_path, kind, fault, number)


@pytest.mark.parametrize(
    ("name", "fault", "said"),
    [
        ("ReadBinaryI16", "one short", "256 of each were read, and has 511 numbers instead of 512"),
        ("ReadAnalogF64", "one long", "256 of each were read, and has 513 numbers instead of 512"),
        ("ReadAnalogF64", "says 257", "257 of each were read, and has 512 numbers"),
        (
            "ReadBinaryI16",
            "ni-error -200284 after 100",
            "-200284.*100 of each were read, and has 0",
        ),
        *(
            ("ReadAnalogF64", fault, rf"{fault.split()[0]} V of [ab] at sample \d")
            for fault in FLOATS
        ),
    ],
)
def test_a_read_that_is_refused_is_described(card, tmp_path, name, fault, said):
    values, _ = MODES[mode_of(name)]
    card.set(Call(name, 2), faults_of(Call(name))[fault], **values)
    found, error = collect(tmp_path, card, triggered=False)
    np.testing.assert_array_equal(found, right(found.shape[1]))
    assert error
    assert "Dev1" in error
    assert re.search(said, error)


@pytest.mark.parametrize("volt", [5e-324, -0.0, 1e300])
def test_odd_volts_are_kept_or_refused(card, tmp_path, volt):
    card.set(Call("ReadAnalogF64", 2), with_value(3, volt), **NO_COUNTS)
    found, error = collect(tmp_path, card, triggered=False)
    assert error is None or found.shape[1] == BLOCK
    sent = right(N)
    sent[0, BLOCK + 3] = volt
    np.testing.assert_array_equal(found[:, :N], sent[:, : found.shape[1]])
