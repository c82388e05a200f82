"""Contents of input files. Pipes and devices are refused, because reading them may never end or never begin."""

from __future__ import annotations

import errno
import stat
from typing import TYPE_CHECKING

from interdrive.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path


def content_of_file(path: Path) -> bytes:
    """All bytes of a regular file; symbolic links are followed.

    Raises:
        OSError: The file cannot be read, or is a folder, a pipe or a device; `strerror` states which.
    """
    try:
        mode = path.stat().st_mode
    except ValueError:  # a NUL, or no text
        raise OSError(errno.EINVAL, "this is no valid path", repr(str(path))) from None
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(errno.EINVAL, "it is a pipe or a device, not a file", str(path))
    return path.read_bytes()


def content_of_input(path: Path) -> bytes:
    """The same for an input file of a command or function.

    Raises:
        InputError: The file cannot be read; one line names it.
    """
    try:
        return content_of_file(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except OSError as error:
        hint = "; check its permissions" if isinstance(error, PermissionError) else ""
        raise InputError(f"{path}: cannot be read: {error.strerror or error}{hint}") from error
