"""Which rules of the road agents, replayed vehicles and recorded drivers broke."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run.arrays import Violations
from interdrive.run.rules import VIOLATIONS
from interdrive.run.violations.crosswalks import People, crosswalks, people, recorded_people
from interdrive.run.violations.drives import Drives, Row, driven, recorded
from interdrive.run.violations.junction_rules import Told, keep_clear, right_of_way, uses
from interdrive.run.violations.lanes import lane_rules
from interdrive.run.violations.lines import line_rules, passings
from interdrive.run.violations.markings import has_closed_markings, solid_lines
from interdrive.run.violations.passing import Standing, recorded_standing, standing
from interdrive.run.violations.ways import Ways

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence, Set

    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.run.record import RunRecord

#: Columns of numbers.
_KINDS: Mapping[str, type] = {
    **dict.fromkeys(("participant_id", "first_time_step", "last_time_step", "lanelet_id", "partner_id"), np.int64),
    **dict.fromkeys(("x", "y", "value"), np.float64),
}

__all__ = ["joined", "recorded_violations", "violations"]


def violations(
    run: RunRecord,
    road: _core.RoadNetwork,
    areas: Mapping[str, Any],
    obeying: Collection[int],
    entries: Mapping[str, Any],
    judged: Collection[int] | None = None,
) -> Violations:
    """All violations of a run, sorted by source, participant, rule and time.

    Cars, trucks, buses, motorcycles and taxis are judged, whichever planner drives them; of agents that replace a
    recorded vehicle the recording, too. Speed limits and directions are those of the lanelets below the centre.

    Args:
        run: The run; its violations are not read.
        road: Its road network.
        areas: What ways share, as `_core.Scenario.junctions` tells.
        obeying: Ids of the agents that enter junctions when they are told to.
        entries: When they did, as `_core.World.entries` tells.
        judged: Only these participants are judged, and no recordings; None: all are.
    """
    ended = run.outcomes
    pairs = [(int(i), int(j)) for i, j in zip(ended.agent_id, ended.partner_id, strict=True) if j >= 0]
    collisions = {*pairs, *((j, i) for i, j in pairs)}
    entered = zip(*(entries[name].tolist() for name in ("agent_id", "area", "granted")), strict=True)
    told = Told({*obeying}, {(agent, area) for agent, area, granted in entered if not granted})
    rows = _broken(driven(run, judged), standing(run, road), people(run), run, road, areas, collisions, told)
    if judged is None:
        rows += _of_recordings(run, road, areas)
    return _sorted(rows)


def recorded_violations(run: RunRecord, road: _core.RoadNetwork, areas: Mapping[str, Any]) -> Violations:
    """Violations of the recordings of agents alone; of the states of the run only what never changes is read."""
    return _sorted(_of_recordings(run, road, areas))


def joined(parts: Sequence[Violations]) -> Violations:
    """Violations of several parts of a run, each of other participants or times, sorted as those of the whole."""
    names = [name for name in Row._fields if name in Violations.stored]
    columns = [[getattr(part, name) for name in names] for part in parts]
    rows = [Row(*values) for part in columns for values in zip(*(_plain(column) for column in part), strict=True)]
    return _sorted(rows)


def _plain(column: NDArray[Any] | tuple[str, ...]) -> Sequence[Any]:
    return column if isinstance(column, tuple) else column.tolist()


def _of_recordings(run: RunRecord, road: _core.RoadNetwork, areas: Mapping[str, Any]) -> list[Row]:
    still, walking = recorded_standing(run, road), recorded_people(run)
    return _broken(recorded(run), still, walking, run, road, areas, set(), Told(set(), set()))


def _sorted(rows: list[Row]) -> Violations:
    rows.sort(key=lambda row: (Violations.SOURCES.index(row.source), row.participant_id, VIOLATIONS.index(row.rule)))
    return Violations(
        source=tuple(row.source for row in rows),
        rule=tuple(row.rule for row in rows),
        **{name: np.array([getattr(row, name) for row in rows], dtype=kind) for name, kind in _KINDS.items()},
    )


def _broken(
    drives: Drives,
    still: Standing,
    walking: People,
    run: RunRecord,
    road: _core.RoadNetwork,
    areas: Mapping[str, Any],
    collisions: Set[tuple[int, int]],
    told: Told,
) -> list[Row]:
    """Rules that these broke, in the order of the rules for every vehicle."""
    if not drives.judged:
        return []
    lanelets = run.scenario.lanelets
    passed = passings(drives, run.scenario, road)
    rows = lane_rules(drives, road, still) + line_rules(drives, passed, road)
    rows += crosswalks(drives, walking, run.scenario, road)
    has_lines = has_closed_markings(lanelets)
    if not len(areas["junction"]) and not has_lines:
        return rows
    collided = {number for pair in collisions for number in pair}
    routes = {agent.id: agent.route_lanelet_ids for agent in run.agents}
    ways = Ways(drives, lanelets, road, routes, collided)
    used = uses(drives, ways, areas)
    rows += right_of_way(drives, ways, areas, used, passed, collisions, road)
    rows += keep_clear(drives, areas, used, told, road)
    if has_lines:
        rows += solid_lines(drives, ways, lanelets, road)
    return rows
