"""Atomic writing of files and folders. pyarrow is loaded on first use."""

from __future__ import annotations

import errno
import json
import math
import os
import re
import secrets
import shutil
import sys
from contextlib import contextmanager, suppress
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import ResultsError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

#: Longest name that a hidden name may contain [bytes]; file systems take 255, and a process and an ending are added.
_NAME_MAX = 180

#: How often a folder is replaced anew if other processes replace it at the same moment.
_ATTEMPTS = 100


def resolved(path: str | Path, *, follow: bool = True) -> Path:
    """The path as an absolute one without symbolic links; it need not exist.

    Args:
        path: The path.
        follow: Also follow a link at the last name; otherwise return the path of the link itself.

    Raises:
        ResultsError: if its links are circular, it is not a valid path, or Arrow could not open it.
    """
    try:
        target = Path(os.path.realpath(path))
        if not follow and Path(path).name not in ("", ".."):
            target = Path(os.path.realpath(Path(path).parent)) / Path(path).name
        str(target).encode()
        target.stat(follow_symlinks=follow)
    except UnicodeEncodeError:
        raise ResultsError(f"{path}: results need a path that is UTF-8 from the root on; choose another one") from None
    except ValueError as cause:
        raise ResultsError(f"{str(path)!r}: not a valid path ({cause})") from None
    except OSError as cause:
        if cause.errno == errno.ELOOP:
            raise ResultsError(f"{path}: its symbolic links are circular; choose another path") from None
    return target


def not_a_link(folder: str | Path) -> Path:
    """A folder to write to as an absolute path; a symbolic link is refused, because its target may be unexpected.

    Raises:
        ResultsError: The folder is a symbolic link, or the path is not valid.
    """
    target = resolved(folder)
    if resolved(folder, follow=False).is_symlink():
        raise ResultsError(f"{folder}: this is a symbolic link; name the folder that it points to, or remove the link")
    return target


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A path to write one file or folder to, which replaces `path` on success and is removed on failure.

    The contents are flushed to disk before the renaming: after a power failure they are complete or absent. A symbolic
    link of that name is replaced itself; its target is unchanged.

    Raises:
        ResultsError: if it cannot be written; one line with path and cause.
    """
    with written_beside(resolved(path, follow=False), replace_path) as partial:
        yield partial


@contextmanager
def written_beside(target: Path, move: Callable[[Path, Path], None]) -> Iterator[Path]:
    """A hidden path beside `target` to write to; `move(path, target)` puts it in place.

    Raises:
        ResultsError: if it cannot be written; one line with path and cause.
    """
    # Keeps the ending: writers of images choose the format by it. Threads, and containers whose process ids repeat, may
    # write the same file at the same time.
    partial = target.with_name(f"{hidden(target)}.{os.getpid()}-{secrets.token_hex(4)}.partial{target.suffix[:20]}")
    try:
        with parents_of(target):
            yield partial
            for path in (*partial.rglob("*"), partial):
                sync(path)
            move(partial, target)
            sync(target.parent)
    except BaseException as cause:
        _remove(partial)
        if isinstance(cause, (OSError, _arrow_exception())):
            raise ResultsError(f"{target}: cannot be written: {one_line(cause)}") from cause
        if isinstance(cause, ResultsError) and str(partial) in str(cause):
            # A part of a folder: the message names the folder.
            raise ResultsError(str(cause).replace(str(partial), str(target))) from cause
        raise


@contextmanager
def parents_of(target: Path) -> Iterator[None]:
    """Makes the missing folders above `target`; folders that are still empty in the end are removed."""
    created: list[Path] = []
    try:
        for parent in reversed([parent for parent in target.parents if not parent.exists()]):
            parent.mkdir(exist_ok=True)
            created.append(parent)
        yield
        for parent in created:
            if parent.exists():
                sync(parent.parent)
    finally:
        for parent in reversed(created):
            with suppress(OSError):  # it has contents
                parent.rmdir()


def hidden(target: Path) -> str:
    """The beginning of names beside `target` that are there only for a while; short enough for every file system."""
    name = target.name
    return f".{name}" if len(os.fsencode(name)) <= _NAME_MAX else f".{sha256(os.fsencode(name)).hexdigest()[:16]}"


def replace_path(partial: Path, target: Path) -> None:
    """Moves a new file or folder to its place, whose old contents are removed; a file never replaces a folder."""
    if target.is_dir() and not target.is_symlink() and not partial.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not (partial.is_dir() and (target.is_dir() or target.is_symlink())):
        partial.replace(target)
        return
    gone: list[Path] = []
    for is_last in (*[False] * _ATTEMPTS, True):
        old = target.with_name(f"{hidden(target)}.{os.getpid()}-{secrets.token_hex(4)}.old")
        with suppress(FileNotFoundError):  # another process has just moved it away
            target.rename(old)
            gone.append(old)
        try:
            partial.rename(target)
            break
        except OSError as cause:
            if is_last or cause.errno not in (errno.ENOTEMPTY, errno.EEXIST):  # another process put its own there
                if gone and not os.path.lexists(target):
                    gone.pop().rename(target)
                raise
    for old in gone:
        _remove(old)


def _remove(path: Path) -> None:
    """Removes as much as possible without errors, so that the original failure is reported."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def sync(path: Path) -> None:
    """Flushes a file, or the entries of a folder, to disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_json(values: Mapping[str, Any], path: Path) -> None:
    """Writes plain values as JSON, see `json_text`."""
    path.write_bytes(json_text(values, indent=2).encode() + b"\n")


def json_text(values: Any, *, indent: int | None = None) -> str:  # noqa: ANN401 - any plain values
    """Plain values as JSON, which has no infinities and no nan: "inf", "-inf" and null stand for them.

    Arrays and paths become plain values, bytes of file names that are not UTF-8 become escapes; without `indent` there
    are no spaces.
    """
    separators = (",", ":") if indent is None else None
    dumped = partial(json.dumps, indent=indent, separators=separators, ensure_ascii=False, allow_nan=False)
    try:
        text = dumped(values)
    except (TypeError, ValueError):  # few values are not plain
        text = dumped(_finite(values))
    return re.sub("[\ud800-\udfff]", lambda found: f"\\u{ord(found[0]):04x}", text)


def _finite(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _finite(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return str(value) if isinstance(value, Path) else value


def _arrow_exception() -> type[Exception]:
    """Arrow's exception class; a placeholder that is never raised if Arrow is not loaded."""
    exception: type[Exception] = getattr(sys.modules.get("pyarrow"), "ArrowException", OSError)
    return exception


def one_line(cause: BaseException) -> str:
    """The cause on one line; errors of the operating system without their number."""
    # Arrow's system errors have an error number and their own text.
    text = os.strerror(cause.errno) if isinstance(cause, OSError) and cause.errno else str(cause)
    return " ".join(text.split()) or type(cause).__name__
