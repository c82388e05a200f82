"""What a search may change: starts and speeds of vehicles near an agent, an error of one of them, the agent's sight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from interdrive.config.binding import bind, dotted
from interdrive.errors import InputError
from interdrive.files import content_of_input
from interdrive.scenario.inspection import candidates
from interdrive.storage.reading import decoded, parsed_toml

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.array_types import Floats
    from interdrive.scenario import Scenario

#: Errors of one other vehicle, each with one line of explanation.
ERRORS = {
    "brakes": "it brakes for no reason, and then goes on",
    "drifts": "it leaves the middle of its way to one side",
    "inattentive": "it replays its recording and does not react",
    "disobeys": "it keeps no rules of the road",
}

#: Others count that come so near to the agent in the recording [m].
NEAR = 30.0


@dataclass(frozen=True)
class Space:
    """Bounds of what a search changes.

    Attributes:
        start_time: The others start this much further along their recording [s].
        start_speed: Their speeds are multiplied by this.
        errors: Errors of which at most one vehicle makes one, keys of `ERRORS`.
        error_share: Share of the runs in which one does.
        sight: Radius within which the agent sees [m].
        others: Number of vehicles that are disturbed: those that come nearest to the agent.
    """

    start_time: Annotated[tuple[float, float], "s"] = (-2.0, 2.0)
    start_speed: tuple[float, float] = (0.8, 1.2)
    errors: tuple[str, ...] = ("brakes", "drifts", "inattentive", "disobeys")
    error_share: float = 0.75
    sight: Annotated[tuple[float, float], "m"] = (30.0, 80.0)
    others: int = 4

    def __post_init__(self) -> None:
        """Checks bounds and names."""
        bounds = {"start_time": self.start_time, "start_speed": self.start_speed, "sight": self.sight}
        for name, (low, high) in bounds.items():
            if not low <= high:
                raise InputError(name, f"the lower bound {low:g} is above the upper one {high:g}")
            if name != "start_time" and not low > 0.0:
                raise InputError(name, f"must be positive, is {low:g}")
        for name in self.errors:
            if name not in ERRORS:
                raise InputError("errors", f"there is no error {name}; there are {', '.join(ERRORS)}")
        if not 0.0 <= self.error_share <= 1.0:
            raise InputError("error_share", f"must be from 0 to 1, is {self.error_share:g}")
        if self.others < 1:
            raise InputError("others", f"must be positive, is {self.others}")

    @classmethod
    def read(cls, path: Path) -> Space:
        """The space of a TOML file with some of the attributes; the others have their defaults.

        Args:
            path: The file.

        Raises:
            InputError: The file does not exist, is not TOML, or says something that is no space.
        """
        content = content_of_input(path)
        try:
            values = dict(dotted(parsed_toml(decoded(content))))
        except ValueError as cause:
            raise InputError(f"{path}: not a TOML file: {cause}") from None
        try:
            return bind(cls(), values)
        except InputError as error:
            raise error.within(str(path)) from None

    @property
    def size(self) -> int:
        """Number of coordinates of a point: two for each other vehicle, four of the error, one of the sight."""
        return 2 * self.others + 5


@dataclass(frozen=True)
class Pair:
    """An agent of a scenario, with the vehicles that come near to it in the recording, nearest first."""

    scenario: Scenario
    agent_id: int
    others: tuple[int, ...]


@dataclass(frozen=True)
class Error:
    """What one other vehicle does wrong.

    Attributes:
        kind: A key of `ERRORS`.
        who: The vehicle.
        time: From its first state on [s].
        size: Braking [m/s²], or sideways offset, positive to the left [m].
        duration: Of the braking [s].
    """

    kind: str
    who: int
    time: float
    size: float
    duration: float


@dataclass(frozen=True)
class Disturbance:
    """A point of the space in the terms of the field.

    Attributes:
        times: By vehicle, how much further along its recording it starts [s].
        speeds: By vehicle, the factor of its speeds.
        error: The error of one of them; None: there is none.
        sight: Radius within which the agent sees [m]; None: as its settings say.
    """

    times: dict[int, float]
    speeds: dict[int, float]
    error: Error | None
    sight: float | None

    def words(self) -> str:
        """What is different, in one line."""
        said = [
            f"{who} starts {abs(time):.2f} s {'further on' if time > 0.0 else 'earlier on its way'}"
            for who, time in self.times.items()
            if time != 0.0
        ]
        said += [f"{who} drives at {factor:.3f} of its speed" for who, factor in self.speeds.items() if factor != 1.0]
        if self.error is not None:
            error = self.error
            what = {
                "brakes": f"brakes with {error.size:.1f} m/s² for {error.duration:.1f} s, {error.time:.1f} s after "
                "its start",
                "drifts": f"drifts {abs(error.size):.2f} m to the {'left' if error.size > 0.0 else 'right'}, "
                f"{error.time:.1f} s after its start",
                "inattentive": "does not react",
                "disobeys": "keeps no rules of the road",
            }
            said.append(f"{error.who} {what[error.kind]}")
        if self.sight is not None:
            said.append(f"the agent sees {self.sight:.0f} m far")
        return "; ".join(said) or "nothing is disturbed"


def pairs(scenario: Scenario, n_others: int) -> list[Pair]:
    """All agents of a scenario that have a vehicle near in the recording."""
    obstacles = scenario.obstacles
    able = candidates(scenario)
    rows = [row for row, is_able in enumerate(able.accepted.tolist()) if is_able]
    found = []
    for row in rows:
        nearest = []
        for other in rows:
            there = obstacles.valid[row] & obstacles.valid[other]
            if other == row or not there.any():
                continue
            dx = obstacles.x[row, there] - obstacles.x[other, there]
            dy = obstacles.y[row, there] - obstacles.y[other, there]
            distance = float(np.hypot(dx, dy).min())
            if distance <= NEAR:
                nearest.append((distance, int(obstacles.ids[other])))
        if nearest:
            others = tuple(number for _, number in sorted(nearest)[:n_others])
            found.append(Pair(scenario, int(obstacles.ids[row]), others))
    return found


def undisturbed(space: Space) -> Floats:
    """The point of a space at which nothing is changed."""
    point = np.empty(space.size)
    for other in range(space.others):
        point[2 * other] = _back(0.0, space.start_time)
        point[2 * other + 1] = _back(1.0, space.start_speed)
    point[-5:] = (1.0, 0.0, 0.0, 0.0, 1.0)
    return point


def disturbance(space: Space, pair: Pair, point: Floats) -> Disturbance:
    """What a point means for a pair; coordinates are from 0 to 1."""
    times, speeds = {}, {}
    for other, who in enumerate(pair.others):
        times[who] = _toward(float(point[2 * other]), space.start_time, 0.0)
        speeds[who] = _toward(float(point[2 * other + 1]), space.start_speed, 1.0)
    is_wrong, which, when, size, sight = (float(value) for value in point[-5:])
    error = None
    if is_wrong < space.error_share and space.errors:
        kinds = len(space.errors)
        kind = space.errors[min(int(is_wrong / space.error_share * kinds), kinds - 1)]
        whom = pair.others[min(int(which * len(pair.others)), len(pair.others) - 1)]
        if kind == "brakes":
            error = Error(kind, whom, 4.0 * when, 4.0 + 2.0 * size, 0.5 + 1.5 * size)
        elif kind == "drifts":
            side = 1.0 if size >= 0.5 else -1.0
            error = Error(kind, whom, 4.0 * when, side * (0.3 + 0.7 * abs(2.0 * size - 1.0)), 2.0)
        else:
            error = Error(kind, whom, 0.0, 0.0, 0.0)
    low, high = space.sight
    return Disturbance(times, speeds, error, None if sight >= 1.0 else low + (high - low) * sight)


def _back(neutral: float, bounds: tuple[float, float]) -> float:
    """Coordinate of the undisturbed value, or of the bound that is nearest to it."""
    low, high = bounds
    return 0.0 if high == low else float(np.clip((neutral - low) / (high - low), 0.0, 1.0))


def _toward(coordinate: float, bounds: tuple[float, float], neutral: float) -> float:
    """The value of a coordinate; exactly the undisturbed one at its coordinate."""
    low, high = bounds
    if low <= neutral <= high and coordinate == _back(neutral, bounds):
        return neutral
    return low + (high - low) * coordinate
