"""Options of sources, as commands, Python and run.json write them."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeAlias

from interdrive.errors import InputError
from interdrive.scenario.limits import LARGEST_DT, SMALLEST_DT

#: Kinds of lanes that are left out unless they are kept.
KEPT = ("bike", "bus", "parking", "shoulder")
#: An option as users give it: as text or as value.
OptionValue: TypeAlias = "str | float | os.PathLike[str] | Iterable[str] | tuple[float, float] | None"
_PROJECTIONS = ("tm", "utm", "local")
_OFFSETS = ("none", "add", "subtract")


@dataclass(frozen=True)
class SourceOptions:
    """How a source is read; what a format has no use for is ignored.

    Attributes:
        map: File with the roads of a recording that has none.
        dt: Time between steps [s]; None: as recorded, 0.1 for maps.
        start: Time of the first step [s], in the times of the recording; None: its earliest.
        duration: Time after which the recording is cut [s]; None: not at all.
        projection: Of geographic coordinates to the plane: `tm`, `utm` or `local`; None: what the format uses.
        origin: Latitude and longitude of the plane's origin [degrees]; None: the map's first point.
        offset: What is done with the offset that an OpenDRIVE header states: `none`, `add` or `subtract`.
        shift: Added to the positions of a recording [m], (x, y).
        keep: Kinds of lanes that are read although not every vehicle may use them, of `KEPT`.
        country: Code of three letters, which says on which side vehicles drive; empty: unknown.
        case: Which of several recordings of a file is read; None: the first.
    """

    map: Path | None = None
    dt: float | None = None
    start: float | None = None
    duration: float | None = None
    projection: str | None = None
    origin: tuple[float, float] | None = None
    offset: str = "none"
    shift: tuple[float, float] = (0.0, 0.0)
    keep: frozenset[str] = frozenset()
    country: str = ""
    case: int | None = None

    @classmethod
    def read(cls, given: Mapping[str, OptionValue]) -> SourceOptions:
        """Options from texts or values by name.

        Raises:
            InputError: A name or value that is not known; the line begins with the name.
        """
        values: dict[str, Any] = {}
        for name, value in given.items():
            if name not in _READERS:
                raise InputError(f"{name}: no option of sources; there are {', '.join(_READERS)}")
            if value is not None:
                values[name] = _READERS[name](name, value)
        return cls(**values)

    def texts(self) -> dict[str, str]:
        """The options that are not the defaults, as texts from which `read` makes the same again."""
        return {
            field.name: _text(getattr(self, field.name))
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }


def _text(value: Any) -> str:  # noqa: ANN401 - any option
    if isinstance(value, frozenset | tuple):
        return ",".join(_text(one) for one in (sorted(value) if isinstance(value, frozenset) else value))
    return repr(value) if isinstance(value, float) else str(value)


def _number(name: str, value: object) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if not abs(number) <= 1e12:
        raise InputError(f"{name}: expected a number, not {value}")
    return number


def _dt(name: str, value: object) -> float:
    number = _number(name, value)
    if not SMALLEST_DT <= number <= LARGEST_DT:
        raise InputError(f"{name}: expected a time step between {SMALLEST_DT:g} and {LARGEST_DT:g} s, not {value}")
    return number


def _duration(name: str, value: object) -> float:
    number = _number(name, value)
    if number <= 0.0:
        raise InputError(f"{name}: expected seconds above 0, not {value}")
    return number


def _pair(name: str, value: object) -> tuple[float, float]:
    parts = value.split(",") if isinstance(value, str) else value
    numbers = [_number(name, part) for part in parts] if isinstance(parts, Iterable) else []
    if len(numbers) != 2:
        raise InputError(f"{name}: expected two numbers, such as 1.5,2, not {value}")
    return numbers[0], numbers[1]


def _origin(name: str, value: object) -> tuple[float, float]:
    latitude, longitude = _pair(name, value)
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        raise InputError(f"{name}: expected latitude,longitude in degrees, not {value}")
    return latitude, longitude


def _chosen(*words: str) -> Any:  # noqa: ANN401 - a reader as in _READERS
    def read(name: str, value: object) -> str:
        if value not in words:
            raise InputError(f"{name}: expected {', '.join(words[:-1])} or {words[-1]}, not {value}")
        return str(value)

    return read


def _kept(name: str, value: object) -> frozenset[str]:
    words = value.split(",") if isinstance(value, str) else value
    kept = frozenset(str(word).strip() for word in words) if isinstance(words, Iterable) else frozenset((str(value),))
    unknown = sorted(kept.difference(KEPT))
    if unknown:
        raise InputError(f"{name}: {unknown[0]} is none of {', '.join(KEPT)}")
    return kept


def _country(name: str, value: object) -> str:
    text = str(value).upper()
    if not (len(text) == 3 and text.isascii() and text.isalpha()):
        raise InputError(f"{name}: expected a code of three letters such as DEU, not {value}")
    return text


def _case(name: str, value: object) -> int:
    try:
        return int(str(value))
    except ValueError:
        raise InputError(f"{name}: expected a whole number, not {value}") from None


def _map(name: str, value: object) -> Path:
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name}: expected the path of a map, not {value}")
    return Path(value)


_READERS = {
    "map": _map,
    "dt": _dt,
    "start": _number,
    "duration": _duration,
    "projection": _chosen(*_PROJECTIONS),
    "origin": _origin,
    "offset": _chosen(*_OFFSETS),
    "shift": _pair,
    "keep": _kept,
    "country": _country,
    "case": _case,
}
