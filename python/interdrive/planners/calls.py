"""Calls of planners written in Python: whatever one of them does costs its own agent only."""

from __future__ import annotations

import math
import signal
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

from interdrive.errors import InterdriveError
from interdrive.planners.contract import stated

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from interdrive._core import Predictions, View
    from interdrive.planners.contract import Planner


#: The arrays of a plan for `Plans.set`, or a line that says why there are none.
Answer = tuple[Any, ...] | str


class _TooLong(BaseException):
    """Goes through a planner's own `except Exception`."""


@contextmanager
def _interrupted_after(seconds: float) -> Iterator[None]:
    """Raises `_TooLong` in the block after this time, where that is possible: in the main thread, by a signal."""
    if math.isinf(seconds) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def ask(planner: Planner, view: View, predictions: Predictions, timeout_s: float) -> Answer:
    """What a planner answers: the arrays of its trajectory, or a line that says what is wrong with it.

    Args:
        planner: The planner.
        view: What its agent sees.
        predictions: For everybody in view and the agent itself.
        timeout_s: Longest time that the call may take [s]; inf: any.
    """
    start = time.perf_counter()
    try:
        with _interrupted_after(timeout_s):
            trajectory = planner.plan(view, predictions)
        seconds = time.perf_counter() - start
        if seconds > timeout_s:
            return _too_slow(seconds, timeout_s)
        return cast("Answer", stated(trajectory))
    except _TooLong:
        return _too_slow(time.perf_counter() - start, timeout_s)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever a planner raises costs its own agent only
        return failure(error)


def failure(error: BaseException) -> str:
    """One line for whatever a planner raised."""
    text = " ".join(str(error).split())
    if isinstance(error, InterdriveError):
        return text
    if isinstance(error, ValueError) and "read-only" in text:
        return f"it writes into its view, which is read-only ({text})"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _too_slow(seconds: float, timeout_s: float) -> str:
    return f"it took {seconds:.3g} s, allowed are {timeout_s:g} s (step.planner_timeout_s)"
