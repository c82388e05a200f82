"""One place of a trial: the panel, honest drivers and adversaries, each in the place of the same agent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.adversaries.drivers import ADVERSARIES, HONEST, Driver
from interdrive.errors import InterdriveError
from interdrive.files import read_scenario
from interdrive.panel import PANEL
from interdrive.panel.judgement import judged, panel_drives
from interdrive.panel.worlds import World
from interdrive.scoring import ScoringSettings
from interdrive.scoring.drive_facts import drives_of
from interdrive.simulation import Simulation, simulate

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.config.specs import PlannerSpec
    from interdrive.runs import Run
    from interdrive.scenario import Scenario

#: How the others drive, and what all expect of each other.
TRAFFIC, PREDICTOR = "velocity_adjusting", "lane_following"

#: A vice acts if the adversary is this far from its base at some step [m].
_DIFFERENT = 0.05


@dataclass(frozen=True)
class Place:
    """An agent of a file. `file` and `road` name the file and the stretch of road."""

    path: Path
    file: str
    road: str
    agent_id: int


@dataclass(frozen=True)
class Drive:
    """One driver in one place.

    Attributes:
        driver: Its name.
        file: The file. road: Its stretch of road. agent_id: The agent.
        score: From 0 to 1.
        in_time: It reached its goal in time.
        acts: It differs from its base there; always true of honest drivers.
        why: What made the score less than 1.
    """

    driver: str
    file: str
    road: str
    agent_id: int
    score: float
    in_time: bool
    acts: bool
    why: str


def trial(place: Place) -> list[Drive] | str:
    """All drivers in the place of an agent; in one line why there are none if the agent cannot be driven."""
    try:
        return _trial(place)
    except InterdriveError as error:
        return f"{place.file}, agent {place.agent_id}: {error}"


def _trial(place: Place) -> list[Drive]:
    scenario, settings = read_scenario(place.path), ScoringSettings()
    planner: dict[int | str, PlannerSpec] = {place.agent_id: "lawful", "default": TRAFFIC}
    first = simulate(
        scenario,
        agents=[place.agent_id, *_others(scenario, place.agent_id)],
        planner=planner,
        predictor=PREDICTOR,
        threads=1,
    )
    world = World.of(first, place.agent_id)
    panel = panel_drives(world, PANEL, settings, measures_hindrance=True)
    runs: dict[str, Run] = {**panel.runs, HONEST: world.driven_by(Driver)}
    rows = []

    def add(name: str, run: Run, *, base: Run | None) -> None:
        drive = drives_of(run, [place.agent_id], settings)[place.agent_id]
        _, total, _, reasons = judged(drive, run, panel, settings)
        acts = base is None or _differs(run, base, place.agent_id)
        rows.append(
            Drive(name, place.file, place.road, place.agent_id, total.score, drive.in_time, acts, "; ".join(reasons))
        )

    for name, run in runs.items():
        add(name, run, base=None)
    for adversary in ADVERSARIES:
        add(adversary.name, world.driven_by(adversary.planner), base=runs[adversary.base])
    return rows


def _others(scenario: Scenario, agent_id: int) -> list[int]:
    """All other vehicles that can be agents and have a recording."""
    found = Simulation(scenario, agents="all", threads=1).agents
    recorded = set(scenario.obstacles.ids.tolist())
    return [agent.id for agent in found if agent.id != agent_id and agent.id in recorded]


def _differs(run: Run, base: Run, agent_id: int) -> bool:
    """The agent is elsewhere at some step, or ends at another one."""
    tracks = []
    for one in (run, base):
        row = int(np.searchsorted(one.states.participant_id, agent_id))
        there = one.states.valid[row]
        tracks.append(np.stack([one.states.x[row, there], one.states.y[row, there]]))
    own, other = tracks
    if own.shape != other.shape:
        return True
    return bool(np.hypot(*(own - other)).max(initial=0.0) > _DIFFERENT)
