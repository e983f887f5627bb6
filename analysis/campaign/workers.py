"""Call one function on many items: in this process, on this machine's cores, or on a cluster.

The function must be importable where it runs: defined in a module, not in a console. Each item is
sent separately, so an item should be at least a tenth of a second of work.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from importlib.metadata import version
from typing import Any, TypeVar

from sautereau.analysis.errors import AnalysisError
from sautereau.rig.version import made_by

Item = TypeVar("Item")
Result = TypeVar("Result")
Where = int | str  # Processes here, where 1 is the calling one, or the address of a Dask scheduler

LIBRARIES = ("numpy", "scipy")  # Those that compute the results besides sautereau
BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment variables for the number of threads of numpy's linear algebra; 1 in each worker."""
TIMEOUT = 10.0  # s, for a scheduler to answer, and to have a worker


@cache
def computed_by() -> str:
    """Return what computes results here: equal texts give equal results.

    Version and code of sautereau, as `sautereau.rig.version.made_by`, and versions of `LIBRARIES`.
    """
    libraries = (f"{name} {version(name)}" for name in LIBRARIES)
    return f"{made_by()}, {', '.join(libraries)}"


def _stamped(function: Callable[[Item], Result], item: Item) -> tuple[str, Result]:
    """Return what computes a result, and the result."""
    return computed_by(), function(item)


def worthwhile(items: int, each: int) -> int:
    """Return how many processes shorten the work: one more for each so many items, one per core."""
    return min(os.cpu_count() or 1, 1 + items // each)


def run_over(
    function: Callable[[Item], Result], items: Sequence[Item], where: Where = 1
) -> Generator[tuple[int, Result], None, None]:
    """Yield the number and the result of every item, in the order of their completion.

    After an interruption, or when the caller closes the generator, no further item is started, and
    the items in work on this machine are completed. An exception of the function is raised here.

    Args:
        function: Defined in a module, and without side effects, because a cluster calls it again
            for an item whose worker was lost.
        where: See `Where`.

    Raises:
        AnalysisError: The number of processes is less than 1, a process was killed, or the cluster
            does not answer, was lost, or has workers that compute with another version.
    """
    if isinstance(where, str):
        yield from _on_cluster(function, items, where)
    elif where < 1:
        raise AnalysisError(f"processes: {where} is less than 1; give 1 or more")
    elif where == 1:
        for i, item in enumerate(items):
            yield i, function(item)
    else:
        yield from _on_cores(function, items, where)


def _on_cores(
    function: Callable[[Item], Result], items: Sequence[Item], processes: int
) -> Iterator[tuple[int, Result]]:
    # Not "fork", which would copy the locks of the recording readers' threads in any state.
    context = multiprocessing.get_context("spawn")
    if os.name == "nt":
        processes = min(processes, 61)  # all that Windows waits for at once
    pool = ProcessPoolExecutor(processes, mp_context=context, initializer=_start_worker)
    try:
        yield from _through(pool, function, items, processes)
    except BrokenProcessPool as error:
        raise AnalysisError(
            f"one of {processes} processes was killed, for example because memory ran out; run the"
            " command again, with fewer processes if this is repeated"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _through(
    pool: Executor, function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[tuple[int, Result]]:
    """Yield the results of an executor, for which at most three items per worker wait."""
    waiting: dict[Future[Result], int] = {}
    for i, item in enumerate(items):
        waiting[pool.submit(function, item)] = i
        limit = 3 * workers if i + 1 < len(items) else 1
        while len(waiting) >= limit:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()


def _start_worker() -> None:
    """Leave Ctrl-C to the parent process, end when it ends, and use one core."""
    for threads in BLAS:  # before numpy is imported
        os.environ.setdefault(threads, "1")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, name="parent", daemon=True).start()


def _on_cluster(
    function: Callable[[Item], Result], items: Sequence[Item], address: str
) -> Iterator[tuple[int, Result]]:
    try:
        from distributed import Client, KilledWorker
        from distributed.comm.core import CommClosedError
    except ImportError as error:
        raise AnalysisError(
            f"cluster {address}: Dask is not installed; pip install 'sautereau[cluster]'"
        ) from error
    try:
        client = Client(address, timeout=TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise AnalysisError(
            f"cluster {address}: no scheduler answered within {TIMEOUT:g} s ({error}); give the"
            " address that `dask scheduler` prints, such as tcp://192.168.1.2:8786"
        ) from error
    with client:
        workers = _workers(client, address)
        try:
            pool = client.get_executor(pure=False)
            for i, (computed, result) in _through(
                pool, partial(_stamped, function), items, workers
            ):
                if computed != computed_by():  # of a worker that has come since
                    raise _mixed(address, {"a worker that has come since": computed})
                yield i, result
        except (KilledWorker, CancelledError, CommClosedError) as error:
            raise AnalysisError(
                f"cluster {address}: workers or the scheduler ended during the work ({error}); look"
                " at their logs, and run the command again"
            ) from error


def _mixed(address: str, others: Mapping[str, str]) -> AnalysisError:
    listed = "".join(f"\n  {worker}: {computed}" for worker, computed in others.items())
    return AnalysisError(
        f"cluster {address}: these workers would compute other results than this machine"
        f" ({computed_by()}); install the same versions there, and start them again:{listed}"
    )


def _workers(client: Any, address: str) -> int:
    """Return the number of items that a cluster works on at the same time.

    Raises:
        AnalysisError: It has no workers, or some compute with another version.
    """
    try:
        client.wait_for_workers(1, timeout=TIMEOUT)
    except TimeoutError as error:
        raise AnalysisError(
            f"cluster {address}: its scheduler had no worker within {TIMEOUT:g} s; start some with"
            f" `dask worker {address}`"
        ) from error
    found = client.run(computed_by, on_error="return")  # an older version lacks the function
    others = {
        worker: " ".join(f"{type(said).__name__}: {said}".split())
        if isinstance(said, BaseException)
        else said
        for worker, said in found.items()
        if said != computed_by() and not isinstance(said, OSError)  # it has ended
    }
    if others:
        raise _mixed(address, others)
    return sum(client.nthreads().values())
