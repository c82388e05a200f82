"""Arrow arrays made of numpy arrays and back, from their buffers.

Nearly every conversion of pyarrow itself (`pa.array`, `to_numpy`, `fill_null`, `empty_table`) first imports pandas
where it is installed, which takes half a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pyarrow as pa
    from numpy.typing import NDArray

    from interdrive.array_types import Bools

#: Names of types that numpy gives to others.
_KINDS = {"float": "float32", "double": "float64", "halffloat": "float16"}


def numbers(values: NDArray[Any], absent: Bools | None = None) -> pa.Array:
    """An Arrow array of a numpy array of integers or floats, null where `absent`."""
    import pyarrow as pa  # noqa: PLC0415

    content = np.ascontiguousarray(values)
    kind = pa.from_numpy_dtype(content.dtype)
    return pa.Array.from_buffers(kind, len(content), [_validity(absent), pa.py_buffer(content)])


def truths(values: Bools, absent: Bools | None = None) -> pa.Array:
    """An Arrow array of truths, null where `absent`."""
    import pyarrow as pa  # noqa: PLC0415

    return pa.Array.from_buffers(pa.bool_(), len(values), [_validity(absent), _bits(values)])


def texts(values: Iterable[str | None]) -> pa.Array:
    """An Arrow array of texts, null for None.

    Raises:
        UnicodeEncodeError: A text has characters that are none, such as half a pair of surrogates.
    """
    import pyarrow as pa  # noqa: PLC0415

    encoded = [None if text is None else text.encode() for text in values]
    ends = np.cumsum([0, *(len(text or b"") for text in encoded)], dtype=np.int32)
    content = pa.py_buffer(b"".join(text or b"" for text in encoded))
    absent = np.array([text is None for text in encoded], dtype=np.bool_)
    return pa.Array.from_buffers(pa.string(), len(encoded), [_validity(absent), pa.py_buffer(ends), content])


def values_of(column: pa.ChunkedArray | pa.Array, absent: Any = None) -> NDArray[Any]:  # noqa: ANN401 - a value
    """The values of a column of numbers, truths, texts or labels.

    Args:
        column: The column.
        absent: What stands for null; None: nan, which makes floats of integers, and None among texts.

    Returns:
        An array that owns its values; texts are an array of objects.
    """
    import pyarrow as pa  # noqa: PLC0415

    if isinstance(column, pa.ChunkedArray):
        chunks = column.chunks or [pa.nulls(0, column.type)]
        parts = [values_of(chunk, absent) for chunk in chunks]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)
    array = column
    if pa.types.is_dictionary(array.type):
        names = [absent if name is None else name for name in array.dictionary.to_pylist()]
        rows = _content(array.indices).astype(np.int64)
        rows[_are_absent(array.indices)] = len(names)
        picked: NDArray[Any] = np.array([*names, absent], dtype=object)[rows]
        return picked
    if pa.types.is_string(array.type) or pa.types.is_large_string(array.type):
        return np.array([absent if text is None else text for text in array.to_pylist()], dtype=object)
    found = _content(array)
    if not array.null_count:
        return found
    if absent is None:
        found, absent = found.astype(np.float64), np.nan
    found[_are_absent(array)] = absent
    return found


def _content(array: pa.Array) -> NDArray[Any]:
    import pyarrow as pa  # noqa: PLC0415

    n, begin, content = len(array), array.offset, array.buffers()[1]
    if pa.types.is_boolean(array.type):
        return _unpacked(content, begin, n)
    kind = np.dtype(_KINDS.get(str(array.type), str(array.type)))
    if not n:
        return np.zeros(0, dtype=kind)
    return np.frombuffer(content, dtype=kind, count=n, offset=kind.itemsize * begin).copy()


def _are_absent(array: pa.Array) -> Bools:
    validity = array.buffers()[0]
    if validity is None:
        return np.zeros(len(array), dtype=np.bool_)
    return ~_unpacked(validity, array.offset, len(array))


def _unpacked(bits: pa.Buffer, begin: int, n: int) -> Bools:
    if not n:
        return np.zeros(0, dtype=np.bool_)
    some = np.unpackbits(np.frombuffer(bits, dtype=np.uint8), count=begin + n, bitorder="little")
    return some[begin:].astype(np.bool_)


def _validity(absent: Bools | None) -> pa.Buffer | None:
    return None if absent is None or not absent.any() else _bits(~absent)


def _bits(truths: Bools | Sequence[bool]) -> pa.Buffer:
    import pyarrow as pa  # noqa: PLC0415

    return pa.py_buffer(np.packbits(np.asarray(truths, dtype=np.bool_), bitorder="little"))
