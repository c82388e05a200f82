"""How participants look: outlines, heading marks, colours of agents, markers of outcomes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import Shape

if TYPE_CHECKING:
    from interdrive.plots.view import Floats
    from interdrive.run import Run

RECORDED = "#8c8c8c"
RECORDED_EDGE = "#5f5f5f"
GOAL = "#0072B2"
INK = "#222222"

#: Colours of agents, told apart with every common kind of colour blindness (Okabe and Ito; Tol); used in turn.
AGENTS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#332288",
    "#56B4E9",
    "#882255",
    "#44AA99",
    "#999933",
)


@dataclass(frozen=True)
class Mark:
    """Marker of an outcome: matplotlib's marker, fill colour, size [pt], and what the legend says."""

    marker: str
    color: str
    size: float
    text: str


#: Shape and colour both tell the outcome.
MARKS = {
    "goal_reached": Mark("o", "#009E73", 4.0, "goal reached"),
    "goal_reached_late": Mark("^", "#56B4E9", 4.8, "goal reached late"),
    "time_limit": Mark("s", "#E69F00", 4.0, "time limit"),
    "goal_missed": Mark("D", "#CC79A7", 3.8, "goal missed"),
    "infeasible": Mark("v", "#F0E442", 5.0, "no feasible plan"),
    "collision": Mark("X", "#D55E00", 6.0, "collision"),
    "planner_error": Mark("*", "#000000", 6.5, "planner error"),
    "running": Mark("o", "#ffffff", 4.0, "still running"),
}


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


def body_outlines(run: Run) -> list[list[Floats]]:
    """Outlines in the body frame, one list per row of `run.states`; agents without a recording are rectangles."""
    obstacles = run.scenario.obstacles
    shapes = dict(zip(obstacles.ids.tolist(), obstacles.shapes, strict=True))
    states = run.states
    return [
        outlines(shapes.get(number, Shape("rectangle", length=float(length), width=float(width))))
        for number, length, width in zip(states.ids.tolist(), states.length, states.width, strict=True)
    ]


def heading_mark(length: float, width: float) -> Floats:
    """A triangle in the front half that points forwards, in the body frame [m], shape (3, 2)."""
    return np.array([(0.42 * length, 0.0), (0.08 * length, 0.34 * width), (0.08 * length, -0.34 * width)])


def placed(points: Floats, x: float, y: float, orientation: float) -> Floats:
    """Points of the body frame [m], shape (..., 2), for a body at that pose."""
    cos, sin = np.cos(orientation), np.sin(orientation)
    turned: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return turned


def agent_colors(run: Run) -> dict[int, str]:
    """A colour per agent id."""
    return {agent.id: AGENTS[index % len(AGENTS)] for index, agent in enumerate(run.agents)}
