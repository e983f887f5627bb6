"""The bench's DAQ card: it arms acquisitions, and feeds them with the motion of the bench."""

from collections.abc import Callable

from sautereau.rig.acquisition import Daq
from sautereau.sim_backend.device_types import DEVICE_TYPES
from sautereau.sim_backend.devices.daqmx.card import (
    DaqmxError,
    Module,
    TaskSetup,
    chassis_in,
)
from sautereau.sim_backend.devices.daqmx.runs import RetriggeredRun, SampledRun, Wiring
from sautereau.sim_backend.fault_injection import FaultInjection
from sautereau.sim_backend.physics.events import Motions


def _chassis(daq: Daq, module: str) -> str:
    """Return the chassis of a module: one in its name, else that of the rig's trigger source."""
    own, first = chassis_in(module), chassis_in(daq.devices[0])
    if daq.trigger_source.startswith("/") and own in ("", first):
        return daq.trigger_source.split("/")[1]
    return own or first or "cDAQ1"


def _inputs(daq: Daq, device: str, number: int | None) -> tuple[str, ...]:
    """Return the inputs of a device; an ideal one has those of the rig."""
    if number is not None:
        return tuple(f"ai{n}" for n in range(number))
    return tuple(one.terminal for one in daq.channels if daq.device_of(one) == device)


class BenchCard:
    """A DAQmx device whose analog inputs are wired to the sensors of the bench.

    Args:
        injection: Of the scene's faults.
        now: Returns the simulated time [s].
    """

    def __init__(self, wiring: Wiring, injection: FaultInjection, now: Callable[[], float]):
        daq = wiring.rig.daq
        products = wiring.scene.products(daq)
        types = {name: DEVICE_TYPES[product] for name, product in products.items()}
        self.modules = tuple(
            Module(
                *(name, device, _inputs(daq, name, device.inputs)),
                chassis=_chassis(daq, name) if device.in_chassis else "",
            )
            for name, device in types.items()
        )
        self.paced = wiring.paced
        self.runs: list[SampledRun] = []
        """Acquisitions that are not over, and those that ended since the last start."""
        self.starts: list[float] = []
        """s, simulated times at which acquisitions started, by their edges or by themselves."""
        self._wiring, self._injection, self._now = wiring, injection, now
        self._armed = 0
        self._last: Motions | None = None
        self._failure: Callable[[], DaqmxError] | None = None

    def check(self) -> None:
        """Raise `DaqmxError` if the card is disconnected."""
        self._injection.check_plugged()

    def start(self, setup: TaskSetup) -> SampledRun:
        """Arm an acquisition, or start one that keeps samples before its trigger's edge.

        Raises:
            DaqmxError: The card is disconnected, or the bench has failed.
        """
        with self._wiring.lock:
            run = self._new_run(setup)
            if setup.before is not None:
                if setup.start_trigger is None:
                    run.trigger(self._now())
            elif setup.trigger is None and setup.per_trigger is None:
                self.starts.append(self._now())
                self._injection.begin_press()
                run.trigger(self._now(), self._injection.of_run())
            return run

    def _new_run(self, setup: TaskSetup) -> SampledRun:
        self._injection.check_plugged()
        if self._failure is not None:
            raise self._failure()
        kind = SampledRun if setup.per_trigger is None else RetriggeredRun
        run = kind(self._wiring, setup, self._armed, self._last)
        self._armed += 1
        self.runs = [*(other for other in self.runs if not other.over), run]
        self._wiring.lock.notify_all()  # in effect once the lock is released
        wired = self._wiring.rig.daq.trigger_source.rpartition("/")[2]
        used = [terminal for terminal in (setup.trigger, setup.start_trigger) if terminal]
        run.unwired = any(terminal.rpartition("/")[2] != wired for terminal in used)
        return run

    # Called by the bench, under the lock.

    def edge(self, delay: float = 0.0, *, falling: bool = False) -> None:
        """Receive an edge at the trigger input; it counts as a press if a task waits for it.

        Args:
            delay: s, from now to the edge.
            falling: Whether it is a falling edge.
        """
        time = self._now() + delay
        waiting = [run for run in self.runs if run.waits_for(falling)]
        if waiting and self._injection.begin_press():
            self.starts.append(time)
            for run in waiting:
                run.trigger(time, self._injection.of_run())

    def feed(self, motions: Motions) -> None:
        """Receive the motion of one controller sample."""
        self._last = motions
        for run in self.runs:
            run.feed(motions)

    @property
    def busy(self) -> bool:
        """Whether an acquisition needs simulated time to advance."""
        return any(run.waiting_for_time for run in self.runs)

    @property
    def awaited(self) -> bool:
        """Whether a thread waits for samples that are complete."""
        return any(run.due for run in self.runs)

    def stop(self) -> None:
        """End all acquisitions."""
        for run in self.runs:
            run.stopped = True

    def fail(self, error: Exception) -> None:
        """End all acquisitions, and refuse new ones, because the bench has failed."""
        self._failure = lambda: DaqmxError(-50150, f"The stand-in has failed: {error}")
        for run in self.runs:
            run.fail(self._failure)
