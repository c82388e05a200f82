"""Reading of text files that others may have written: JSON and TOML. Whatever is wrong with them is a ValueError."""

from __future__ import annotations

import json
import math
import tomllib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path


def read_json(path: Path) -> Any:  # noqa: ANN401 - any JSON value
    """Reads a JSON file.

    Raises:
        OSError: The file cannot be read.
        ValueError: As `parsed_json` and `decoded`.
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is not a file")
    return parsed_json(decoded(path.read_bytes()))


def parsed_json(text: str) -> Any:  # noqa: ANN401 - any JSON value
    """The value of a JSON text.

    Raises:
        ValueError: It is not JSON, is nested too deeply, or has an invalid number (NaN, Infinity, 1e999).
    """
    try:
        return json.loads(text, parse_constant=_finite_number, parse_float=_finite_number)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def parsed_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises:
        ValueError: It is not TOML, or is nested too deeply.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("its brackets are nested too deeply") from None


def decoded(content: bytes) -> str:
    """The text of a file in UTF-8, with or without a mark at its beginning.

    Raises:
        ValueError: It is not UTF-8; the message says where.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as cause:
        line = content.count(b"\n", 0, cause.start) + 1
        raise ValueError(f"byte {content[cause.start]} at line {line} is not UTF-8; save the file as UTF-8") from None


def _finite_number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is not a JSON number")
    return number
