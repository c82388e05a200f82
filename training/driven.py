"""Traffic as it occurs in our own simulation: agents that interdrive's planners drive, as if they had been recorded.

An agent that is driven by a planner moves unlike people and unlike other simulators' drivers, and it is what the
predictor meets most in a run.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from interdrive import __version__
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError
from interdrive.files import read_scenario, shipped_scenario
from interdrive.scenario import Obstacles, Shape
from interdrive.simulation import simulate
from training.split import FOLDS, place_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.scenario import Scenario
    from training.split import Place

#: Planners that drive, in turns; two files of three have the default one.
_PLANNERS = ("frenet", "idm_mobil", "frenet")
#: What they expect of each other; not the predictor that is trained, so that rows do not depend on earlier weights.
_PREDICTOR = "lane_following"
#: So many files of a place are driven at most.
_FILES_PER_PLACE = 8
#: Shipped scenarios by whose agents a planner is known.
_WITNESSES = ("lane_merge", "t_junction")


def files_to_drive(files: Sequence[Path], places: tuple[Place, ...]) -> dict[str, str]:
    """Which files are driven, all of places for training, and the planner of each: name of the file to planner."""
    of_place: dict[str, list[str]] = {}
    for path in files:
        place = place_of(path.stem, places)
        if place.part in FOLDS:
            of_place.setdefault(place.name, []).append(path.stem)
    chosen: dict[str, str] = {}
    for name in sorted(of_place):
        there = sorted(of_place[name])
        take = np.unique(np.linspace(0, len(there) - 1, min(_FILES_PER_PLACE, len(there))).astype(int))
        for k in take:
            chosen[there[k]] = _PLANNERS[len(chosen) % len(_PLANNERS)]
    return chosen


@cache
def behaviour_of(planner: str) -> str:
    """Twelve digits that change with what a planner does: rows driven by another version of it are other rows.

    They stand for the version of interdrive, all default settings of a run, and every position of all agents that the
    planner drives in two shipped scenarios.
    """
    found = hashlib.sha256(f"{__version__} {_PREDICTOR} {SimulationSettings()}".encode())
    for name in _WITNESSES:
        driven = driven_traffic(read_scenario(shipped_scenario(name)), planner)
        assert driven is not None, "shipped scenarios have agents"
        for values in (driven[0].obstacles.x, driven[0].obstacles.y, driven[1]):
            found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()[:12]


def driven_traffic(scenario: Scenario, planner: str) -> tuple[Scenario, NDArray[np.int64]] | None:
    """The scenario as it went when all its vehicles that can be agents were driven by a planner.

    Returns:
        The scenario with the simulated motion in place of the recording, and the ids of the agents, ascending; None
        where no vehicle can become an agent.
    """
    try:
        run = simulate(scenario, planner=planner, predictor=_PREDICTOR, threads=1)
    except InputError:
        return None
    states = run.states
    sizes = zip(states.length.tolist(), states.width.tolist(), strict=True)
    obstacles = Obstacles(
        ids=states.participant_id,
        kinds=states.kinds,
        shapes=tuple(Shape("rectangle", length=length, width=width) for length, width in sizes),
        is_static=states.is_static,
        x=states.x,
        y=states.y,
        orientation=states.orientation,
        velocity=states.velocity,
        acceleration=states.acceleration,
        yaw_rate=states.yaw_rate,
        valid=states.valid,
    )
    return replace(scenario, obstacles=obstacles), states.participant_id[states.is_agent]
