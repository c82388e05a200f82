"""Failures that are driven again, by processes that end where a planner takes too long."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.batches.pool import Task
from interdrive.errors import InputError, InterdriveError
from interdrive.failure_search.backends import backend_of
from interdrive.failure_search.failures import Failure, Verdict, check_failure, replay

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

#: What is said of a planner that gives no answer, instead of the kind of its failure.
LOST = "no answer"


@dataclass(frozen=True)
class _Again:
    """A failure to drive again; `planner` in the agent's place, None: the one that failed."""

    failure: Failure
    planner: str | None
    trust: bool


def checked(
    found: Sequence[Failure], planner: str, *, trust: bool = False, run_timeout: float = math.inf
) -> Iterator[Verdict]:
    """What a planner does in the agents' places, failure by failure.

    Args:
        found: The failures.
        planner: The planner, as on the command line.
        trust: Import planners of other agents that a failure names as module:object.
        run_timeout: A drive that takes longer, twice, ends [s]; its verdict is `LOST`. So is that of one whose process
            ends.

    Raises:
        InputError: There is no such planner, code is named and not trusted, or the time is not positive.
    """
    for end in _driven([_Again(one, planner, trust) for one in found], run_timeout):
        yield Verdict(LOST, end.why) if end.lost else end.value


def digest_again(found: Failure, *, trust: bool = False, run_timeout: float = math.inf) -> str:
    """The digest of a failure that is driven again.

    Args:
        found: The failure.
        trust: Import planners that it names as module:object.
        run_timeout: It may take this long [s].

    Raises:
        InputError: It names code and is not trusted, or the time is not positive.
        InterdriveError: It took too long, twice, or its process ended.
    """
    (end,) = _driven([_Again(found, None, trust)], run_timeout)
    if end.lost:
        raise InterdriveError(f"{found.folder}: {end.why}")
    return str(end.value)


def _driven(wanted: Sequence[_Again], run_timeout: float) -> Iterator[Any]:
    """How the drives end, in their order."""
    if not run_timeout > 0:
        raise InputError(f"run_timeout: must be positive, is {run_timeout:g}")
    with closing(backend_of(1, None, run_timeout)) as backend:
        for one in wanted:
            for end in backend.run(_drive, _once(Task(one))):
                if isinstance(end.value, InterdriveError):
                    raise end.value
                yield end


def _once(task: Task[_Again]) -> Callable[[str], Task[_Again] | None]:
    """Gives a task to the first who asks."""
    left = iter([task])
    return lambda _group: next(left, None)


def _drive(again: _Again, _attempts: int) -> Verdict | str | InterdriveError:
    """The verdict on a planner, or the digest of a failure; errors are the result, as they would end the process."""
    try:
        if again.planner is None:
            return replay(again.failure, trust=again.trust)[0].digest
        return check_failure(again.failure, again.planner, trust=again.trust)
    except InterdriveError as error:
        return error
