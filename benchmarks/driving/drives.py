"""One scenario driven by all of its vehicles: a row per agent, and what its drive looks like beside its recording."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from causes import Delay, held_up_by
from comfort import UNKNOWN, extremes
from events import events
from free_way import free
from lane_changes import Lanes, lane_changes, shown_lane_changes, written
from pace import paces
from places import category_of
from realism import Samples, samples_of

from interdrive import _core
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.errors import InterdriveError
from interdrive.files import read_scenario
from interdrive.simulation import Simulation, reachable_agents

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from interdrive.config.schema import SimulationSettings
    from interdrive.runs import Run

#: An agent stands below the first speed, as it knows itself, and is slow below the second one [m/s].
STANDING, SLOW = _core.STANDSTILL_SPEED, 1.0
#: Standing or being slow for longer counts [s].
LONG = 10.0
#: Outcomes of agents that arrive.
ENDED_WELL = ("goal_reached", "goal_reached_late")


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
        pace, recorded_pace: Share of free flow, see pace.py; nan where it says nothing.
        brake, across, jerk: Largest values, see comfort.py. recorded_brake and so on: The same of its recording.
        stands_at_end: It ends standing, neither at its goal nor in a collision.
        stood_free: Longest time for which it stood with a free way, see free_way.py [s]; 0 up to 10 s of standing.
        violations: Rules of the road that it broke. broken: Their names, each once.
        recorded_violations: The same of its recording.
        changes: Its lane changes, see lane_changes.py. recorded_changes: The same of its recording, without blinkers.
        event: What it failed in, see events.py: the smallest id of the agents in it; -1 if it did not fail.
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
    pace: float
    recorded_pace: float
    brake: float
    across: float
    jerk: float
    recorded_brake: float
    recorded_across: float
    recorded_jerk: float
    stands_at_end: bool
    stood_free: float
    violations: int
    broken: str
    recorded_violations: int
    changes: str
    recorded_changes: str
    event: int


@dataclass(frozen=True)
class Driven:
    """A scenario that was driven, or why it was not."""

    path: Path
    digest: str
    reachable: tuple[int, ...]
    drives: tuple[Drive, ...]
    samples: tuple[Samples, ...]
    refused: str = ""


@dataclass(frozen=True)
class Failures:
    """By agents that fail: their event; what held them up, the head of their queue, and the delay from it [s]."""

    events: dict[int, int]
    causes: dict[int, tuple[str, int, float]]


def drive(
    path: Path,
    place: str,
    reachable: Sequence[int] | None,
    predictor: str,
    settings: SimulationSettings,
    *,
    planner: str = DEFAULT_PLANNER,
    with_causes: bool = True,
) -> Driven:
    """Drives a scenario; `reachable` are the ids of the reachable agents if they are known already."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    try:
        known = _reachable(path) if reachable is None else tuple(reachable)
        simulation = Simulation(path, planner=planner, predictor=predictor, settings=settings, threads=1)
        run = simulation.run()
    except InterdriveError as error:
        return Driven(path, digest, (), (), (), str(error).removeprefix(f"{path}: "))
    routes = [agent.route for agent in simulation.agents]
    delays = {agent.id: Delay.of(run, i, routes[i]) for i, agent in enumerate(run.agents)}
    ends = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
    lost = [agent for agent in ends if agent in known and ends[agent] != "goal_reached"]
    failures = Failures(
        events(run, routes, delays, {*lost, *(agent for agent in ends if ends[agent] == "collision")}),
        held_up_by(simulation, delays, lost) if lost and with_causes else {},
    )
    lanes = Lanes(simulation.road, run.scenario.lanelets)
    drives = tuple(
        _row(run, i, path, place, agent.id in known, delays[agent.id], failures, simulation, lanes)
        for i, agent in enumerate(run.agents)
    )
    samples = tuple(samples_of(run, i, routes[i], category_of(path)) for i in range(len(run.agents)))
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
    is_reachable: bool,
    delay: Delay,
    failures: Failures,
    simulation: Simulation,
    lanes: Lanes,
) -> Drive:
    agent, ended, states, dt = run.agents[i], run.outcomes, run.states, run.scenario.dt
    outcome, step = ended.outcome[i], int(ended.time_step[i])
    cause, head, seconds = failures.causes.get(agent.id, ("", -1, float("nan")))
    partner, partner_id = _partner(run, i)
    row, route = int(np.searchsorted(states.participant_id, agent.id)), simulation.agents[i].route
    speed = states.velocity[row]
    present, stands = np.flatnonzero(states.valid[row]), states.valid[row] & (np.abs(speed) < STANDING)
    recording = np.flatnonzero(run.scenario.obstacles.ids == agent.id)
    recorded = run.scenario.obstacles.velocity[recording[0]] if len(recording) else np.empty(0)
    smooth = extremes(states, row, dt)
    human = extremes(run.scenario.obstacles, int(recording[0]), dt) if len(recording) else UNKNOWN
    pace, recorded_pace = paces(run, i, route, simulation.road)
    changes = shown_lane_changes(states, row, run.plans, lanes, dt)
    recorded_changes = [
        change for i in recording[:1].tolist() for change, _ in lane_changes(run.scenario.obstacles, i, lanes, dt)
    ]
    broken = _broken(run, agent.id, "agent")
    return Drive(
        category=category_of(path),
        place=place,
        scenario=path.stem,
        agent_id=agent.id,
        origin=agent.origin,
        reachable=is_reachable,
        outcome=outcome,
        time=step * dt,
        late=(step - agent.goal_time_step[1]) * dt if outcome == "goal_reached_late" else float("nan"),
        lost=delay.at(min(step, agent.goal_time_step[1])),
        stood=longest(speed < STANDING, dt),
        slow=longest(speed < SLOW, dt),
        recorded_slow=longest(recorded < SLOW, dt),
        hardest=float(np.nanmax(np.abs(np.diff(speed)), initial=0.0)) / dt,
        off_lanelets=float(ended.off_lanelets[i]),
        partner=partner,
        partner_id=partner_id,
        impact_speed=float(ended.impact_speed[i]),
        cause=cause,
        head_id=head,
        cause_seconds=seconds,
        pace=pace,
        recorded_pace=recorded_pace,
        brake=smooth.brake,
        across=smooth.across,
        jerk=smooth.jerk,
        recorded_brake=human.brake,
        recorded_across=human.across,
        recorded_jerk=human.jerk,
        stands_at_end=bool(stands[present[-1:]].any()) and outcome not in ENDED_WELL and outcome != "collision",
        stood_free=_stood_free(run, row, route, stands),
        violations=len(broken),
        broken=" ".join(sorted(set(broken))),
        recorded_violations=len(_broken(run, agent.id, "recording")),
        changes=written(changes),
        recorded_changes=written(recorded_changes),
        event=failures.events.get(agent.id, -1),
    )


def _stood_free(run: Run, row: int, route: _core.Route, stands: NDArray[np.bool_]) -> float:
    """The longest time for which an agent stood with a free way [s]; 0 if it never stood for long."""
    if longest(stands, run.scenario.dt) <= LONG:
        return 0.0
    idle, steps = stands.copy(), np.flatnonzero(stands)
    idle[steps] = free(run, row, route, steps)
    return longest(idle, run.scenario.dt)


def _broken(run: Run, agent_id: int, source: str) -> list[str]:
    """Names of the rules that an agent or its recording broke, one for each violation."""
    found = run.violations
    if found is None:
        return []
    rows = zip(found.participant_id.tolist(), found.source, found.rule, strict=True)
    return [rule for participant, by, rule in rows if (participant, by) == (agent_id, source)]


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
    return ("standing" if states.is_static[row] or abs(speed) < STANDING else "replayed"), partner


def longest(mask: NDArray[np.bool_], dt: float) -> float:
    """The longest stretch of a mask [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return float((edges[1::2] - edges[::2]).max(initial=0) * dt)
