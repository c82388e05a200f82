"""What an agent did when: driving, slowing, standing, reversing, braking; and which participants it waited for."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from interdrive import _core
from interdrive.run.arrays import PLAN_STATUS
from interdrive.scenario.control import GOING_SIGNALS, shown_together

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints
    from interdrive.run.record import AgentRecord, RunRecord
    from interdrive.scenario import StopLine

PhaseKind: TypeAlias = Literal["driving", "slowing", "standing", "reversing", "emergency braking"]

#: An agent that decelerates by more than this slows [m/s²].
_SLOWING = 1.0

#: Shorter phases belong to their neighbour [s].
_SHORTEST = 0.5

#: A vehicle ahead is named if it is at most this far away: [m] while standing, [m] and [s] while driving.
_AHEAD_STANDING, _AHEAD_DRIVING, _AHEAD_S = 10.0, 20.0, 3.0

#: A vehicle ahead of an agent that drives is named only if it can hold the agent up: if it is no faster, or the speed
#: from which the agent follows it comfortably is at most this above its own [m/s]. That speed is that of Gipps for this
#: time gap [s], deceleration [m/s²] and gap at rest [m].
_HELD, _TIME_GAP, _COMFORTABLE, _REST = 2.0, 1.0, 2.0, 2.0

#: Participants cross the path of a waiting agent within this distance [m], faster than this [m/s].
_CROSSING_AHEAD, _CROSSING_SPEED = 20.0, 1.0

#: An agent stands at a stop line if its front is at most this far before it, or beyond it [m].
_BEFORE_LINE, _BEYOND_LINE = 3.0, 0.5

#: An agent stands before the end of a lane if its front is at most this far before it [m].
_BEFORE_END = 15.0

#: Distance between the points of a path [m].
_PATH_SPACING = 1.0

#: Moments of a phase at which the vehicle ahead is looked for.
_MOMENTS = 9


@dataclass(frozen=True)
class Phase:
    """A stretch of time in which an agent did one thing.

    Attributes:
        kind: What it did.
        first_time_step: Its first time step. last_time_step: Its last one, included.
        leader_id: The vehicle ahead in most of this time that held it up, -1 for none; what is beyond a line at which
            it waits, or far or fast enough not to hold it up, is not meant. While it reverses, neither this nor what
            follows is told.
        crossing_ids: While it stood without a vehicle ahead or a line to wait at: participants that crossed its path,
            in their order.
        red_lanelet_id: The lanelet of the stop line that it stood at or came to, nearer than any vehicle, if its light
            was red or yellow most of the time; -1 otherwise.
        sign_lanelet_id: The same for a line with a stop sign.
        left_lanelet_id: While it stood without a vehicle ahead, a line or an order: the lanelet whose end is ahead of
            it and which its route leaves for the lane beside; -1 otherwise.
        order: Why (one of `ORDERS`) it was told most of the time to wait, before a junction while it slowed or stood or
            before a crosswalk, and because of which participant (-1 for none); None if it was not, or only by the
            vehicle ahead.
    """

    kind: PhaseKind
    first_time_step: int
    last_time_step: int
    leader_id: int = -1
    crossing_ids: tuple[int, ...] = ()
    red_lanelet_id: int = -1
    sign_lanelet_id: int = -1
    left_lanelet_id: int = -1
    order: tuple[str, int] | None = None

    @property
    def n_steps(self) -> int:
        """Number of time steps."""
        return self.last_time_step - self.first_time_step + 1


def phases(run: RunRecord, agent: AgentRecord) -> tuple[Phase, ...]:
    """Phases of an agent in their order, one after the other, from its first to its last state.

    The last state counts only if it is the only one: nothing was driven from there. Empty if it never started.
    """
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent.id))
    columns = np.flatnonzero(states.valid[row])
    columns = columns[:-1] if len(columns) > 1 else columns
    if not len(columns):
        return ()
    kinds = _kinds(run, row, columns)
    shortest = max(1, round(_SHORTEST / run.scenario.dt))
    path = _thinned(agent.reference_path)
    found, at = [], 0
    for kind, length in _merged(kinds, shortest):
        inside = columns[at : at + length]
        at += length
        first, last = (int(column) + states.first_time_step for column in (inside[0], inside[-1]))
        if kind == "reversing":
            found.append(Phase(kind, first, last))
            continue
        leader = _leader_in(run, path, row, inside, standing=kind == "standing")
        order = _order(run, agent.id, first, last) if kind != "emergency braking" else None
        if kind == "driving" and order is not None and order[0] != "crosswalk":
            order = None  # It drives towards a junction, which takes no time yet.
        stands = kind == "standing"
        red, sign = _line_ahead(run, agent, row, inside, leader, standing=stands)
        if red >= 0 or sign >= 0:
            leader = -1
        is_alone = stands and order is None and leader == red == sign == -1
        left = _left_lanelet(run, agent, row, int(inside[-1])) if is_alone else -1
        crossing = _crossing(run, path, row, inside) if is_alone and left < 0 else ()
        found.append(Phase(kind, first, last, leader, crossing, red, sign, left, order))
    return tuple(found)


def emergency_steps(run: RunRecord, agent_id: int) -> Ints:
    """Time steps at which an agent braked as hard as it could for want of a safer plan, ascending."""
    plans = run.plans
    braking = (plans.agent_id == agent_id) & (plans.status == PLAN_STATUS.index("emergency_braking"))
    found: Ints = np.sort(plans.time_step[braking])
    return found


def _kinds(run: RunRecord, row: int, columns: Ints) -> list[PhaseKind]:
    states = run.states
    velocity, acceleration = states.velocity[row, columns], states.acceleration[row, columns]
    emergency = np.isin(columns + states.first_time_step, emergency_steps(run, int(states.participant_id[row])))
    kinds: list[PhaseKind] = []
    for v, a, braking in zip(velocity.tolist(), acceleration.tolist(), emergency.tolist(), strict=True):
        if abs(v) < _core.JUDGED_STANDSTILL_SPEED:
            kinds.append("standing")
        elif braking:
            kinds.append("emergency braking")
        elif v < 0.0:
            kinds.append("reversing")
        else:
            kinds.append("slowing" if a < -_SLOWING else "driving")
    return kinds


def _merged(kinds: list[PhaseKind], shortest: int) -> list[tuple[PhaseKind, int]]:
    """Phases and their lengths; short ones, but for emergencies, are part of what came before or comes next."""
    runs = [(kind, len(list(steps))) for kind, steps in groupby(kinds)]
    made: list[tuple[PhaseKind, int]] = []
    waiting = 0
    for kind, length in runs:
        is_short = length < shortest and kind != "emergency braking"
        if made and (is_short or made[-1][0] == kind):
            made[-1] = made[-1][0], made[-1][1] + length
        elif is_short:
            waiting += length
        else:
            made.append((kind, length + waiting))
            waiting = 0
    return made if not waiting else [(kinds[-1], waiting)]


def _leader_in(run: RunRecord, path: Floats, row: int, columns: Ints, *, standing: bool) -> int:
    """The vehicle ahead at more than half of some moments; -1 for none."""
    moments = columns[np.unique(np.linspace(0, len(columns) - 1, _MOMENTS).round().astype(np.int64))]
    speed = np.abs(run.states.velocity[row, moments])
    reach = np.full(len(moments), _AHEAD_STANDING) if standing else np.maximum(_AHEAD_DRIVING, _AHEAD_S * speed)
    found = (_leader(run, path, row, int(column), float(far)) for column, far in zip(moments, reach, strict=True))
    ahead = [
        number if standing or safe <= own + _HELD else -1 for (number, safe), own in zip(found, speed, strict=True)
    ]
    ids, counts = np.unique(ahead, return_counts=True)
    most = int(counts.argmax())
    return int(ids[most]) if 2 * counts[most] > len(ahead) else -1


def _leader(run: RunRecord, path: Floats, row: int, column: int, reach: float) -> tuple[int, float]:
    """The nearest participant that reaches into what a footprint would cover along the path, and how fast to follow it.

    -1 for none. `reach` is the largest distance between the two footprints along the path [m]; the speed [m/s] is that
    from which it can be followed comfortably.
    """
    states = run.states
    rows = _near(run, row, column, reach)
    if not len(rows) or len(path) < 2:
        return -1, np.inf
    near, beside, own_front, half = _extents(run, path, row, rows, column)
    gap = np.where(beside < half, near - own_front, np.inf)
    gap[gap < -0.5 * states.length[row]] = np.inf  # beside or behind
    best = int(gap.argmin())
    if gap[best] > reach:
        return -1, np.inf
    room, speed = max(float(gap[best]) - _REST, 0.0), max(float(states.velocity[rows[best], column]), 0.0)
    early = _COMFORTABLE * _TIME_GAP
    safe = float(np.sqrt(early**2 + speed**2 + 2.0 * _COMFORTABLE * room)) - early
    return int(states.participant_id[rows[best]]), safe if speed > states.velocity[row, column] else speed


def _crossing(run: RunRecord, path: Floats, row: int, columns: Ints) -> tuple[int, ...]:
    """Moving participants that passed through the next metres of the path, in their order."""
    states = run.states
    if len(path) < 2:
        return ()
    found: list[int] = []
    for column in columns[:: max(1, round(_SHORTEST / run.scenario.dt))].tolist():
        rows = _near(run, row, column, _CROSSING_AHEAD)
        rows = rows[np.abs(states.velocity[rows, column]) > _CROSSING_SPEED]
        if not len(rows):
            continue
        near, beside, own_front, half = _extents(run, path, row, rows, column)
        passing = (beside < half) & (near - own_front <= _CROSSING_AHEAD) & (near > own_front - 0.5)
        found += [number for number in states.participant_id[rows[passing]].tolist() if number not in found]
    return tuple(found)


def _line_ahead(
    run: RunRecord, agent: AgentRecord, row: int, columns: Ints, leader: int, *, standing: bool
) -> tuple[int, int]:
    """Lanelets of the nearest stop line of the route before which an agent waits: for red, for a stop sign.

    Each is -1 if it does not wait for that. What is ahead of it already at the line is not beyond it. An agent that
    stands is near the line; others come to it soon if they do not stop.
    """
    states, path = run.states, agent.reference_path
    other = np.searchsorted(states.participant_id, [leader])
    there = columns if leader < 0 else columns[states.valid[other[0], columns]]
    last = int(there[-1])
    lines = [line for line in run.scenario.stop_lines if line.lanelet_id in agent.route_lanelet_ids]
    if not lines or len(path) < 2:
        return -1, -1
    points = np.array([*(line.ends.mean(axis=0) for line in lines), (states.x[row, last], states.y[row, last])])
    s, beside, _ = path_coordinates(path, points)
    ahead = s[:-1] - s[-1] - 0.5 * float(states.length[row])
    across = np.array([0.5 * float(np.hypot(*np.diff(line.ends, axis=0)[0])) for line in lines])
    fastest = float(np.abs(states.velocity[row, columns]).max())
    reach = _BEFORE_LINE if standing else max(_AHEAD_DRIVING, _AHEAD_S * fastest)
    if leader >= 0:
        near, _, own_front, _ = _extents(run, path, row, other, last)
        reach = min(reach, float(near[0]) - own_front)
    near_enough = (ahead >= -_BEYOND_LINE) & (ahead <= reach) & (beside[:-1] <= across)
    for place in np.argsort(ahead, kind="stable").tolist():
        if near_enough[place]:
            line = lines[place]
            if _is_red(run, agent, line, columns):
                return line.lanelet_id, -1
            if line.has_stop_sign:
                return -1, line.lanelet_id
    return -1, -1


def _is_red(run: RunRecord, agent: AgentRecord, line: StopLine, columns: Ints) -> bool:
    """Whether the lights of a stop line, for the way that an agent takes, were red or yellow in most of the columns."""
    lights = {light.id: light for light in run.scenario.traffic_lights}
    taken = [ids for following, ids in line.light_ids if following in agent.route_lanelet_ids]
    ways = taken or [ids for _, ids in line.light_ids]  # a route may end at the line
    steps = run.states.first_time_step + columns
    shown = shown_together([lights[i] for ids in ways for i in ids], int(steps[-1]) + 1)
    holding = ~np.isin(shown[steps], GOING_SIGNALS)
    return bool(2 * np.count_nonzero(holding) > len(columns))


def _left_lanelet(run: RunRecord, agent: AgentRecord, row: int, column: int) -> int:
    """The lanelet before whose end an agent stands and from which its route changes to the lane beside; -1 for none."""
    states, lanelets = run.states, run.scenario.lanelets
    front = np.array([states.x[row, column], states.y[row, column]])
    front += (
        0.5
        * states.length[row]
        * np.array([np.cos(states.orientation[row, column]), np.sin(states.orientation[row, column])])
    )
    route = agent.route_lanelet_ids
    for this, following in pairwise(route):
        place = int(np.searchsorted(lanelets.ids, this))
        beside = following in (lanelets.adjacent_left[place], lanelets.adjacent_right[place])
        ends = lanelets.left[place][-1], lanelets.right[place][-1]
        width, middle = float(np.hypot(*(ends[1] - ends[0]))), 0.5 * (ends[0] + ends[1])
        across = (ends[1] - ends[0]) / max(width, 1e-9)
        aside, along = float((front - middle) @ across), float((middle - front) @ np.array([-across[1], across[0]]))
        if beside and 0.0 <= along <= _BEFORE_END and abs(aside) <= 0.5 * width:
            return int(this)
    return -1


def _order(run: RunRecord, agent_id: int, first: int, last: int) -> tuple[str, int] | None:
    """Why and for which participant an agent was told to wait in most of some time steps; None if it was not."""
    orders = run.orders
    if orders is None:
        return None
    begin, end = np.maximum(orders.first_time_step, first), np.minimum(orders.last_time_step, last)
    long: dict[tuple[str, int], int] = {}
    for place in np.flatnonzero((orders.agent_id == agent_id) & (end >= begin)).tolist():
        if orders.kind[place] != "queue":
            told = orders.kind[place], int(orders.by_id[place])
            long[told] = long.get(told, 0) + int(end[place] - begin[place]) + 1
    if not long or 2 * sum(long.values()) <= last - first + 1:
        return None
    return max(long, key=lambda told: (long[told], -told[1]))


def _near(run: RunRecord, row: int, column: int, reach: float) -> Ints:
    """Rows of the other participants that could be within reach."""
    states = run.states
    far = np.hypot(states.x[:, column] - states.x[row, column], states.y[:, column] - states.y[row, column])
    size = 0.5 * (np.hypot(states.length, states.width) + np.hypot(states.length[row], states.width[row]))
    there = states.valid[:, column] & (far <= reach + size)
    there[row] = False
    found: Ints = np.flatnonzero(there)
    return found


def _extents(run: RunRecord, path: Floats, row: int, rows: Ints, column: int) -> tuple[Floats, Floats, float, Floats]:
    """Where participants are beside the path: nearest arc length, distance of centres, own front, and half widths."""
    states = run.states
    every = np.append(rows, row)
    points = np.stack([states.x[every, column], states.y[every, column]], axis=1)
    s, beside, heading = path_coordinates(path, points)
    own_front = float(s[-1]) + 0.5 * float(states.length[row])
    s, beside, turned = s[:-1], beside[:-1], states.orientation[rows, column] - heading[:-1]
    along, across = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    length, width = 0.5 * states.length[rows], 0.5 * states.width[rows]
    half = along * width + across * length + 0.5 * states.width[row]
    return s - (along * length + across * width), beside, own_front, half


def _thinned(path: Floats) -> Floats:
    """Points of a path about a metre apart."""
    spacing = float(np.hypot(*np.diff(path[:2], axis=0).T).sum()) if len(path) > 1 else 0.0
    return path[:: max(1, round(_PATH_SPACING / spacing))] if spacing > 0.0 else path


def path_coordinates(path: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Arc length of the nearest point of a path [m], distance from it [m] and heading there [rad], shape (points,)."""
    start, side = path[:-1], np.diff(path, axis=0)
    size = np.maximum(np.hypot(*side.T), 1e-9)
    s0 = np.concatenate([[0.0], np.cumsum(size)[:-1]])
    offset = points[:, None] - start
    part = np.clip((offset * side).sum(axis=2) / size**2, 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(offset - part[..., None] * side, 2, 0))
    nearest = distance.argmin(axis=1)
    each = np.arange(len(points))
    heading = np.arctan2(side[nearest, 1], side[nearest, 0])
    return s0[nearest] + part[each, nearest] * size[nearest], distance[each, nearest], heading
