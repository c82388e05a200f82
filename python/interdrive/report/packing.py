"""Arrays as few bytes: whole multiples of a resolution, differences, split into byte planes, compressed."""

from __future__ import annotations

import base64
import zlib
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.report.contract import Entry

#: Bits of a float32's mantissa (23) that are dropped where a number has no resolution of its own: 4 digits remain.
_DROPPED_BITS = 10

#: zlib's strongest; decoding does not take longer.
_LEVEL = 9


#: Integer types by the names that the page knows, the smallest first; little end first.
_KINDS: dict[Literal["u8", "i8", "i16", "i32"], np.dtype[Any]] = {
    "u8": np.dtype("u1"),
    "i8": np.dtype("i1"),
    "i16": np.dtype("<i2"),
    "i32": np.dtype("<i4"),
}


class Packer:
    """Collects arrays; `header` describes them for unpacking, `text` is all of them in base64.

    An array is stored as integers if it has a resolution (its unit) and as float32 otherwise. Integers may be
    differences: along the last axis, and along the first column from row to row. Where values are absent (nan), a bit
    mask follows. The bytes of all first bytes come first, then those of all second bytes, and so on, little end first.
    """

    def __init__(self) -> None:
        """Starts empty."""
        self.header: dict[str, Entry] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, name: str, array: NDArray[Any], *, unit: float | None = None, steps: bool = False) -> None:
        """Adds an array under a name.

        Args:
            name: How the reader finds it.
            array: Numbers or truth values of any shape; nan where absent.
            unit: Resolution; values are rounded to whole multiples. Without it, or where they are too large for it,
                integers stay exact and other numbers keep four digits (and inf and nan).
            steps: Store differences; better where neighbours are alike.
        """
        values = np.asarray(array)
        if values.dtype.kind == "f" and (unit is None or not _is_small(values, unit)):
            at = self._put(_planes(_shortened(values)))
            self.header[name] = {"type": "f32", "shape": list(values.shape), "at": at}
        else:
            absent = ~np.isfinite(values) if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)
            whole = np.zeros(values.shape, dtype=np.int64)
            whole[~absent] = np.round(values[~absent] / (unit or 1.0)).astype(np.int64)
            if absent.any():
                whole = _carried(whole, absent)
            if steps:
                whole = _differences(whole)
            kind = _narrowest(whole)
            at, shape = self._put(_planes(whole.astype(_KINDS[kind]))), list(values.shape)
            self.header[name] = {"type": kind, "shape": shape, "at": at, "unit": unit or 1.0, "steps": steps}
            if absent.any():
                self.header[name]["absent"] = self._put(np.packbits(absent.ravel(), bitorder="little").tobytes())

    def text(self) -> str:
        """All arrays, compressed (zlib) and in base64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), _LEVEL)).decode("ascii")

    def _put(self, data: bytes) -> int:
        at = self._size
        self._parts.append(data)
        self._size += len(data)
        return at


def _is_small(values: NDArray[Any], unit: float) -> bool:
    """Multiples of the unit, and differences of two of them, are 32-bit integers."""
    largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    return bool(largest / unit < 2**30)


def _narrowest(whole: NDArray[np.int64]) -> Literal["u8", "i8", "i16", "i32"]:
    """The smallest type that holds all values."""
    low, high = int(whole.min(initial=0)), int(whole.max(initial=0))
    limits = {name: np.iinfo(kind) for name, kind in _KINDS.items()}
    return next(name for name, limit in limits.items() if limit.min <= low and high <= limit.max)


def _shortened(values: NDArray[Any]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # what is too large for single precision is inf
        single = np.ascontiguousarray(values, dtype="<f4")
    bits = single.view("<u4").copy()
    finite = np.isfinite(single)
    half, mask = np.uint32(1 << (_DROPPED_BITS - 1)), np.uint32(0xFFFFFFFF << _DROPPED_BITS & 0xFFFFFFFF)
    bits[finite] = (bits[finite] + half) & mask
    return bits.view("<f4")


def _carried(whole: NDArray[np.int64], absent: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Absent entries repeat what stands before them in their row."""
    rows = whole.reshape(-1, whole.shape[-1])
    last = np.where(absent.reshape(rows.shape), 0, np.arange(rows.shape[1]))
    last = np.maximum.accumulate(last, axis=1)
    return np.take_along_axis(rows, last, axis=1).reshape(whole.shape)


def _differences(whole: NDArray[np.int64]) -> NDArray[np.int64]:
    rows = whole.reshape(-1, whole.shape[-1]) if whole.size else whole.reshape(0, 1)
    made = np.diff(rows, axis=1, prepend=0)
    made[:, 0] = np.diff(rows[:, 0], prepend=0)
    return made.reshape(whole.shape)


def _planes(values: NDArray[Any]) -> bytes:
    flat = np.ascontiguousarray(values).reshape(-1)
    return flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T.tobytes()
