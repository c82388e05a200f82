"""What a process is told to drive for a search: worlds of points, and how they end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.failure_search.disturbed_worlds import disturbed
from interdrive.failure_search.evaluation import drive_of, in_disturbed
from interdrive.failure_search.pairs import scenario_at
from interdrive.failure_search.plausibility import implausible
from interdrive.failure_search.spaces import disturbance, undisturbed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.failure_search.allocation import Proposal
    from interdrive.failure_search.disturbances import Disturbance, Pair
    from interdrive.failure_search.evaluation import Drive, Drivers, Judged
    from interdrive.failure_search.spaces import Space
    from interdrive.scenario import Scenario

#: Draws of a point until the search takes the pair for one without a plausible world.
_DRAWS = 50


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
        failing: A point that fails, to be made small and kept; None: nothing has failed yet.
        signature: Of that failure.
        until: Time of the clock of all machines at which making it small ends [s since 1970]; 0: it is kept as it is.
    """

    setup: Setup
    pair: Pair
    proposal: Proposal | None = None
    failing: tuple[float, ...] | None = None
    signature: str = ""
    until: float = math.inf


@dataclass(frozen=True)
class Driven:
    """A run that was done.

    Attributes:
        point: The point.
        draws: How often points were drawn for it.
        judged: How the agent ended; None: no draw was plausible.
        disturbance: The point in words.
    """

    point: tuple[float, ...]
    draws: int
    judged: Judged | None
    disturbance: str = ""


def driven(trial: Trial) -> Driven:
    """Drives the first plausible world of a proposal, or the undisturbed one."""
    setup, pair = trial.setup, trial.pair
    if trial.proposal is None:
        neutral = undisturbed(setup.space)
        scenario = scenario_at(pair.path)
        found = drive_at(setup, pair, change_at(setup, pair, neutral), scenario).judged(scenario)
        return Driven(tuple(neutral.tolist()), 1, found)
    points = trial.proposal.points(setup.seed)
    draws, ended = 0, None
    while ended is None and draws < _DRAWS:
        draws, point = draws + 1, next(points)
        change = change_at(setup, pair, point)
        world = disturbed_world(setup, pair, change)
        ended = None if world is None else judged_in(*world)
    return Driven(tuple(point.tolist()), draws, ended, change.words())


def world_at(setup: Setup, pair: Pair, point: Sequence[float] | Floats) -> tuple[Scenario, Drive] | None:
    """The world of a point and who drives in it; None if it is not plausible."""
    return disturbed_world(setup, pair, change_at(setup, pair, point))


def disturbed_world(setup: Setup, pair: Pair, change: Disturbance) -> tuple[Scenario, Drive] | None:
    """The world in which something is disturbed and who drives in it; None if it is not plausible."""
    if change.rare is not None:
        return None
    original = scenario_at(pair.path)
    scenario = disturbed(original, change)
    if implausible(original, scenario, moved_by(change)):
        return None
    return scenario, drive_at(setup, pair, change, scenario)


def judged_in(scenario: Scenario, way: Drive) -> Judged | None:
    """How the agent ends in a world; None if a vehicle has no route there."""
    try:
        return way.judged(scenario)
    except InputError:
        return None


def change_at(setup: Setup, pair: Pair, point: Sequence[float] | Floats) -> Disturbance:
    """What a point means for a pair."""
    return disturbance(setup.space, setup.drivers.traffic, pair, point)


def drive_at(setup: Setup, pair: Pair, change: Disturbance, scenario: Scenario) -> Drive:
    """Who drives what in a disturbed world."""
    return in_disturbed(drive_of(scenario, pair.agent_id, setup.drivers), change)


def signature(pair: Pair, found: Judged) -> str:
    """What failures that are alike have in common: agent, kind, partner, lanelets of both; "" without a failure."""
    if not found.failure:
        return ""
    places = "-".join(map(str, found.lanelets))
    return f"{pair.scenario} {pair.agent_id} {found.failure} {found.partner_id} {places}"


def moved_by(change: Disturbance) -> set[int]:
    """The vehicles whose start or speed is disturbed."""
    return {who for who, time in change.times.items() if time != 0.0 or change.speeds[who] != 1.0}
