"""Values of a simulation_config.p beside a SUMO scenario, which is never unpickled.

Its operations are listed, and a small machine runs the few of them that make plain values; it imports nothing.
"""

from __future__ import annotations

import pickletools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

#: Largest file [bytes].
_LARGEST = 64 * 2**10
#: Classes whose objects become dicts of their attributes, and one whose objects become their value.
_RECORDS = frozenset({("sumocr.sumo_config.default", "DefaultConfig"), ("commonroad.common.util", "Interval")})
_TEXTS = frozenset({("commonroad.scenario.obstacle", "ObstacleType")})
_MARK = object()

#: Operations that push a value, by the value or by their argument.
_CONSTANTS: dict[str, Any] = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
_ARGUMENTS = frozenset({"BININT", "BININT1", "BININT2", "LONG1", "BINFLOAT", "BINUNICODE", "SHORT_BINUNICODE"})
_SKIPPED = frozenset({"PROTO", "FRAME", "STOP"})


class NotUnderstoodError(Exception):
    """It holds something else than plain values; the text says what and where."""


def values_of(data: bytes) -> dict[str, Any]:
    """Attributes of the configuration.

    Args:
        data: Content of the file.

    Raises:
        NotUnderstoodError: An operation or a name is not among the known ones, or the file is damaged or too large.
    """
    if len(data) > _LARGEST:
        raise NotUnderstoodError(f"{len(data)} bytes are more than {_LARGEST}")
    machine, place = _Machine(), 0
    try:
        for operation, argument, position in pickletools.genops(data):
            place = position or 0
            machine.run(operation.name, argument)
        found = machine.stack[-1]
    except NotUnderstoodError as error:
        raise NotUnderstoodError(f"{error}, byte {place}") from None
    except (ValueError, IndexError, KeyError, TypeError, AttributeError) as error:
        raise NotUnderstoodError(f"it is damaged after byte {place}") from error
    if len(machine.stack) != 1 or not isinstance(found, dict):
        raise NotUnderstoodError("it is no DefaultConfig")
    return found


class _Machine:
    """A stack of plain values."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self._known: list[Any] = []
        self._run: dict[str, Callable[[Any], None]] = {
            "MARK": lambda _: self.stack.append(_MARK),
            "MEMOIZE": lambda _: self._known.append(self.stack[-1]),
            "BINGET": lambda place: self.stack.append(self._known[place]),
            "LONG_BINGET": lambda place: self.stack.append(self._known[place]),
            "EMPTY_DICT": lambda _: self.stack.append({}),
            "EMPTY_LIST": lambda _: self.stack.append([]),
            "TUPLE1": lambda _: self.stack.append((self.stack.pop(),)),
            "TUPLE": lambda _: self.stack.append(tuple(self._since_mark())),
            "SETITEM": lambda _: self._set([self.stack.pop(-2), self.stack.pop()]),
            "SETITEMS": lambda _: self._set(self._since_mark()),
            "APPEND": lambda _: self._extend([self.stack.pop()]),
            "APPENDS": lambda _: self._extend(self._since_mark()),
            "STACK_GLOBAL": self._name,
            "NEWOBJ": self._new,
            "REDUCE": self._call,
            "BUILD": self._build,
        }

    def run(self, name: str, argument: Any) -> None:  # noqa: ANN401 - any argument
        """Does one operation."""
        if name in _SKIPPED:
            return
        if name in _CONSTANTS:
            self.stack.append(_CONSTANTS[name])
        elif name in _ARGUMENTS:
            self.stack.append(argument)
        elif name in self._run:
            self._run[name](argument)
        else:
            raise NotUnderstoodError(name)

    def _since_mark(self) -> list[Any]:
        place = max(i for i, value in enumerate(self.stack) if value is _MARK)
        found = self.stack[place + 1 :]
        del self.stack[place:]
        return found

    def _set(self, items: list[Any]) -> None:
        self._target(dict).update(zip(items[::2], items[1::2], strict=True))

    def _extend(self, items: list[Any]) -> None:
        self._target(list).extend(items)

    def _target(self, kind: type) -> Any:  # noqa: ANN401 - a dict or a list
        if not isinstance(self.stack[-1], kind):
            raise TypeError
        return self.stack[-1]

    def _name(self, _: object) -> None:
        name, module = self.stack.pop(), self.stack.pop()
        if (module, name) not in _RECORDS | _TEXTS:
            raise NotUnderstoodError(f"{module}.{name}")
        self.stack.append((module, name))

    def _new(self, _: object) -> None:
        arguments, name = self.stack.pop(), self.stack.pop()
        if name not in _RECORDS or arguments != ():
            raise NotUnderstoodError("NEWOBJ")
        self.stack.append({})

    def _call(self, _: object) -> None:
        arguments, name = self.stack.pop(), self.stack.pop()
        if name not in _TEXTS or len(arguments) != 1 or not isinstance(arguments[0], str):
            raise NotUnderstoodError("REDUCE")
        self.stack.append(arguments[0])

    def _build(self, _: object) -> None:
        state = self.stack.pop()
        self._target(dict).update(dict(state))
