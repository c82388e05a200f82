"""Tasks of a batch on a Ray cluster: one Ray task per run, and nothing about distribution beyond that.

On every node the run is done by a process of its own, as without Ray, with the same limits. Ray does a task again whose
node or process is lost.
"""

from __future__ import annotations

import socket
import time
from typing import TYPE_CHECKING, Any

from interdrive.batches.pool import End, Pool, Task
from interdrive.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

#: A task whose node or process is lost is done again by Ray so often, at once: perhaps on the same lost node.
_RETRIES = 3
#: When Ray gives it up, it gets it again so often, after this pause [s]: Ray may need half a minute to know that a
#: node is lost.
_AGAIN, _PAUSE = 5, 10.0
#: Tasks that are handed to Ray at once, per CPU of the cluster: nobody waits for the next one.
_AHEAD = 2
#: A cluster has this long to accept a connection [s].
_ANSWER_MAX = 10.0
#: How long one look at the tasks takes if nothing happens [s].
_LOOK_EVERY = 1.0


class Cluster:
    """A Ray cluster that runs already, as seen by `batch`."""

    def __init__(
        self, address: str, workers: int | None, *, timeout_s: float = float("inf"), memory: float = float("inf")
    ) -> None:
        """Connects.

        Args:
            address: Of the cluster; "auto": the one on this machine.
            workers: So many tasks at once; None: as the cluster's CPUs allow.
            timeout_s: A task may take this long [s].
            memory: A process may have this much resident memory [bytes].

        Raises:
            MissingExtraError: Ray is not installed.
            InputError: No cluster at the address.
        """
        try:
            import ray  # noqa: PLC0415 - optional
        except ImportError:
            raise MissingExtraError("ray is not installed; pip install interdrive[ray]") from None
        self._ray: Any = ray
        self._workers, self._limits = workers, (timeout_s, memory)
        self._waiting: dict[Any, tuple[Task[Any], int]] = {}
        self._is_ours = not ray.is_initialized()
        if self._is_ours:
            _check_that_somebody_answers(address)
            try:
                ray.init(address=address, logging_level="ERROR", log_to_driver=False)
            except (ConnectionError, OSError, RuntimeError, ValueError) as cause:
                raise _nobody(address, str(cause)) from cause

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks until there are none and yields how they ended, in the order in which they end.

        Args:
            function: Called in a process of some node with the payload and the number of the attempt.
            take: Gives the next task.
        """
        ray = self._ray
        remote = ray.remote(num_cpus=1, max_retries=_RETRIES)(_in_process)
        exhausted = False
        again: list[tuple[float, Task[Any], int]] = []  # when, what, how often Ray has had it
        while True:
            while not (exhausted and not again) and len(self._waiting) < self._at_once():
                if again and again[0][0] <= time.monotonic():
                    _, task, times = again.pop(0)
                elif exhausted or (fresh := take("")) is None:
                    exhausted = True
                    break
                else:
                    task, times = fresh, 0
                self._waiting[remote.remote(function, task.payload, *self._limits)] = task, times + 1
            if not self._waiting:
                if not again:
                    return
                time.sleep(max(0.0, again[0][0] - time.monotonic()))
                continue
            ready, _ = ray.wait(list(self._waiting), num_returns=1, timeout=_LOOK_EVERY)
            for reference in ready:
                task, times = self._waiting.pop(reference)
                try:
                    value, lost, why, attempts = ray.get(reference)
                except ray.exceptions.RayError as cause:
                    if times <= _AGAIN and not isinstance(cause, ray.exceptions.RayTaskError):
                        again.append((time.monotonic() + _PAUSE, task, times))
                        continue
                    reason = str(cause).strip().partition("\n")[0]
                    yield End(task, None, "crashed", f"Ray gave it up: {reason}", times)
                else:
                    yield End(task, value, lost, why, attempts)

    def _at_once(self) -> int:
        if self._workers is not None:
            return self._workers
        return max(1, _AHEAD * int(self._ray.cluster_resources().get("CPU", 1)))

    def close(self) -> None:
        """Gives up what is still being done, and disconnects."""
        for reference in self._waiting:
            self._ray.cancel(reference, force=True)
        self._waiting.clear()
        if self._is_ours:
            self._ray.shutdown()


def _check_that_somebody_answers(address: str) -> None:
    """Ray itself would try for a minute.

    Raises:
        InputError: Nobody does.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon or not port.isdecimal():
        return  # "auto", which Ray finds out at once
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_ANSWER_MAX).close()
    except (OSError, OverflowError) as cause:
        raise _nobody(address, str(cause)) from cause


def _nobody(address: str, reason: str) -> InputError:
    return InputError(
        f"ray {address}: no cluster answers there ({reason.strip().partition(chr(10))[0]}); "
        "start one with `ray start --head`"
    )


#: The process that does the runs of this Ray worker.
_POOLS: dict[tuple[float, float], Pool] = {}


def _in_process(
    function: Callable[[Any, int], Any], payload: object, timeout_s: float, memory: float
) -> tuple[Any, str, str, int]:
    """Runs in a Ray worker: the value, how the task was lost or "", why, and the number of attempts."""
    if (timeout_s, memory) not in _POOLS:
        for pool in _POOLS.values():
            pool.close()
        _POOLS.clear()
        _POOLS[timeout_s, memory] = Pool(1, timeout_s=timeout_s, memory=memory)
    tasks = [Task(payload)]
    ends = list(_POOLS[timeout_s, memory].run(function, lambda _: tasks.pop() if tasks else None))
    return ends[0].value, ends[0].lost, ends[0].why, ends[0].attempts
