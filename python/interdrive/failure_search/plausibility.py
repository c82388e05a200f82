"""Whether a recording with other starts and speeds can have come about."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario.inspection import lanelets_at

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.array_types import Bools, Floats
    from interdrive.scenario import Obstacles, Scenario

#: A follower may have to brake so hard for the vehicle ahead at its start [m/s²]; sideways distance of followers [m].
_BRAKING_MAX, _LANE = 4.0, 2.0
#: Pairs farther apart than this are not looked at [m]; for so long they are thought to drive straight on [s].
_REACH, _STRAIGHT = 80.0, 3.0
#: The times at which they may touch then [s].
_TIMES = np.arange(0.0, _STRAIGHT, 0.1)


def implausible(original: Scenario, changed: Scenario, moved: set[int]) -> str:
    """Why a disturbed world cannot have come about; "" if it can.

    A vehicle is off the road at its start; or, where this is not so in the recording, it overlaps another one then, one
    of both has to brake hard, or they touch straight on whichever brakes.
    """
    before, after = original.obstacles, changed.obstacles
    names = sorted(moved)
    rows = np.searchsorted(after.ids, names)
    starts = after.valid[rows].argmax(axis=1)
    lanelets = lanelets_at(changed.lanelets, after.x[rows, starts], after.y[rows, starts])
    for who, row, own in zip(names, rows.tolist(), lanelets, strict=True):
        if after.valid[row].sum() < 2:
            return f"{who} has no way left"
        if not own.any():
            return f"{who} starts off every lanelet"
    sizes = _sizes(after)
    scenes: dict[int, tuple[_Scene, _Scene]] = {}
    for who, row, first in zip(names, rows.tolist(), starts.tolist(), strict=True):
        if first not in scenes:
            scenes[first] = _Scene.of(before, sizes, first), _Scene.of(after, sizes, first)
        for other, why in _conflicts(*scenes[first], row):
            return why.format(f"{who} and {int(after.ids[other])}", f"{who} or {int(after.ids[other])}")
    return ""


def _conflicts(before: _Scene, after: _Scene, row: int) -> Iterator[tuple[int, str]]:
    """The vehicles with which one cannot have started, and why, with places for both of them."""
    near = after.valid & (after.distances(row) <= _REACH)
    near[row] = False
    worst, recorded = after.braking(row), before.braking(row)
    too_hard = near & (worst > _BRAKING_MAX) & (recorded <= _BRAKING_MAX)
    may_overlap, may_meet = near & after.may_overlap(row), near & after.may_meet(row)
    for other in np.flatnonzero(too_hard | may_overlap | may_meet).tolist():
        if may_overlap[other] and after.overlaps(row, other) and not before.overlaps(row, other):
            yield other, "{0} overlap at the start"
        if too_hard[other]:
            yield other, f"{{1}} has to brake with {worst[other]:.1f} m/s² at the start"
        if may_meet[other] and after.is_too_late(row, other) and not before.is_too_late(row, other):
            yield other, f"{{0}} touch, whichever brakes with {_BRAKING_MAX:g} m/s² at the start"


@dataclass(frozen=True)
class _Scene:
    """All vehicles at a time step, one row each.

    Attributes:
        valid: Whether it is there.
        centre: Where [m], shape (vehicles, 2).
        heading: Unit vector along it, likewise.
        speed: Along it [m/s].
        size: Length and width [m], likewise.
        radius: How far it reaches at most from its centre [m].
    """

    valid: Bools
    centre: Floats
    heading: Floats
    speed: Floats
    size: Floats
    radius: Floats
    _ways: dict[tuple[int, float], Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, obstacles: Obstacles, size: Floats, column: int) -> _Scene:
        """Those of a recording, with their lengths and widths."""
        angle = obstacles.orientation[:, column]
        return cls(
            obstacles.valid[:, column],
            np.stack([obstacles.x[:, column], obstacles.y[:, column]], axis=1).astype(np.float64),
            np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(np.float64),
            obstacles.velocity[:, column].astype(np.float64),
            size,
            0.5 * np.hypot(size[:, 0], size[:, 1]) + 1e-9,
        )

    def distances(self, row: int) -> Floats:
        """Distances of the centres from that of one vehicle [m]."""
        found: Floats = np.hypot(*(self.centre - self.centre[row]).T)
        return found

    def braking(self, row: int) -> Floats:
        """What one vehicle, or each other one behind it, needs not to hit the other on the same line [m/s²]."""
        apart, half = self.centre - self.centre[row], 0.5 * (self.size[:, 0] + self.size[row, 0])
        # As seen by who follows: the vehicle itself, or the other one.
        ahead = _needed(self.heading[row], apart, self.heading, self.speed[row], self.speed, half)
        behind = _needed(self.heading, -apart, self.heading[row], self.speed, self.speed[row], half)
        found: Floats = np.maximum(ahead, behind) * (self.valid & self.valid[row])
        return found

    def may_overlap(self, row: int) -> Bools:
        """Who is so near that both may overlap."""
        found: Bools = self.distances(row) <= self.radius + self.radius[row]
        return found

    def may_meet(self, row: int) -> Bools:
        """Whose way straight on comes so near that both may touch."""
        way = np.maximum(self.speed, 0.0)[:, None] * _STRAIGHT * self.heading
        low = np.minimum(self.centre, self.centre + way) - self.radius[:, None]
        high = np.maximum(self.centre, self.centre + way) + self.radius[:, None]
        found: Bools = ((low <= high[row]) & (low[row] <= high)).all(axis=1)
        return found

    def overlaps(self, row: int, other: int) -> bool:
        """Whether two rectangles overlap."""
        if not (self.valid[row] and self.valid[other] and self.may_overlap(row)[other]):
            return False
        return _touch(self._corners(row), self._corners(other), (self.centre[other] - self.centre[row])[None])

    def is_too_late(self, row: int, other: int) -> bool:
        """Whether both touch straight on, whichever of them brakes as hard as a follower may have to."""
        if not (self.valid[row] and self.valid[other]):
            return False
        bodies = self._corners(row), self._corners(other)
        free, braked = ([self._way(one, braking) for one in (row, other)] for braking in (0.0, _BRAKING_MAX))
        apart = self.centre[other] - self.centre[row]
        return _touch(*bodies, apart + free[1] - braked[0]) and _touch(*bodies, apart + braked[1] - free[0])

    def _corners(self, row: int) -> Floats:
        """Corners of a footprint about its centre, in their order, shape (4, 2)."""
        along = 0.5 * self.size[row, 0] * self.heading[row]
        across = 0.5 * self.size[row, 1] * np.array([-self.heading[row, 1], self.heading[row, 0]])
        corners: Floats = np.array([along + across, along - across, -along - across, -along + across])
        return corners

    def _way(self, row: int, braking: float) -> Floats:
        """How far a vehicle gets straight on, shape (times, 2) [m]."""
        if (row, braking) not in self._ways:
            speed = max(float(self.speed[row]), 0.0)
            moving = _TIMES if braking == 0.0 else np.minimum(_TIMES, speed / braking)
            self._ways[row, braking] = (speed * moving - 0.5 * braking * moving**2)[:, None] * self.heading[row]
        return self._ways[row, braking]


def _needed(
    heading: Floats, apart: Floats, led: Floats, speed: Floats | float, led_speed: Floats | float, half: Floats
) -> Floats:
    """What followers need not to hit their leaders [m/s²]; 0 where these are not on the same line.

    Args:
        heading: Of the followers, unit vectors.
        apart: From follower to leader [m].
        led: Headings of the leaders.
        speed: Of the followers [m/s].
        led_speed: Of the leaders [m/s].
        half: Half of both lengths [m].
    """
    along = (apart * heading).sum(axis=1)
    across = apart[:, 1] * heading[..., 0] - apart[:, 0] * heading[..., 1]
    turned = (led * heading).sum(axis=1)
    closing = speed - led_speed * turned
    follows = (along > 0.0) & (np.abs(across) <= _LANE) & (turned >= math.cos(math.pi / 4.0)) & (closing > 0.0)
    found: Floats = np.where(follows, closing * closing / (2.0 * np.maximum(along - half, 0.01)), 0.0)
    return found


def _sizes(obstacles: Obstacles) -> Floats:
    """Length and width of every footprint [m]."""
    sizes = []
    for shape in obstacles.shapes:
        if len(shape.vertices):
            sizes.append(np.ptp(shape.vertices, axis=0))
        else:
            sizes.append((shape.length or 2.0 * shape.radius, shape.width or 2.0 * shape.radius))
    return np.array(sizes, dtype=np.float64)


def _touch(body: Floats, other: Floats, apart: Floats) -> bool:
    """Whether two rectangles overlap at one of some displacements: no side of either separates them."""
    overlaps = np.ones(len(apart), dtype=np.bool_)
    for side in (body[0] - body[1], body[1] - body[2], other[0] - other[1], other[1] - other[2]):
        first, second, shift = body @ side, other @ side, apart @ side
        overlaps &= (first.max() >= second.min() + shift) & (second.max() + shift >= first.min())
        if not overlaps.any():
            return False
    return True
