"""Both wire protocols: hostile hosts for the emulated devices, hostile devices for the drivers."""

import random
from concurrent import futures
from pathlib import Path
from typing import Any

import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx._stubs import nidaqmx_pb2_grpc

from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.odrive.driver import OdriveController
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer, Servicer
from sautereau.sim_backend.devices.emulators import EMULATORS
from tests.cards import Card
from tests.emulated import Encoders, ScriptedPort
from tests.fuzz import mutate
from tests.fuzz.run import Wrong

RIG = load_rig()
TRANSCRIPTS = Path(__file__).parents[1] / "sim_backend" / "galil_transcripts"


class Unmoved(Encoders):
    """An arm at rest that refuses commands without sense."""

    def drive(self, offsets, limits):
        if not np.isfinite([*offsets, *limits]).all():
            raise Wrong("a command to an amplifier is not finite")


def transcript_lines() -> list[str]:
    """Return the commands of all transcripts of the controller."""
    found = []
    for path in sorted(TRANSCRIPTS.glob("*.txt")):
        for line in path.read_text().splitlines():
            if line and not line.startswith(("#", "==")):
                found.append(line.split("=>")[0].split("~>")[0].strip())
    return found


ODRIVE_LINES = [
    "p 0 1.5 0 0", "t 0 1", "f 0", "i", "u 0", "ss", "sc", "r vbus_voltage", "r axis0.error",
    "w axis0.controller.input_pos 1", "w axis0.requested_state 8", "r axis1.encoder.pos_estimate",
]  # fmt: skip


class Emulator:
    """The emulated controller, which gets programs and commands that no host sends."""

    def __init__(self, folder: Path, name: str, lines: list[str], alive: bytes):
        self._name, self._lines, self._alive = name, lines, alive

    def case(self, dice: random.Random) -> str:
        firmware = EMULATORS.get(self._name)(RIG, Unmoved(), lambda *change: None, False)
        lines = [dice.choice(self._lines) for _ in range(dice.randrange(1, 40))]
        text = "\r".join(lines) + "\r"
        if dice.random() < 0.8:
            text = mutate.of_text(text, dice, (";", "\r", "\\", "#A", "XQ", "JP#A", "DL", "MG"))
        data = text.encode("utf-8", "replace")[: 1 << 17]
        if dice.random() < 0.2:
            data = mutate.of_bytes(data, dice)[: 1 << 17]
        received = 0
        for at in range(0, len(data), 512):
            received += len(firmware.receive(data[at : at + 512]))
            for _ in range(dice.choice((0, 1, 20))):
                firmware.tick()
        if received > 1 << 24:
            raise Wrong(f"{received} bytes answer {len(data)}")
        firmware.receive(b"\r\\\r")
        return "alive" if self._alive in firmware.receive(b"i\r" + b"MG 4711\r") else "silent"


