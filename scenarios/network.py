"""Lanelets and how they hang together."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from curves import Floats, Path, joined

LANE_WIDTH = 3.5


@dataclass
class Lanelet:
    """A lanelet: bounds [m], shape (vertices, 2), centre line, and ids of those around it."""

    id: int
    left: Floats
    right: Floats
    center: Path
    kinds: tuple[str, ...] = ("urban",)
    predecessors: list[int] = field(default_factory=list)
    successors: list[int] = field(default_factory=list)
    adjacent_left: tuple[int, bool] | None = None
    adjacent_right: tuple[int, bool] | None = None
    markings: tuple[str, str] = ("solid", "solid")


@dataclass
class Incoming:
    """One arm of an intersection: lanelets that lead in, and those inside by direction."""

    lanelets: list[int]
    left: list[int] = field(default_factory=list)
    straight: list[int] = field(default_factory=list)
    right: list[int] = field(default_factory=list)


@dataclass
class Light:
    """A traffic light: colours and their lengths in time steps, when the cycle begins, its lanelets, its place [m]."""

    phases: tuple[tuple[str, int], ...]
    offset: int
    lanelets: tuple[int, ...]
    position: tuple[float, float]


@dataclass
class Sign:
    """A traffic sign beside lanelets: its German code, its lanelets, its place [m]."""

    code: str
    lanelets: tuple[int, ...]
    position: tuple[float, float]


@dataclass
class Network:
    """All lanelets by id, the arms of each intersection, lights, signs, and the speed limit of all lanelets [m/s]."""

    speed_limit: float
    lanelets: dict[int, Lanelet] = field(default_factory=dict)
    intersections: list[list[Incoming]] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    signs: list[Sign] = field(default_factory=list)

    def add(
        self,
        number: int,
        center: Path,
        spacing: float,
        *,
        width: float = LANE_WIDTH,
        kinds: tuple[str, ...] = ("urban",),
        markings: tuple[str, str] = ("solid", "solid"),
    ) -> Lanelet:
        """Adds a lanelet along a centre line, its vertices about `spacing` apart [m]."""
        grid = np.linspace(0.0, center.length, max(2, round(center.length / spacing) + 1))
        left, right = (rounded(center.at(grid, side * 0.5 * width)[0]) for side in (1.0, -1.0))
        self.lanelets[number] = Lanelet(number, left, right, center, kinds, markings=markings)
        return self.lanelets[number]

    def follow(self, first: int, second: int) -> None:
        """The second lanelet is a successor of the first."""
        self.lanelets[first].successors.append(second)
        self.lanelets[second].predecessors.append(first)

    def neighbours(self, left: int, right: int, *, same_direction: bool = True, marking: str = "dashed") -> None:
        """Two lanelets side by side; their common bound gets the same vertices.

        Seen by `right`, `left` is at its left; if they run against each other, each is at the other's left.
        """
        here, there = self.lanelets[right], self.lanelets[left]
        here.adjacent_left = (left, same_direction)
        here.markings = (marking, here.markings[1])
        if same_direction:
            there.adjacent_right = (right, True)
            there.right = here.left
            there.markings = (there.markings[0], marking)
        else:
            there.adjacent_left = (right, False)
            there.left = here.left[::-1]
            there.markings = (marking, there.markings[1])

    def path(self, route: list[int]) -> Path:
        """Centre line along lanelets that follow each other."""
        return joined([self.lanelets[number].center for number in route])


def rounded(values: Floats) -> Floats:
    """As written: four decimals, no negative zero."""
    return np.round(values, 4) + 0.0
