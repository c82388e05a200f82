"""The process of a batch that is connected to a Ray cluster: one Ray task per run, and no distribution beyond that.

On every node the run is done by a process of its own, as without Ray, with the same limits. Ray does a task again whose
node or process is lost.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from interdrive import _core
from interdrive.batches.pool import Pool, Task
from interdrive.errors import InputError, InterdriveError
from interdrive.planners.workers import end_with_the_parent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection
    from pathlib import Path

#: A task whose node or process is lost is done again by Ray so often, at once: perhaps on the same lost node.
_RETRIES = 3
#: When Ray gives it up, it gets it again so often, after this pause [s]: Ray may need half a minute to know that a
#: node is lost.
_AGAIN, _PAUSE = 5, 10.0
#: Number of times that Ray repeats a task whose node ran out of memory; by default for ever.
_RETRIES_MEMORY = 1
#: Tasks submitted to Ray at once, per CPU of the cluster, so that no CPU waits for the next one.
_AHEAD = 2
#: A cluster has this long to accept a connection [s].
_ANSWER_MAX = 10.0
#: How long one look at the tasks takes if nothing happens [s].
_LOOK_EVERY = 1.0


def drive(connection: Connection, words: Path, address: str, workers: int | None, limits: tuple[float, float]) -> None:
    """Runs in the process until the other end is closed.

    It says "begun" and "connected" once each, and then, for every function that it is sent, "take" (and is sent the
    number and the payload of a task, or None), "end" (with a task's number, value, loss, reason and attempts) and
    "none" when there are no more. "error" comes with an exception and ends it.

    Args:
        connection: To the process of the batch.
        words: File for what Ray prints.
        address: Of the cluster; "auto": the one on this machine.
        workers: So many tasks at once; None: as the cluster's CPUs allow.
        limits: Time limit of a task [s] and limit of the resident memory of a process [bytes].
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    threading.Thread(target=end_with_the_parent, daemon=True).start()
    _print_to(words)
    connection.send(("begun", None))
    try:
        ray = _connected(address)
        connection.send(("connected", None))
        driver = Driver(ray, workers, limits)
        while True:
            function = connection.recv()
            for end in driver.run(function, lambda: _asked(connection)):
                connection.send(("end", end))
            connection.send(("none", None))
    except InterdriveError as error:
        connection.send(("error", error))
    except (EOFError, BrokenPipeError, ConnectionResetError):  # all is done
        ray.shutdown()
    except Exception as error:  # noqa: BLE001 - whatever it is, the batch should name it
        connection.send(("error", InterdriveError(f"{type(error).__name__}: {error}")))


def _asked(connection: Connection) -> tuple[int, Any] | None:
    connection.send(("take", None))
    given: tuple[int, Any] | None = connection.recv()
    return given


def _print_to(words: Path) -> None:
    """Ray prints in the middle of what others print, some of it from below Python."""
    sys.stdout.flush()
    file = os.open(words, os.O_WRONLY | os.O_APPEND)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)


def _connected(address: str) -> Any:  # noqa: ANN401 - the module
    """Ray, connected to the cluster.

    Raises:
        InputError: No cluster there.
    """
    _check_that_cluster_answers(address)
    os.environ.setdefault("RAY_task_oom_retries", str(_RETRIES_MEMORY))
    import ray  # noqa: PLC0415 - optional

    try:
        ray.init(address=address, logging_level="ERROR", log_to_driver=False)
    except (ConnectionError, OSError, RuntimeError, ValueError) as cause:
        raise no_cluster(address, str(cause)) from cause
    return ray


