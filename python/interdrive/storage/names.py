"""Names of files. On Linux a name may be any bytes, which Python keeps as lone surrogates."""

from __future__ import annotations

from pathlib import Path

from interdrive.errors import InputError


def path_of(name: str) -> Path:
    """The path that a text in a setting means; `~` and `~user` are home folders.

    Raises:
        InputError: It can be no path, or there is no such user.
    """
    try:
        path = Path(name).expanduser()
    except RuntimeError:
        raise InputError(f"{name}: there is no home folder of that user") from None
    if "\0" in name:
        raise InputError(f"{name!r}: this is no valid path")
    return path


def readable(name: str) -> str:
    r"""The name with bytes that are not UTF-8 as escapes such as \xe9, for Parquet, XML and pages.

    Args:
        name: Any text; text without lone surrogates is returned unchanged.
    """
    try:
        name.encode()
    except UnicodeEncodeError:
        try:
            return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
        except UnicodeEncodeError:
            return name.encode("utf-8", "backslashreplace").decode()
    return name
