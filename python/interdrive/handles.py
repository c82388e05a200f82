"""Shapes, roads and scenarios of the Python side as handles of the core."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scenario import KINDS

if TYPE_CHECKING:
    from interdrive.scenario import Obstacles, Scenario, Shape


def core_shape(shape: Shape) -> _core.Shape:
    """The core's handle for a shape.

    Raises:
        InputError: An impossible shape (size not positive, polygon that crosses itself).
    """
    if shape.kind == "rectangle":
        return _core.Shape.rectangle(shape.length, shape.width, *shape.center, shape.orientation)
    if shape.kind == "circle":
        return _core.Shape.circle(shape.radius, *shape.center)
    if shape.kind == "polygon":
        return _core.Shape.polygon(np.ascontiguousarray(shape.vertices, dtype=np.float64))
    return _core.Shape.group([core_shape(member) for member in shape.members])


def core_road(scenario: Scenario, gap_tolerance: float, open_end_length: float) -> _core.RoadNetwork:
    """The core's road network.

    Raises:
        InputError: No lanelets, a bound with fewer than two vertices or a value that is not a number.
    """
    lanelets = scenario.lanelets
    return _core.RoadNetwork(
        lanelets.ids.tolist(),
        [np.ascontiguousarray(bound, dtype=np.float64) for bound in lanelets.left],
        [np.ascontiguousarray(bound, dtype=np.float64) for bound in lanelets.right],
        [list(ids) for ids in lanelets.predecessors],
        [list(ids) for ids in lanelets.successors],
        lanelets.adjacent_left.tolist(),
        lanelets.adjacent_left_same_direction.tolist(),
        lanelets.adjacent_right.tolist(),
        lanelets.adjacent_right_same_direction.tolist(),
        lanelets.speed_limit.tolist(),
        gap_tolerance=gap_tolerance,
        open_end_length=open_end_length,
    )


def core_scenario(scenario: Scenario, road: _core.RoadNetwork) -> _core.Scenario:
    """The core's scenario: road and recorded traffic."""
    o: Obstacles = scenario.obstacles
    return _core.Scenario(
        scenario.dt,
        road,
        o.ids.tolist(),
        [KINDS.index(kind) for kind in o.kinds],
        [core_shape(shape) for shape in o.shapes],
        o.is_static.tolist(),
        0,
        np.ascontiguousarray(o.x, dtype=np.float64),
        np.ascontiguousarray(o.y, dtype=np.float64),
        np.ascontiguousarray(o.orientation, dtype=np.float64),
        np.ascontiguousarray(o.velocity, dtype=np.float64),
        np.ascontiguousarray(o.acceleration, dtype=np.float64),
        np.ascontiguousarray(o.yaw_rate, dtype=np.float64),
        np.ascontiguousarray(o.valid),
    )
