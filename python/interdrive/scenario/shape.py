"""Footprints and areas, and how a footprint is brought to the place where its vehicle is."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: A footprint whose centre is nearer to its state's position than this is there [m]; digits are cut in files.
_AT_POSITION = 1e-3
#: Rounding errors of coordinates of cities [m].
_ROUNDING = 1e-6
#: Angles [rad] and lengths [m] that differ by less are the same: files have three or more decimals.
_SAME = 1e-3
#: A rectangle around a footprint must be smaller than one along its heading by this factor to tell another heading.
_TIGHTER = 0.98


@dataclass(frozen=True)
class Shape:
    """A footprint in the body frame, or an area in the world frame.

    Attributes:
        kind: "rectangle", "circle", "polygon" or "group".
        length: Rectangle's length [m] along its own orientation.
        width: Rectangle's width [m].
        radius: Circle's radius [m].
        center: Centre of a rectangle or circle [m].
        orientation: Orientation of a rectangle [rad].
        vertices: Polygon's vertices [m], shape (vertices, 2), without a repeated last one.
        members: Shapes of a group.
    """

    kind: Literal["rectangle", "circle", "polygon", "group"]
    length: float = 0.0
    width: float = 0.0
    radius: float = 0.0
    center: tuple[float, float] = (0.0, 0.0)
    orientation: float = 0.0
    vertices: Floats = field(default_factory=lambda: np.empty((0, 2)))
    members: tuple[Shape, ...] = ()

    def __post_init__(self) -> None:
        """The vertices are read-only from here on."""
        self.vertices.setflags(write=False)

    @property
    def middle(self) -> tuple[float, float]:
        """Centre of a rectangle or circle, of other shapes that of the box around them [m]."""
        return self.center if self.kind in ("rectangle", "circle") else _middle(self, 0.0)


def centred(shape: Shape, *, stands: bool) -> tuple[Shape, tuple[float, float], float]:
    """A footprint around the origin of the body frame, and where that frame moved.

    Args:
        shape: Footprint in any body frame.
        stands: Whether the vehicle never moves. Then its frame may also turn to the sides of the footprint, forward
            along the longer one; that of a moving vehicle points where it drives.

    Returns:
        The same footprint in a frame whose origin is the centre of its extent; that centre [m] and the turn [rad] in
        the old frame. A footprint that is already there is returned as it is, with zeros.
    """
    if shape.kind == "group" and len(shape.members) == 1:
        shape = shape.members[0]
    if shape.kind in ("rectangle", "circle") and shape.center == (0.0, 0.0) and shape.orientation == 0.0:
        return shape, (0.0, 0.0), 0.0
    if (shape.kind == "polygon" and len(shape.vertices) < 3) or (shape.kind == "group" and not shape.members):
        return shape, (0.0, 0.0), 0.0
    if not all(np.isfinite(points).all() for points, _ in _discs(shape)):
        return shape, (0.0, 0.0), 0.0
    x, y = shape.middle
    is_there = math.hypot(x, y) <= _AT_POSITION
    turn = _turn(shape, stands=stands, is_there=is_there)
    if is_there and turn == 0.0:
        return _upright(shape), (0.0, 0.0), 0.0
    x, y = _middle(shape, turn)
    return _upright(_moved(shape, (x, y), turn)), (x, y), turn


def _discs(shape: Shape) -> list[tuple[Floats, float]]:
    """Points and the radius around each that the hulls of the parts are made of."""
    if shape.kind == "group":
        return [one for member in shape.members for one in _discs(member)]
    if shape.kind == "polygon":
        return [(shape.vertices, 0.0)]
    if shape.kind == "circle":
        return [(np.array([shape.center]), shape.radius)]
    half = 0.5 * np.array([shape.length, shape.width])
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * half
    return [(corners @ _rotation(shape.orientation).T + np.array(shape.center), 0.0)]


def _rotation(angle: float) -> Floats:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def _extent(shape: Shape, turn: float) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates in a frame that is turned [m], shape (2,) each."""
    turned = [(points @ _rotation(turn), radius) for points, radius in _discs(shape)]
    low = np.min([points.min(axis=0) - radius for points, radius in turned], axis=0)
    return low, np.max([points.max(axis=0) + radius for points, radius in turned], axis=0)


