"""Structure-aware mutation of protobuf messages: fields by their descriptors, for any message of any version."""

from __future__ import annotations

from typing import TYPE_CHECKING

from google.protobuf.descriptor import FieldDescriptor
from tests.fuzz import numbers

if TYPE_CHECKING:
    from random import Random

    from google.protobuf.message import Message

#: Largest whole numbers of the kinds of fields.
_BITS = {"int32": 31, "sint32": 31, "sfixed32": 31, "int64": 63, "sint64": 63, "sfixed64": 63}
_UNSIGNED = {"uint32": 32, "fixed32": 32, "uint64": 64, "fixed64": 64}
#: What an empty list of texts is filled from; numbers from 0.
_FIRST = {FieldDescriptor.CPPTYPE_STRING: "x"}


def mutated(message: Message, random: Random) -> None:
    """One to five changes to a message, in place; it stays a valid message of its kind.

    Args:
        message: What is changed.
        random: Source of all choices.
    """
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 5))):
        owners: dict[str, list[Message]] = {}
        for owner in _messages(message):
            if owner.ListFields():
                owners.setdefault(owner.DESCRIPTOR.name, []).append(owner)
        if owners:
            _change(random.choice(owners[random.choice(sorted(owners))]), random)


def _messages(message: Message) -> list[Message]:
    """A message and all messages in it."""
    found = [message]
    for field, value in message.ListFields():
        if field.type == field.TYPE_MESSAGE:
            for inner in value if _is_repeated(field) else [value]:
                found += _messages(inner)
    return found


def _is_repeated(field: FieldDescriptor) -> bool:
    return bool(field.label == field.LABEL_REPEATED)


def _change(owner: Message, random: Random) -> None:
    if random.random() < 0.15:
        _fill(owner, random)
        return
    field, value = random.choice(owner.ListFields())
    if random.random() < 0.12 and field.label != field.LABEL_REQUIRED:
        owner.ClearField(field.name)
    elif _is_repeated(field):
        _change_list(field, value, random)
    elif field.type != field.TYPE_MESSAGE:
        setattr(owner, field.name, _value(field, value, random))


def _fill(owner: Message, random: Random) -> None:
    """A field that was not set is set, which may clear another one of the same group; a message stays empty."""
    unset = [
        f
        for f in owner.DESCRIPTOR.fields
        if (not getattr(owner, f.name) if _is_repeated(f) else not owner.HasField(f.name))
    ]
    if not unset:
        return
    field = random.choice(unset)
    if _is_repeated(field):
        values = getattr(owner, field.name)
        if field.type == field.TYPE_MESSAGE:
            values.add()
        else:
            values.append(_value(field, _FIRST.get(field.cpp_type, 0), random))
    elif field.type == field.TYPE_MESSAGE:
        getattr(owner, field.name).SetInParent()
    else:
        setattr(owner, field.name, _value(field, field.default_value, random))


def _change_list(field: FieldDescriptor, values: list, random: Random) -> None:  # type: ignore[type-arg]
    chosen = random.randrange(len(values))
    kind = random.choice(("remove", "repeat", "change", "change"))
    if kind == "remove":
        del values[chosen]
    elif field.type == field.TYPE_MESSAGE:
        if kind == "repeat":
            for _ in range(random.choice((1, 1, 2, 30))):
                values.add().CopyFrom(values[chosen])
        else:
            values[chosen].CopyFrom(values[random.randrange(len(values))])
    elif kind == "repeat":
        values.append(values[chosen])
    else:
        values[chosen] = _value(field, values[chosen], random)


def _value(field: FieldDescriptor, old: object, random: Random) -> object:
    """Another value that the field can hold."""
    kinds = {getattr(field, f"TYPE_{name.upper()}"): name for name in (*_BITS, *_UNSIGNED)}
    if field.type in (field.TYPE_DOUBLE, field.TYPE_FLOAT):
        value = numbers.real(random, float(old))  # type: ignore[arg-type]
        return value if field.type == field.TYPE_DOUBLE or abs(value) < 3e38 or value != value else 3e38
    if field.type == field.TYPE_BOOL:
        return not old
    if field.type == field.TYPE_ENUM:
        return random.choice(field.enum_type.values).number
    if field.type == field.TYPE_STRING:
        return random.choice(("", "x", str(old) * 2, "../../x", "\x1b[31m", "Ω", "274"))
    if field.type in kinds:
        name = kinds[field.type]
        low, high = (-(2 ** _BITS[name]), 2 ** _BITS[name] - 1) if name in _BITS else (0, 2 ** _UNSIGNED[name] - 1)
        return min(max(numbers.whole(random, int(old)), low), high)  # type: ignore[call-overload]
    return old
