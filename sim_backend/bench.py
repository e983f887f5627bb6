"""The stand-in: a simulated bench behind a serial port and a DAQ server."""

import contextlib
import os
import threading
import time
from collections.abc import Callable
from functools import partial

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.card import BenchCard
from sautereau.sim_backend.clock import Clock, FairLock
from sautereau.sim_backend.devices.daqmx.runs import Wiring
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from sautereau.sim_backend.devices.emulators import SERIAL, Networked, emulator_of
from sautereau.sim_backend.devices.plant import ArmPlant
from sautereau.sim_backend.devices.ports import PortGone, PtyPort, SocketPort, TcpPort
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_injection import BadLine, FaultInjection
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.sim_backend.physics.events import Truth, truths
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.sensors.fingertip import FingertipLoad
from sautereau.sim_backend.sensors.simulated import SIMULATED

BUSY = 20.0  # s of real time, in which a busy machine has computed any answer without faults


class Bench:
    """Physics, controller and card under one clock, which runs only while one of them is busy.

    Args:
        rig: The nominal bench; the scene may make the simulated one differ.
        scene: What is simulated.
        seed: Of all noise and of every fault.
        paced: Whether simulated time follows real time.

    Raises:
        SceneError: The scene has no arm, or faults that cannot occur on this bench; it asks
            for an accuracy that cannot be reached; or no package simulates the rig's
            controller or a quantity that it measures.
    """

    def __init__(self, rig: Rig, scene: Scene, seed: int = 0, paced: bool = False):
        self.scene, self.reached = prepared(rig, scene)
        """The scene with every choice made, and a text that names engine and step, and the
        accuracy that they reach where the scene asks for one."""
        self.paced = paced
        self.world = new_world(rig, self.scene)
        self.rig = scene.as_wired(self.world.rig)
        self.failure: Exception | None = None
        unit = scene.controller or ControllerUnit()
        self.plant = ArmPlant(self.world, unit.index_angles, unit.limit_switches)
        self.ethernet = unit.interface == "ethernet"
        """Whether the controller is connected by Ethernet, else by its serial port."""
        self._inverted, self._output_delay = unit.output_inverted, unit.output_delay
        self.injection = FaultInjection(self.scene.faults, self.plant, lambda: self.world.time)
        self._lock = FairLock()
        self._closing = threading.Event()
        self._last_motion = 0.0
        self._line = BadLine(self.scene.faults, seed, self.injection.past)
        wiring = Wiring(
            self.rig,
            self.scene,
            seed,
            self._lock,
            paced,
            lambda: self.passed,
            self.world.string_modes,
        )
        self.card = BenchCard(wiring, self.injection, lambda: self.world.time)
        loaded = scene.weight is not None or self.rig.arm.fixture_mass > 0
        self._load = FingertipLoad(self.rig, scene.weight, self.card.starts) if loaded else None
        self._powered_up = False
        given = {} if scene.controller is None else {"unit": scene.controller}
        emulate = emulator_of(rig.controller.kind, **given)
        self.firmware = emulate(rig, self.plant, self._on_output, paced)
        self._powered_up = True
        self._outbox: dict[str, bytes] = {}
        self.on_message: Callable[[], None] = lambda: None
        """Called when the controller has sent something by itself."""
        self._clock = Clock(self, self._lock, paced, self._fail)

    def __enter__(self) -> "Bench":
        self._clock.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._closing.set()
            self.card.stop()
            self._lock.notify_all()
        self._clock.__exit__()

    def receive(self, data: bytes, letter: str = SERIAL) -> bytes:
        """Pass bytes from a port to the controller, and return what it sends.

        Unless time is paced the host is infinitely slow: its bytes arrive when nothing moves
        any longer, so that its own timing never changes the result. Without bytes this returns
        what the controller has sent by itself.

        Raises:
            PortGone: The port went with the cable, or the bench has failed.
        """
        with self._lock:
            if data and not self.paced:
                latest = self.world.time + 60.0  # s, in which a command is carried out
                self._lock.wait_for(
                    lambda: not self.busy or self._closing.is_set() or self.world.time > latest
                )
            if self.failure is not None:
                raise PortGone
            if data and self.paced:  # a tick is computed ahead: wait until its time has passed
                # About a sample of the controller.
                time.sleep(min(max(0.0, self.time - self.passed), 1e-3))
            receive = self.firmware.receive
            if letter != SERIAL:
                receive = partial(self._networked.receive, letter=letter)
            waiting, delay = self._outbox.pop(letter, b""), 0.0
            try:
                if not data:
                    return waiting
                answer = waiting + self._line.carry(data, receive)
                delay = self._line.delay
            finally:
                self._lock.notify_all()
        if answer and delay:
            self._closing.wait(delay)
        return answer

    def connect(self, peer: int) -> str | None:
        """Open a connection from a host's TCP port to the controller.

        Returns:
            Its handle, None if all are in use.
        """
        with self._lock:
            return self._networked.connect(peer)

    def connected(self, port: str) -> bool:
        """Return whether the controller still has a handle."""
        with self._lock:
            return self._networked.connected(port)

    def disconnect(self, port: str) -> None:
        """Lose a TCP connection."""
        with self._lock:
            self._networked.disconnect(port)

    def operate(self, act: Callable[[ArmPlant], None]) -> None:
        """Let an operator act on the arm, its switches or its cables; one sample passes."""
        with self._lock:
            act(self.plant)
            self.tick()
            self._lock.notify_all()

    @property
    def _networked(self) -> Networked:
        if not isinstance(self.firmware, Networked):
            raise SceneError(
                f"controller.kind: the stand-in of a {self.rig.controller.kind!r} has no Ethernet"
                " port; use a pseudo-terminal"
            )
        return self.firmware

    def _on_output(self, number: int, level: bool) -> None:
        if not self._powered_up:  # burned levels: there was nobody to see their edges
            return
        if number == self.rig.controller.trigger_output:
            within = self.firmware.phase * self.rig.controller.sample_period
            self.card.edge(within + self._output_delay, falling=level == self._inverted)

    def truth(self) -> list[Truth]:
        """Return the true events of each triggered acquisition, in order."""
        with self._lock:
            return truths(self.world.events, self.card.starts)

    # What the clock advances.

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.world.time

    @property
    def passed(self) -> float:
        """Simulated time [s] that has passed by the real clock; inf if it is not paced."""
        return self._clock.passed

    @property
    def busy(self) -> bool:
        """Whether simulated time must advance: something moves, is sampled, or comes to rest."""
        firmware = self.firmware
        if firmware.held:
            return False
        if firmware.moving or (self.paced and firmware.watching) or self.card.busy:
            return True
        # s, in which the arm comes to rest after a motion.
        return self.world.time - self._last_motion < 2.0 and not self.world.finger.settled

    @property
    def line_busy(self) -> bool:
        """Whether simulated time must not run ahead of real time, as on a line that takes time.

        The host renews the watchdog in real time, and a watchdog counts while the line is busy.
        """
        return self.firmware.line_busy

    @property
    def awaited(self) -> bool:
        """Whether a thread waits for samples that are complete."""
        return self.card.awaited

    def tick(self) -> None:
        """Do one controller sample."""
        self.injection.inject()
        self.firmware.tick()
        reference = self.plant.wired(self.firmware.reference)
        for port, message in self.firmware.outgoing().items():
            sent = self._line.towards_host(message)
            self._outbox[port] = self._outbox.get(port, b"") + sent
            if port != SERIAL and self._line.gone:
                self._networked.miss_acknowledgement(port)
        if self._outbox:
            self.on_message()
        motions = self.world.advance(reference, any(self.firmware.motors_on))
        self.plant.sample()
        if self.firmware.moving:
            self._last_motion = self.world.time
        if self._load is not None:
            motions = self._load.on(motions, self.world.finger.joints())
        self.card.feed(motions)

    def _fail(self, error: Exception) -> None:
        self.failure = error
        self.card.fail(error)
        self._closing.set()
        self._lock.notify_all()


