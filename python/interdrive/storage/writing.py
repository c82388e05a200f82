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
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import ResultsError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping


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


def _check_arrow() -> None:
    """Checks before the simulation that tables can be written."""
    try:
        import pyarrow.parquet  # noqa: F401, PLC0415
    except ImportError as cause:
        raise ResultsError(
            f"no results can be written, pyarrow does not work here: {one_line(cause)}; "
            "`pip install --upgrade interdrive` brings versions that fit together"
        ) from cause


def check_folder(folder: str | Path, what: str, mark: str, belongs: Callable[[Path], bool], *, overwrite: bool) -> Path:
    """A folder that can be written whole, as an absolute path.

    Args:
        folder: New or empty, or one of the same kind.
        what: The kind of folder, for messages.
        mark: File that every folder of this kind has.
        belongs: Whether an entry may be part of such a folder.
        overwrite: The folder may be replaced.

    Raises:
        ResultsError: if it is a symbolic link, has contents that must not be replaced, or pyarrow does not work.
    """
    target = not_a_link(folder)
    _check_arrow()
    try:
        if not target.exists():
            nearest = next(parent for parent in target.parents if parent.exists())
            if not nearest.is_dir():
                raise ResultsError(f"{folder}: {nearest} is not a folder")
            _check_writable(folder, nearest)
            return target
        if not target.is_dir():
            raise ResultsError(f"{folder}: a file with this name already exists")
        entries = sorted(target.iterdir())
        foreign = [entry.name for entry in entries if not belongs(entry)]
    except OSError as cause:
        raise ResultsError(f"{folder}: cannot be used as a {what} folder: {one_line(cause)}") from cause
    inside = [entry.name for entry in entries]
    if inside and (mark not in inside or foreign):
        example = (foreign or inside)[0]
        raise ResultsError(
            f"{folder}: this folder has other contents ({example}) and is not replaced; choose another one"
        )
    if inside and not overwrite:
        raise ResultsError(f"{folder}: a {what} already exists there; --overwrite (overwrite=True) replaces it")
    _check_writable(folder, target.parent)  # the new folder replaces the old one
    return target


def _check_writable(folder: str | Path, place: Path) -> None:
    if not os.access(place, os.W_OK | os.X_OK):
        raise ResultsError(f"{folder}: no permission to write in {place}")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A path to write one file or folder to, which replaces `path` on success and is removed on failure.

    The contents are flushed to disk before the renaming: after a power failure they are complete or absent. A symbolic
    link of that name is replaced itself; its target is unchanged.

    Raises:
        ResultsError: if it cannot be written; one line with path and cause.
    """
    with _replacing(resolved(path, follow=False)) as partial:
        yield partial


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    # Keeps the ending: writers of images choose the format by it. Threads, and containers whose process ids repeat, may
    # write the same file at the same time.
    own = f".{target.name}.{os.getpid()}-{secrets.token_hex(4)}"
    partial = target.with_name(f"{own}.partial{target.suffix}")
    created: list[Path] = []
    try:
        for parent in reversed([parent for parent in target.parents if not parent.exists()]):
            parent.mkdir(exist_ok=True)
            created.append(parent)
        yield partial
        _move(partial, target, target.with_name(f"{own}.old"))
        for parent in created:
            _sync(parent.parent)
    except BaseException as cause:
        _remove(partial)
        for parent in reversed(created):
            if parent.exists() and not any(parent.iterdir()):
                parent.rmdir()
        if isinstance(cause, (OSError, _arrow_exception())):
            raise ResultsError(f"{target}: cannot be written: {one_line(cause)}") from cause
        if isinstance(cause, ResultsError) and str(partial) in str(cause):
            # A part of a folder: the message names the folder.
            raise ResultsError(str(cause).replace(str(partial), str(target))) from cause
        raise


def _move(partial: Path, target: Path, old: Path) -> None:
    """Moves the new file or folder to its place; an existing folder is `old` for a moment."""
    if target.is_dir() and not target.is_symlink() and not partial.is_dir():
        # A file never replaces a folder, because all its contents would be lost.
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    for path in (*partial.rglob("*"), partial):
        _sync(path)
    if not (partial.is_dir() and (target.is_dir() or target.is_symlink())):
        partial.replace(target)
    else:
        target.rename(old)
        try:
            partial.rename(target)
        except BaseException:
            old.rename(target)
            raise
        _remove(old)
    _sync(target.parent)


def _remove(path: Path) -> None:
    """Removes as much as possible without errors, so that the original failure is reported."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _sync(path: Path) -> None:
    """Flushes a file, or the entries of a folder, to disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_json(path: Path) -> Any:  # noqa: ANN401 - any JSON value
    """Reads a JSON file.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is not JSON, is nested too deeply, or has an invalid number (NaN, Infinity, 1e999).
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is not a file")
    try:
        return json.loads(path.read_bytes(), parse_constant=_finite_number, parse_float=_finite_number)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _finite_number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is not a JSON number")
    return number


def write_json(values: Mapping[str, Any], path: Path) -> None:
    """Writes plain values as JSON, see `json_text`."""
    path.write_bytes(json_text(values, indent=2).encode() + b"\n")


def json_text(values: Any, *, indent: int | None = None) -> str:  # noqa: ANN401 - any plain values
    """Plain values as JSON, which has no infinities and no nan: "inf", "-inf" and null stand for them.

    Arrays and paths become plain values, bytes of file names that are not UTF-8 become escapes; without `indent` there
    are no spaces.
    """
    separators = (",", ":") if indent is None else None
    text = json.dumps(_finite(values), indent=indent, separators=separators, ensure_ascii=False, allow_nan=False)
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
