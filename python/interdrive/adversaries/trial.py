"""One place of a trial: the panel, honest drivers and adversaries, each in the place of the same agent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.adversaries.drivers import ADVERSARIES, HONEST, Driver
from interdrive.files import read_scenario
from interdrive.foreign import failure
from interdrive.panel import PANEL, World, panel_drives, why_driven_anew
from interdrive.scoring import ScoringSettings
from interdrive.scoring import drive_facts as facts
from interdrive.scoring.hindrance import Hindrance, hindrance_of
from interdrive.scoring.judgement import judged
from interdrive.simulation import Simulation, simulate

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.config.specs import PlannerSpec
    from interdrive.native_settings import RulesSettings
    from interdrive.panel.stored import PanelFolder
    from interdrive.scenario import Scenario

#: How the others drive, and what all expect of each other.
TRAFFIC, PREDICTOR = "velocity_adjusting", "lane_following"

#: Gates that rules of the road lower; a little speeding is left out.
_RULES = ("direction", "red_light", "crosswalk", "stop_sign", "right_of_way")

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


@dataclass(frozen=True)
class Trial:
    """All drivers in the place of an agent.

    Attributes:
        drives: One per driver.
        driven_anew: Why a stored panel had nothing there; "" if it had, or there is none.
    """

    drives: tuple[Drive, ...]
    driven_anew: str = ""


def trial(place: Place, stored: PanelFolder | None = None) -> Trial | str:
    """All drivers in the place of an agent; in one line why there are none if the agent cannot be driven."""
    try:
        return _trial(place, stored)
    except Exception as error:  # noqa: BLE001 - one place that fails is told, the others are driven
        return f"{place.file}, agent {place.agent_id}: {failure(error)}"


def _trial(place: Place, stored: PanelFolder | None) -> Trial:
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
    panel = panel_drives(world, PANEL, settings, measures_hindrance=True, stored=stored)
    rows = []

    def driven(planner: PlannerSpec, rules: RulesSettings | None = None) -> tuple[facts.Drive, Hindrance]:
        run = world.driven_by(planner, rules)
        drive = facts.drives_of(run, [place.agent_id], settings)[place.agent_id]
        return drive, Hindrance() if panel.without is None else hindrance_of(drive, run, panel.without)

    def add(name: str, drive: facts.Drive, taken: Hindrance, *, acts: bool = True) -> None:
        _, total, reasons = judged(drive, taken, panel, settings)
        rows.append(
            Drive(name, place.file, place.road, place.agent_id, total.score, drive.in_time, acts, "; ".join(reasons))
        )

    honest = {name: (drive, panel.hindrances.get(name, Hindrance())) for name, drive in panel.drives.items()}
    honest[HONEST] = driven(Driver)
    for name, (drive, taken) in honest.items():
        add(name, drive, taken)
    for adversary in ADVERSARIES:
        drive, taken = driven(adversary.planner, adversary.rules)
        differs = _differs if adversary.rules is None else _breaks_more
        add(adversary.name, drive, taken, acts=differs(drive, honest[adversary.base][0]))
    return Trial(tuple(rows), why_driven_anew(panel.notes))


def _others(scenario: Scenario, agent_id: int) -> list[int]:
    """All other vehicles that can be agents and have a recording."""
    found = Simulation(scenario, agents="all", threads=1).agents
    recorded = set(scenario.obstacles.ids.tolist())
    return [agent.id for agent in found if agent.id != agent_id and agent.id in recorded]


def _differs(drive: facts.Drive, base: facts.Drive) -> bool:
    """The agent is elsewhere at some step, or ends at another one."""
    if drive.x.shape != base.x.shape:
        return True
    return bool(np.hypot(drive.x - base.x, drive.y - base.y).max(initial=0.0) > _DIFFERENT)


def _breaks_more(drive: facts.Drive, base: facts.Drive) -> bool:
    """A rule of the road lowers a gate further."""
    return any(drive.gates.get(name, 1.0) < base.gates.get(name, 1.0) for name in _RULES)