class StandIn:
    """The simulated bench as the host sees it: a serial port and a gRPC address.

    Args:
        scene: What is simulated.
        seed: Of all noise.
        paced: Whether simulated time follows real time.
    """

    def __init__(self, rig: Rig, scene: Scene, seed: int = 0, *, paced: bool = False):
        self._nominal = rig
        self.scene = scene
        self.bench = Bench(rig, scene, seed, paced)
        if self.bench.ethernet:
            self._make_port = lambda: TcpPort(self.bench)
        else:
            serial = PtyPort if hasattr(os, "openpty") else SocketPort
            self._make_port = lambda: serial(self.bench.receive)
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> "StandIn":
        with contextlib.ExitStack() as stack:
            self._serial = stack.enter_context(self._make_port())
            self.bench.on_message = self._serial.wake
            self._daq = stack.enter_context(DaqmxServer(self.bench.card))
            stack.enter_context(self.bench)  # ends first, so that no call waits for it
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()
        if failure := self.bench.failure:
            if not isinstance(exception[1], BaseException):
                raise failure
            exception[1].add_note(f"The stand-in has failed before that: {failure}")

    @property
    def serial_port(self) -> str:
        """Port for pyserial, or `tcp://127.0.0.1:port` of the controller's Ethernet."""
        return self._serial.url

    @property
    def daq_address(self) -> str:
        """Address for a gRPC channel, `127.0.0.1:port`."""
        return self._daq.address

    @property
    def rig(self) -> Rig:
        """The nominal rig as wired to this stand-in: its addresses, its sensors' calibrations."""
        wired = self.scene.as_wired(self._nominal)
        values = {"controller.port": self.serial_port, "daq.address": self.daq_address}
        if not self.bench.paced:  # keep-alive messages and answers come in real time
            values["controller.watchdog_period"] = "5 s"
            if self.scene.faults is None and wired.controller.timeout < BUSY:
                values["controller.timeout"] = f"{BUSY:g} s"
        return with_values(wired, values)

    def serve_forever(self) -> None:
        """Wait until the stand-in fails, or the waiting thread is interrupted."""
        while self.bench.failure is None:
            time.sleep(0.2)

    def truth(self) -> list[Truth]:
        """Return the true events after each trigger, which no recording holds."""
        return self.bench.truth()


