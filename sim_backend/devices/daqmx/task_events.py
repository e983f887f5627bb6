"""The events of a task: every n samples, and its end; each is a stream of answers."""

from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.attributes import refuse
from sautereau.sim_backend.devices.daqmx.card import Run, ServerGone
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError
from sautereau.sim_backend.devices.daqmx.task import FINITE, CardTask

_WAIT = 0.05
"""s, after which a stream checks whether its client and its task are still there."""
_ACQUIRED = 1


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


class Events:
    """The part of the servicer that sends events."""

    _task: Callable[[Any], CardTask]
    _tasks: dict[str, CardTask]
    _closing: Any

    @_stream
    def RegisterEveryNSamplesEvent(self, request, context):  # noqa: N802
        task = self._idle(request, "every n samples")
        kind = request.every_n_samples_event_type_raw or request.every_n_samples_event_type
        n = request.n_samples
        if kind != _ACQUIRED:
            raise DaqmxError(-200965, "An input task has no samples to transfer.")
        if not n:
            raise DaqmxError(-200880, "Every 0 samples is not possible.")
        for run in self._runs(task, context):
            sent = 0
            while self._waits(task, run, context):
                # A bench that is not paced runs only as far as somebody reads.
                goal = (sent + 1) * n if self._may_run(task, sent * n) else 0
                there = run.wait_for(goal, _WAIT)
                for _ in range(sent, there // n):
                    sent += 1
                    yield pb.RegisterEveryNSamplesEventResponse(
                        every_n_samples_event_type_raw=kind, n_samples=n
                    )
                if there >= task.length:
                    break
                self._closing.wait(0 if goal else _WAIT)

    @_stream
    def RegisterDoneEvent(self, request, context):  # noqa: N802
        task = self._idle(request, "done")
        for run in self._runs(task, context):
            while self._waits(task, run, context):
                goal = task.length if task.mode == FINITE else 0
                try:
                    over, status = run.wait_for(goal, _WAIT) >= task.length, 0
                except DaqmxError as fault:
                    over, status = True, fault.code
                if over:
                    yield pb.RegisterDoneEventResponse(status=status)
                    break
                self._closing.wait(0 if goal else _WAIT)

    def _idle(self, request: Any, what: str) -> CardTask:
        task = self._task(request)
        if task.progress.run is not None:
            raise DaqmxError(-200960, f"The {what} event cannot be registered while it runs.")
        return task

    def _runs(self, task: CardTask, context: grpc.ServicerContext) -> Iterator[Run]:
        """Yield each run of a task once, until the client or the task is gone.

        The client waits for the metadata, which say that its event is registered.
        """
        context.send_initial_metadata(())
        last = None
        while context.is_active() and task.name in self._tasks and not self._closing.is_set():
            run = task.progress.run
            if run is None or run is last:
                self._closing.wait(_WAIT)
            else:
                last = run
                yield run

    def _waits(self, task: CardTask, run: Run, context: grpc.ServicerContext) -> bool:
        return task.progress.run is run and context.is_active() and not self._closing.is_set()

    def _may_run(self, task: CardTask, position: int) -> bool:
        return task.card.paced or task.mode == FINITE or task.progress.position >= position
