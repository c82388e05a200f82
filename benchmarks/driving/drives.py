"""One scenario driven by all of its vehicles: a row per agent, and what its drive looks like beside its recording."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from causes import Delay, held_up_by
from realism import Samples, samples_of

from interdrive.errors import InterdriveError
from interdrive.files import read_scenario
from interdrive.simulation import Simulation, reachable_agents

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from interdrive.config.schema import SimulationSettings
    from interdrive.runs import Run

#: An agent stands below the first speed and is slow below the second one [m/s].
STANDING, SLOW = 0.1, 1.0
#: Standing or being slow for longer counts [s].
LONG = 10.0


@dataclass(frozen=True)
class Drive:
    """How one agent fared; a row of the CSV file.

    Attributes:
        scenario: Name of its file. category: Folder of the file. place: Name in training/split.toml.
        agent_id: Its id. origin: "recorded" or "planning problem".
        reachable: Recorded, and its own outcome is goal_reached where all vehicles replay their recordings.
        outcome: One of `interdrive.run.OUTCOMES`. time: When, from the first time step on [s].
        late: How long after its deadline it arrived [s]; nan where it did not, or was in time.
        lost: Behind its recording at the same place, at its end or deadline [s].
        stood, slow: Longest time below 0.1 and 1 m/s [s]. recorded_slow: The latter in its recording.
        hardest: Largest change of its speed within a time step [m/s²].
        off_lanelets: Largest overhang of its body beyond the lanelets [m].
        partner: What it ran into: "agent", "replayed", "standing", "road edge", or "". partner_id: -1 for none.
        impact_speed: Relative speed at the contact [m/s]; nan without.
        cause: What held it up longest before its deadline; "" where it was in time.
        head_id: The first vehicle of the queue that the cause belongs to. cause_seconds: Delay from that cause [s].
    """

    category: str
    place: str
    scenario: str
    agent_id: int
    origin: str
    reachable: bool
    outcome: str
    time: float
    late: float
    lost: float
    stood: float
    slow: float
    recorded_slow: float
    hardest: float
    off_lanelets: float
    partner: str
    partner_id: int
    impact_speed: float
    cause: str
    head_id: int
    cause_seconds: float


@dataclass(frozen=True)
class Driven:
    """A scenario that was driven, or why it was not."""

    path: Path
    digest: str
    reachable: tuple[int, ...]
    drives: tuple[Drive, ...]
    samples: tuple[Samples, ...]
    refused: str = ""


def drive(
    path: Path,
    place: str,
    reachable: Sequence[int] | None,
    predictor: str,
    settings: SimulationSettings,
    *,
    with_causes: bool = True,
) -> Driven:
    """Drives a scenario; `reachable` are the ids of the reachable agents if they are known already."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    try:
        known = _reachable(path) if reachable is None else tuple(reachable)
        simulation = Simulation(path, predictor=predictor, settings=settings, threads=1)
        run = simulation.run()
    except InterdriveError as error:
        return Driven(path, digest, (), (), (), str(error).removeprefix(f"{path}: "))
    routes = [agent.route for agent in simulation.agents]
    delays = {agent.id: Delay.of(run, i, routes[i]) for i, agent in enumerate(run.agents)}
    failing = [
        agent.id
        for agent, outcome in zip(run.agents, run.outcomes.outcome, strict=True)
        if agent.id in known and outcome != "goal_reached"
    ]
    causes = held_up_by(simulation, delays, failing) if failing and with_causes else {}
    drives = tuple(_row(run, i, path, place, known, delays, causes) for i in range(len(run.agents)))
    samples = tuple(samples_of(run, i, routes[i], path.parent.name) for i in range(len(run.agents)))
    return Driven(path, digest, known, drives, tuple(one for one in samples if one is not None))


def _reachable(path: Path) -> tuple[int, ...]:
    """Recorded vehicles whose recording reaches their goal in time; planning problems have none to judge by."""
    recorded = {agent.id for agent in Simulation(path, threads=1).agents if agent.origin == "recorded"}
    return tuple(i for i in reachable_agents(read_scenario(path)) if i in recorded)


class ReachableCache:
    """Reachable agents by the hash of their scenario, kept in a JSON file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known: dict[str, list[int]] = json.loads(path.read_text()) if path.exists() else {}

    def of(self, scenario: Path) -> list[int] | None:
        """The ids, or None where they are not known yet."""
        return self._known.get(hashlib.sha256(scenario.read_bytes()).hexdigest())

    def keep(self, driven: Sequence[Driven]) -> None:
        """Writes those that were found."""
        self._known |= {one.digest: list(one.reachable) for one in driven if not one.refused}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(self._known, sort_keys=True))


def _row(
    run: Run,
    i: int,
    path: Path,
    place: str,
    reachable: Sequence[int],
    delays: dict[int, Delay],
    causes: dict[int, tuple[str, int, float]],
) -> Drive:
    agent, ended, dt = run.agents[i], run.outcomes, run.scenario.dt
    outcome, step = ended.outcome[i], int(ended.time_step[i])
    cause, head, seconds = causes.get(agent.id, ("", -1, float("nan")))
    partner, partner_id = _partner(run, i)
    speed = run.states.velocity[np.searchsorted(run.states.participant_id, agent.id)]
    recorded = _recorded_speed(run, agent.id)
    late = (step - agent.goal_time_step[1]) * dt if outcome == "goal_reached_late" else float("nan")
    return Drive(
        path.parent.name,
        place,
        path.stem,
        agent.id,
        agent.origin,
        agent.id in reachable,
        outcome,
        step * dt,
        late,
        delays[agent.id].at(min(step, agent.goal_time_step[1])),
        longest(speed < STANDING, dt),
        longest(speed < SLOW, dt),
        longest(recorded < SLOW, dt),
        float(np.nanmax(np.abs(np.diff(speed)), initial=0.0)) / dt,
        float(ended.off_lanelets[i]),
        partner,
        partner_id,
        float(ended.impact_speed[i]),
        cause,
        head,
        seconds,
    )


def _partner(run: Run, i: int) -> tuple[str, int]:
    """What an agent ran into, and its id."""
    ended, states = run.outcomes, run.states
    if ended.outcome[i] != "collision":
        return "", -1
    if ended.off_road[i]:
        return "road edge", -1
    partner = int(ended.partner_id[i])
    row = int(np.searchsorted(states.participant_id, partner))
    if states.is_agent[row]:
        return "agent", partner
    speed = states.velocity[row, max(0, int(ended.time_step[i]) - states.first_time_step)]
    return ("standing" if states.is_static[row] or speed < STANDING else "replayed"), partner


def _recorded_speed(run: Run, agent_id: int) -> NDArray[np.float64]:
    """Speed in the recording of an agent [m/s]; empty for a planning problem."""
    obstacles = run.scenario.obstacles
    row = np.flatnonzero(obstacles.ids == agent_id)
    return obstacles.velocity[row[0]] if len(row) else np.empty(0)


def longest(mask: NDArray[np.bool_], dt: float) -> float:
    """The longest stretch of a mask [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return float((edges[1::2] - edges[::2]).max(initial=0) * dt)
