"""Code of others in this process, planners and predictors: what it raises as one line, what it changes put back."""

from __future__ import annotations

import os
import sys
import warnings
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from interdrive.errors import InterdriveError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

P = ParamSpec("P")
T = TypeVar("T")

#: Longer texts of exceptions are cut [characters].
_TEXT_MAX = 1000


#: How numpy handles floating-point errors: numpy 1 has functions for it, numpy 2 a variable of the context.
_read_errors: Callable[[], object]
_write_errors: Callable[[Any], object]
if hasattr(np, "geterrobj"):
    _read_errors, _write_errors = np.geterrobj, np.seterrobj  # type: ignore[attr-defined] # noqa: NPY201
else:
    _variable = np._core.umath._extobj_contextvar  # type: ignore[attr-defined] # np.geterr takes longer than all the rest
    _read_errors, _write_errors = _variable.get, _variable.set


class _Depth:
    """How many calls of foreign code contain each other now, and in which of them this process was forked off."""

    now = 0
    forked = 0


def _was_forked() -> None:
    _Depth.forked = _Depth.now


os.register_at_fork(after_in_child=_was_forked)


def undisturbed(function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
    """What the function returns or raises, with the process left as it was.

    Put back are the recursion limit, numpy's handling of floating-point errors, the filters of warnings, and the
    standard streams. A child that the function forks, and that comes back from it, ends here.
    """
    limit, errors, filters = sys.getrecursionlimit(), _read_errors(), warnings.filters[:]
    streams = sys.stdin, sys.stdout, sys.stderr
    _Depth.now += 1
    try:
        return function(*arguments, **named)
    finally:
        sys.setrecursionlimit(limit)  # first of all: what follows makes calls
        if _Depth.forked >= _Depth.now:
            os._exit(0)
        _Depth.now -= 1
        sys.stdin, sys.stdout, sys.stderr = streams
        if _read_errors() != errors:
            _write_errors(errors)
        if warnings.filters != filters:
            warnings.resetwarnings()  # tells the interpreter, too
            warnings.filters[:] = filters  # type: ignore[index]


@contextmanager
def same_folder() -> Iterator[None]:
    """Puts the working folder back after the block."""
    try:
        before = Path.cwd()
    except OSError:
        before = None
    try:
        yield
    finally:
        if before is not None:
            with suppress(OSError):
                os.chdir(before)


def text_of(error: BaseException) -> str:
    """What an exception says, on one line and not too long; "" if it cannot even say that."""
    try:
        parts = [str(error), *getattr(error, "__notes__", ())]  # the notes say which argument was of a wrong type
        # A text may be of a class that does anything when it is asked; the methods of str do not.
        words = [word for part in parts for word in str.split(str.__getitem__(part, slice(_TEXT_MAX)))]
        return " ".join(words)[:_TEXT_MAX]
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: BLE001 - whatever it does
        return ""


def failure(error: BaseException, given: str = "") -> str:
    """One line for whatever foreign code raised.

    Args:
        error: What it raised.
        given: What it was given to read only; "" if nothing.
    """
    kind, text = type(error), text_of(error)
    if issubclass(kind, InterdriveError) and text:
        return text
    if given and issubclass(kind, ValueError) and "read-only" in text:
        return f"it writes into its {given}, which is read-only ({text})"
    return f"{kind.__name__}: {text}" if text else kind.__name__
