"""Binds dotted names to nested frozen dataclasses, for `--set`, TOML files and run.json."""

from __future__ import annotations

import difflib
import enum
import inspect
import math
import re
import types
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

#: The value of a setting: of its type, or a text as typed on a command line.
Setting: TypeAlias = "str | int | float | bool | Sequence[Setting] | None"

_WORDS: dict[object, str] = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "a text",
    type(None): "none",
}


class _MismatchError(Exception):
    """The value does not fit the type; never leaves this module."""


def bind(defaults: T, values: Mapping[str, Any], *, unknown: str = "no such setting") -> T:
    """Returns a copy of `defaults` in which the named fields have the given values.

    Args:
        defaults: Instance of a frozen dataclass, whose fields may be frozen dataclasses again.
        values: Dotted name ("planner.frenet.horizon") -> a text as typed on a command line, or a value as TOML and
            JSON give it. Texts are converted to the type of the field; tuples are written "1, 2, 3", absence "none".
        unknown: What is said of a name that does not exist.

    Returns:
        A new instance, or the same one if nothing is named. Its dataclasses check ranges in `__post_init__`.

    Raises:
        InputError: for an unknown name (with the nearest one), a group where a value is needed, a value of another
            type, or a value that a dataclass refuses; the text starts with the dotted name.
    """
    if not values and type(defaults).__dataclass_params__.frozen:  # type: ignore[attr-defined]
        return defaults
    known = flatten(defaults)
    for key in values:
        if key not in known:
            raise InputError(key, _unknown(key, list(known), unknown))
    return _rebuilt(defaults, values, "")


