"""The stand-in: a simulated bench behind a serial port and a DAQ server."""

import contextlib
import os
import threading
import time
from dataclasses import dataclass

from rig.load import with_values
from rig.schema import Rig
from sim_backend.daqmx.server import DaqmxServer, TaskSetup, serve
from sim_backend.galil.firmware import GalilFirmware
from sim_backend.runs import SampledRun
from sim_backend.scene import Scene
from sim_backend.serial_port import PtyPort, SocketPort
from sim_backend.world import World

AMPLIFIER_VOLTS = 9.998
"""V, command of an amplifier at the torque limit."""
SETTLING = 2.0
"""s, for which time goes on after a motion so that the arm comes to rest."""
PATIENCE = 60.0
"""s of simulated time that may pass before a command is carried out."""


@dataclass(frozen=True)
class Truth:
    """What really happened after one trigger; s from its edge."""

    contacts: tuple[float, ...]
    releases: tuple[float, ...]


class Bench:
    """Physics, controller and card under one clock, which goes only when something does.

    Args:
        rig: The nominal bench; the scene may make the true one differ.
        scene: What is simulated.
        seed: Of all noise.
        paced: Whether simulated time keeps to the wall clock.
    """

    def __init__(self, rig: Rig, scene: Scene, seed: int = 0, paced: bool = False):
        self.scene = scene
        self.paced = paced
        self.world = World(rig, scene)
        self.rig = scene.as_wired(self.world.rig)
        self.name = rig.daq.device
        self.terminals = tuple(channel.terminal for channel in rig.daq.channels)
        self.failure: Exception | None = None
        self._seed = seed
        self._runs: list[SampledRun] = []
        self._changed = threading.Condition(threading.RLock())
        self._closing = False
        self._rest_force = 0.0
        self._stood_at = 0.0
        self.firmware = GalilFirmware(self, on_output=self._on_output)
        self._clock = threading.Thread(target=self._run_clock, name="stand-in clock", daemon=True)

    def __enter__(self) -> "Bench":
        self._clock.start()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._changed:
            self._closing = True
            for run in self._runs:
                run.stopped = True
            self._changed.notify_all()
        self._clock.join()

    # What the controller is wired to.

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up."""
        return self._counts(self.world.finger.joints())

    def home_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts at the home switches."""
        return self._counts(self.world.rig.arm.home_angles)

    def torque_volts(self) -> tuple[float, float]:
        """Return the commands to the amplifiers [V]."""
        limit = self.world.rig.arm.torque_limit
        first, second = self.world.finger.torques()
        return first / limit * AMPLIFIER_VOLTS, second / limit * AMPLIFIER_VOLTS

    def receive(self, data: bytes) -> bytes:
        """Pass bytes from the serial line to the controller, and return its answer.

        Unless time is paced the host is infinitely slow: what it sends arrives when
        nothing moves any more, so that its own timing never changes what happens.
        """
        with self._changed:
            if not self.paced:
                latest = self.world.time + PATIENCE
                self._changed.wait_for(
                    lambda: not self._busy or self._closing or self.world.time > latest
                )
            answer = self.firmware.receive(data)
            self._changed.notify_all()
            return answer

    # What the card is wired to.

    def start(self, setup: TaskSetup) -> SampledRun:
        """Arm an acquisition."""
        with self._changed:
            run = SampledRun(
                self.rig,
                setup.terminals,
                setup.rate,
                setup.n_samples,
                self.scene.sensors,
                (self._seed, len(self._runs)),
                self._rest_force,
                self._changed,
            )
            self._runs.append(run)
            if setup.trigger is None:
                run.trigger(self.world.time)
            elif setup.trigger.rpartition("/")[2] != self.rig.daq.trigger_source:
                run.unwired = True
            self._changed.notify_all()
            return run

    def truth(self) -> list[Truth]:
        """Return what really happened in each triggered acquisition, in order."""
        with self._changed:
            starts = [run.trigger_time for run in self._runs if run.trigger_time is not None]
            events = self.world.events
            ends = [*starts[1:], float("inf")]
            return [
                Truth(
                    tuple(t - start for t in events.contacts if start <= t < end),
                    tuple(t - start for t in events.releases if start <= t < end),
                )
                for start, end in zip(starts, ends, strict=True)
            ]

    def _on_output(self, number: int, level: bool) -> None:
        if level and number == self.rig.controller.trigger_output:
            for run in self._runs:
                if not run.unwired:
                    run.trigger(self.world.time)

    def _counts(self, joints: tuple[float, float]) -> tuple[int, int]:
        start, radians = self.world.start, self.world.radians_per_count
        return round((joints[0] - start[0]) / radians), round((joints[1] - start[1]) / radians)

    @property
    def _busy(self) -> bool:
        if self.firmware.moving or any(run.waiting_for_time for run in self._runs):
            return True
        return self.world.time - self._stood_at < SETTLING and not self.world.finger.settled

    def _run_clock(self) -> None:
        ahead = 0.0
        while True:
            with self._changed:
                idle = not self._busy
                self._changed.wait_for(lambda: self._busy or self._closing)
                if self._closing:
                    return
                if idle:
                    ahead = time.monotonic() - self.world.time
                try:
                    self._tick()
                except Exception as error:  # noqa: BLE001 - handed to whoever asks next
                    self.failure = error
                    self._closing = True
                    for run in self._runs:
                        run.stopped = True
                self._changed.notify_all()
            # Outside the lock, so that the host can get a word in between two samples.
            time.sleep(max(0.0, ahead + self.world.time - time.monotonic()) if self.paced else 0)

    def _tick(self) -> None:
        self.firmware.tick()
        released = len(self.world.events.releases)
        motions = self.world.advance(self.firmware.reference, any(self.firmware.motors_on))
        self._rest_force = float(motions.finger_force[-1])
        if self.firmware.moving:
            self._stood_at = self.world.time
        for run in self._runs:
            run.feed(motions, self.world.events.releases[released:])


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
            stack.enter_context(self.bench)
            self._serial = stack.enter_context(self._make_port(self.bench.receive))
            self._daq: DaqmxServer = stack.enter_context(serve(self.bench))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()
        if self.bench.failure and not exception[0]:
            raise self.bench.failure

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
        return with_values(
            wired,
            {"controller.port": self.serial_port, "daq.address": self.daq_address},
        )

    def serve_forever(self) -> None:
        """Wait until the stand-in fails, or the waiting thread is interrupted."""
        while self.bench.failure is None:
            time.sleep(0.2)

    def truth(self) -> list[Truth]:
        """Return what really happened after each trigger; no recording holds it."""
        return self.bench.truth()
