"""The schema of run.json: the type of every field that is read."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from interdrive.config.binding import bind, flatten
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError, ResultsError
from interdrive.native_settings import RulesSettings, ViewSettings
from interdrive.results.columns import ON_DEMAND
from interdrive.scenario.limits import LARGEST_ID

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path


class _Expected(Protocol):
    """The expected type of a value."""

    @property
    def words(self) -> str: ...

    def holds(self, value: object) -> bool:
        """Whether the value is of this type, regardless of its contents."""

    def check(self, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
        """Raises ResultsError unless the value and all its contents are as expected."""


@dataclass(frozen=True)
class _Plain:
    """A number, a text, a truth value or null."""

    words: str
    holds: Callable[[Any], bool]

    def check(self, value: object, where: str) -> None:
        if not self.holds(value):
            raise _unexpected(value, self, where)


@dataclass(frozen=True)
class _ListOf:
    item: _Expected
    length: int | None = None
    at_least: int = 0

    @property
    def words(self) -> str:
        if self.length is not None:
            return f"a list of {self.length}"
        return f"a list of at least {self.at_least}" if self.at_least else "a list"

    def holds(self, value: object) -> bool:
        return isinstance(value, list)

    def check(self, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
        if not self.holds(value) or self.length not in (None, len(value)) or len(value) < self.at_least:
            raise _unexpected(value, self, where)
        for place, item in enumerate(value):
            self.item.check(item, f"{where}[{place}]")


@dataclass(frozen=True)
class _TableOf:
    """A table with any names."""

    item: _Expected
    words: str = "a table"

    def holds(self, value: object) -> bool:
        return isinstance(value, dict)

    def check(self, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
        if not self.holds(value):
            raise _unexpected(value, self, where)
        for name, item in value.items():
            self.item.check(item, _inside(where, name))


@dataclass(frozen=True)
class _Table:
    """A table with known names; other names are ignored."""

    needed: Mapping[str, _Expected]
    optional: Mapping[str, _Expected]
    words: str = "a table"

    def holds(self, value: object) -> bool:
        return isinstance(value, dict)

    def check(self, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
        if not self.holds(value):
            raise _unexpected(value, self, where)
        for name, expected in {**self.needed, **self.optional}.items():
            if name in value:
                expected.check(value[name], _inside(where, name))
            elif name in self.needed:
                raise ResultsError(f"{_inside(where, name)}: missing")


@dataclass(frozen=True)
class _OneOf:
    kinds: tuple[_Expected, ...]

    @property
    def words(self) -> str:
        return " or ".join(one.words for one in self.kinds)

    def holds(self, value: object) -> bool:
        return any(one.holds(value) for one in self.kinds)

    def check(self, value: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
        own = next((one for one in self.kinds if one.holds(value)), None)
        if own is None:
            raise _unexpected(value, self, where)
        own.check(value, where)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e300


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_ID


_TEXT = _Plain("a text", lambda value: isinstance(value, str))
_WHOLE = _Plain("a whole number", _is_whole)
_NUMBER = _Plain("a number", _is_number)
_INFINITE = _Plain("inf", lambda value: value in ("inf", "-inf"))
_POSITIVE = _Plain("a positive number", lambda value: _is_number(value) and value > 0)
_TRUTH = _Plain("true or false", lambda value: isinstance(value, bool))
_NULL = _Plain("null", lambda value: value is None)
_ID = _Plain("an agent id", lambda value: isinstance(value, str) and value.lstrip("-").isdecimal() and len(value) < 17)
_DIGEST = _Plain(
    "64 hexadecimal digits",
    lambda value: (
        isinstance(value, str) and (not value or (len(value) == 64 and set(value) <= set("0123456789abcdef")))
    ),
)
_POINT = _ListOf(_NUMBER, 2)
_ANYTHING = _Plain("anything", lambda _: True)
_CHOICE = _OneOf((_TEXT, _TableOf(_ANYTHING)))


def _shape(depth: int) -> _Table:
    """A shape whose groups are nested at most to this depth."""
    return _Table(
        needed={"kind": _Plain("a kind of shape", lambda value: value in ("rectangle", "circle", "polygon", "group"))},
        optional={
            **dict.fromkeys(("length", "width", "radius", "orientation"), _NUMBER),
            "center": _POINT,
            "vertices": _ListOf(_POINT, at_least=3),
            "members": _ListOf(_shape(depth - 1) if depth else _NULL),
        },
    )


#: Two bounds, which may be infinite.
_INTERVAL = _OneOf((_ListOf(_OneOf((_NUMBER, _INFINITE)), 2), _NULL))

_GOAL = _Table(
    needed={
        "areas": _ListOf(_shape(3)),
        "lanelet_ids": _ListOf(_WHOLE),
        "time_step": _ListOf(_WHOLE, 2),
        "velocity": _INTERVAL,
        "orientation": _INTERVAL,
    },
    optional={},
)

_AGENT = _Table(
    needed={"id": _WHOLE},
    optional={"origin": _TEXT, "start_time_step": _WHOLE, "goal": _ListOf(_GOAL), "route_lanelet_ids": _ListOf(_WHOLE)},
)

_SCENARIO = _Table(
    needed={"name": _TEXT, "path": _OneOf((_TEXT, _NULL)), "sha256": _DIGEST, "dt": _POSITIVE},
    optional={"benchmark_id": _TEXT, "notes": _ListOf(_TEXT)},
)

_SOURCE = _Table(
    needed={
        "format": _TEXT,
        "files": _ListOf(_Table(needed={"name": _TEXT, "sha256": _DIGEST}, optional={}), at_least=1),
        "options": _TableOf(_TEXT),
    },
    optional={},
)

_SETTINGS = _Table(
    needed={},
    optional={
        "agents": _OneOf((_TEXT, _WHOLE, _ListOf(_WHOLE))),
        "planner": _CHOICE,
        "predictor": _CHOICE,
        **dict.fromkeys(("views", "rules"), _TableOf(_TableOf(_ANYTHING))),
        "v2x": _TableOf(_TRUTH),
        "repeatable": _TRUTH,
        "seed": _OneOf((_WHOLE, _NULL)),
        "settings": _TableOf(_OneOf((_TEXT, _NUMBER, _TRUTH, _NULL, _ListOf(_OneOf((_TEXT, _NUMBER, _TRUTH, _NULL)))))),
    },
)

_INFORMATION = _Table(
    needed={"scenario": _SCENARIO, "digest": _DIGEST, "notes": _ListOf(_TEXT)},
    optional={
        "source": _OneOf((_SOURCE, _NULL)),
        "settings": _SETTINGS,
        "seed": _OneOf((_WHOLE, _NULL)),
        "finished": _TRUTH,
        **dict.fromkeys(ON_DEMAND, _OneOf((_TEXT, _NULL))),
        "cooperation": _OneOf((_TableOf(_ANYTHING), _NULL)),
        "agents": _ListOf(_AGENT),
        "versions": _TableOf(_OneOf((_TEXT, _NULL))),
        "platform": _TableOf(_OneOf((_TEXT, _WHOLE, _NULL))),
        "rows": _TableOf(_WHOLE),
    },
)


def check_information(path: Path, info: dict[str, Any]) -> None:
    """Raises ResultsError unless every field of a run.json has its type; the line names file and field."""
    try:
        _INFORMATION.check(info, "")
        _check_settings(info.get("settings", {}))
        _check_ids([agent["id"] for agent in info.get("agents", ())])
    except ResultsError as cause:
        raise ResultsError(f"{path}: {cause}") from None


def _check_ids(ids: Sequence[int]) -> None:
    for number, times in Counter(ids).items():
        if times > 1:
            raise ResultsError(f"agents: agent {number} occurs twice")


def _inside(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


def _unexpected(value: object, expected: _Expected, where: str) -> ResultsError:
    shown = json.dumps(value)
    return ResultsError(f"{where}: expected {expected.words}, not {shown if len(shown) <= 60 else f'{shown[:57]}...'}")


def _check_settings(said: Mapping[str, Any]) -> None:
    """Checks the values of known settings; `verify` refuses unknown ones."""
    known = flatten(SimulationSettings())
    settings = said.get("settings", {})
    try:
        bind(SimulationSettings(), {name: value for name, value in settings.items() if name in known})
    except InputError as cause:
        raise ResultsError(f"settings.settings.{cause}") from None
    for group, record in (("views", ViewSettings()), ("rules", RulesSettings())):
        fields = flatten(record)
        for agent, own in said.get(group, {}).items():
            _ID.check(agent, f"settings.{group}")
            try:
                bind(record, {name: value for name, value in own.items() if name in fields})
            except InputError as cause:
                raise ResultsError(f"settings.{group}.{agent}: {cause}") from None
