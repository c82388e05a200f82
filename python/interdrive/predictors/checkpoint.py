"""Tensors of a legacy torch checkpoint (torch < 1.6), read without torch and without running what it says.

Such a stream is five pickles (magic number, protocol, type sizes, named tensors, keys of storages) and the raw
storages behind them, little endian. The pickles are walked opcode by opcode: those that a dictionary of tensors needs
are known, and the three names that it refers to stand for a dictionary, a kind of storage and "a piece of a storage".
Nothing is imported or called; anything else is refused.
"""

from __future__ import annotations

import io
import math
import pickletools
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAGIC = 0x1950A86A20F9469CFC6C
PROTOCOL = 1001

_DICTIONARY = "collections OrderedDict"
_STORAGE = "torch FloatStorage"
_TENSOR = "torch._utils _rebuild_tensor_v2"
_MARK = object()

_CONSTANTS: dict[str, Any] = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_NUMBERS_AND_TEXTS = {"LONG1", "BININT", "BININT1", "BININT2", "BINUNICODE"}
_EMPTY: dict[str, Any] = {"EMPTY_DICT": dict, "EMPTY_LIST": list, "EMPTY_TUPLE": tuple}
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


@dataclass(frozen=True)
class _Name:
    """One of the three names that a stream may refer to."""

    text: str


@dataclass(frozen=True)
class _Storage:
    key: str
    count: int


@dataclass(frozen=True)
class _Piece:
    """A tensor: a piece of a storage."""

    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


class _RefusedError(Exception):
    """Why a stream cannot be read; never leaves this module."""


def read_checkpoint(data: bytes, source: str) -> dict[str, NDArray[np.float32]]:
    """All tensors of a stream that torch.save wrote before torch 1.6.

    Args:
        data: The stream.
        source: Where it is from, for messages.

    Returns:
        float32 arrays by name.

    Raises:
        InputError: It is truncated or no such stream, or it wants something else than tensors (such as a call of any
            function); the text starts with `source`. Nothing of it has been run then.
    """
    try:
        return _tensors(io.BytesIO(data))
    except _RefusedError as error:
        raise InputError(f"{source}: {error}") from error
    except (ValueError, LookupError, TypeError, AttributeError, struct.error, OverflowError) as error:
        raise InputError(f"{source}: truncated, or no stream of tensors as torch wrote them until 1.5") from error


def _tensors(stream: io.BytesIO) -> dict[str, NDArray[np.float32]]:
    if _Pickle().load(stream) != MAGIC or _Pickle().load(stream) != PROTOCOL:
        raise _RefusedError("no stream of tensors as torch wrote them until 1.5")
    if _Pickle().load(stream).get("little_endian") is not True:
        raise _RefusedError("the numbers are not little endian")
    named = _Pickle().load(stream)
    storages = {key: _raw(stream) for key in _Pickle().load(stream)}
    if stream.read(1):
        raise _RefusedError("there is something behind the last storage")
    return {name: _values(name, piece, storages) for name, piece in named.items()}


def _raw(stream: io.BytesIO) -> NDArray[np.float32]:
    (count,) = struct.unpack("<q", stream.read(8))
    raw = stream.read(4 * count) if count >= 0 else b""
    if len(raw) != 4 * count:
        raise _RefusedError("truncated")
    return np.frombuffer(raw, dtype="<f4").astype(np.float32)


def _values(name: object, piece: object, storages: dict[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    if not isinstance(name, str) or not isinstance(piece, _Piece):
        raise _RefusedError(f"entry {name!r} is no tensor")
    storage, size = storages[piece.storage.key], math.prod(piece.shape)
    contiguous = tuple(math.prod(piece.shape[i + 1 :]) for i in range(len(piece.shape)))
    inside = 0 <= piece.offset <= piece.offset + size <= len(storage) == piece.storage.count
    if piece.strides != contiguous or any(length < 0 for length in piece.shape) or not inside:
        raise _RefusedError(f"tensor {name} is not one piece of its storage")
    return storage[piece.offset : piece.offset + size].reshape(piece.shape)


class _Pickle:
    """The few opcodes of a pickle that make up numbers, texts, containers and tensors."""

    def __init__(self) -> None:
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def load(self, stream: io.BytesIO) -> Any:  # noqa: ANN401 - plain values, containers, pieces
        """The next pickle of a stream, which stands behind it then."""
        for opcode, argument, _ in pickletools.genops(stream):
            if opcode.name == "STOP":
                return self._stack.pop()
            if opcode.name != "PROTO":
                self._do(opcode.name, argument)
        raise _RefusedError("truncated")

    def _do(self, name: str, argument: Any) -> None:  # noqa: ANN401 - as pickletools gives it
        stack = self._stack
        if name in _NUMBERS_AND_TEXTS:
            stack.append(argument)
        elif name in _CONSTANTS:
            stack.append(_CONSTANTS[name])
        elif name in _EMPTY:
            stack.append(_EMPTY[name]())
        elif name == "MARK":
            stack.append(_MARK)
        elif name in ("BINPUT", "LONG_BINPUT"):
            self._memo[argument] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            stack.append(self._memo[argument])
        else:
            self._build(name, argument)

    def _build(self, name: str, argument: Any) -> None:  # noqa: ANN401 - as pickletools gives it
        stack = self._stack
        if name == "TUPLE":
            stack.append(tuple(self._since_mark()))
        elif name in _TUPLES:
            stack[-_TUPLES[name] :] = [tuple(stack[-_TUPLES[name] :])]
        elif name == "SETITEM":
            value, key = stack.pop(), stack.pop()
            stack[-1][key] = value
        elif name == "SETITEMS":
            items = self._since_mark()
            stack[-1].update(zip(items[::2], items[1::2], strict=True))
        elif name == "APPENDS":
            items = self._since_mark()
            stack[-1].extend(items)
        elif name == "BUILD":
            stack.pop()  # notes of torch on the dictionary
        elif name == "GLOBAL":
            stack.append(_known(argument))
        elif name == "BINPERSID":
            stack.append(_storage(*stack.pop()))
        elif name == "REDUCE":
            arguments, made = stack.pop(), stack.pop()
            stack.append(_made(made, arguments))
        else:
            raise _RefusedError(f"it holds {name}, which tensors do not need; nothing of it was run")

    def _since_mark(self) -> list[Any]:
        start = max(i for i, value in enumerate(self._stack) if value is _MARK)
        found = self._stack[start + 1 :]
        del self._stack[start:]
        return found


def _known(name: str) -> _Name:
    if name not in (_DICTIONARY, _STORAGE, _TENSOR):
        raise _RefusedError(f"it refers to {name.replace(' ', '.')}, which tensors do not need; nothing of it was run")
    return _Name(name)


def _storage(what: object, kind: object, key: object, _device: object, count: object, view: object) -> _Storage:
    if what != "storage" or kind != _Name(_STORAGE) or view is not None:
        raise _RefusedError("it holds a storage that is not one of float32 numbers")
    if not isinstance(key, str) or type(count) is not int:
        raise _RefusedError("it holds a storage without key or size")
    return _Storage(key, count)


def _made(name: object, arguments: tuple[Any, ...]) -> object:
    """What the call of one of the known names stands for."""
    if name == _Name(_DICTIONARY) and not arguments:
        return {}
    if name == _Name(_TENSOR):
        storage, offset, shape, strides, *_ = arguments
        whole = all(type(number) is int for number in (offset, *shape, *strides))
        if isinstance(storage, _Storage) and whole:
            return _Piece(storage, offset, tuple(shape), tuple(strides))
    raise _RefusedError("it wants something made that is no tensor; nothing of it was run")
