"""Grids of concrete cases: those of JRC's comparison of reference drivers, or those of a file."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: The manoeuvres, each with the numbers of a case: speeds [m/s], distances [m], and a deceleration [m/s²].
MANOEUVRES = {
    "cut_in": ("velocity", "other_velocity", "gap", "sideways"),
    "cut_out": ("velocity", "front_distance", "sideways"),
    "following": ("velocity", "deceleration"),
}

#: Grids that have names.
GRIDS = ("jrc", "jrc_high", "jrc_low")

#: More cases than this are driven only if confirmed (`--yes`), ...
CASES_MAX = 1_000_000
#: ... and no grid has more than this.
_CASES_LARGEST = 10_000_000

_G = 9.81


@dataclass(frozen=True)
class Grid:
    """Cases of one manoeuvre.

    Attributes:
        manoeuvre: One of `MANOEUVRES`.
        cases: The numbers by name, arrays of shape (cases,).
        skipped: Number of cut-ins left out because the other vehicle is not slower.
    """

    manoeuvre: str
    cases: dict[str, Floats]
    skipped: int = 0

    def __len__(self) -> int:
        return len(self.cases["velocity"])

    def case(self, row: int) -> dict[str, float]:
        """The numbers of the case in a `row`, by name."""
        return {name: float(values[row]) for name, values in self.cases.items()}


def grid(manoeuvre: str, name: str) -> Grid:
    """The grid of a manoeuvre by its name, one of `GRIDS`, or from a TOML file.

    The file has a table for each manoeuvre, with a list, or {from, to, step}, for each of its numbers; speeds may be
    given as `velocity_kmh` and `other_velocity_kmh`.

    Args:
        manoeuvre: One of `MANOEUVRES`.
        name: Name or path.

    Raises:
        InputError: There is no such grid, or the file is incomplete; one line names what is missing.
    """
    if name in GRIDS:
        return _joined(manoeuvre, [_jrc(manoeuvre, part) for part in _parts(manoeuvre, name)])
    path = Path(name)
    if not path.is_file():
        raise InputError(f"--grid {name}: no such file; named grids are {', '.join(GRIDS)}")
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as cause:
        raise InputError(f"--grid {name}: not a TOML file ({cause})") from None
    table = tables.get(manoeuvre)
    if not isinstance(table, dict):
        raise InputError(f"--grid {name}: there is no table [{manoeuvre}]")
    axes = [_axis(name, table, number) for number in MANOEUVRES[manoeuvre]]
    n_cases = math.prod(len(axis) for axis in axes)
    if n_cases > _CASES_LARGEST:
        raise InputError(f"--grid {name}: {n_cases:,} cases are more than {_CASES_LARGEST:,}, the most of a grid")
    return _product(manoeuvre, axes)


def _parts(manoeuvre: str, name: str) -> tuple[str, ...]:
    if name == "jrc":
        return ("jrc_high", "jrc_low") if manoeuvre == "cut_in" else ("jrc",)
    return (name,)


def _jrc(manoeuvre: str, part: str) -> Grid:
    """A grid of JRC: pairs of speeds, gaps and sideways speeds."""
    if manoeuvre == "following":
        return _product(manoeuvre, [_even(12, 2, 59) / 3.6, _G * _even(0.05, 0.05, 19)])
    if manoeuvre == "cut_out":
        return _product(manoeuvre, [_even(10, 10, 13) / 3.6, _even(2, 5, 30), _even(0.1, 0.2, 15)])
    if part == "jrc_high":
        own, other, gap = _even(70, 20, 4), _even(10, 30, 4), _even(1, 2, 60)
    else:
        own, other, gap = _even(20, 10, 5), _even(10, 10, 5), _even(1, 1, 59)
    made = _product(manoeuvre, [own / 3.6, other / 3.6, gap, _even(0.0, 0.1, 18)])
    return Grid(manoeuvre, made.cases)


def _even(start: float, step: float, number: int) -> Floats:
    return start + step * np.arange(number, dtype=np.float64)


def _joined(manoeuvre: str, grids: list[Grid]) -> Grid:
    names = MANOEUVRES[manoeuvre]
    return Grid(manoeuvre, {name: np.concatenate([one.cases[name] for one in grids]) for name in names})


def _product(manoeuvre: str, axes: list[Floats]) -> Grid:
    names = MANOEUVRES[manoeuvre]
    columns = [column.ravel() for column in np.meshgrid(*axes, indexing="ij")]
    slower = columns[1] < columns[0] if manoeuvre == "cut_in" else np.ones(len(columns[0]), dtype=np.bool_)
    cases = {name: column[slower] for name, column in zip(names, columns, strict=True)}
    return Grid(manoeuvre, cases, int((~slower).sum()))


def _axis(file: str, table: dict[str, Any], name: str) -> Floats:
    factor, key = 1.0, name
    if name not in table and f"{name}_kmh" in table:
        factor, key = 1.0 / 3.6, f"{name}_kmh"
    if key not in table:
        raise InputError(f"--grid {file}: {name} is missing")
    given = table[key]
    try:
        if isinstance(given, dict):
            start, end, step = (float(given[part]) for part in ("from", "to", "step"))
            values = _range(file, key, start, end, step)
        else:
            values = np.atleast_1d(np.asarray(given, dtype=np.float64))
    except (KeyError, TypeError, ValueError):
        raise InputError(f"--grid {file}: {key} must be numbers, or from, to and step") from None
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise InputError(f"--grid {file}: {key} must not be negative")
    made: Floats = factor * values.astype(np.float64)
    return made


def _range(file: str, key: str, start: float, end: float, step: float) -> Floats:
    """From `start` to `end`, both included."""
    if not step > 0.0:
        raise InputError(f"--grid {file}: the step of {key} must be positive, is {step:g}")
    if not (math.isfinite(start) and start <= end <= start + step * _CASES_LARGEST):
        raise InputError(f"--grid {file}: {key} from {start:g} to {end:g} in steps of {step:g} is no range")
    values: Floats = start + step * np.arange(int((end - start) / step + 1e-9) + 1, dtype=np.float64)
    return values
