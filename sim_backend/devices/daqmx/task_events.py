"""The events of a task: every n samples, each sample, and its end; each is a stream of answers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import wraps
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.attributes import call, given, refuse
from sautereau.sim_backend.devices.daqmx.card import Run, ServerGone
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import FINITE

_WAIT = 0.05
"""s, after which a stream checks whether its client and its task are still there."""
_ACQUIRED = 1
_SIGNALS = (12487, 12530)
"""Sample clock and sample complete, which occur once for each sample."""
EVERY_N, DONE, SIGNAL = "every n samples", "done", "signal"
"""Kinds of events."""


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
class Registration:
    """One registered event of a task."""

    kind: str


def _register(task: CardTask, kind: str, taken: int) -> Registration:
    """Register an event; ``taken`` is the error where it is registered already."""
    if task.run is not None:
        raise DaqmxError(-200960, f"The event {kind} cannot be registered while the task runs.")
    registration = Registration(kind)
    if task.events.setdefault(kind, registration) is not registration:
        raise DaqmxError(taken, f"The event {kind} is already registered.")
    return registration


class Events:
    """The part of the servicer that sends events."""

    _task: Callable[[Any], CardTask]
    _tasks: dict[str, CardTask]
    _closing: Any

    @_stream
    def RegisterEveryNSamplesEvent(self, request, context):  # noqa: N802
        task = self._task(request)
        kind = given(request, "every_n_samples_event_type")
        n = request.n_samples
        if kind != _ACQUIRED:
            raise DaqmxError(-200980, "An input task has no samples to transfer.")
        if not n:
            raise DaqmxError(-200880, "Every 0 samples is not possible.")
        answer = pb.RegisterEveryNSamplesEventResponse(
            every_n_samples_event_type_raw=kind, n_samples=n
        )
        yield from self._every(n, answer, task, _register(task, EVERY_N, -200966), context)

    @_stream
    def RegisterDoneEvent(self, request, context):  # noqa: N802
        task = self._task(request)
        registration = _register(task, DONE, -200950)
        for run in self._runs(task, registration, context):
            while self._waits(task, run, registration, context):
                goal = task.length if task.mode == FINITE else 0
                try:
                    over, status = run.wait_for(goal, _WAIT) >= task.length, 0
                except DaqmxError as fault:
                    over, status = True, fault.code
                if over:
                    yield pb.RegisterDoneEventResponse(status=status)
                    break
                self._closing.wait(0 if goal else _WAIT)

    @_stream
    def RegisterSignalEvent(self, request, context):  # noqa: N802
        task, signal = self._task(request), given(request, "signal_id")
        if signal not in _SIGNALS:
            raise DaqmxError(-200987, f"The stand-in has no events of the signal {signal}.")
        answer = pb.RegisterSignalEventResponse(signal_id=signal)
        yield from self._every(1, answer, task, _register(task, SIGNAL, -200949), context)

    @call
    def UnregisterEveryNSamplesEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(EVERY_N, None)

    @call
    def UnregisterDoneEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(DONE, None)

    @call
    def UnregisterSignalEvent(self, request, context):  # noqa: N802
        self._task(request).events.pop(SIGNAL, None)

    def _every(
        self,
        n: int,
        answer: Any,
        task: CardTask,
        registration: Registration,
        context: grpc.ServicerContext,
    ) -> Iterator[Any]:
        """Yield an answer for every ``n`` samples of each run of a task."""
        for run in self._runs(task, registration, context):
            sent = 0
            while self._waits(task, run, registration, context):
                # A bench that is not paced runs only as far as somebody reads.
                goal = (sent + 1) * n if self._may_run(task, sent * n) else 0
                there = run.wait_for(goal, _WAIT)
                for _ in range(sent, there // n):
                    sent += 1
                    yield answer
                if there >= task.length:
                    break
                self._closing.wait(0 if goal else _WAIT)

    def _runs(
        self, task: CardTask, registration: Registration, context: grpc.ServicerContext
    ) -> Iterator[Run]:
        """Yield each run of a task once, until the client, the task or the event is gone.

        The client waits for the metadata, which say that its event is registered.
        """
        context.send_initial_metadata(())
        last = None
        try:
            while self._listens(task, registration, context):
                run = task.run
                if run is None or run is last:
                    self._closing.wait(_WAIT)
                else:
                    last = run
                    yield run
        finally:
            if task.events.get(registration.kind) is registration:
                del task.events[registration.kind]

    def _listens(
        self, task: CardTask, registration: Registration, context: grpc.ServicerContext
    ) -> bool:
        there = task.events.get(registration.kind) is registration and task.name in self._tasks
        return there and context.is_active() and not self._closing.is_set()

    def _waits(
        self, task: CardTask, run: Run, registration: Registration, context: grpc.ServicerContext
    ) -> bool:
        return task.run is run and self._listens(task, registration, context)

    def _may_run(self, task: CardTask, position: int) -> bool:
        return task.card.paced or task.mode == FINITE or task.position >= position
