"""Planners in Python that run in separate processes, because their class has `parallel = True`.

Every worker process stages the same world, which never steps: it only turns the scenes that it receives into views. A
planner stays in the process in which it was made, so it may keep state; results do not depend on the number of
processes. If a planner raises an exception, only its own agent ends. If it kills its process, or hangs where no signal
reaches it, the other planners of the process are lost as well.
"""

from __future__ import annotations

import math
import multiprocessing
import pickle
import signal
import weakref
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
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

#: Time limit for the start of a process [s]; it imports the package and stages the world.
_START_MAX = 120.0
#: A call that exceeds its limit by this much [s] does not react to signals: its process is killed.
_GRACE = 1.0


@dataclass(frozen=True)
class Wanted:
    """What one agent needs besides the scene.

    Attributes:
        progress: `s`, `stop_s`, `stop_release` and `stop_by` of its `Ego`.
        known: What it knows, for an agent with V2X.
        predictions: Predictions for those, for an agent with V2X.
    """

    progress: tuple[float, float, float, int | None]
    known: list[tuple[Any, ...]] | None = None
    predictions: _core.Predictions | None = None


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
        n_processes: int,
        timeout_s: float = math.inf,
    ) -> None:
        """Starts the processes and waits until all are ready.

        Args:
            stage: Makes a world with the participants of the simulation; it is sent to the processes.
            make: Makes the planner of each agent; it is sent to the processes.
            n_processes: Number of processes, at most one per agent.
            timeout_s: Time limit of a call [s].

        Raises:
            InputError: A process does not start, or a planner cannot be made there.
        """
        self._timeout_s = timeout_s
        ids = sorted(make)
        context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []
        self._close = weakref.finalize(self, _stop, self._workers)
        for k in range(min(n_processes, len(ids))):
            agents = tuple(ids[k :: min(n_processes, len(ids))])
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
        """
        parts = pickle.dumps((scene.parts(), predictions), protocol=pickle.HIGHEST_PROTOCOL)
        asked = []
        for worker in self._workers:
            mine = [(i, wanted[i]) for i in worker.agents if i in wanted]
            if mine and not worker.lost:
                try:
                    worker.connection.send((parts, mine))
                except OSError:
                    worker.lost = "its process ended"
            asked.append((worker, [i for i, _ in mine]))
        answers: dict[int, Answer] = {}
        for worker, mine_ids in asked:
            for i in mine_ids:
                answers[i] = Failure(worker.lost) if worker.lost else self._receive(worker, i)
        return answers

    def _receive(self, worker: _Worker, agent: int) -> Answer:
        """The next result; without one the process is lost with all its planners."""
        blame = f"the planner of agent {agent}"
        limit = None if math.isinf(self._timeout_s) else self._timeout_s + _GRACE
        try:
            if worker.connection.poll(limit):
                return cast("Answer", worker.connection.recv())
            worker.lost = f"its process was killed: {blame} took too long (step.planner_timeout_s)"
            worker.process.kill()
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
            view = world.view(scene, i, told.progress, told.known)
            seen = predictions.seen_by(view) if told.predictions is None else told.predictions
            try:
                answer = ask(planners[i], view, seen, timeout_s)
            except KeyboardInterrupt as error:  # Ctrl-C of the terminal is ignored here
                answer = Failure(failure(error))
            connection.send(answer)
