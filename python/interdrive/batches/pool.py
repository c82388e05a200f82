"""Worker processes that may die, hang or grow too large; their task is then repeated once by another process.

A task waits in the parent until a process is free, so that nothing is lost with a process but the one task it works on.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from interdrive.errors import InterdriveError
from interdrive.planners.workers import end_with_the_parent, uninterrupted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

T = TypeVar("T")

#: A process that starts has this long until it is ready [s]; it imports the package.
_START_MAX = 120.0
#: How often limits are looked at [s].
_LOOK_EVERY = 0.2
#: A task is started at most so often.
ATTEMPTS_MAX = 2
#: Processes may die before they are ready so often in a row.
_STILLBORN_MAX = 3
#: Libraries below numpy and Arrow start as many threads as these say.
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")


@dataclass(frozen=True)
class Task(Generic[T]):
    """Something to do in another process.

    Attributes:
        payload: What the function gets; it must be possible to pickle it.
        group: Tasks of the same group are best done by the same process.
    """

    payload: T
    group: str = ""


@dataclass(frozen=True)
class End(Generic[T]):
    """How a task ended.

    Attributes:
        task: The task.
        value: What the function returned; None if it was lost.
        lost: "crashed", "timeout" or "memory" if every attempt was lost; "" otherwise.
        why: In words.
        attempts: How often it was started.
    """

    task: Task[T]
    value: Any
    lost: str = ""
    why: str = ""
    attempts: int = 1


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    is_ready: bool = False
    task: Task[Any] | None = None
    attempts: int = 0
    since: float = field(default_factory=time.monotonic)
    group: str = ""


class Pool:
    """Processes (spawn) with one native thread each."""

    def __init__(self, workers: int, *, timeout_s: float = float("inf"), memory: float = float("inf")) -> None:
        """Starts nothing yet.

        Args:
            workers: How many processes.
            timeout_s: A task may take this long [s].
            memory: A process may have this much resident memory [bytes].
        """
        self._n, self._timeout_s, self._memory = workers, timeout_s, memory
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []
        self._stillborn = 0

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends all processes at once, whatever they are doing."""
        for worker in self._workers:
            worker.connection.close()
            worker.process.kill()
        for worker in self._workers:
            worker.process.join()
        self._workers.clear()

    def run(self, function: Callable[[T, int], Any], take: Callable[[str], Task[T] | None]) -> Iterator[End[T]]:
        """Does tasks until there are none and yields how they ended, in the order in which they end.

        Args:
            function: Called in a process with the payload and the number of the attempt.
            take: Gives the next task for a process, which is told the group that the process was busy with last.

        Raises:
            InterdriveError: Processes do not start.
        """
        again: list[tuple[Task[T], int]] = []
        exhausted = False
        while True:
            for worker in [item for item in self._workers if item.is_ready and item.task is None]:
                task, attempts = again.pop() if again else (take(worker.group), 0)
                if task is None:
                    exhausted = True
                    break
                self._assign(worker, function, task, attempts + 1)
            busy = [worker for worker in self._workers if worker.task is not None]
            if exhausted and not busy and not again:
                return
            if not exhausted or again:
                self._fill()
            for worker, lost, why in self._watched():
                task, attempts = worker.task, worker.attempts
                if lost is None:  # an answer
                    worker.task = None
                    if task is not None:
                        yield End(task, why, attempts=attempts)
                    continue
                self._remove(worker)
                if task is None:
                    continue
                if attempts < ATTEMPTS_MAX:
                    again.append((task, attempts))
                else:
                    yield End(task, None, lost, why, attempts)

    def _fill(self) -> None:
        """As many processes as there should be."""
        while len(self._workers) < self._n:
            ours, theirs = self._context.Pipe()
            # A daemon could not start the processes of planners.
            process = self._context.Process(target=_work, args=(theirs,), daemon=False, name="interdrive-batch")
            with _STARTING, _one_thread(), uninterrupted():
                process.start()
                theirs.close()
                self._workers.append(_Worker(process, ours))

    def _assign(self, worker: _Worker, function: Callable[[T, int], Any], task: Task[T], attempts: int) -> None:
        worker.task, worker.attempts, worker.group = task, attempts, task.group
        worker.since = time.monotonic()
        with suppress(OSError):  # it died in the meantime, which its sentinel tells
            worker.connection.send((function, task.payload, attempts))

    def _watched(self) -> Iterator[tuple[_Worker, str | None, Any]]:
        """What happened to processes: (worker, None, answer) or (worker, how it was lost, why)."""
        things: list[Any] = [worker.connection for worker in self._workers]
        things += [worker.process.sentinel for worker in self._workers]
        happened = wait(things, _LOOK_EVERY)
        now = time.monotonic()
        for worker in list(self._workers):
            if worker.connection in happened or not worker.process.is_alive():
                answer = self._received(worker)
                if answer is _LATE:
                    yield worker, "timeout", self._too_long()
                elif answer is _NOTHING:
                    yield worker, "crashed", self._obituary(worker)
                elif not worker.is_ready:
                    worker.is_ready, self._stillborn = True, 0
                else:
                    yield worker, None, answer
                continue
            spent = now - worker.since
            if not worker.is_ready and spent > _START_MAX:
                self._count_stillborn(f"are not ready within {_START_MAX:g} s")
                yield worker, "crashed", "it was not ready in time"
                continue
            if worker.task is None:
                continue
            if spent > self._timeout_s:
                yield worker, "timeout", self._too_long()
            elif resident_memory(worker.process.pid) > self._memory:
                yield worker, "memory", f"its process exceeded {self._memory / 2**20:.0f} MiB (--memory)"

    def _received(self, worker: _Worker) -> object:
        """What a process says: `_NOTHING` if it is gone, `_LATE` if it does not come to its end in time."""
        found: list[object] = []

        def receive() -> None:
            try:
                found.append(worker.connection.recv() if worker.connection.poll() else _NOTHING)
            except (EOFError, OSError):
                found.append(_NOTHING)

        if worker.task is None or math.isinf(self._timeout_s):
            receive()
            return found[0]
        thread = threading.Thread(target=receive, daemon=True)
        thread.start()
        thread.join(max(1.0, worker.since + self._timeout_s - time.monotonic()))
        if thread.is_alive():
            worker.process.kill()  # which ends what the thread waits for
            thread.join()
            return _LATE
        return found[0]

    def _too_long(self) -> str:
        return f"it took longer than {self._timeout_s:g} s (--run-timeout)"

    def _count_stillborn(self, what: str) -> None:
        """Processes that never get ready are replaced, but not for ever."""
        self._stillborn += 1
        if self._stillborn >= _STILLBORN_MAX:
            raise InterdriveError(f"worker processes {what}")

    def _obituary(self, worker: _Worker) -> str:
        worker.process.join(5.0)
        code = worker.process.exitcode
        if not worker.is_ready:
            self._count_stillborn(
                f"ended at once (exit code {code}); does the script guard its calls by `if __name__ == '__main__':`?"
            )
        if code is not None and code < 0:
            name = signal.Signals(-code).name
            return f"its process was killed ({name}{'; out of memory?' if name == 'SIGKILL' else ''})"
        return f"its process ended (exit code {code})"

    def _remove(self, worker: _Worker) -> None:
        worker.connection.close()
        worker.process.kill()
        worker.process.join()
        self._workers.remove(worker)


_NOTHING, _LATE = object(), object()
#: Processes are started by one thread at a time: the environment and the signals of the process change meanwhile.
_STARTING = threading.Lock()


def resident_memory(pid: int | None) -> int:
    """Memory that a process occupies [bytes]; 0 where the system does not say."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that start now have one thread in the libraries that they load."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _work(connection: Connection) -> None:
    """Runs in the process until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=end_with_the_parent, daemon=True).start()
    import interdrive.batches.job  # noqa: F401, PLC0415 - before the clock runs

    connection.send("ready")
    while True:
        try:
            function, payload, attempts = connection.recv()
        except (EOFError, OSError):
            return
        answer = function(payload, attempts)
        try:
            connection.send(answer)
        except OSError:
            return
