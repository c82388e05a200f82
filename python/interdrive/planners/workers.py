"""Planners in Python that run in separate processes, because their class has `parallel = True`.

Every worker process stages the same world, which never steps: it only turns the scenes that it receives into views. A
planner stays in the process in which it was made, so it may keep state. How many processes there are depends on the
number of planners alone, so that results do not depend on the number of threads, which says how many of them work at a
time. If a planner raises an exception, only its own agent ends. If it kills its process, or hangs where no signal
reaches it, the other planners of the process are lost as well: none up to `PROCESSES_MAX` planners.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import signal
import threading
import time
import weakref
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, cast

from interdrive.errors import InputError
from interdrive.foreign import failure
from interdrive.planners.calls import Failure, ask

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

    from interdrive import _core
    from interdrive.planners.calls import Answer
    from interdrive.planners.contract import Planner

#: More planners than this share processes: each imports the package and stages the world (about 80 MB, 0.3 s).
PROCESSES_MAX = 8
#: Time limit for the start of a process [s]; it imports the package and stages the world.
_START_MAX = 120.0
#: A call that exceeds its limit by this much [s] does not react to signals: its process is killed.
_GRACE = 1.0


@dataclass(frozen=True)
class Wanted:
    """What one agent needs besides the scene.

    Attributes:
        progress: Where it is and what it must not pass: `_progress` of its `Ego`.
        known: What it knows, for an agent with V2X.
        predictions: Predictions for those, for an agent with V2X.
        driver: What its driver has drawn, if it has one.
    """

    progress: tuple[float, float, list[tuple[float, float, int, int | None]]]
    known: list[tuple[Any, ...]] | None = None
    predictions: _core.Predictions | None = None
    driver: dict[str, float] | None = None


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    agents: tuple[int, ...]
    #: Why the process was lost.
    lost: str = ""


class Workers:
    """Processes with one or more planners each."""

    def __init__(
        self,
        stage: Callable[[], _core.World],
        make: Mapping[int, Callable[[], Planner]],
        at_once: int,
        timeout_s: float = math.inf,
    ) -> None:
        """Starts the processes and waits until all are ready.

        Args:
            stage: Makes a world with the participants of the simulation; it is sent to the processes.
            make: Makes the planner of each agent; it is sent to the processes.
            at_once: So many processes work at a time.
            timeout_s: Time limit of a call [s].

        Raises:
            InputError: A process does not start, or a planner cannot be made there.
        """
        self._at_once, self._timeout_s = at_once, timeout_s
        self.seconds: dict[int, tuple[float, float]] = {}
        ids = sorted(make)
        n_processes = min(PROCESSES_MAX, len(ids))
        context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []
        self._close = weakref.finalize(self, _stop, self._workers)
        for k in range(n_processes):
            agents = tuple(ids[k::n_processes])
            ours, theirs = context.Pipe()
            arguments = (theirs, stage, {i: make[i] for i in agents}, timeout_s)
            process = context.Process(target=_work, args=arguments, daemon=True, name=f"interdrive-planners-{k}")
            with uninterrupted():
                process.start()
            theirs.close()
            self._workers.append(_Worker(process, ours, agents))
        for worker in self._workers:
            self._await_start(worker)

    def _await_start(self, worker: _Worker) -> None:
        problem = "it did not start in time"
        try:
            if worker.connection.poll(_START_MAX):
                problem = worker.connection.recv()
        except (EOFError, OSError):
            problem = "it ended at once; does the script guard its calls by `if __name__ == '__main__':`?"
        if problem:
            self.close()
            raise InputError(
                f"planners of agents {', '.join(map(str, worker.agents))} in a separate process: {problem}"
            )

    def ask(self, scene: _core.Scene, predictions: _core.Predictions, wanted: dict[int, Wanted]) -> dict[int, Answer]:
        """Calls all requested planners and returns their results.

        Args:
            scene: The present scene.
            predictions: Predictions for all participants.
            wanted: Agent id -> what it needs besides.

        Afterwards `seconds` says how long the view and the call of each agent that answered took in its process.
        """
        self.seconds = {}
        parts = pickle.dumps((scene.parts(), predictions), protocol=pickle.HIGHEST_PROTOCOL)
        answers: dict[int, Answer] = {}
        idle = [(worker, mine) for worker in self._workers if (mine := [i for i in worker.agents if i in wanted])]
        idle.reverse()
        #: Those that work: the agents whose answers are to come, and until when the next one must be there.
        busy: dict[Connection, tuple[_Worker, list[int], float]] = {}
        while idle or busy:
            while idle and len(busy) < self._at_once:
                worker, mine = idle.pop()
                self._send(worker, (parts, [(i, wanted[i]) for i in mine]))
                if worker.lost:
                    answers |= dict.fromkeys(mine, Failure(worker.lost))
                else:
                    busy[worker.connection] = worker, mine, self._deadline()
            first = min((until for _, _, until in busy.values()), default=math.inf)
            ready = wait(list(busy), None if math.isinf(first) else max(0.0, first - time.monotonic()))
            for connection, (worker, mine, until) in list(busy.items()):
                if connection not in ready and time.monotonic() < until:
                    continue
                del busy[connection]
                agent, *rest = mine
                answers[agent] = self._receive(worker, agent, in_time=connection in ready)
                if worker.lost:
                    answers |= dict.fromkeys(rest, Failure(worker.lost))
                elif rest:
                    busy[connection] = worker, rest, self._deadline()
        return answers

    def _deadline(self) -> float:
        return time.monotonic() + self._timeout_s + _GRACE

    @staticmethod
    def _send(worker: _Worker, request: object) -> None:
        if not worker.lost:
            try:
                worker.connection.send(request)
            except OSError:
                worker.lost = "its process ended"

    def _receive(self, worker: _Worker, agent: int, *, in_time: bool) -> Answer:
        """The next answer; without one the process is lost with all its planners."""
        blame = f"the planner of agent {agent}"
        if not in_time:
            worker.lost = f"its process was killed: {blame} took too long (step.planner_timeout_s)"
            worker.process.kill()
            return Failure(worker.lost)
        try:
            answer, self.seconds[agent] = worker.connection.recv()
            return cast("Answer", answer)
        except (EOFError, OSError):
            worker.process.join(1.0)
            worker.lost = f"its process ended in {blame} (exit code {worker.process.exitcode})"
            return Failure(worker.lost)

    def close(self) -> None:
        """Ends the processes."""
        self._close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Blocks Ctrl-C until new processes can ignore it; this thread gets it a moment later."""
    resource_tracker.ensure_running()  # it would lift the block when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    try:
        # It may raise because of a Ctrl-C just before, although the signal is already blocked.
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_the_parent() -> None:
    """Ends the process with its parent; otherwise an unwanted run or a planner in an endless loop might never end."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def can_be_sent(thing: object) -> bool:
    """Whether the object can be pickled for another process."""
    try:
        pickle.dumps(thing)
    except Exception:  # noqa: BLE001 - whatever its pickling raises
        return False
    return True


def _stop(workers: list[_Worker]) -> None:
    for worker in workers:
        worker.connection.close()
    for worker in workers:
        worker.process.join(2.0)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


def _work(
    connection: Connection,
    stage: Callable[[], _core.World],
    make: Mapping[int, Callable[[], Planner]],
    timeout_s: float,
) -> None:
    """Runs in the worker process until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=end_with_the_parent, daemon=True).start()
    try:
        world, planners = stage(), {i: factory() for i, factory in make.items()}
    except BaseException as error:  # noqa: BLE001 - reported to the parent
        connection.send(failure(error))
        return
    connection.send("")
    while True:
        try:
            request: Any = connection.recv()
        except (EOFError, OSError):
            return
        parts, wanted = request
        scene_parts, predictions = pickle.loads(parts)
        scene = world.scene_from(scene_parts)
        for i, told in wanted:
            begin = time.perf_counter()
            view = world.view(scene, i, told.progress, told.known, told.driver)
            seen = predictions.seen_by(view) if told.predictions is None else told.predictions
            asked = time.perf_counter()
            try:
                answer = ask(planners[i], view, seen, timeout_s)
            except KeyboardInterrupt as error:  # Ctrl-C of the terminal is ignored here
                answer = Failure(failure(error))
            connection.send((answer, (asked - begin, time.perf_counter() - asked)))
