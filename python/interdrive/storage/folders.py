"""Folders of results: claimed before the work begins, written whole, and never put in the place of another result.

A folder is claimed by locking a hidden file beside it, `.<name>.claim`. The system gives the lock back when the process
ends, however it ends. Where a file system has no locks nothing is claimed, and two processes may do the same work; no
result is lost there either, because a folder takes its name only if the name is free, and another one otherwise.
"""

from __future__ import annotations

import errno
import os
import threading
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.errors import ResultsError
from interdrive.storage.locks import Locks
from interdrive.storage.writing import hidden, not_a_link, one_line, parents_of, replace_path, resolved, written_beside

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

#: Folders that are claimed, each with the process and the thread that did.
_CLAIMED: set[tuple[Path, int, int]] = set()

#: What a rename says if something with contents, or something else than a folder, has the name.
_NAME_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


class TakenError(ResultsError):
    """A folder is there already, or another process is writing it."""


@dataclass(frozen=True)
class FolderKind:
    """What a folder of results holds.

    Attributes:
        what: Its name, for messages.
        mark: File that every folder of this kind has.
        belongs: Whether an entry may be part of such a folder; one with other entries is never replaced.
    """

    what: str
    mark: str
    belongs: Callable[[Path], bool]


def keep_inputs(target: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuses to write a file or folder in the place of something that is read.

    Args:
        target: What is to be written.
        inputs: Files and folders that are read. Links, other spellings and hard links of them count, too.

    Raises:
        ResultsError: `target` is one of them, or a folder that one of them lies in.
    """
    places = {resolved(target, follow=False), resolved(target)}
    written = {found for place in places if (found := _identity(place)) is not None}
    for path in inputs:
        # Not `resolved`, which is for results: names of what is read need not be UTF-8.
        beside = Path(os.path.realpath(Path(path).parent)) / Path(path).name
        for name in {beside, Path(os.path.realpath(path))}:
            around = [name, *name.parents]
            if places.intersection(around) or written.intersection(map(_identity, around)):
                raise ResultsError(f"{target}: this would replace {path}, which is read; choose another path")


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of what is there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


@contextmanager
def claimed(
    folder: str | Path, kind: FolderKind, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """Claims a folder for this thread until the results are in it; yields its absolute path.

    Inside, `whole_folder` and further claims of the same thread find it claimed. A claim ends with its process.

    Args:
        folder: New or empty, or one of the same kind.
        kind: What it is to hold.
        overwrite: The folder may be replaced.
        inputs: Files that are read, none of which may be replaced.

    Raises:
        ResultsError: Another process or thread has claimed it; and as `check_folder` and `keep_inputs`.
    """
    own = resolved(folder, follow=False), os.getpid(), threading.get_ident()
    if own in _CLAIMED:
        yield own[0]
        return
    target = check_folder(folder, kind, overwrite=overwrite)
    keep_inputs(target, inputs)
    claim = target.with_name(f"{hidden(target)}.claim")
    with ExitStack() as stack:
        try:
            stack.enter_context(parents_of(target))
            locks = _locked(claim)
        except OSError as cause:
            raise ResultsError(f"{folder}: cannot be written: {one_line(cause)}") from cause
        if locks is None:
            raise TakenError(
                f"{folder}: another process is writing a {kind.what} there; wait for it, or choose another folder"
            )
        _CLAIMED.add(own)
        try:
            check_folder(folder, kind, overwrite=overwrite)  # another process may have finished a moment ago
            yield target
        finally:
            if os.getpid() == own[1]:  # else a forked child ends here
                _CLAIMED.remove(own)
                with suppress(OSError):
                    claim.unlink()
                locks.close()


@contextmanager
def claimed_new(folder: str | Path, kind: FolderKind) -> Iterator[Path]:
    """Claims the first of the folders NAME, NAME-2, NAME-3 ... that is not there yet, and yields its absolute path.

    Raises:
        ResultsError: No folder can be written there.
    """
    with ExitStack() as stack:
        for candidate in _numbered(Path(folder)):
            if not os.path.lexists(candidate):
                with suppress(TakenError):
                    target = stack.enter_context(claimed(candidate, kind))
                    break
        yield target


@contextmanager
def whole_folder(
    folder: str | Path, kind: FolderKind, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """A new hidden folder to write to, which becomes `folder` on success and is removed on failure.

    If something appeared at the name meanwhile that must not be replaced, the new folder is kept beside it.

    Args:
        folder: New or empty, or one of the same kind.
        kind: What it is to hold.
        overwrite: The folder may be replaced.
        inputs: Files that were read, none of which may be replaced.

    Raises:
        ResultsError: As `claimed`; it cannot be written; or the name was taken meanwhile: one line that says where the
            results are.
    """

    def put(partial: Path, target: Path) -> None:
        try:
            if overwrite and os.path.lexists(target):
                replace_path(partial, check_folder(target, kind, overwrite=True))
            else:
                partial.rename(target)
        except (ResultsError, OSError) as cause:
            if isinstance(cause, OSError) and cause.errno not in _NAME_TAKEN:
                raise
            kept = _moved_to_a_free_name(partial, target)
            if kept != target:  # else it is free again
                raise ResultsError(
                    f"{target}: something else appeared there and is not replaced; the {kind.what} is in {kept}"
                ) from None

    check_tables()
    with claimed(folder, kind, overwrite=overwrite, inputs=inputs) as target, written_beside(target, put) as partial:
        partial.mkdir()
        yield partial


def check_tables() -> None:
    """Checks that tables can be written, which takes a tenth of a second, before work that would be lost otherwise.

    Raises:
        ResultsError: pyarrow does not work.
    """
    try:
        import pyarrow.parquet  # noqa: F401, PLC0415
    except ImportError as cause:
        raise ResultsError(
            f"no results can be written, pyarrow does not work here: {one_line(cause)}; "
            "`pip install --upgrade interdrive` brings versions that fit together"
        ) from cause


def check_folder(folder: str | Path, kind: FolderKind, *, overwrite: bool = False) -> Path:
    """A folder that can be written whole, as an absolute path.

    Args:
        folder: New or empty, or one of the same kind.
        kind: What it is to hold.
        overwrite: The folder may be replaced.

    Raises:
        ResultsError: if it is a symbolic link or has contents that must not be replaced.
    """
    target = not_a_link(folder)
    try:
        if not target.exists():
            nearest = next(parent for parent in target.parents if parent.exists())
            if not nearest.is_dir():
                raise ResultsError(f"{folder}: {nearest} is not a folder")
            _check_writable(folder, nearest)
            return target
        if not target.is_dir():
            raise TakenError(f"{folder}: a file with this name already exists")
        entries = sorted(target.iterdir())
        foreign = [entry.name for entry in entries if not kind.belongs(entry)]
    except OSError as cause:
        raise ResultsError(f"{folder}: cannot be used as a {kind.what} folder: {one_line(cause)}") from cause
    inside = [entry.name for entry in entries]
    if inside and (kind.mark not in inside or foreign):
        example = (foreign or inside)[0]
        raise TakenError(
            f"{folder}: this folder has other contents ({example}) and is not replaced; choose another one"
        )
    if inside and not overwrite:
        raise TakenError(f"{folder}: a {kind.what} already exists there; --overwrite (overwrite=True) replaces it")
    _check_writable(folder, target.parent)  # the new folder replaces the old one
    return target


def _check_writable(folder: str | Path, place: Path) -> None:
    if not os.access(place, os.W_OK | os.X_OK):
        raise ResultsError(f"{folder}: no permission to write in {place}")


def _locked(claim: Path) -> Locks | None:
    """The lock on the file of a claim; None if another process or thread has it."""
    while True:
        locks = Locks(claim)
        try:
            is_own = locks.take(0, wait=False)
        except OSError:
            return locks  # this file system has no locks
        if not is_own:
            locks.close()
            return None
        if locks.is_at(claim):
            return locks
        locks.close()  # its last owner has removed it


def _moved_to_a_free_name(partial: Path, target: Path) -> Path:
    """Gives a finished folder the name `target`, or the next free name, and returns it."""
    free = (candidate for candidate in _numbered(target) if not os.path.lexists(candidate))
    while True:
        candidate = next(free)
        try:
            partial.rename(candidate)
        except OSError as cause:
            if cause.errno not in _NAME_TAKEN:
                raise
        else:
            return candidate


def _numbered(folder: Path) -> Iterator[Path]:
    """The folder, and others of the same name with a number: NAME, NAME-2, NAME-3 ..."""
    yield folder
    yield from (folder.with_name(f"{folder.name}-{number}") for number in count(2))
