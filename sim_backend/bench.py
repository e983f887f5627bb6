"""The stand-in: a simulated bench behind a serial port and a DAQ server."""

import contextlib
import os
import threading
import time
from typing import TypeVar

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.clock import Clock
from sautereau.sim_backend.devices.daqmx.around_run import AroundSampledRun
from sautereau.sim_backend.devices.daqmx.runs import SampledRun
from sautereau.sim_backend.devices.daqmx.server import DaqmxError, DaqmxServer, TaskSetup, serve
from sautereau.sim_backend.devices.firmware import new_firmware
from sautereau.sim_backend.devices.odrive.firmware import OdriveFirmware
from sautereau.sim_backend.devices.plant import ArmPlant
from sautereau.sim_backend.devices.serial_port import PortGone, PtyPort, SocketPort
from sautereau.sim_backend.fair_lock import Turns
from sautereau.sim_backend.faults.line import bad_line
from sautereau.sim_backend.faults.strikes import Strikes
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.prepare import prepared
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.truth import Truth, truths

SETTLING = 2.0
"""s, for which time goes on after a motion so that the arm comes to rest."""
PATIENCE = 60.0
"""s of simulated time that may pass before a command is carried out."""


AnyRun = TypeVar("AnyRun", bound=SampledRun)


class Bench:
    """Physics, controller and card under one clock, which goes only when something does.

    Args:
        rig: The nominal bench; the scene may make the true one differ.
        scene: What is simulated.
        seed: Of all noise and of every fault.
        paced: Whether simulated time keeps to the wall clock.

    Raises:
        SceneError: The scene has no arm, or faults that cannot strike on this bench, or it
            asks for an accuracy that cannot be had.
    """

    def __init__(self, rig: Rig, scene: Scene, seed: int = 0, paced: bool = False):
        self.scene, self.reached = prepared(rig, scene)
        """The scene with every choice made, and what accuracy that reaches; empty where none
        was asked for."""
        self.paced = paced
        self.world = new_world(rig, self.scene)
        self.rig = scene.as_wired(self.world.rig)
        self.name = rig.daq.device
        self.failure: Exception | None = None
        self.finger_force = 0.0
        """N, of the finger on the key now."""
        self._plant = ArmPlant(self.world)
        self._terminals = tuple(channel.terminal for channel in rig.daq.channels)
        self._seed = seed
        self._runs: list[SampledRun] = []
        self._armed = 0
        self._starts: list[float] = []
        self._strikes = Strikes(self.scene.faults, self._plant, lambda: self.world.time)
        self._turns = Turns()
        self._closing = threading.Event()
        self._stood_at = 0.0
        self._line = bad_line(self.scene.faults, seed, self._strikes.past)
        self.firmware = new_firmware(rig, self._plant, self._on_output, paced)
        self._clock = Clock(self, self._turns, paced, self._fail)

    def __enter__(self) -> "Bench":
        self._clock.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._turns:
            self._closing.set()
            for run in self._runs:
                run.stopped = True
            self._turns.notify_all()
        self._clock.__exit__()

    # What the controller is wired to.

    def receive(self, data: bytes) -> bytes:
        """Pass bytes from the serial line to the controller, and return its answer.

        Unless time is paced the host is infinitely slow: what it sends arrives when
        nothing moves any more, so that its own timing never changes what happens.

        Raises:
            PortGone: The port went with the cable, or the bench has failed.
        """
        with self._turns:
            if not self.paced:
                latest = self.world.time + PATIENCE
                self._turns.wait_for(
                    lambda: not self.busy or self._closing.is_set() or self.world.time > latest
                )
            if self.failure is not None:
                raise PortGone
            try:
                if self._line is None:
                    return self.firmware.receive(data)
                answer = self._line.carry(data, self.firmware.receive)
                delay = self._line.delay
            finally:
                self._turns.notify_all()
        if answer and delay:
            self._closing.wait(delay)
        return answer

    def _on_output(self, number: int, level: bool) -> None:
        if level and number == self.rig.controller.trigger_output:
            waiting = [run for run in self._runs if run.waiting_for_trigger]
            if waiting and self._strikes.begin_press():
                self._starts.append(self.world.time)
                for run in waiting:
                    run.trigger(self.world.time, self._strikes.of_run())

    # What the card is wired to.

    @property
    def terminals(self) -> tuple[str, ...]:
        """The card's analog inputs.

        Raises:
            DaqmxError: The card is unplugged.
        """
        self._strikes.check_plugged()
        return self._terminals

    def start(self, setup: TaskSetup) -> SampledRun:
        """Arm an acquisition.

        Raises:
            DaqmxError: The card is unplugged, or the bench has failed.
        """
        with self._turns:
            run = self._new_run(SampledRun, setup)
            if setup.trigger is None:
                self._starts.append(self.world.time)
                run.trigger(self.world.time)
            self._turns.notify_all()
            return run

    def start_around(self, setup: TaskSetup, before: int) -> AroundSampledRun:
        """Start an acquisition of which so many samples lie before its trigger's edge.

        Raises:
            DaqmxError: The card is unplugged, or the bench has failed.
        """
        with self._turns:
            run = self._new_run(AroundSampledRun, setup)
            run.begin(self.world.time, before)
            self._turns.notify_all()
            return run

    def _new_run(self, kind: type[AnyRun], setup: TaskSetup) -> AnyRun:
        self._strikes.check_plugged()
        if self.failure is not None:
            raise _failed(self.failure)
        run = kind(
            self.rig,
            setup.terminals,
            setup.rate,
            setup.n_samples,
            self.scene.sensors,
            self._seed,
            self._armed,
            self.finger_force,
            self._turns,
            self.scene.faults,
        )
        self._armed += 1
        self._runs = [*(other for other in self._runs if not other.over), run]
        trigger = setup.trigger or self.rig.daq.trigger_source
        run.unwired = trigger.rpartition("/")[2] != self.rig.daq.trigger_source
        return run

    def truth(self) -> list[Truth]:
        """Return what really happened in each triggered acquisition, in order."""
        with self._turns:
            return truths(self.world.events, self._starts)

    # What the clock makes go.

    @property
    def time(self) -> float:
        """s, simulated."""
        return self.world.time

    @property
    def busy(self) -> bool:
        """Whether time must go on: something moves, is sampled, or comes to rest."""
        if isinstance(self.firmware, OdriveFirmware) and self.firmware.held:
            return False
        if self.firmware.moving or (self.paced and self.firmware.watching):
            return True
        for run in self._runs:
            if run.waiting_for_time:
                return True
        return self.world.time - self._stood_at < SETTLING and not self.world.finger.settled

    @property
    def awaited(self) -> bool:
        """Whether somebody waits for samples that are there."""
        return any(run.due for run in self._runs)

    def tick(self) -> None:
        """Do one controller sample."""
        self._strikes.strike()
        self.firmware.tick()
        events = self.world.events
        released, returned = len(events.releases), len(events.returns)
        reference = self._plant.wired(self.firmware.reference)
        motions = self.world.advance(reference, any(self.firmware.motors_on))
        self._plant.sample()
        self.finger_force = float(motions.finger_force[-1])
        if self.firmware.moving:
            self._stood_at = self.world.time
        if self._runs:
            events = self.world.events
            sudden = (*events.releases[released:], *events.returns[returned:])
            jumps = sorted(event.time for event in sudden)
            for run in self._runs:
                run.feed(motions, jumps)

    def _fail(self, error: Exception) -> None:
        self.failure = error
        for run in self._runs:
            run.fail(lambda: _failed(error))
        self._closing.set()
        self._turns.notify_all()