def _check_that_cluster_answers(address: str) -> None:
    """Checks that a cluster answers; Ray itself would try for a minute.

    Raises:
        InputError: There is no answer.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdecimal():
        return  # "auto", which Ray finds out at once
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_MAX).close()
    except (OSError, OverflowError) as cause:
        raise no_cluster(address, str(cause)) from cause


def of_this_process() -> str | None:
    """Address of the cluster that this process is connected to already; the batch uses it whatever it is asked."""
    ray = sys.modules.get("ray")
    if ray is None or not ray.is_initialized():
        return None
    with suppress(Exception):  # connected in a way that knows no address
        return str(ray.get_runtime_context().gcs_address)
    return None


def no_cluster(address: str, reason: str) -> InputError:
    """There is no cluster that could be used."""
    if "Version mismatch" in reason:
        return InputError(f"ray {address}: {' '.join(reason.split())}")
    if "node_ip_address" in reason:  # the file that every node has
        return InputError(
            f"ray {address}: this machine is not a node of that cluster; join it with `ray start --address={address}`"
        )
    return InputError(
        f"ray {address}: no cluster answers there ({reason.strip().partition(chr(10))[0]}); "
        "start one with `ray start --head`"
    )


class Driver:
    """Hands tasks to Ray."""

    def __init__(self, ray: Any, workers: int | None, limits: tuple[float, float]) -> None:  # noqa: ANN401 - the module
        """Uses a connection that is there.

        Args:
            ray: The module, connected.
            workers: So many tasks at once; None: as the cluster's CPUs allow.
            limits: Time limit of a task [s] and limit of the resident memory of a process [bytes].
        """
        self._ray, self._workers, self._limits = ray, workers, limits
        self._waiting: dict[Any, tuple[int, Any, int]] = {}  # number, payload, how often Ray has had it

    def run(
        self, function: Callable[[Any, int], Any], take: Callable[[], tuple[int, Any] | None]
    ) -> Iterator[tuple[int, Any, str, str, int]]:
        """Does tasks until there are none and yields how they ended, in the order in which they end.

        Args:
            function: Called in a process of some node with the payload and the number of the attempt.
            take: Gives the number and the payload of the next task.

        Raises:
            InterdriveError: The cluster is lost, or a node cannot do tasks.
        """
        ray = self._ray
        remote = ray.remote(num_cpus=1, max_retries=_RETRIES)(_in_process)
        exhausted = False
        again: list[tuple[float, tuple[int, Any, int]]] = []  # when, what
        while True:
            while not (exhausted and not again) and len(self._waiting) < self._at_once():
                if again and again[0][0] <= time.monotonic():
                    number, payload, times = again.pop(0)[1]
                elif exhausted or (fresh := take()) is None:
                    exhausted = True
                    break
                else:
                    (number, payload), times = fresh, 0
                reference = remote.remote(function, payload, *self._limits, _core.__version__)
                self._waiting[reference] = number, payload, times + 1
            if not self._waiting:
                if not again:
                    return
                time.sleep(max(0.0, again[0][0] - time.monotonic()))
                continue
            ready, _ = ray.wait(list(self._waiting), num_returns=1, timeout=_LOOK_EVERY)
            for reference in ready:
                number, payload, times = self._waiting.pop(reference)
                try:
                    end = ray.get(reference)
                except ray.exceptions.RayError as cause:
                    lost = self._lost(cause, times)
                    if lost is None:
                        again.append((time.monotonic() + _PAUSE, (number, payload, times)))
                        continue
                    end = lost
                yield (number, *end)

    def _lost(self, cause: Exception, times: int) -> tuple[None, str, str, int] | None:
        """How a task has ended that Ray has given up so often; None: it is to be done again.

        Raises:
            InterdriveError: The others would end like this, too.
        """
        errors = self._ray.exceptions
        if isinstance(cause, errors.LocalRayletDiedError):
            raise InterdriveError("the node on this machine is lost")
        if isinstance(cause, errors.RayTaskError):
            # What happens in a run is its result. What raises is what is there before it.
            origin = cause.cause
            if isinstance(origin, NodeError) and times <= _AGAIN:
                return None
            where = re.search(r"\bip=([^,)]+)", str(cause))
            raise InterdriveError(
                f"node {where[1] if where else '(unknown)'} cannot do runs: {_first_line(origin)} "
                "(nodes need this version of interdrive, and the planners under test)"
            )
        reason = _first_line(cause)
        if isinstance(cause, errors.OutOfMemoryError):
            return None, "memory", f"Ray ended it, its node ran out of memory: {reason}", 1 + _RETRIES_MEMORY
        return (None, "crashed", f"Ray gave it up: {reason}", times) if times > _AGAIN else None

    def _at_once(self) -> int:
        if self._workers is not None:
            return self._workers
        return max(1, _AHEAD * int(self._ray.cluster_resources().get("CPU", 1)))


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".")


class NodeError(Exception):
    """A process of a node cannot be started."""


#: The process that does the runs of this Ray worker.
_POOLS: dict[tuple[float, float], Pool] = {}


def _in_process(
    function: Callable[[Any, int], Any], payload: object, timeout_s: float, memory: float, version: str
) -> tuple[Any, str, str, int]:
    """Runs in a Ray worker: the value, how the task was lost or "", why, and the number of attempts."""
    if version != _core.__version__:
        raise InterdriveError(f"it has interdrive {_core.__version__}, this machine {version}")
    if (timeout_s, memory) not in _POOLS:
        _close_pools()
        _POOLS[timeout_s, memory] = Pool(1, timeout_s=timeout_s, memory=memory)
    tasks = [Task(payload)]
    try:
        ends = list(_POOLS[timeout_s, memory].run(function, lambda _: tasks.pop() if tasks else None))
    except InterdriveError as error:
        _close_pools()  # the next task begins anew
        raise NodeError(str(error)) from None
    return ends[0].value, ends[0].lost, ends[0].why, ends[0].attempts


def _close_pools() -> None:
    for pool in _POOLS.values():
        pool.close()
    _POOLS.clear()
