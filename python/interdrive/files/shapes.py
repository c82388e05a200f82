"""Converts shapes of commonroad-io.

Up to 2024.3 its shapes are Rectangle, Circle, Polygon and ShapeGroup. From 2026.1 on footprints are RectObstacleShape,
CircleObstacleShape, PolygonObstacleShape, TruckShape and SemiTrailerTruckShape, and areas are RectOccupancy,
CircleOccupancy, PolygonOccupancy and OccupancyGroup, all in other modules. So they are distinguished by their
attributes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from interdrive.scenario import Shape

#: An object of commonroad-io, which has no types, or of `elements`, which has the same attributes.
Foreign = Any


def name_of(member: Foreign) -> str:
    """The name in the format of a member of an enumeration of commonroad-io; text is one."""
    return str(getattr(member, "value", member))


def shape_of(source: Foreign) -> Shape:
    """Converts a footprint or an area of any version of commonroad-io.

    Raises:
        TypeError: The class is none of them.
    """
    members = getattr(source, "shapes", None) or getattr(source, "occupancies", None)
    if members is not None:
        return Shape("group", members=tuple(shape_of(member) for member in members))
    if hasattr(source, "trailer_dims"):
        return _semi_trailer(source)
    if hasattr(source, "truck_dims"):
        return _rectangle(source.truck_dims, (-float(source.origin_x_shift), 0.0))
    if hasattr(source, "radius"):
        return Shape("circle", radius=float(source.radius), center=_center(source))
    if hasattr(source, "length") and hasattr(source, "width"):
        shift = float(getattr(source, "origin_x_shift", 0.0))
        center = (-shift, 0.0) if shift else _center(source)
        return _rectangle(source, center, float(getattr(source, "orientation", 0.0)))
    if hasattr(source, "vertices"):
        return polygon(np.array(source.vertices, dtype=np.float64).reshape(len(source.vertices), -1))
    raise TypeError(f"a shape of the class {type(source).__name__} is not known, only rectangles, circles, polygons")


def polygon(vertices: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Shape:
    """A polygon from its vertices [m], shape (vertices, 2 or 3); a repeated last one is dropped."""
    vertices = np.ascontiguousarray(vertices[:, :2], dtype=np.float64)
    if len(vertices) > 1 and np.array_equal(vertices[0], vertices[-1]):
        vertices = vertices[:-1]
    return Shape("polygon", vertices=vertices)


def _rectangle(size: Foreign, center: tuple[float, float], orientation: float = 0.0) -> Shape:
    return Shape("rectangle", float(size.length), float(size.width), center=center, orientation=orientation)


def _semi_trailer(source: Foreign) -> Shape:
    """Truck and trailer in line, hitch angle 0."""
    truck, trailer = source.truck_shape, source.trailer_dims
    hitch = float(source.hitch_shift_from_origin)
    center = hitch - (float(trailer.length) / 2.0 - float(trailer.dist_from_front_to_hitch))
    return Shape("group", members=(shape_of(truck), _rectangle(trailer, (center, 0.0))))


def _center(source: Foreign) -> tuple[float, float]:
    names = [name for name in ("rect_center", "circle_center", "center") if hasattr(source, name)]
    center: Foreign = getattr(source, names[0]) if names else (0.0, 0.0)
    if hasattr(center, "x"):  # a shapely point
        return float(center.x), float(center.y)
    return float(center[0]), float(center[1])


def middle_of(shape: Shape) -> tuple[float, float]:
    """Centre of an area: of a polygon its centroid, of a group the mean of its members' centres."""
    if shape.kind == "group":
        x, y = np.mean([middle_of(member) for member in shape.members], axis=0)
        return float(x), float(y)
    if shape.kind != "polygon":
        return shape.center
    x, y = (shape.vertices - shape.vertices[0]).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    if abs(cross.sum()) < 1e-12:
        return float(shape.vertices[:, 0].mean()), float(shape.vertices[:, 1].mean())
    centroid = [((v + np.roll(v, -1)) * cross).sum() / (3.0 * cross.sum()) for v in (x, y)]
    return float(shape.vertices[0, 0] + centroid[0]), float(shape.vertices[0, 1] + centroid[1])
