"""Files and folders that appear whole or not at all. pyarrow is loaded on first use."""

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
        follow: Also where the last name is a link; otherwise the path of the link itself.

    Raises:
        ResultsError: if its links lead in a circle, it can be no path, or Arrow could not open it.
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
        raise ResultsError(f"{str(path)!r}: this is no path ({cause})") from None
    except OSError as cause:
        if cause.errno == errno.ELOOP:
            raise ResultsError(f"{path}: its symbolic links lead in a circle; choose another path") from None
    return target


def not_a_link(folder: str | Path) -> Path:
    """A folder to write to as an absolute path, unless it is a symbolic link: you may not expect what it points to.

    Raises:
        ResultsError: It is one, or a path that cannot be.
    """
    target = resolved(folder)
    if resolved(folder, follow=False).is_symlink():
        raise ResultsError(f"{folder}: this is a symbolic link; name the folder that it points to, or remove the link")
    return target


def _check_arrow() -> None:
    """Tells before a simulation rather than after it that no table can be written."""
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
        folder: New or empty, or one that holds the same kind of thing.
        what: The kind of thing, for the reader.
        mark: File without which a folder is not of that kind.
        belongs: Whether an entry of the folder is part of such a thing.
        overwrite: It may be replaced.

    Raises:
        ResultsError: if it is a symbolic link, something is there that must not be replaced, or pyarrow does not work.
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
            raise ResultsError(f"{folder}: a file of that name is in the way")
        entries = sorted(target.iterdir())
        foreign = [entry.name for entry in entries if not belongs(entry)]
    except OSError as cause:
        raise ResultsError(f"{folder}: cannot be used as a {what} folder: {one_line(cause)}") from cause
    inside = [entry.name for entry in entries]
    if inside and (mark not in inside or foreign):
        example = (foreign or inside)[0]
        raise ResultsError(
            f"{folder}: this folder holds other things ({example}) and is left alone; choose another one"
        )
    if inside and not overwrite:
        raise ResultsError(f"{folder}: a {what} is there already; ask for overwriting or choose another folder")
    _check_writable(folder, target.parent)  # what is written takes the folder's place
    return target


def _check_writable(folder: str | Path, place: Path) -> None:
    if not os.access(place, os.W_OK | os.X_OK):
        raise ResultsError(f"{folder}: there is no permission to write in {place}")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A path to write one file or folder to, which takes the place of `path` if all goes well and vanishes if not.

    What was written reaches the disk before it is renamed: after a loss of power it is whole or not there. A symbolic
    link of that name is replaced itself; what it points to is left alone.

    Raises:
        ResultsError: if it cannot be written; one line with path and cause.
    """
    with _replacing(resolved(path, follow=False)) as partial:
        yield partial


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    # Keeps the ending: writers of pictures choose the format by it. Threads, and containers whose process ids repeat,
    # may write the same file at once.
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
            # A part that is replaced within the whole: the reader knows the whole by its own name.
            raise ResultsError(str(cause).replace(str(partial), str(target))) from cause
        raise


def _move(partial: Path, target: Path, old: Path) -> None:
    """Puts what was written into its place; a folder that is there is `old` for a moment."""
    if target.is_dir() and not target.is_symlink() and not partial.is_dir():
        # A file never takes the place of a folder, which would be gone with all that is in it.
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
    """Removes what can be removed: the reason why the writing failed is the one to report."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _sync(path: Path) -> None:
    """Waits until a file, or which names are in a folder, has reached the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_json(path: Path) -> Any:  # noqa: ANN401 - any JSON value
    """What a JSON file says.

    Raises:
        OSError: It cannot be read.
        ValueError: It is no JSON, nested too deeply, or holds a number that is none (NaN, Infinity, 1e999).
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is no file")
    try:
        return json.loads(path.read_bytes(), parse_constant=_finite_number, parse_float=_finite_number)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _finite_number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no number of JSON")
    return number


def write_json(values: Mapping[str, Any], path: Path) -> None:
    """Writes plain values as JSON, as `json_text` has them."""
    path.write_bytes(json_text(values, indent=2).encode() + b"\n")


def json_text(values: Any, *, indent: int | None = None) -> str:  # noqa: ANN401 - any plain values
    """Plain values as JSON, which has no infinities and no nan: "inf", "-inf" and null stand for them.

    Arrays and paths become plain values, bytes of file names that are not UTF-8 become escapes; without `indent`
    nothing is wasted on spaces.
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
    """Arrow's own exception; one that is never raised anew here if Arrow was not even loaded."""
    exception: type[Exception] = getattr(sys.modules.get("pyarrow"), "ArrowException", OSError)
    return exception


def one_line(cause: BaseException) -> str:
    """The cause on one line; for errors of the operating system without their number."""
    # Arrow's errors of the system have its number, and a text of their own.
    text = os.strerror(cause.errno) if isinstance(cause, OSError) and cause.errno else str(cause)
    return " ".join(text.split()) or type(cause).__name__
