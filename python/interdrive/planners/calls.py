"""Calls of planners written in Python; a failure ends only the planner's own agent."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from interdrive.foreign import failure, traceback_of, undisturbed
from interdrive.planners.contract import stated

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from interdrive._core import Predictions, View
    from interdrive.planners.contract import Planner


#: If the signal does not arrive within this time [s] ...
_GRACE = 0.5
#: ... a thread that checks at this interval [s] interrupts the call.
_LOOK_EVERY = 0.25


@dataclass(frozen=True)
class Failure:
    """Why there is no plan: one line, and the traceback of the planner's exception ("" if it raised none)."""

    line: str
    traceback: str = ""


#: The arrays of a plan for `Step.set` of the core, or why there are none.
Answer = tuple[Any, ...] | Failure


class _TooLong(BaseException):
    """Not an `Exception`, so that a planner's `except Exception` does not catch it."""


def ask(planner: Planner, view: View, predictions: Predictions, timeout_s: float) -> Answer:
    """Calls a planner and returns the arrays of its trajectory, or its failure.

    Args:
        planner: The planner.
        view: View of its agent.
        predictions: Predictions for the participants in view and the agent itself.
        timeout_s: Time limit of the call [s]; inf: none.
    """
    start = time.perf_counter()
    try:
        with _interrupted_after(timeout_s):
            answer = undisturbed(planned, planner, view, predictions)
        seconds = time.perf_counter() - start
        return answer if seconds <= timeout_s else _too_slow(seconds, timeout_s)
    except _TooLong:
        return _too_slow(time.perf_counter() - start, timeout_s)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - whatever a planner raises costs its own agent only
        return Failure(failure(error, "view", placed=True), traceback_of(error))


def planned(planner: Planner, view: View, predictions: Predictions) -> tuple[Any, ...]:
    """The arrays of a planner's trajectory; whatever it raises passes through."""
    return cast("tuple[Any, ...]", stated(planner.plan(view, predictions)))


@contextmanager
def _interrupted_after(seconds: float) -> Iterator[None]:
    """Raises `_TooLong` in the block after this time, if possible: in the main thread.

    It uses a signal, and a moment later another thread in case the planner has disabled the signal.
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
    """A thread that raises `_TooLong` in the main thread when a call exceeds its time limit; it sleeps in between."""

    def __init__(self) -> None:
        self._until, self._has_barked, self._process = math.inf, False, 0
        self._barking = threading.Lock()

    def watch(self, seconds: float) -> None:
        """Sets the time limit [s] of the block that begins now."""
        self._until = time.monotonic() + seconds
        if self._process != os.getpid():  # a thread does not survive a fork
            self._process, self._barking = os.getpid(), threading.Lock()
            threading.Thread(target=self._guard, daemon=True, name="interdrive-planner-timeout").start()

    def rest(self) -> None:
        """Ends the block; a pending exception is raised and caught here.

        Python can also withdraw such an exception, but then keeps checking for it: slower, and endless under a
        profiler.
        """
        try:
            self._until = math.inf
            with self._barking:  # an exception that is being raised has arrived after this, and no other follows
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


def _too_slow(seconds: float, timeout_s: float) -> Failure:
    return Failure(f"it took {seconds:.3g} s, at most {timeout_s:g} s are allowed (step.planner_timeout_s)")
