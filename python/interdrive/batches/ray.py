"""Tasks of a batch on a Ray cluster, as the process of the batch sees them.

Ray ends the process that is connected to a cluster when the cluster is lost, without a word to Python. So it is another
process that is connected (`interdrive.batches.ray_driver`), and its end is an error like others.
"""

from __future__ import annotations

import importlib.util
import itertools
import multiprocessing
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.batches.pool import End
from interdrive.batches.ray_driver import drive, no_cluster, of_this_process
from interdrive.errors import InterdriveError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from interdrive.batches.pool import Task

#: The process has this long to take its leave of the cluster [s].
_LEAVE_MAX = 10.0
#: What Ray writes before a line of its log, and colours.
_ORNAMENT = re.compile(r"\x1b\[[0-9;]*m|^\[[^]]*\] (\(\w+\) )?[\w.]+:\d+: ")


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
            InterdriveError: The process that is to be connected ends before it begins.
        """
        if importlib.util.find_spec("ray") is None:
            raise MissingExtraError("ray is not installed; pip install interdrive[ray]")
        self._address = of_this_process() or address
        self._words = tempfile.NamedTemporaryFile(prefix="interdrive-ray-")  # noqa: SIM115 - closed by `close`
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._is_idle = False
        self._process = context.Process(
            target=drive,
            args=(theirs, Path(self._words.name), self._address, workers, (timeout_s, memory)),
            daemon=True,
            name="interdrive-ray",
        )
        self._process.start()
        theirs.close()
        try:
            self._wait_for_it()
        except BaseException:
            self.close()
            raise
        self._is_idle = True

    def _wait_for_it(self) -> None:
        """Until it is connected."""
        kind = ""
        try:
            for _ in range(2):
                kind, what = self._connection.recv()
                if kind == "error":
                    raise what
        except EOFError:
            words = self._last_words()
            if not kind:
                raise InterdriveError(
                    f"the process for Ray ended at once ({words}); "
                    "does the script guard its calls by `if __name__ == '__main__':`?"
                ) from None
            raise no_cluster(self._address, words) from None

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks until there are none and yields how they ended, in the order in which they end.

        Args:
            function: Called in a process of some node with the payload and the number of the attempt.
            take: Gives the next task.

        Raises:
            InterdriveError: The cluster is lost.
        """
        given: dict[int, Task[Any]] = {}
        numbers = itertools.count()
        self._is_idle = False
        try:
            self._connection.send(function)
            while True:
                kind, what = self._connection.recv()
                if kind == "none":
                    break
                if kind == "error":
                    raise self._lost(str(what))
                if kind == "end":
                    number, *how = what
                    yield End(given.pop(number), *how)
                    continue
                task = take("")
                number = next(numbers)
                if task is not None:
                    given[number] = task
                self._connection.send(None if task is None else (number, task.payload))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise self._lost(f"the cluster, or its node on this machine, is lost ({self._last_words()})") from None
        self._is_idle = True

    def _lost(self, reason: str) -> InterdriveError:
        return InterdriveError(
            f"ray {self._address}: {reason}; finished runs are kept, repeat the command to do the missing ones"
        )

    def _last_words(self) -> str:
        """What Ray has printed before the process ended, or its exit code."""
        self._process.join(_LEAVE_MAX)
        self._words.seek(0)
        lines = self._words.read().decode(errors="replace").splitlines()
        said = [words for line in lines if (words := _ORNAMENT.sub("", line).strip())]
        return said[-1].partition(". ")[0] if said else f"exit code {self._process.exitcode}"

    def close(self) -> None:
        """Gives up what is still being done, and disconnects."""
        self._connection.close()
        if self._is_idle:
            self._process.join(_LEAVE_MAX)
        self._process.kill()  # Ray ends the tasks of a process that is gone
        self._process.join()
        self._words.close()