class Port(ScriptedPort):
    """A serial port with an emulated controller behind, whose answers are changed."""

    def __init__(self, firmware: Any, dice: random.Random, probability: float):
        super().__init__()
        self._firmware, self._dice, self._probability = firmware, dice, probability
        self.left = 20_000

    def write(self, data: bytes) -> int:
        self._count()
        answer = self._firmware.receive(bytes(data))
        for _ in range(50):
            self._firmware.tick()
        if self._dice.random() < self._probability:
            text = answer.decode("latin-1")
            changed = mutate.of_text(text, self._dice).encode("latin-1", "replace")
            answer = self._dice.choice((changed, mutate.of_bytes(answer, self._dice), b""))
        self.incoming += answer[: 1 << 18]
        return len(data)

    def read(self, size: int = 1) -> bytes:
        self._count()
        return super().read(size)

    def _count(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise OSError("the cable was cut")


class Clock:
    """Time that passes when it is looked at."""

    def __init__(self):
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1e-3
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += max(0.0, seconds)


class Driver:
    """A driver whose controller answers what no controller sends."""

    def __init__(self, folder: Path, name: str, controller: Any):
        self._name, self._controller = name, controller

    def case(self, dice: random.Random) -> str:
        firmware = EMULATORS.get(self._name)(RIG, Unmoved(), lambda *change: None, False)
        port, clock = Port(firmware, dice, dice.choice((0.0, 0.01, 0.1, 1.0))), Clock()
        driver = self._controller(RIG, open_port=port.open, clock=clock, sleep=clock.sleep)
        outcome = "refused"
        try:
            driver.connect()
            outcome = "connected"
            driver.home()
            outcome = "homed"
        except SautereauError:
            port.left = 20_000
        finally:
            try:
                driver.disconnect()
            except SautereauError:
                outcome += ", lost"
        return outcome


METHODS = {m.name: m for m in pb.DESCRIPTOR.services_by_name["NiDAQmx"].methods}
SERVED = [
    name
    for name, method in METHODS.items()
    if getattr(Servicer, name) is not getattr(nidaqmx_pb2_grpc.NiDAQmxServicer, name)
    and not method.server_streaming
]
USUAL = (
    "CreateTask", "CreateAIVoltageChan", "CfgSampClkTiming", "CfgDigEdgeStartTrig", "StartTask",
    "ReadAnalogF64", "StopTask", "ClearTask", "CfgInputBuffer", "GetChanAttributeDouble",
)  # fmt: skip
INTEGERS = (0, 1, 2, -1, 3, 4, 10, 1000, 10178, 10123, 10106, 2**31 - 1, -(2**31), 5, 100_000)
STRINGS = ("t", "t", "t", "Dev1", "Dev1/ai0", "Dev1/ai0:1", "/Dev1/PFI0", "Dev1/ai0:30000000", "v")
LONGEST_CALL = 1.0  # s


def request(name: str, dice: random.Random) -> bytes:
    """Return the bytes of a request whose fields have usual and hostile values."""
    descriptor = METHODS[name].input_type
    message = getattr(pb, descriptor.name)()
    for field in descriptor.fields:
        if dice.random() < 0.1:
            continue
        kind = field.cpp_type
        if field.is_repeated or kind == field.CPPTYPE_MESSAGE:
            if field.name == "task":
                message.task.name = "t" if dice.random() < 0.9 else dice.choice(mutate.TEXTS[:20])
        elif kind == field.CPPTYPE_STRING:
            few = dice.choice((STRINGS, STRINGS, STRINGS, mutate.TEXTS))
            value = "t" if field.name == "session_name" else dice.choice(few)
            setattr(message, field.name, value if field.type == field.TYPE_STRING else b"x")
        elif kind in (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT):
            value = dice.choice(("1000", "10", "-10", "1", *mutate.NUMBERS[:23]))
            setattr(message, field.name, float(value))
        elif kind == field.CPPTYPE_BOOL:
            setattr(message, field.name, dice.random() < 0.5)
        else:
            unsigned = kind in (field.CPPTYPE_UINT32, field.CPPTYPE_UINT64)
            low, high = (0, 2**32 - 1) if unsigned else (-(2**31), 2**31 - 1)
            setattr(message, field.name, max(low, min(high, dice.choice(INTEGERS))))
    data = message.SerializeToString()
    return mutate.of_bytes(data, dice) if dice.random() < 0.1 else data


class CardServer:
    """The stand-in's gRPC server, which is asked what no client asks; then it serves as before."""

    def __init__(self, folder: Path):
        self._server = DaqmxServer(Card())
        self._server.__enter__()
        self._rig = with_values(
            RIG, {"daq.address": self._server.address, "daq.trigger_timeout": "1 s"}
        )
        self._channel = grpc.insecure_channel(
            self._server.address, [("grpc.max_receive_message_length", -1)]
        )

    def _call(self, name: str, data: bytes) -> str:
        path = f"/nidaqmx_grpc.NiDAQmx/{name}"
        try:
            self._channel.unary_unary(path)(data, timeout=LONGEST_CALL)
        except grpc.RpcError as error:
            details = str(error.details())  # type: ignore[attr-defined]
            if "Exception calling" in details:
                raise Wrong(f"{name}: {details}") from None
            return str(error.code())  # type: ignore[attr-defined]
        return "OK"

    def case(self, dice: random.Random) -> str:
        self._call("CreateTask", pb.CreateTaskRequest(session_name="t").SerializeToString())
        for _ in range(dice.randrange(1, 12)):
            name = dice.choice(USUAL if dice.random() < 0.6 else SERVED)
            self._call(name, request(name, dice))
        clear = pb.ClearTaskRequest()
        clear.task.name = "t"
        self._call("ClearTask", clear.SerializeToString())
        with Acquisition(self._rig.daq, 0.02) as acquisition:
            acquisition.start()
            if sum(block.volts.shape[1] for block in acquisition.blocks()) != 1024:
                raise Wrong("fewer samples than requested")
        return "served"


class Mangling(grpc.ServerInterceptor):
    """Changes what the server answers."""

    def __init__(self):
        self.dice, self.probability = random.Random(0), 0.0

    def intercept_service(self, continuation: Any, handler_call_details: Any) -> Any:
        handler = continuation(handler_call_details)
        if handler is None or handler.response_streaming:
            return handler

        def serialize(message: Any) -> bytes:
            data = handler.response_serializer(message)
            if self.dice.random() < self.probability:
                data = mutate.of_bytes(data, self.dice)[: 1 << 22]
            return data

        return grpc.unary_unary_rpc_method_handler(
            handler.unary_unary, handler.request_deserializer, serialize
        )


class CardClient:
    """The acquisition, whose card answers what no card sends."""

    def __init__(self, folder: Path):
        self._mangling = Mangling()
        servicer = Servicer(Card())  # pyright: ignore[reportAbstractUsage]
        self._server = grpc.server(futures.ThreadPoolExecutor(8), interceptors=[self._mangling])
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(servicer, self._server)
        port = self._server.add_insecure_port("127.0.0.1:0")
        self._server.start()
        values = {"daq.address": f"127.0.0.1:{port}", "daq.trigger_timeout": "0.3 s"}
        self._rig, self._servicer = with_values(RIG, values), servicer

    def case(self, dice: random.Random) -> str:
        self._mangling.dice = dice
        self._mangling.probability = dice.choice((0.02, 0.2, 1.0))
        found = []
        try:
            with Acquisition(self._rig.daq, 0.02) as acquisition:
                acquisition.start()
                for block in acquisition.blocks():
                    found.append(block.volts)
        finally:
            self._mangling.probability = 0.0
            self._servicer._tasks.clear()
        if not found or any(block.ndim != 2 or len(block) != 2 for block in found):
            raise Wrong("blocks of another shape")
        return "acquired"


def make(name: str, folder: Path) -> Any:
    """Return one of the protocols' targets."""
    match name:
        case "galil-emulator":
            return Emulator(folder, "galil", transcript_lines(), b" 4711.0000")
        case "odrive-emulator":
            return Emulator(folder, "odrive", ODRIVE_LINES, b"Hardware")
        case "galil-driver":
            return Driver(folder, "galil", GalilController)
        case "odrive-driver":
            return Driver(folder, "odrive", OdriveController)
        case "card-server":
            return CardServer(folder)
        case _:
            return CardClient(folder)
