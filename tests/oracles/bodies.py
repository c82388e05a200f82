"""Footprints as shapely geometry, built from their definition and not from the core."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from interdrive import _core
from interdrive.scenario import Obstacles, Shape
from interdrive.scenario.native import core_shape

Pose = tuple[float, float, float]

#: Rounding of distances: near the origin, and where coordinates have seven digits before the point.
EXACT, EXACT_FAR_AWAY = 1e-10, 2e-8


def poses_of(obstacles: Obstacles, row: int) -> np.ndarray:
    return np.column_stack([obstacles.x[row], obstacles.y[row], obstacles.orientation[row]])


@dataclass(frozen=True)
class Body:
    """Convex or not: shapely geometry in the body frame, grown by a radius (a circle is a point with a radius)."""

    geometry: shapely.Geometry
    radius: float
    handle: _core.Shape

    def at(self, poses: np.ndarray) -> np.ndarray:
        """Geometry at every pose (x, y, orientation), shape (poses,); the radius is left out."""
        poses = np.atleast_2d(np.asarray(poses, dtype=float))
        vertices = shapely.get_coordinates(self.geometry)
        cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
        x = poses[:, 0, None] + vertices[None, :, 0] * cos - vertices[None, :, 1] * sin
        y = poses[:, 1, None] + vertices[None, :, 0] * sin + vertices[None, :, 1] * cos
        points = np.stack([x, y], axis=-1)
        if self.geometry.geom_type == "Point":
            return shapely.points(points[:, 0])
        return shapely.polygons(points)

    @property
    def reach(self) -> float:
        """Radius of a circle around the body origin that holds the body [m]."""
        return float(np.hypot(*shapely.get_coordinates(self.geometry).T).max()) + self.radius


def body_of(shape: Shape) -> Body:
    """A footprint for both sides of a comparison."""
    handle = core_shape(shape)
    if shape.kind == "circle":
        return Body(shapely.Point(shape.center), shape.radius, handle)
    if shape.kind == "polygon":
        return Body(shapely.Polygon(shape.vertices), 0.0, handle)
    assert shape.kind == "rectangle"
    a, b = 0.5 * shape.length, 0.5 * shape.width
    turned = Body(shapely.Polygon([(-a, -b), (a, -b), (a, b), (-a, b)]), 0.0, handle)
    return Body(turned.at((*shape.center, shape.orientation))[0], 0.0, handle)


def distances(a: Body, a_poses: np.ndarray, b: Body, b_poses: np.ndarray) -> np.ndarray:
    """Distance at every pair of poses by shapely [m]; 0: they share a point."""
    apart = shapely.distance(a.at(a_poses), b.at(b_poses)) - a.radius - b.radius
    return np.maximum(apart, 0.0)


def core_distances(a: Body, a_poses: np.ndarray, b: Body, b_poses: np.ndarray) -> np.ndarray:
    """Distance at every pair of poses by the core [m]."""
    pairs = zip(np.atleast_2d(a_poses).tolist(), np.atleast_2d(b_poses).tolist(), strict=True)
    return np.array([a.handle.distance(tuple(p), b.handle, tuple(q)) for p, q in pairs])


def random_shape(rng: np.random.Generator, kinds: tuple[str, ...] = ("rectangle", "circle", "polygon")) -> Shape:
    """A body between a pedestrian and a bus; polygons are star-shaped, mostly not convex; origin anywhere near."""
    center = tuple(rng.uniform(-1.0, 1.0, 2)) if rng.random() < 0.3 else (0.0, 0.0)
    match rng.choice(kinds):
        case "rectangle":
            length, width = rng.uniform(0.4, 14.0), rng.uniform(0.3, 3.0)
            return Shape(
                "rectangle", length, width, center=center, orientation=rng.choice([0.0, rng.uniform(-3.0, 3.0)])
            )
        case "circle":
            return Shape("circle", radius=rng.uniform(0.2, 4.0), center=center)
        case _:
            n = int(rng.integers(3, 12))
            angles = np.sort((np.arange(n) + rng.uniform(0.05, 0.95, n)) * (2 * np.pi / n))
            radii = rng.uniform(0.5, 6.0, n)
            return Shape("polygon", vertices=np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))