def _middle(shape: Shape, turn: float) -> tuple[float, float]:
    """Centre of the extent along turned axes, in the frame of the shape."""
    low, high = _extent(shape, turn)
    x, y = (_rotation(turn) @ (0.5 * (low + high))).tolist()
    return float(x), float(y)


def _turn(shape: Shape, *, stands: bool, is_there: bool) -> float:
    """Direction of the longer side of the tightest rectangle around what stands; 0 where the heading tells it."""
    if not stands or shape.kind == "circle":
        return 0.0
    if shape.kind == "rectangle":
        return float(np.arctan2(np.sin(shape.orientation), np.cos(shape.orientation)))
    outlines = [points for points, radius in _discs(shape) if radius == 0.0 and len(points) > 1]
    sides = [np.roll(points, -1, axis=0) - points for points in outlines]
    angles = {0.0}
    for dx, dy in itertools.chain.from_iterable(side.tolist() for side in sides):
        if math.hypot(dx, dy) > _SAME:
            angles.add(math.remainder(math.atan2(dy, dx), 0.5 * math.pi))
    areas = {angle: float(np.prod(np.subtract(*_extent(shape, angle)))) for angle in sorted(angles, key=abs)}
    best = min(areas, key=areas.__getitem__)
    angle = best if areas[best] < _TIGHTER * areas[0.0] else 0.0
    if angle == 0.0 and is_there:
        return 0.0
    low, high = _extent(shape, angle)
    length, width = (high - low).tolist()
    if width > length + _SAME:
        angle += -0.5 * math.pi if angle > 0.0 else 0.5 * math.pi
    return angle


def _moved(shape: Shape, center: tuple[float, float], turn: float) -> Shape:
    """The shape in a frame with another origin and direction."""
    if shape.kind == "group":
        return replace(shape, members=tuple(_moved(member, center, turn) for member in shape.members))
    if shape.kind == "polygon":
        return replace(shape, vertices=(shape.vertices - np.array(center)) @ _rotation(turn))
    x, y = ((np.array(shape.center) - np.array(center)) @ _rotation(turn)).tolist()
    # What differs from the origin by rounding only is at the origin.
    x, y = (0.0 if abs(v) < _ROUNDING else float(v) for v in (x, y))
    orientation = math.remainder(shape.orientation - turn, 2.0 * math.pi) if shape.kind == "rectangle" else 0.0
    return replace(shape, center=(x, y), orientation=orientation)


def _upright(shape: Shape) -> Shape:
    """A rectangle along an axis, whichever of its sides is called length, or drawn as a polygon, as one of the body."""
    if shape.kind == "rectangle" and shape.center == (0.0, 0.0):
        quarters = round(shape.orientation / (0.5 * math.pi))
        if abs(shape.orientation - quarters * 0.5 * math.pi) < 1e-9 and shape.orientation != 0.0:
            sizes = (shape.width, shape.length) if quarters % 2 else (shape.length, shape.width)
            return Shape("rectangle", length=sizes[0], width=sizes[1])
    if shape.kind == "polygon" and len(shape.vertices) == 4:
        low, high = _extent(shape, 0.0)
        corners = shape.vertices - 0.5 * (low + high)
        half = 0.5 * (high - low)
        signs = {(bool(x > 0.0), bool(y > 0.0)) for x, y in corners.tolist()}
        if len(signs) == 4 and float(np.abs(np.abs(corners) - half).max()) < _ROUNDING:
            length, width = (high - low).tolist()
            # Without the rounding of differences of large coordinates.
            return Shape("rectangle", length=round(length, 6), width=round(width, 6))
    return shape
