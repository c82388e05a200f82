"""What a process is told to drive for a search: worlds of points, and the smallest disturbance of a failure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError, InterdriveError
from interdrive.failure_search.disturbed_worlds import disturbed, implausible
from interdrive.failure_search.evaluation import avoided_by, drive_of, in_disturbed
from interdrive.failure_search.pairs import scenario_at
from interdrive.failure_search.shrinking import shrunk
from interdrive.failure_search.spaces import disturbance, undisturbed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.failure_search.allocation import Proposal
    from interdrive.failure_search.evaluation import Drive, Judged
    from interdrive.failure_search.spaces import Disturbance, Pair, Space
    from interdrive.scenario import Scenario

#: Draws of a point until the search takes the pair for one without a plausible world.
_DRAWS = 50


@dataclass(frozen=True)
class Drivers:
    """Who drives in a search: the planner under test, the traffic, and the predictor of all."""

    planner: str
    traffic: str
    predictor: str


@dataclass(frozen=True)
class Setup:
    """What all runs of a search have in common."""

    drivers: Drivers
    space: Space
    seed: int


@dataclass(frozen=True)
class Trial:
    """A run to do.

    Attributes:
        setup: Of the search.
        pair: The agent.
        proposal: What to try; None: the undisturbed world.
        failing: A point that fails, to be made small; None: nothing has failed yet.
        signature: Of that failure.
    """

    setup: Setup
    pair: Pair
    proposal: Proposal | None = None
    failing: tuple[float, ...] | None = None
    signature: str = ""


@dataclass(frozen=True)
class Driven:
    """A point, how often points were drawn for it, and how the agent ended; None: no draw was plausible."""

    point: tuple[float, ...]
    draws: int
    judged: Judged | None


def drive(numbered: tuple[int, Trial], _attempts: int) -> Driven | InterdriveError:
    """Does a trial. Errors of the input are its result, since an exception would end the process."""
    _, trial = numbered
    try:
        return _shrunk(trial) if trial.failing is not None else _driven(trial)
    except InterdriveError as error:
        return error


def _driven(trial: Trial) -> Driven:
    setup = trial.setup
    if trial.proposal is None:
        neutral = undisturbed(setup.space)
        scenario = scenario_at(trial.pair.path)
        found = drive_at(setup, trial.pair, change_at(setup, trial.pair, neutral), scenario).judged(scenario)
        return Driven(tuple(neutral.tolist()), 1, found)
    points = trial.proposal.points(setup.seed)
    draws, ended = 0, None
    while ended is None and draws < _DRAWS:
        draws, point = draws + 1, next(points)
        ended = judged_at(setup, trial.pair, point)
    return Driven(tuple(point.tolist()), draws, ended)


def _shrunk(trial: Trial) -> Driven:
    """The smallest disturbance under which the agent fails in the same way, avoided by whoever avoids the first one."""
    setup, pair = trial.setup, trial.pair
    avoiding = ""

    def still_fails(point: Sequence[float] | Floats) -> bool:
        world = _world(setup, pair, point)
        if world is None:
            return False
        scenario, way = world
        found = _judged(scenario, way)
        if found is None or signature(pair, found) != trial.signature:
            return False
        return not avoiding or bool(avoided_by(scenario, way, (avoiding,)))

    first = np.array(trial.failing)
    world = _world(setup, pair, first)
    if world is not None:
        avoiding = avoided_by(*world)
    small = shrunk(first, undisturbed(setup.space), still_fails)
    return Driven(tuple(small.tolist()), 1, judged_at(setup, pair, small))


def judged_at(setup: Setup, pair: Pair, point: Sequence[float] | Floats) -> Judged | None:
    """What happens in the world of a point; None if it is not plausible."""
    world = _world(setup, pair, point)
    return None if world is None else _judged(*world)


def _world(setup: Setup, pair: Pair, point: Sequence[float] | Floats) -> tuple[Scenario, Drive] | None:
    """The world of a point and who drives in it; None if it is not plausible."""
    change = change_at(setup, pair, point)
    original = scenario_at(pair.path)
    scenario = disturbed(original, change)
    if change.rare is not None or implausible(original, scenario, moved_by(change)):
        return None
    return scenario, drive_at(setup, pair, change, scenario)


def _judged(scenario: Scenario, way: Drive) -> Judged | None:
    try:
        return way.judged(scenario)
    except InputError:  # a vehicle has no route from its new start
        return None


def change_at(setup: Setup, pair: Pair, point: Sequence[float] | Floats) -> Disturbance:
    """What a point means for a pair."""
    return disturbance(setup.space, setup.drivers.traffic, pair, point)


def drive_at(setup: Setup, pair: Pair, change: Disturbance, scenario: Scenario) -> Drive:
    """Who drives what in a disturbed world."""
    drivers = setup.drivers
    return in_disturbed(drive_of(scenario, pair.agent_id, drivers.planner, drivers.traffic, drivers.predictor), change)


def signature(pair: Pair, found: Judged) -> str:
    """What failures that are alike have in common; "" without a failure."""
    return f"{pair.scenario} {pair.agent_id} {found.failure} {found.partner_id}" if found.failure else ""


def moved_by(change: Disturbance) -> set[int]:
    """The vehicles whose start or speed is disturbed."""
    return {who for who, time in change.times.items() if time != 0.0 or change.speeds[who] != 1.0}
