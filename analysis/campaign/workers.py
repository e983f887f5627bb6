"""One function over many items: in this process, on this machine's cores, or on a cluster.

A function and its items have to be importable where they run: of a module, and not typed into a
console. Items are best pieces of work of a tenth of a second or more, for each is sent by itself.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from sautereau.analysis.errors import AnalysisError

if TYPE_CHECKING:
    from concurrent.futures import Future

Item = TypeVar("Item")
Result = TypeVar("Result")
Where = int | str
"""Processes on this machine, of which 1 is the caller's own; or the address of a Dask scheduler."""

WAITING = 3
"""Items for each worker that are sent ahead."""
BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""What tells numpy's linear algebra how many threads it may have: of several processes, one."""
PATIENCE = 10.0
"""s, within which a scheduler has to answer, and to have a worker."""


def run_over(
    function: Callable[[Item], Result], items: Sequence[Item], where: Where = 1
) -> Generator[tuple[int, Result], None, None]:
    """Yield the number and the result of every item, in the order in which they are ready.

    Whoever stops listening, or is interrupted, waits for the items that this machine is working
    on, and no other is begun. What the function raises is raised here.

    Args:
        function: Of a module, without side effects: a cluster calls it again for an item whose
            worker is lost.
        items: What it is called with, one at a time.
        where: See `Where`.

    Raises:
        AnalysisError: There are no such processes, no such cluster, or it is lost.
    """
    if isinstance(where, str):
        yield from _on_cluster(function, items, where)
    elif where < 1:
        raise AnalysisError(f"processes: {where} cannot work; give 1 or more")
    elif where == 1:
        for i, item in enumerate(items):
            yield i, function(item)
    else:
        yield from _on_cores(function, items, where)


def _on_cores(
    function: Callable[[Item], Result], items: Sequence[Item], processes: int
) -> Iterator[tuple[int, Result]]:
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    # Not by fork: readers of recordings have threads, whose locks a fork would copy as they are.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, mp_context=context, initializer=_begin_worker)
    waiting: dict[Future[Result], int] = {}
    try:
        for i, item in enumerate(items):
            waiting[pool.submit(function, item)] = i
            if len(waiting) >= WAITING * processes:
                ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in ready:
                    yield waiting.pop(future), future.result()
        while waiting:
            ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in ready:
                yield waiting.pop(future), future.result()
    except BrokenProcessPool as error:
        raise AnalysisError(
            f"one of {processes} processes was ended from outside, as by a lack of memory;"
            " call again, with fewer processes if it happens again"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, end with it, and take one core."""
    import multiprocessing
    import os
    import signal
    import threading

    for threads in BLAS:  # before numpy is imported
        os.environ.setdefault(threads, "1")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, name="parent", daemon=True).start()


def _on_cluster(
    function: Callable[[Item], Result], items: Sequence[Item], address: str
) -> Iterator[tuple[int, Result]]:
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise AnalysisError(
            f"cluster {address}: Dask is not installed; pip install 'sautereau[cluster]'"
        ) from error
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise AnalysisError(
            f"cluster {address}: no scheduler answered within {PATIENCE:g} s ({error}); give the"
            " address that `dask scheduler` tells, as tcp://192.168.1.2:8786"
        ) from error
    with client:
        workers = _workers(client, address)
        numbers: dict[Any, int] = {}
        left = iter(enumerate(items))
        futures = as_completed(loop=client.loop)

        def send(most: int) -> None:
            for i, item in islice(left, most):
                future = client.submit(function, item, pure=False)
                numbers[future.key] = i
                futures.add(future)

        send(WAITING * workers)
        for future in futures:
            yield numbers.pop(future.key), _result(future, address)
            future.release()
            send(1)


def _workers(client: Any, address: str) -> int:
    """Return how many items a cluster works on at once."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise AnalysisError(
            f"cluster {address}: its scheduler had no worker within {PATIENCE:g} s; start some by"
            f" `dask worker {address}`"
        ) from error
    return sum(client.nthreads().values())


def _result(future: Any, address: str) -> Any:
    from concurrent.futures import CancelledError

    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        return future.result()
    except (KilledWorker, CancelledError, CommClosedError) as error:
        raise AnalysisError(
            f"cluster {address}: work was lost with its workers or its scheduler ({error});"
            " look at their logs, and call again"
        ) from error
