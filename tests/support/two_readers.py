"""A document as the core and as commonroad-io read it, compared field by field."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from commonroad_io import read_by_commonroad_io

from interdrive.errors import InputError
from interdrive.files.read import read_document

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from interdrive.scenario import Scenario


def disagreements(data: bytes, file: str) -> list[str]:
    """Where both readers differ: names of fields, or what only one of them refuses; nothing if both refuse.

    Notes about elements of which the first of several counts are those of the core alone.
    """
    core = _read(lambda: read_document(data, file, raw=True))
    other = _read(lambda: read_by_commonroad_io(data, file))
    if isinstance(core, InputError) or isinstance(other, InputError):
        both = isinstance(core, InputError) and isinstance(other, InputError)
        return [] if both else [f"the core: {core}; commonroad-io: {other}"]
    found = list(_differences(core, other, ""))
    notes = {note for note in core.notes if not note.endswith("the first counts") or " stated twice " in note}
    return found + [f"note: {note}" for note in sorted(notes ^ set(other.notes))]


def _read(read: Callable[[], Scenario]) -> Scenario | InputError:
    try:
        return read()
    except InputError as error:
        return error


def _differences(one: Any, other: Any, where: str) -> Iterator[str]:
    if is_dataclass(one) and type(one) is type(other):
        for field in fields(one):
            if field.name not in ("notes", "raw"):
                yield from _differences(getattr(one, field.name), getattr(other, field.name), f"{where}.{field.name}")
    elif isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        for index, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from _differences(a, b, f"{where}[{index}]")
    elif isinstance(one, np.ndarray):
        is_float = one.dtype.kind == "f"
        if one.dtype != other.dtype or not np.array_equal(one, other, equal_nan=is_float):
            yield where
    elif one != other and not (one != one and other != other):
        yield f"{where}: {one} and {other}"
