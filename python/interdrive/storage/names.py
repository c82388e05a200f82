"""Names of files as texts: on Linux a name is any bytes, which Python keeps as lone surrogates."""

from __future__ import annotations


def readable(name: str) -> str:
    r"""The name with bytes that are not UTF-8 as escapes such as \xe9; what Parquet, XML and pages can hold.

    Args:
        name: Any text; one without lone surrogates comes back as it is.
    """
    try:
        name.encode()
    except UnicodeEncodeError:
        try:
            return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
        except UnicodeEncodeError:
            return name.encode("utf-8", "backslashreplace").decode()
    return name