def _failed(error: Exception) -> DaqmxError:
    return DaqmxError(-50150, f"The stand-in has failed: {error}")


class StandIn:
    """The simulated bench as the host sees it: a serial port and a gRPC address.

    Args:
        rig: The nominal bench.
        scene: What is simulated.
        seed: Of all noise.
        paced: Whether simulated time keeps to the wall clock.
        port: `pty` for a pseudo-terminal, `socket` for TCP on loopback; by default a
            pseudo-terminal where the system has them.
    """

    def __init__(
        self, rig: Rig, scene: Scene, seed: int = 0, *, paced: bool = False, port: str | None = None
    ):
        self._nominal = rig
        self.scene = scene
        self.bench = Bench(rig, scene, seed, paced)
        self._make_port = {"pty": PtyPort, "socket": SocketPort}[
            port or ("pty" if hasattr(os, "openpty") else "socket")
        ]
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> "StandIn":
        with contextlib.ExitStack() as stack:
            self._serial = stack.enter_context(self._make_port(self.bench.receive))
            self._daq: DaqmxServer = stack.enter_context(serve(self.bench))
            stack.enter_context(self.bench)  # it ends first, so that nobody waits for it
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
        """What to give to pyserial."""
        return self._serial.url

    @property
    def daq_address(self) -> str:
        """What to give to a gRPC channel, `127.0.0.1:port`."""
        return self._daq.address

    @property
    def rig(self) -> Rig:
        """The nominal rig as wired to this stand-in: its addresses, its sensors' charts."""
        wired = self.scene.as_wired(self._nominal)
        values = {"controller.port": self.serial_port, "daq.address": self.daq_address}
        if not self.bench.paced:  # signs of life mean nothing then, and come by the wall's clock
            values["controller.watchdog_period"] = "5 s"
        return with_values(wired, values)

    def serve_forever(self) -> None:
        """Wait until the stand-in fails, or the waiting thread is interrupted."""
        while self.bench.failure is None:
            time.sleep(0.2)

    def truth(self) -> list[Truth]:
        """Return what really happened after each trigger; no recording holds it."""
        return self.bench.truth()
