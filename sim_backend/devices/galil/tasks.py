"""The threads of a program: their turns, their errors, and the automatic subroutines."""

from collections.abc import Callable, Collection

from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.program import ERROR_ROUTINES, Program, Thread

THREADS = 8  # Threads, numbered from 0
LINE_TIME = 250e-6  # s, duration of any line of a program; the threads run alternately

GOLDEN = (5**0.5 - 1) / 2  # Its multiples, modulo 1, are spread evenly


class Tasks:
    """Runs threads, line by line.

    Args:
        execute: Carries out one command of a thread.
        store: Keeps an error's code for TC.
        report: Sends a message that no host asked for.
        error_routine: Whether #CMDERR is entered after a refused command.
    """

    def __init__(
        self,
        execute: Callable[[str, Thread], None],
        store: Callable[[int], None],
        report: Callable[[str], None],
        error_routine: bool = True,
    ) -> None:
        self.threads: dict[int, Thread] = {}
        self.failed_line, self.failed_thread = 0, -1
        """Line and thread of the last error."""
        self.current = -1
        """Number of the thread that runs a line."""
        self.pending: list[str] = []
        """Automatic subroutines that are due once."""
        self.phase = 0.0
        """Fraction of the sample that has passed when the present line runs."""
        self._execute, self._store, self._report = execute, store, report
        self._error_routine = error_routine
        self._busy, self._turns, self._served = 0.0, 0.0, -1
        self._idle = True
        self._entered: set[str] = set()
        """Automatic subroutines that have run since their conditions began to hold."""

    @property
    def in_error_routine(self) -> bool:
        """Whether thread 0 runs an automatic subroutine of an error."""
        return 0 in self.threads and any(
            name in ERROR_ROUTINES for name in self.threads[0].routines
        )

    def raise_once(self, label: str) -> None:
        """Make an automatic subroutine due, once."""
        if label not in self.pending:
            self.pending.append(label)

    def operand(self, code: str, number: int) -> int:
        """Return the value of _XQ, _HX or _ZS of a thread."""
        thread = self.threads.get(number)
        if code == "XQ":
            # A line that runs is about to be followed by the next: _XQ0-1 is that line itself.
            return -1 if thread is None else thread.line + (number == self.current)
        if code == "ZS":
            return 0 if thread is None else thread.depth
        return 0 if thread is None else 2 if thread.waiting else 1

    def halt(self, numbers: Collection[int] = range(THREADS)) -> None:
        """End threads, if they run."""
        for number in numbers:
            if number in self.threads:
                self.threads.pop(number).running = False

    def enter(self, label: str, program: Program) -> bool:
        """Run an automatic subroutine in thread 0, whether or not that runs.

        Returns:
            Whether it is entered: the program must have it, and no other of its kind may run.
        """
        if label not in program.labels:
            return False
        line, thread = program.labels[label], self.threads.get(0)
        if thread is None:
            self.threads[0] = Thread(program, line, hosted=False, routine=label)
            return True
        busy = ERROR_ROUTINES if label in ERROR_ROUTINES else (label,)
        stuck = thread.stuck and label in ERROR_ROUTINES
        if stuck or any(name in busy for name in thread.routines):
            return False
        try:
            thread.call(line, label)
        except CommandError:
            return False
        return True

    def raise_events(self, active: Collection[str], program: Program) -> None:
        """Enter the automatic subroutine of a condition that holds, or of a past event."""
        self._entered &= set(active)
        if not active and not self.pending:
            return
        for label in (*ERROR_ROUTINES, "#MCTIME"):
            if label in active:
                if self.enter(label, program):
                    self.threads[0].looped = label in self._entered
                    self._entered.add(label)
            elif label in self.pending:
                entered = self.enter(label, program)
                if entered or label not in program.labels or not self.in_error_routine:
                    self.pending.remove(label)

    def run(self, sample_time: float, program: Program, held: Collection[int]) -> None:
        """Run the threads alternately, as many lines as fit into a sample.

        Args:
            sample_time: s.
            held: Numbers of threads that must not run.
        """
        share = LINE_TIME / sample_time
        if self._idle:  # not synchronous with the samples, it looks at waits once per line's time
            self._turns = (self._turns + GOLDEN) % 1
            self._busy = self._turns * share
        self.phase = self._busy
        for number, thread in sorted(self.threads.items()):
            if number not in held and thread.wait is not None and not thread.waiting:
                self._run_line(number, thread, program)  # the rest of a line that was counted
        self._idle = False
        while self._busy < 1:
            ready = [n for n, each in self.threads.items() if n not in held and not each.waiting]
            if not ready:
                self._idle = True
                break
            later = [number for number in ready if number > self._served]
            self._served = min(later or ready)
            self.phase = self._busy
            self._busy += share
            self._run_line(self._served, self.threads[self._served], program)
        self._busy = max(0.0, self._busy - 1)

    def _run_line(self, number: int, thread: Thread, program: Program) -> None:
        if not thread.running:
            return
        self.current = number
        try:
            thread.run_line(self._execute)
        except CommandError as error:
            # #CMDERR ends the failing thread unless that is thread 0; without it, all end.
            self._store(error.code)
            self.failed_line, self.failed_thread = thread.line, number
            if number != 0:
                self.halt([number])
            if not (self._error_routine and self.enter("#CMDERR", program)):
                self._report(f"?{thread.line} {thread.command}\r\n")
                self.halt()
        finally:
            self.current = -1
        if not thread.running and self.threads.get(number) is thread:
            del self.threads[number]
