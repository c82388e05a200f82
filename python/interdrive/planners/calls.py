"""Calls of planners written in Python: whatever one of them does costs its own agent only."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

from interdrive.foreign import failure, undisturbed
from interdrive.planners.contract import stated

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from interdrive._core import Predictions, View
    from interdrive.planners.contract import Planner


#: A signal that does not come is helped after this time [s] ...
_GRACE = 0.5
#: ... by a thread that looks so often [s].
_LOOK_EVERY = 0.25

#: The arrays of a plan for `Plans.set`, or a line that says why there are none.
Answer = tuple[Any, ...] | str


class _TooLong(BaseException):
    """Goes through a planner's own `except Exception`."""


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
            answer = undisturbed(_planned, planner, view, predictions)
        seconds = time.perf_counter() - start
        return answer if seconds <= timeout_s else _too_slow(seconds, timeout_s)
    except _TooLong:
        return _too_slow(time.perf_counter() - start, timeout_s)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - whatever a planner raises costs its own agent only
        return failure(error, "view")


def _planned(planner: Planner, view: View, predictions: Predictions) -> Answer:
    return cast("Answer", stated(planner.plan(view, predictions)))


@contextmanager
def _interrupted_after(seconds: float) -> Iterator[None]:
    """Raises `_TooLong` in the block after this time, where that is possible: in the main thread.

    A signal does it; a moment later, another thread, should the planner have switched the signal off.
    """
    if math.isinf(seconds) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGALRM,))
    try:
        try:
            _WATCHDOG.watch(seconds + _GRACE)
            signal.setitimer(signal.ITIMER_REAL, seconds)
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL if before is None else before)
    finally:
        _WATCHDOG.rest()


class _Watchdog:
    """A thread that raises `_TooLong` in the main thread when a call has outlived its limit; it sleeps in between."""

    def __init__(self) -> None:
        self._until, self._has_barked, self._process = math.inf, False, 0
        self._barking = threading.Lock()

    def watch(self, seconds: float) -> None:
        """The block that begins now may take this long [s]."""
        self._until = time.monotonic() + seconds
        if self._process != os.getpid():  # a thread does not survive a fork
            self._process, self._barking = os.getpid(), threading.Lock()
            threading.Thread(target=self._guard, daemon=True, name="interdrive-planner-timeout").start()

    def rest(self) -> None:
        """The block is over; an exception that is still on its way is raised and taken here.

        Python can also withdraw such an exception, but goes on looking for it: slower, and endless under a profiler.
        """
        try:
            self._until = math.inf
            with self._barking:  # a bark that has begun is over after this, another does not begin
                pass
            if self._has_barked:
                _raise_in_main_thread(_TooLong)
                while True:
                    time.sleep(0.0)
        except _TooLong:
            pass
        self._has_barked = False

    def _guard(self) -> None:
        while True:
            time.sleep(_LOOK_EVERY)
            with self._barking:
                if time.monotonic() > self._until:
                    self._has_barked = True
                    _raise_in_main_thread(_TooLong)


_WATCHDOG = _Watchdog()


def _raise_in_main_thread(kind: type[BaseException]) -> None:
    number = ctypes.c_ulong(threading.main_thread().ident or 0)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(number, ctypes.py_object(kind))


def _too_slow(seconds: float, timeout_s: float) -> str:
    return f"it took {seconds:.3g} s, allowed are {timeout_s:g} s (step.planner_timeout_s)"
