"""Which part of the world a picture shows, and which way up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats
    from interdrive.run import RunRecord, States

#: Space around the motion of the agents: share of its longer side, and least and largest space [m].
_MARGIN, _MARGIN_MIN, _MARGIN_MAX = 0.06, 6.0, 15.0

#: A turned picture must save this much of the area, or the reader is better off with x to the right.
_WORTH_TURNING = 0.6


@dataclass(frozen=True)
class View:
    """A rectangle of the world, turned by `angle`: the picture's x axis points to `angle` in the world [rad].

    Attributes:
        angle: Direction of the picture's x axis in the world [rad].
        center: Centre of the rectangle in the picture frame [m].
        width: Extent along the picture's x axis [m].
        height: Extent along the picture's y axis [m].
    """

    angle: float
    center: tuple[float, float]
    width: float
    height: float

    def picture_from_world(self, points: Floats) -> Floats:
        """The same points [m], shape (..., 2), turned into the picture frame."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        rotation = np.array([[cos, -sin], [sin, cos]])
        turned: Floats = np.asarray(points, dtype=np.float64) @ rotation
        return turned

    @property
    def x_limits(self) -> tuple[float, float]:
        """Smallest and largest x in the picture frame [m]."""
        return self.center[0] - 0.5 * self.width, self.center[0] + 0.5 * self.width

    @property
    def y_limits(self) -> tuple[float, float]:
        """Smallest and largest y in the picture frame [m]."""
        return self.center[1] - 0.5 * self.height, self.center[1] + 0.5 * self.height

    def shaped(self, aspect_min: float, aspect_max: float) -> View:
        """The same view, grown until height / width lies between the limits."""
        height = max(self.height, aspect_min * self.width)
        return replace(self, height=height, width=max(self.width, height / aspect_max))

    def touches(self, points_in_picture: Floats) -> bool:
        """The bounding box of the points overlaps the view."""
        low, high = points_in_picture.min(axis=0), points_in_picture.max(axis=0)
        (x0, x1), (y0, y1) = self.x_limits, self.y_limits
        return bool(low[0] <= x1 and high[0] >= x0 and low[1] <= y1 and high[1] >= y0)


def view_of(run: RunRecord) -> View:
    """Where the agents move (all participants, if there are no agents), as small as possible.

    The picture is turned if that makes it much smaller or if it would stand upright; then most vehicles drive to
    the right.
    """
    return view_around(*_driven(run.states))


def view_of_end(run: RunRecord, agent_id: int, seconds: float = 5.0, around: float = 15.0) -> View:
    """Where an agent was last, with some space around.

    Args:
        run: The run.
        agent_id: The agent.
        seconds: For how long before its end [s].
        around: How far from there the view reaches at least [m].
    """
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent_id))
    last = np.flatnonzero(states.valid[row])[-1 - round(seconds / run.scenario.dt) :]
    way = np.stack([states.x[row, last], states.y[row, last]], axis=1)
    corners = around * np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
    return view_around((way[:, None] + corners).reshape(-1, 2), way[-1:] - way[:1])


def view_around(points: Floats, motion: Floats) -> View:
    """A view of points of the world [m], shape (points, 2), with some space around them.

    It is turned if that makes it much smaller or if it would stand upright; then most of the ways `motion` [m], shape
    (vehicles, 2), lead to the right.
    """
    angle = _turn(points, motion)
    box = View(angle, (0.0, 0.0), 0.0, 0.0).picture_from_world(points)
    low, high = box.min(axis=0), box.max(axis=0)
    margin = float(np.clip(_MARGIN * (high - low).max(), _MARGIN_MIN, _MARGIN_MAX))
    width, height = (high - low) + 2.0 * margin
    center = 0.5 * (low + high)
    return View(angle, (float(center[0]), float(center[1])), float(width), float(height))


def _driven(states: States) -> tuple[Floats, Floats]:
    """Corners of all footprints that count [m], shape (points, 2), and each vehicle's way from first to last."""
    counts = states.is_agent if states.is_agent.any() else np.ones(len(states.participant_id), dtype=bool)
    points, motion = [np.empty((0, 2))], [np.empty((0, 2))]
    for row in np.flatnonzero(counts & states.valid.any(axis=1)):
        track = np.stack([states.x[row], states.y[row]], axis=1)[states.valid[row]]
        reach = 0.5 * max(states.length[row], states.width[row])
        points += [track - reach, track + reach]
        motion.append(track[-1:] - track[:1])
    every = np.concatenate(points)
    return (every if len(every) else np.zeros((1, 2))), np.concatenate(motion)


def _turn(points: Floats, motion: Floats) -> float:
    angles = np.radians(np.arange(0.0, 180.0, 2.0))
    extents = np.array(
        [np.ptp(View(angle, (0.0, 0.0), 0.0, 0.0).picture_from_world(points), axis=0) for angle in angles]
    )
    extents += 2.0 * _MARGIN_MIN
    areas = extents.prod(axis=1)
    lying = np.flatnonzero(extents[:, 0] >= extents[:, 1])
    best = lying[np.argmin(areas[lying])]
    upright = extents[0, 1] > 1.5 * extents[0, 0]
    if areas[best] >= _WORTH_TURNING * areas[0]:
        if not upright:
            return 0.0
        best = np.argmin(np.abs(angles - 0.5 * np.pi))
    angle = float(angles[best])
    forward = motion @ np.array([np.cos(angle), np.sin(angle)])
    return angle if forward.sum() >= 0.0 else angle - float(np.pi)
