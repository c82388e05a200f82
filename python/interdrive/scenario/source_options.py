"""Options of sources, as commands, settings, Python and run.json write them."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, TypeAlias

from interdrive.errors import InputError
from interdrive.scenario.limits import LARGEST_DT, SMALLEST_DT

#: An option as users give it: as text or as value.
OptionValue: TypeAlias = "str | float | os.PathLike[str] | Iterable[str] | tuple[float, float] | None"

_WORDS = {
    "projection": ("tm", "utm", "local"),
    "offset": ("none", "add", "subtract"),
    "keep": ("bike", "bus", "parking", "shoulder"),
}


@dataclass(frozen=True)
class SourceOptions:
    """How maps and recordings of other tools are read; what a format has no use for is ignored.

    Attributes:
        map: File with the roads of a recording that has none.
        dt: Time between steps; none: as recorded, 0.1 s for maps.
        start: Time of the first step, in the times of the recording; none: its earliest.
        duration: Time after which the recording is cut; none: not at all.
        projection: Of geographic coordinates to the plane; none: what the format uses.
        origin: Latitude and longitude of the plane's origin; none: the map's first point.
        utm_origin: Easting and northing that are subtracted from those of UTM; none: those of the origin.
        offset: What is done with the offset that an OpenDRIVE header states.
        shift: Added to the positions of a recording, (x, y).
        keep: Kinds of lanes that are read although not every vehicle may use them: bike, bus, parking, shoulder.
        country: Code of three letters, which says on which side vehicles drive; empty: unknown.
        case: Which of several recordings of a file is read; none: the first.
    """

    map: str | None = None
    dt: Annotated[float | None, "s"] = None
    start: Annotated[float | None, "s"] = None
    duration: Annotated[float | None, "s"] = None
    projection: Literal["tm", "utm", "local"] | None = None
    origin: Annotated[tuple[float, float] | None, "degrees"] = None
    utm_origin: Annotated[tuple[float, float] | None, "m"] = None
    offset: Literal["none", "add", "subtract"] = "none"
    shift: Annotated[tuple[float, float], "m"] = (0.0, 0.0)
    keep: tuple[Literal["bike", "bus", "parking", "shoulder"], ...] = ()
    country: str = ""
    case: int | None = None

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if self.dt is not None and not SMALLEST_DT <= self.dt <= LARGEST_DT:
            raise InputError("dt", f"must be between {SMALLEST_DT:g} and {LARGEST_DT:g} s, is {self.dt:g}")
        if self.duration is not None and not 0.0 < self.duration <= 1e9:
            raise InputError("duration", f"must be above 0 s, is {self.duration:g}")
        if self.origin is not None and not (abs(self.origin[0]) <= 90.0 and abs(self.origin[1]) <= 180.0):
            raise InputError("origin", f"must be latitude,longitude in degrees, is {self.origin}")
        for name, numbers in (
            ("start", (self.start or 0.0,)),
            ("shift", self.shift),
            ("utm_origin", self.utm_origin or ()),
        ):
            if not all(abs(number) <= 1e9 for number in numbers):
                raise InputError(name, "must be a possible number")
        if self.country and not (len(self.country) == 3 and self.country.isascii() and self.country.isalpha()):
            raise InputError("country", f"must be a code of three letters such as DEU, is {self.country}")
        object.__setattr__(self, "country", self.country.upper())
        object.__setattr__(self, "keep", tuple(sorted(set(self.keep))))

    @classmethod
    def read(cls, given: Mapping[str, OptionValue]) -> SourceOptions:
        """Options from texts or values by name.

        Args:
            given: Texts or values; None and empty texts mean the default.

        Raises:
            InputError: A name or value that is not known; the line begins with the name.
        """
        known = [field.name for field in fields(cls)]
        values: dict[str, Any] = {}
        for name, value in given.items():
            if name not in known:
                raise InputError(name, f"no option of sources; there are {', '.join(known)}")
            if value is not None and not (isinstance(value, str) and value == ""):
                values[name] = _read(name, value)
        return cls(**values)

    def texts(self) -> dict[str, str]:
        """The options that are not the defaults, as texts from which `read` makes the same again."""
        return {
            field.name: _text(getattr(self, field.name))
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }


def _text(value: Any) -> str:  # noqa: ANN401 - any option
    if isinstance(value, tuple):
        return ",".join(map(_text, value))
    return repr(value) if isinstance(value, float) else str(value)


def _read(name: str, value: OptionValue) -> object:
    if name == "map":
        if not isinstance(value, str | os.PathLike):
            raise InputError(name, f"expected the path of a map, not {value}")
        return os.fspath(value)
    if name == "country":
        return str(value)
    if name == "case":
        number = _number(name, value)
        if number != int(number):
            raise InputError(name, f"expected a whole number, not {value}")
        return int(number)
    if name in _WORDS:
        words = [part.strip() for part in value.split(",")] if isinstance(value, str) else value
        chosen = tuple(str(word) for word in words) if isinstance(words, Iterable) else (str(words),)
        if not set(chosen) <= set(_WORDS[name]) or (name != "keep" and len(chosen) != 1):
            raise InputError(name, f"expected {' or '.join(_WORDS[name])}, not {value}")
        return chosen if name == "keep" else chosen[0]
    if name in ("origin", "shift", "utm_origin"):
        parts = value.split(",") if isinstance(value, str) else value
        numbers = tuple(_number(name, part) for part in parts) if isinstance(parts, Iterable) else ()
        if len(numbers) != 2:
            raise InputError(name, f"expected two numbers such as 1.5,2, not {value}")
        return numbers
    return _number(name, value)


def _number(name: str, value: object) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if not abs(number) <= 1e12:
        raise InputError(name, f"expected a number, not {value}")
    return number
