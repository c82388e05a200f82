"""The agents that a search tests: vehicles of scenario files that have another one near."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.failure_search.disturbances import Pair
from interdrive.files import read_scenario, scenario_file
from interdrive.files.roads import road_elements
from interdrive.scenario.inspection import candidates

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.scenario import Scenario

#: Others count that come so near to the agent in the recording [m].
NEAR = 30.0
_SAME_IDS = "vehicles have the ids of parts of the road, so a file of a failure would name them otherwise"
#: A process keeps so many scenarios.
_AT_HAND = 256


@lru_cache(maxsize=_AT_HAND)
def scenario_at(path: str) -> Scenario:
    """The scenario of a file."""
    return read_scenario(path)


def paths_of(given: str | Path | Sequence[str | Path]) -> list[Path]:
    """The files that are meant by files, folders and names of shipped scenarios.

    Raises:
        InputError: There is no such file, or a folder holds none.
    """
    found: list[Path] = []
    for item in [given] if isinstance(given, str | Path) else given:
        path = Path(item)
        if path.is_dir():
            inside = sorted(path.rglob("*.xml"))
            if not inside:
                raise InputError(f"{item}: there are no CommonRoad files")
            found += inside
        else:
            found.append(scenario_file(item))
    if not found:
        raise InputError("a search needs a CommonRoad file, a folder of them, or the name of a shipped scenario")
    return [path.absolute() for path in found]


def _once(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """The paths without those of a file that came before, and a word about each of these."""
    seen: dict[Path, Path] = {}
    again = [
        f"{path.stem}: is given twice, and counts once"
        for path in paths
        if seen.setdefault(path.resolve(), path) is not path
    ]
    return list(seen.values()), again


def pairs_of(
    paths: Sequence[Path], n_others: int, agent_id: int | None
) -> tuple[list[Pair], list[list[str]], list[str]]:
    """The pairs of some files, name and content hash of the files, and the files that are left out with the reason.

    Raises:
        InputError: There is no pair.
    """
    found, files = [], []
    paths, left_out = _once(paths)
    by_content: dict[str, str] = {}
    for path in paths:
        try:
            scenario = scenario_at(str(path))
        except InputError as error:
            left_out.append(str(error))
            continue
        if scenario.sha256 in by_content:
            left_out.append(f"{scenario.name}: is the same as {by_content[scenario.sha256]}, and counts once")
            continue
        by_content[scenario.sha256] = scenario.name
        _, _, roads = road_elements(scenario)
        if not set(roads).isdisjoint(scenario.obstacles.ids.tolist()):
            left_out.append(f"{scenario.name}: {_SAME_IDS}")
            continue
        files.append([scenario.name, scenario.sha256])
        own = pairs(scenario, str(path), n_others)
        chosen = [pair for pair in own if agent_id is None or pair.agent_id == agent_id]
        if not chosen and (agent_id is None or len(paths) == 1):
            left_out.append(f"{scenario.name}: {_no_pair(scenario, agent_id)}")
        found += chosen
    if not found:
        why = left_out or [f"agent {agent_id}: no vehicle of these files that can be an agent with another one near"]
        raise InputError(f"nothing to search: {'; '.join(why[:3])}{'; ...' if len(why) > 3 else ''}")
    return found, files, left_out


def pairs(scenario: Scenario, path: str, n_others: int) -> list[Pair]:
    """All agents of a scenario that have a vehicle near in the recording."""
    obstacles = scenario.obstacles
    able = candidates(scenario)
    rows = np.flatnonzero(able.accepted).tolist()
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
            found.append(Pair(path, scenario.name, int(obstacles.ids[row]), others))
    return found


def _no_pair(scenario: Scenario, agent_id: int | None) -> str:
    able = candidates(scenario)
    n = int(able.accepted.sum())
    if agent_id is not None and agent_id not in able.ids[able.accepted].tolist():
        return f"agent {agent_id}: no vehicle that can be an agent has this id"
    if n < 2:
        return f"{n or 'no'} {'vehicle' if n else 'vehicles'} that can be an agent, and a search needs another one near"
    return f"no vehicle that can be an agent has another one within {NEAR:.0f} m"
