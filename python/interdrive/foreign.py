"""Planners and predictors of the user in this process: reports their exceptions in one line, undoes their changes."""

from __future__ import annotations

import os
import sys
import sysconfig
import traceback
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

#: Longer tracebacks lose their beginning [characters]; number of causes of an exception that are followed.
_TRACEBACK_MAX, _CAUSES_MAX = 20_000, 10


#: How numpy handles floating-point errors: numpy 1 has functions for it, numpy 2 a variable of the context.
_read_errors: Callable[[], object]
_write_errors: Callable[[Any], object]
if hasattr(np, "geterrobj"):
    _read_errors, _write_errors = np.geterrobj, np.seterrobj  # type: ignore[attr-defined] # noqa: NPY201
else:
    _variable = np._core.umath._extobj_contextvar  # type: ignore[attr-defined] # np.geterr takes longer than all the rest
    _read_errors, _write_errors = _variable.get, _variable.set


class _Depth:
    """Nesting depth of the present calls of foreign code, and the depth at which this process was forked."""

    now = 0
    forked = 0


def _was_forked() -> None:
    _Depth.forked = _Depth.now


os.register_at_fork(after_in_child=_was_forked)


def undisturbed(function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
    """Returns or raises as the function does, and restores the state of the process.

    Restored are the recursion limit, numpy's handling of floating-point errors, the warning filters, and the
    standard streams. If the function forks, the child process ends here when the function returns.
    """
    limit, errors, filters = sys.getrecursionlimit(), _read_errors(), warnings.filters[:]
    streams = sys.stdin, sys.stdout, sys.stderr
    _Depth.now += 1
    try:
        return function(*arguments, **named)
    finally:
        sys.setrecursionlimit(limit)  # first, because the following lines make calls
        if _Depth.forked >= _Depth.now:
            os._exit(0)
        _Depth.now -= 1
        sys.stdin, sys.stdout, sys.stderr = streams
        if _read_errors() != errors:
            _write_errors(errors)
        if warnings.filters != filters:
            warnings.resetwarnings()  # also sets it in the interpreter
            warnings.filters[:] = filters  # type: ignore[index]


@contextmanager
def same_folder() -> Iterator[None]:
    """Restores the working folder after the block."""
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
    """The text of an exception, on one line of limited length; "" if it cannot be printed."""
    try:
        parts = [str(error), *getattr(error, "__notes__", ())]  # the notes name the argument of a wrong type
        # The text may be of a subclass of str with arbitrary methods; those of str itself are safe.
        words = [word for part in parts for word in str.split(str.__getitem__(part, slice(_TEXT_MAX)))]
        return " ".join(words)[:_TEXT_MAX]
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: BLE001 - whatever it does
        return ""


def place_of(error: BaseException) -> str:
    """Where foreign code raised an exception: file, line and function; "" if it has no frame in a file.

    It is the last frame in a file that is neither ours nor a library's, or else the last frame that is not ours.
    """
    libraries = {Path(path) for path in sysconfig.get_paths().values()}
    own = elsewhere = ""
    # Of the class itself, because a subclass may have an attribute of this name.
    trace = vars(BaseException)["__traceback__"].__get__(error)
    for frame in traceback.extract_tb(trace):
        file = Path(frame.filename)
        if frame.filename.startswith("<") or _is_ours(frame.filename):
            continue
        elsewhere = f"{file.name}:{frame.lineno} in {frame.name}"
        if not libraries & set(file.parents):
            own = elsewhere
    return own or elsewhere


def traceback_of(error: BaseException) -> str:
    """The traceback of an exception of foreign code without our own frames, after those of its causes."""
    parts: list[str] = []
    found: BaseException | None = error
    while found is not None and len(parts) < _CAUSES_MAX:
        # Of the class itself, because a subclass may have attributes of these names.
        trace, cause, context, is_hidden = (
            vars(BaseException)[name].__get__(found)
            for name in ("__traceback__", "__cause__", "__context__", "__suppress_context__")
        )
        frames = [frame for frame in traceback.extract_tb(trace) if not _is_ours(frame.filename)]
        parts.append("".join(traceback.format_list(frames)) + failure(found))
        found = cause if is_hidden or cause is not None else context
    return "\n\nand then\n\n".join(reversed(parts))[-_TRACEBACK_MAX:]


def _is_ours(file: str) -> bool:
    return Path(__file__).parent in Path(file).parents


def failure(error: BaseException, given: str = "", *, placed: bool = False) -> str:
    """One line for an exception of foreign code.

    Args:
        error: The exception.
        given: Its read-only argument; "" if none.
        placed: Begin with where it was raised.
    """
    if placed and (place := place_of(error)):
        return f"{place}: {failure(error, given)}"
    kind, text = type(error), text_of(error)
    if issubclass(kind, InterdriveError) and text:
        return text
    if given and issubclass(kind, ValueError) and "read-only" in text:
        return f"it writes into its {given}, which is read-only ({text})"
    return f"{kind.__name__}: {text}" if text else kind.__name__
