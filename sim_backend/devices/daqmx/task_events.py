"""The events of a task: every n samples, each sample, and its end; each is a stream of answers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import wraps
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.attributes import call, given, refuse
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, Run, ServerGone
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import FINITE

_WAIT = 0.05  # s, after which a stream checks whether its client and its task are still there
_ACQUIRED = 1
EVERY_N, DONE, SIGNAL = "every n samples", "done", "signal"  # Kinds of events


def _stream(method: Callable[..., Any]) -> Callable[..., Any]:
    """Answer the driver's errors of a stream."""

    @wraps(method)
    def answers(self: Any, request: Any, context: grpc.ServicerContext) -> Iterator[Any]:
        try:
            yield from method(self, request, context)
        except DaqmxError as fault:
            refuse(fault, context)
        except ServerGone:
            context.abort(grpc.StatusCode.UNAVAILABLE, "Socket closed")

    return answers


@dataclass(frozen=True, eq=False)
class Listener:
    """A client that waits for an event of a task."""

    kind: str
    task: CardTask
    context: grpc.ServicerContext
    server: "Events"

    def wait(self, seconds: float) -> None:
        """Wait, or until the server closes."""
        self.server._closing.wait(seconds)

    @property
    def there(self) -> bool:
        """Whether client, task, registration and server still exist."""
        registered = self.task.events.get(self.kind) is self
        known = self.task.name in self.server._tasks
        return (
            registered and known and self.context.is_active() and not self.server._closing.is_set()
        )

    def runs(self) -> Iterator[Run]:
        """Yield each run of the task once, while the listener is there.

        The client waits for the metadata, which say that its event is registered.
        """
        self.context.send_initial_metadata(())
        last = None
        try:
            while self.there:
                run = self.task.run
                if run is None or run is last:
                    self.wait(_WAIT)
                else:
                    last = run
                    yield run
        finally:
            if self.task.events.get(self.kind) is self:
                del self.task.events[self.kind]

    def waits(self, run: Run) -> bool:
        """Return whether a run of the task continues while the listener is there."""
        return self.task.run is run and self.there

    def every(self, n: int, answer: Any) -> Iterator[Any]:
        """Yield an answer for every ``n`` samples of each run."""
        task = self.task
        for run in self.runs():
            sent = 0
            while self.waits(run):
                # A bench that is not paced runs only as far as somebody reads.
                free = task.card.paced or task.mode == FINITE or task.position >= sent * n
                goal = (sent + 1) * n if free else 0
                there = run.wait_for(goal, _WAIT)
                for _ in range(sent, there // n):
                    sent += 1
                    yield answer
                if there >= task.length:
                    break
                self.wait(0 if goal else _WAIT)


class Events:
    """The part of the servicer that sends events."""

    _task: Callable[[Any], CardTask]
    _tasks: dict[str, CardTask]
    _closing: Any

    def _register(self, request: Any, context: Any, kind: str, taken: int) -> Listener:
        """Register an event; ``taken`` is the error where it is registered already."""
        task = self._task(request)
        if task.run is not None:
            raise DaqmxError(-200960, f"The event {kind} cannot be registered while the task runs.")
        listener = Listener(kind, task, context, self)
        if task.events.setdefault(kind, listener) is not listener:
            raise DaqmxError(taken, f"The event {kind} is already registered.")
        return listener

    @_stream
    def RegisterEveryNSamplesEvent(self, request, context):  # noqa: N802
        kind = given(request, "every_n_samples_event_type")
        n = request.n_samples
        if kind != _ACQUIRED:
            raise DaqmxError(-200980, "An input task has no samples to transfer.")
        if not n:
            raise DaqmxError(-200880, "Every 0 samples is not possible.")
        answer = pb.RegisterEveryNSamplesEventResponse(
            every_n_samples_event_type_raw=kind, n_samples=n
        )
        yield from self._register(request, context, EVERY_N, -200966).every(n, answer)

    @_stream
    def RegisterDoneEvent(self, request, context):  # noqa: N802
        listener = self._register(request, context, DONE, -200950)
        task = listener.task
        for run in listener.runs():
            while listener.waits(run):
                goal = task.length if task.mode == FINITE else 0
                try:
                    over, status = run.wait_for(goal, _WAIT) >= task.length, 0
                except DaqmxError as fault:
                    over, status = True, fault.code
                if over:
                    yield pb.RegisterDoneEventResponse(status=status)
                    break
                listener.wait(0 if goal else _WAIT)

    @_stream
    def RegisterSignalEvent(self, request, context):  # noqa: N802
        signal = given(request, "signal_id")
        # Sample clock and sample complete, which occur once for each sample.
        if signal not in (12487, 12530):
            raise DaqmxError(-200987, f"The stand-in has no events of the signal {signal}.")
        answer = pb.RegisterSignalEventResponse(signal_id=signal)
        yield from self._register(request, context, SIGNAL, -200949).every(1, answer)

    @call
    def UnregisterEveryNSamplesEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(EVERY_N, None)

    @call
    def UnregisterDoneEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(DONE, None)

    @call
    def UnregisterSignalEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(SIGNAL, None)
