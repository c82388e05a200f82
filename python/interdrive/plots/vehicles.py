"""Footprints of participants: outlines, heading marks, and where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.criticality.source import footprints

if TYPE_CHECKING:
    from collections.abc import Iterable

    from interdrive.array_types import Floats
    from interdrive.plots.view import View
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.scenario import Shape


def outlines(shape: Shape) -> list[Floats]:
    """Closed outlines [m], each of shape (vertices, 2), in the frame of the shape."""
    if shape.kind == "group":
        return [line for member in shape.members for line in outlines(member)]
    if shape.kind == "polygon":
        return [np.asarray(shape.vertices, dtype=np.float64)] if len(shape.vertices) else []
    if shape.kind == "circle":
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        return [shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) + shape.center]
    corners = 0.5 * np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (shape.length, shape.width)
    return [placed(corners, *shape.center, shape.orientation)]


def body_outlines(run: RunRecord) -> list[list[Floats]]:
    """Outlines in the body frame, one list per row of `run.states`; agents without a recording are rectangles."""
    return [outlines(shape) for shape in footprints(run)]


def heading_mark(length: float, width: float) -> Floats:
    """A triangle in the front half that points forwards, in the body frame [m], shape (3, 2)."""
    return np.array([(0.42 * length, 0.0), (0.08 * length, 0.34 * width), (0.08 * length, -0.34 * width)])


def blinker_marks(length: float, width: float, turn: float) -> list[Floats]:
    """The blinkers of a side, 1 left or -1 right, in the body frame [m]: two rectangles of shape (4, 2) at its corners.

    They stand out beyond the body, so that they are seen from afar.
    """
    corners = np.array([(1.0, 1.4), (1.0, 0.5), (0.7, 0.5), (0.7, 1.4)]) * (0.5 * length, 0.5 * width * turn)
    return [corners, corners * (-1.0, 1.0)]


def placed(points: Floats, x: float, y: float, orientation: float) -> Floats:
    """Points of the body frame [m], shape (..., 2), for a body at that pose."""
    cos, sin = np.cos(orientation), np.sin(orientation)
    turned: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return turned


class Footprints:
    """Where the participants of a run are in a picture."""

    def __init__(self, run: RunRecord) -> None:
        """Of a run."""
        self._states, self._bodies = run.states, body_outlines(run)

    def outlines(self, row: int, column: int, view: View) -> list[Floats]:
        """Outlines [m] of a participant (row of the states) at a time step (column)."""
        return [view.picture_from_world(placed(line, *self.pose(row, column))) for line in self._bodies[row]]

    def heading_mark(self, row: int, column: int, view: View) -> Floats:
        """Its heading mark [m]."""
        mark = heading_mark(self._states.length[row], self._states.width[row])
        return view.picture_from_world(placed(mark, *self.pose(row, column)))

    def blinker_marks(self, row: int, column: int, view: View, turn: float) -> list[Floats]:
        """Its blinkers on the side that it shows [m], 1 left or -1 right; none for any other value."""
        if abs(turn) != 1.0:
            return []
        marks = blinker_marks(self._states.length[row], self._states.width[row], turn)
        return [view.picture_from_world(placed(mark, *self.pose(row, column))) for mark in marks]

    def pose(self, row: int, column: int) -> tuple[float, float, float]:
        """Its position [m] and heading [rad]."""
        states = self._states
        return float(states.x[row, column]), float(states.y[row, column]), float(states.orientation[row, column])


def goal_outlines(agents: Iterable[AgentRecord], view: View) -> list[Floats]:
    """Outlines of the goal areas of agents in the picture [m]."""
    areas = [area for agent in agents for area in agent.goal_areas]
    return [view.picture_from_world(line) for area in areas for line in outlines(area)]