def prepared(rig: Rig, scene: Scene) -> tuple[Scene, str]:
    """Return a scene with every choice made, and a text of its engine, step and accuracy.

    Raises:
        SceneError: As of `Bench`.
    """
    faults = []
    if scene.finger == "push":
        faults.append(
            'finger: "push" has no arm for a controller to move; it is for sweeps and `trade`:'
            ' use finger = "ideal" or "servo"'
        )
    elif scene.faults is not None:
        faults += scene.faults.conflicts(scene, rig)
    unit = {} if scene.controller is None else {"unit": scene.controller}
    try:
        emulator_of(rig.controller.kind, **unit)
    except SceneError as error:
        faults.append(str(error))
    for i, channel in enumerate(rig.daq.channels):
        try:
            SIMULATED.get(channel.quantity)
        except SceneError as error:
            faults.append(f"daq.channels.{i}.quantity: {error}")
    if faults:
        raise SceneError("\n".join(faults))
    if scene.step is not None:  # only an accuracy leaves other choices open
        chosen = scene.with_engine()
        return chosen, f"engine {chosen.engine}, steps of {scene.step * 1e6:.4g} us"
    from sautereau.sim_backend.trade.select import select_solver

    selected = select_solver(rig, scene)
    return selected.scene, str(selected)