def constructed(kind: type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass whose fields may lack defaults, with the named fields set as `bind` does it.

    Args:
        kind: The dataclass.
        values: As for `bind`; every field without a default must be among them.

    Raises:
        InputError: As for `bind`, or a field without a default is not given.
    """
    needed = {}
    for item in fields(kind):
        if item.init and item.default is MISSING and item.default_factory is MISSING:
            if item.name not in values:
                raise InputError(item.name, "this setting has no default and must be given")
            needed[item.name] = _fitting(item.name, values[item.name], kind)
    return bind(kind(**needed), values)


def flatten(instance: DataclassInstance) -> dict[str, Any]:
    """Every field of nested dataclasses under its dotted name, as plain values; `bind` takes them back."""
    found: dict[str, Any] = {}
    _flatten(instance, "", found)
    return found


#: Types of values that are plain.
_SIMPLE = frozenset((bool, int, float, str, type(None)))


def _flatten(instance: DataclassInstance, prefix: str, found: dict[str, Any]) -> None:
    for name in _settings_of(type(instance)):
        value = getattr(instance, name)
        if type(value) in _SIMPLE:
            found[prefix + name] = value
        elif hasattr(type(value), "__dataclass_fields__"):
            _flatten(value, f"{prefix}{name}.", found)
        else:
            found[prefix + name] = _plain(value)


def dotted(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of nested tables, as in a TOML file, by dotted name."""
    flat: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            flat.update({f"{key}.{inner}": item for inner, item in dotted(value).items()})
        else:
            flat[key] = value
    return flat


def described(owner: DataclassInstance | type[DataclassInstance]) -> list[tuple[str, Any, str, str]]:
    """(dotted name, value, unit, one line from the docstring) of every field, for listings.

    For a class the values are the defaults, or a remark that there is none.
    """
    kind = owner if isinstance(owner, type) else type(owner)
    rows: list[tuple[str, Any, str, str]] = []
    for item in fields(owner):
        if not item.init:
            continue
        value = _default(item) if isinstance(owner, type) else getattr(owner, item.name)
        if is_dataclass(value) and not isinstance(value, type):
            rows += [(f"{item.name}.{name}", *rest) for name, *rest in described(value)]
        else:
            rows.append((item.name, _plain(value), _unit(kind, item.name), _documentation(kind, item.name)))
    return rows


def description(thing: object) -> str:
    """The docstring of a class, function or object up to its fields; "" if there is none."""
    kind = thing if isinstance(thing, type) or hasattr(thing, "__qualname__") else type(thing)
    return re.split(r"^(?:Attributes|Args|Raises|Returns|Example):", _written(kind), maxsplit=1, flags=re.M)[0].strip()


def _default(item: Field[Any]) -> object:
    if item.default is not MISSING:
        return item.default
    return "must be given" if item.default_factory is MISSING else item.default_factory()


def _written(owner: object) -> str:
    """The docstring, unless it was generated by `dataclass`."""
    text = getattr(owner, "__doc__", None) or ""
    return "" if text.startswith(f"{getattr(owner, '__name__', '')}(") else inspect.cleandoc(text)


@cache
def _settings_of(kind: type[DataclassInstance]) -> tuple[str, ...]:
    """Names of the fields of a dataclass that are settings; the state of a planner is none."""
    return tuple(item.name for item in fields(kind) if item.init)


def _plain(value: object) -> object:
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value


def _unknown(key: str, known: list[str], word: str) -> str:
    inside = [name for name in known if name.startswith(f"{key}.")]
    if inside:
        return f"this is a group of settings, name one of {', '.join(inside[:6])}{', ...' * (len(inside) > 6)}"
    same_ending = [name for name in known if name.endswith(f".{key}")]
    near = same_ending or difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    if not near:
        leaf = {name.rpartition(".")[2]: name for name in known}
        near = [leaf[name] for name in difflib.get_close_matches(key.rpartition(".")[2], list(leaf), n=1)]
    return word + (f"; did you mean {' or '.join(near[:3])}?" if near else "")


def _rebuilt(instance: T, values: Mapping[str, Any], prefix: str) -> T:
    changes: dict[str, Any] = {}
    for item in fields(instance):
        if not item.init:
            continue
        name, old = f"{prefix}{item.name}", getattr(instance, item.name)
        if is_dataclass(old) and not isinstance(old, type):
            new = _rebuilt(old, values, f"{name}.")
            if new is not old:
                changes[item.name] = new
        elif name in values:
            changes[item.name] = _fitting(name, values[name], type(instance))
    if not changes:
        return instance
    try:
        return replace(instance, **changes)
    except InputError as refusal:
        name = f"{prefix}{refusal.location}".rstrip(".")
        raise InputError(*([name] if name else []), refusal.message) from None


def _fitting(name: str, value: object, owner: type) -> object:
    """The value converted to the type of the field; otherwise an error with the expected type and unit."""
    hint, unit = _hint(owner, name.rpartition(".")[2])
    try:
        return _converted(value, hint)
    except _MismatchError:
        expected = _expectation(hint) + (f" [{unit}]" if unit else "")
        if str(value).strip().lower() in ("true", "false"):  # a number can be meant to switch something on
            expected = _clause(_documentation(owner, name.rpartition(".")[2]), expected)
        raise InputError(name, f"expected {expected}, not {value!r}") from None


def _clause(text: str, expected: str) -> str:
    """What is expected, with the first clause of a documentation."""
    clause = re.split(r" \(|[:;.,]", text, maxsplit=1)[0]
    return f"{expected} ({clause[:1].lower()}{clause[1:]})" if clause else expected


@cache
def _hint(owner: type, field: str) -> tuple[object, str]:
    """The type of a field and its unit ("s" for `Annotated[float, "s"]`); "" if none.

    Names in the types of other fields may be unknown at run time.
    """
    kind = next(kind for kind in owner.__mro__ if field in inspect.get_annotations(kind))
    alone = {"__annotations__": {field: inspect.get_annotations(kind)[field]}, "__module__": kind.__module__}
    hint = get_type_hints(type(kind.__name__, (), alone), include_extras=True)[field]
    return (get_args(hint)[0], str(get_args(hint)[1])) if get_origin(hint) is Annotated else (hint, "")


def _unit(owner: type, field: str) -> str:
    try:
        return _hint(owner, field)[1]
    except NameError:  # a name that only type checkers import
        return ""


def _converted(value: object, hint: object) -> object:
    """The value converted to the type.

    Raises:
        _MismatchError: if it cannot be converted to that type.
    """
    if type(hint) is type and hint in _WORDS:  # most are
        return _scalar(value, hint)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _first(value, sorted(arguments, key=lambda kind: kind is str))
    if origin is Literal:
        texts = {str(item): item for item in arguments}
        return _chosen(str(value), texts)
    if origin is tuple:
        return _tuple(value, arguments)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return _chosen(str(value).lower(), {item.name.lower(): item for item in hint})
    if hint not in _WORDS:
        raise TypeError(f"settings cannot have the type {hint!r}")
    return _scalar(value, hint)


def _scalar(value: object, kind: object) -> object:
    if type(value) is kind and kind is not float:
        return value
    if kind is type(None) and str(value).strip().lower() == "none":
        return None
    if kind is bool and str(value).strip().lower() in ("true", "false"):
        return str(value).strip().lower() == "true"
    if kind is str and isinstance(value, str):
        return value
    if kind in (int, float) and isinstance(value, str | int | float) and not isinstance(value, bool):
        if kind is int and isinstance(value, float):
            raise _MismatchError
        try:
            number = int(value) if kind is int else float(value)
        except (ValueError, OverflowError):
            raise _MismatchError from None
        if not math.isnan(number):
            return number
    raise _MismatchError


def _first(value: object, kinds: list[object]) -> object:
    for kind in kinds:
        try:
            return _converted(value, kind)
        except _MismatchError:
            continue
    raise _MismatchError


def _chosen(text: str, choices: Mapping[str, object]) -> object:
    if text.strip() not in choices:
        raise _MismatchError
    return choices[text.strip()]


def _tuple(value: object, kinds: tuple[object, ...]) -> tuple[object, ...]:
    if isinstance(value, str):
        inner = value.strip().removeprefix("[").removesuffix("]").strip().removesuffix(",")
        value = [item.strip() for item in inner.split(",")] if inner else []
    if not isinstance(value, list | tuple):
        raise _MismatchError
    items: list[object] = list(value)
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(items)
    if len(items) != len(kinds):
        raise _MismatchError
    return tuple(_converted(item, kind) for item, kind in zip(items, kinds, strict=True))


def _expectation(hint: object) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(_expectation(item) for item in arguments)
    if origin is Literal:
        return "one of " + ", ".join(str(item) for item in arguments)
    if origin is tuple and arguments[-1:] == (Ellipsis,):
        return f"a list, each item {_expectation(arguments[0])}"
    if origin is tuple:
        return f"a list of {len(arguments)} items ({', '.join(_expectation(item) for item in arguments)})"
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return "one of " + ", ".join(item.name.lower() for item in hint)
    return _WORDS[hint]


def _documentation(owner: type, field: str) -> str:
    """The text after "field:" in the docstring of the class or of one of its base classes; "" if none.

    A field begins a line, or a sentence with a capital letter: in "part of the acceleration: how much" there is none.
    """
    begin = rf"(?:(?:\A|\n)\s*{field}: |(?<=[.\s]){field}: (?=[A-Z\[]))"
    end = r"\n\s*\w+: |\s\w+: [A-Z\[]|\n\s*\n|\Z"
    for kind in owner.__mro__:
        found = re.search(rf"{begin}(.*?)(?={end})", _written(kind), re.DOTALL)
        if found:
            return " ".join(found.group(1).split())
    return ""
