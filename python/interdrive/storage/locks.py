"""Locks on single bytes of a file, between processes and between threads of one.

The system's locks (POSIX, `fcntl.lockf`) end with the process, however it ends, but belong to it as a whole: they do
not keep its threads apart, and closing any handle of the file gives all of them back. So a process opens a file once,
however many of its threads use it, and keeps a list of which bytes are taken. Locks that belong to a handle
(F_OFD_SETLK) would need no list, but not every system has them, and where it has not the list would be needed as well.
"""

from __future__ import annotations

import fcntl
import io
import os
import threading
import weakref
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


@dataclass
class _File:
    handle: io.FileIO
    taken: set[int] = field(default_factory=set)
    users: int = 0


#: Files that are open, by device and inode.
_FILES: dict[tuple[int, int], _File] = {}

#: Protects the lists of open files and taken bytes; notified when a byte is free again.
_CHANGED = threading.Condition()


class Locks:
    """Locks of one owner, such as a batch, on bytes of a file."""

    def __init__(self, path: Path) -> None:
        """Opens the file, or makes it; nothing is taken yet."""
        self._file = _opened(path)
        self._own: set[int] = set()
        # Also when the object is no longer referenced.
        self._end = weakref.finalize(self, _end, self._file, self._own)

    def take(self, byte: int, *, wait: bool) -> bool:
        """Takes a free byte; without waiting returns False if any owner, including this one, has it."""
        with _CHANGED:
            while byte in self._file.taken:
                if not wait:
                    return False
                _CHANGED.wait()
            self._file.taken.add(byte)
            self._own.add(byte)
        try:
            fcntl.lockf(self._file.handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)
        except BaseException as cause:
            _forget(self._file, self._own, byte)
            if isinstance(cause, (BlockingIOError, PermissionError)):  # systems say it in one way or the other
                return False
            raise
        return True

    def give(self, byte: int) -> None:
        """Releases a byte if this owner has it."""
        if byte in self._own:
            _give(self._file, self._own, byte)

    def is_at(self, path: Path) -> bool:
        """Whether the path still names the file whose bytes are locked; another owner may have removed it."""
        try:
            return os.path.samestat(path.stat(), os.fstat(self._file.handle.fileno()))
        except FileNotFoundError:
            return False

    def close(self) -> None:
        """Releases all bytes of this owner."""
        self._end()


def _opened(path: Path) -> _File:
    with _CHANGED:
        try:
            found = path.stat()
            file = _FILES.get((found.st_dev, found.st_ino))
        except FileNotFoundError:
            file = None
        if file is None:
            handle = io.FileIO(path, "a+")
            found = os.fstat(handle.fileno())
            file = _FILES[found.st_dev, found.st_ino] = _File(handle)
        file.users += 1
        return file


def _give(file: _File, own: set[int], byte: int) -> None:
    fcntl.lockf(file.handle, fcntl.LOCK_UN, 1, byte)
    _forget(file, own, byte)


def _forget(file: _File, own: set[int], byte: int) -> None:
    with _CHANGED:
        file.taken.discard(byte)
        own.discard(byte)
        _CHANGED.notify_all()


def _end(file: _File, own: set[int]) -> None:
    with _CHANGED:
        for byte in sorted(own):
            _give(file, own, byte)
        file.users -= 1
        if not file.users:
            for identity in [identity for identity, other in _FILES.items() if other is file]:
                del _FILES[identity]
            file.handle.close()
