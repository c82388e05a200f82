"""File names as text: on Linux a name may be any bytes, which Python keeps as lone surrogates."""

from __future__ import annotations


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
