"""Reference lines: position and heading by arc length, for all points of a road at once."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from interdrive.scenario.limits import LONGEST_LANELET

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats

    #: Along and across the start of a piece [m], and the heading there [rad].
    Local = tuple[Floats, Floats, Floats]

#: Nodes of Gauss-Legendre quadrature between two knots of a table, on [0, 1].
_NODES, _WEIGHTS = (0.5 * values for values in np.polynomial.legendre.leggauss(20))
_NODES += 0.5
#: Distance of knots along a spiral [m], and number of intervals of the table of a polynomial.
_KNOTS_APART, _INTERVALS = 5.0, 256


class Shape(Protocol):
    """A piece that is neither straight nor an arc."""

    def at(self, along: Floats) -> Local:
        """Place and heading after some length [m], in the frame of its start."""


@dataclass(frozen=True)
class Spiral:
    """A clothoid.

    Attributes:
        curvature: At its start [1/m].
        change: Of the curvature along it [1/m²].
        length: [m].
    """

    curvature: float
    change: float
    length: float

    @cached_property
    def _knots(self) -> tuple[Floats, Floats, Floats]:
        reach = min(self.length, LONGEST_LANELET)  # no road is longer, whatever the record says
        at = np.linspace(0.0, reach, max(1, int(np.ceil(reach / _KNOTS_APART))) + 1)
        u, v = self._steps(at[:-1], np.diff(at))
        return at, np.concatenate(([0.0], np.cumsum(u))), np.concatenate(([0.0], np.cumsum(v)))

    def at(self, along: Floats) -> Local:
        """Place and heading after some length."""
        knots, u, v = self._knots
        below = np.clip(np.searchsorted(knots, along, side="right") - 1, 0, len(knots) - 2)
        du, dv = self._steps(knots[below], along - knots[below])
        return u[below] + du, v[below] + dv, self._heading(along)

    def _heading(self, along: Floats) -> Floats:
        return along * (self.curvature + 0.5 * self.change * along)

    def _steps(self, start: Floats, length: Floats) -> tuple[Floats, Floats]:
        heading = self._heading(start[:, None] + length[:, None] * _NODES)
        return length * (np.cos(heading) @ _WEIGHTS), length * (np.sin(heading) @ _WEIGHTS)


@dataclass(frozen=True)
class Polynomial:
    """A curve with cubic coordinates, followed by arc length.

    Attributes:
        u: Coefficients of the coordinate along the start of the piece, constant first [m].
        v: The same across it.
        last: Parameter at the end; that at the start is 0.
        length: Of the piece [m]. The curve is stretched to it, or cut there.
        is_stretched: Which of both.
    """

    u: tuple[float, float, float, float]
    v: tuple[float, float, float, float]
    last: float
    length: float
    is_stretched: bool

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        at = np.linspace(0.0, self.last, _INTERVALS + 1)
        steps = self._lengths(at[:-1], np.diff(at))
        return at, np.concatenate(([0.0], np.cumsum(steps)))

    def _speed(self, p: Floats) -> Floats:
        return np.hypot(_slope(self.u, p), _slope(self.v, p))

    def _lengths(self, start: Floats, step: Floats) -> Floats:
        lengths: Floats = step * (self._speed(start[:, None] + step[:, None] * _NODES) @ _WEIGHTS)
        return lengths

    def at(self, along: Floats) -> Local:
        """Place and heading after some length; straight on beyond the ends."""
        table, lengths = self._table
        scale = lengths[-1] / self.length if self.is_stretched and self.length > 0.0 else 1.0
        wanted = np.clip(along * scale, 0.0, lengths[-1])
        p = np.interp(wanted, lengths, table)
        for _ in range(2):
            below = np.clip(np.searchsorted(table, p, side="right") - 1, 0, len(table) - 2)
            miss = lengths[below] + self._lengths(table[below], p - table[below]) - wanted
            p = np.clip(p - miss / np.maximum(self._speed(p), 1e-9), 0.0, self.last)
        heading = np.arctan2(_slope(self.v, p), _slope(self.u, p))
        beyond = along * scale - wanted
        u, v = (_value(coefficients, p) for coefficients in (self.u, self.v))
        return u + beyond * np.cos(heading), v + beyond * np.sin(heading), heading


def _value(c: Sequence[float], p: Floats) -> Floats:
    return c[0] + p * (c[1] + p * (c[2] + p * c[3]))


def _slope(c: Sequence[float], p: Floats) -> Floats:
    return c[1] + p * (2.0 * c[2] + p * 3.0 * c[3])


@dataclass(frozen=True)
class Piece:
    """A geometry record.

    Attributes:
        s: Where it begins along the road [m].
        x: Its start [m]. y: The same [m].
        heading: There [rad].
        curvature: Of a line or arc [1/m].
        shape: Any other form; None: it is a line or arc.
    """

    s: float
    x: float
    y: float
    heading: float
    curvature: float = 0.0
    shape: Shape | None = None


class ReferenceLine:
    """The geometry records of a road, by s."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        ordered = sorted(pieces, key=lambda piece: piece.s)
        self.starts = np.array([piece.s for piece in ordered])
        self._x, self._y, self._heading, self._curvature = (
            np.array([getattr(piece, name) for piece in ordered]) for name in ("x", "y", "heading", "curvature")
        )
        self._shapes = {place: piece.shape for place, piece in enumerate(ordered) if piece.shape is not None}

    def at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Position [m] and heading [rad] at arc lengths."""
        place = np.maximum(np.searchsorted(self.starts, s, side="right") - 1, 0)
        along = s - self.starts[place]
        start, turn = self._heading[place], self._curvature[place] * along
        chord = along * np.sinc(0.5 * turn / np.pi)
        x = self._x[place] + chord * np.cos(start + 0.5 * turn)
        y = self._y[place] + chord * np.sin(start + 0.5 * turn)
        heading = start + turn
        for one in set(place.tolist()) & self._shapes.keys() if self._shapes else ():
            here = place == one
            u, v, theta = self._shapes[one].at(along[here])
            cos, sin = np.cos(self._heading[one]), np.sin(self._heading[one])
            x[here] = self._x[one] + cos * u - sin * v
            y[here] = self._y[one] + sin * u + cos * v
            heading[here] = self._heading[one] + theta
        return x, y, heading


class Profile:
    """Cubic polynomials one after the other: offsets, widths, superelevations."""

    def __init__(self, records: Sequence[tuple[float, ...]]) -> None:
        table = np.array(sorted(records, key=lambda record: record[0]), dtype=np.float64).reshape(-1, 5)
        self.starts, self._coefficients = table[:, 0], table[:, 1:]

    def __bool__(self) -> bool:
        return len(self.starts) > 0

    def at(self, s: Floats) -> Floats:
        """Values at arc lengths; 0 before the first record."""
        if not len(self.starts):
            return np.zeros_like(s)
        place = np.searchsorted(self.starts, s, side="right") - 1
        a, b, c, d = self._coefficients[np.maximum(place, 0)].T
        along = s - self.starts[np.maximum(place, 0)]
        return np.where(place < 0, 0.0, a + along * (b + along * (c + along * d)))


def is_unordered(values: Sequence[float]) -> bool:
    """Whether records do not follow each other."""
    return any(after < before for before, after in itertools.pairwise(values))


def shape_of(
    kind: str, number: Callable[[str], float], length: float, *, by_arc_length: bool
) -> tuple[float, Shape | None]:
    """Curvature and form of a geometry record.

    Args:
        kind: Name of its element; what is not known is a line.
        number: Its attributes.
        length: Of the record [m].
        by_arc_length: The parameter of a cubic curve runs to the length, not to 1.
    """
    if kind == "arc":
        return number("curvature"), None
    if kind == "spiral" and length > 0.0:
        start, end = number("curvStart"), number("curvEnd")
        return 0.0, Spiral(start, (end - start) / length, length)
    if kind == "poly3" and length > 0.0:
        a, b, c, d = (number(name) for name in "abcd")
        return 0.0, Polynomial((0.0, 1.0, 0.0, 0.0), (a, b, c, d), length, length, is_stretched=False)
    if kind == "paramPoly3" and length > 0.0:
        u, v = (tuple(number(f"{name}{axis}") for name in "abcd") for axis in "UV")
        last = length if by_arc_length else 1.0
        return 0.0, Polynomial(u, v, last, length, is_stretched=True)  # type: ignore[arg-type]
    return 0.0, None
