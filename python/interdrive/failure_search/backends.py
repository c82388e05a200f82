"""What does the tasks of a search: this process, others, or a cluster."""

from __future__ import annotations

import gc
import math
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from interdrive.batches.pool import End, Pool, Task

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class Backend(Protocol):
    """Processes that do tasks; as in batches."""

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks until there are none and yields how they ended."""

    def close(self) -> None:
        """Ends what is still being done."""


class Here:
    """This process."""

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks one after another.

        What the process has until then is left out of garbage collection: to look through all that is imported takes
        0.1 s each time, a tenth of twenty runs.
        """
        gc.freeze()
        try:
            while (task := take("")) is not None:
                yield End(task, function(task.payload, 1))
        finally:
            gc.unfreeze()

    def close(self) -> None:
        """Nothing is left."""


def backend_of(workers: int, ray: str | None, run_timeout: float) -> Backend:
    """What drives with these arguments of a search."""
    if ray is not None:
        from interdrive.batches.ray import Cluster  # noqa: PLC0415 - optional

        return Cluster(ray, None, timeout_s=run_timeout)
    return Here() if workers == 1 and math.isinf(run_timeout) else Pool(workers, timeout_s=run_timeout)


@contextmanager
def spare(busy: Backend, run_timeout: float) -> Iterator[Backend]:
    """What does tasks when the processes of a search are busy with others."""
    one: Backend = Here() if isinstance(busy, Here) else Pool(1, timeout_s=run_timeout)
    with closing(one):
        yield one
