"""Why every agent ended as it did, in words and numbers, from what was recorded."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.run.arrays import PLAN_STATUS
from interdrive.run.contact import contact_between
from interdrive.run.goals import approach, inside, said_seconds, said_time
from interdrive.run.phases import emergency_steps, phases

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints
    from interdrive.run.arrays import Outcomes
    from interdrive.run.contact import Contact
    from interdrive.run.phases import Phase
    from interdrive.run.record import AgentRecord, RunRecord
    from interdrive.scenario import Lanelets

#: So begins what the core says of agents that end because nothing moves any more.
STANDSTILL = "nothing moved any more"
#: So begins what it says of agents that did not enter.
NO_ROOM = "found no room to enter"

#: Shorter stops and shorter times without an admissible sample are no reason for being late [s].
_LONG = 1.0

#: An agent drives in a lanelet if its heading is within this of that of the lane [rad].
_ALONG = 0.25 * np.pi

#: Smaller overhangs are not worth a number [m].
_SMALLEST = 0.05

#: Limits of the vehicle by which samples are rejected.
_LIMITS = ("acceleration", "curvature", "steering rate", "yaw rate", "lateral acceleration")

#: What else rejects samples and says too little as a name.
_REJECTIONS = {
    "negative speed": "driving backwards",
    "left the reference path": "leaving the reference path",
    "stop line": "passing a stop line",
}

#: Participants of these kinds are named with their kind.
_NAMED = ("pedestrian", "bicycle", "motorcycle", "train")


def reasons(run: RunRecord, road: _core.RoadNetwork) -> tuple[str, ...]:
    """One sentence per agent, in the order of `run.outcomes`; "" for agents that reached their goal.

    Args:
        run: The run; its outcomes need no reasons.
        road: Its road network, for how far agents left it.
    """
    agents = {agent.id: agent for agent in run.agents}
    numbers = run.outcomes.agent_id.tolist()
    return tuple(_reason(run, agents[number], place, road) for place, number in enumerate(numbers))


def ended_early(outcomes: Outcomes, time_step: int, dt: float) -> list[str]:
    """One line if a run ended before the time of its agents: after its largest number of steps, or standing.

    Args:
        outcomes: As the core states them.
        time_step: At which the run ended.
        dt: Time between steps [s].
    """
    rows = zip(outcomes.agent_id.tolist(), outcomes.outcome, outcomes.message, strict=True)
    # The core gives a reason for this outcome only if it ends the whole run.
    ended = {
        i: message
        for i, outcome, message in rows
        if outcome == "time_limit" and message and not message.startswith(NO_ROOM)
    }
    if not ended:
        return []
    numbers = [str(i) for i in ended]
    shown = ", ".join(numbers[:5]) + (f" and {len(numbers) - 5} more" if len(numbers) > 5 else "")
    if any(message.startswith(STANDSTILL) for message in ended.values()):
        when = said_seconds(time_step, dt)
        return [f"the run ended at {when} s because nothing moved any more (step.standstill_s); standing: {shown}"]
    still = "while these agents were still driving"
    return [f"the run ended after {time_step} time steps (step.max_steps) {still}: {shown}"]


def _reason(run: RunRecord, agent: AgentRecord, place: int, road: _core.RoadNetwork) -> str:
    ended, message = run.outcomes, run.outcomes.message[place]
    match ended.outcome[place]:
        case "goal_reached":
            text = ""
        case "collision":
            text = _departure(run, agent, road) if ended.off_road[place] else _collision(run, place)
        case "running":
            text = _stopped(run, agent)
        case "planner_error":
            text = message.strip() or "the planner gave no reason"
        case "infeasible":
            steps = len(emergency_steps(run, agent.id))
            before = f" after emergency braking at {said_count(steps, 'time step')}" if steps else ""
            why = said_obstruction(run, agent.id, ended.time_step[place : place + 1])
            because = message.strip() or "the planner gave no reason"
            text = _joined(f"no plan{before}: {because}", why and f"most samples were rejected: {why}")
        case "goal_reached_late":
            text = _joined(_lateness(run, agent), *_causes(run, agent))
        case "time_limit" if message.startswith(NO_ROOM):
            text = message
        case "goal_missed":
            near = approach(run, agent)
            text = _joined(
                near.words or "drove past its goal", "" if near.inside else _missing_change(run, agent, road)
            )
        case _:
            text = _time_over(run, agent, message)
    return text


def _time_over(run: RunRecord, agent: AgentRecord, message: str) -> str:
    """What cost an agent its time, and how near its goal it was; `message` says what ended it before its time."""
    near, over = approach(run, agent), message or "the time was over"
    if near.at_end:
        return _joined(*_causes(run, agent), f"{near.words} when {over}")
    return _joined(*_causes(run, agent), near.words, over if message or not near.words else "")


def _missing_change(run: RunRecord, agent: AgentRecord, road: _core.RoadNetwork) -> str:
    """The first lane change of its route that an agent did not make; "" if it made all of them."""
    lanelets, route = run.scenario.lanelets, agent.route_lanelet_ids
    row = int(np.searchsorted(run.states.participant_id, agent.id))
    columns = np.flatnonzero(run.states.valid[row])
    poses = np.stack([run.states.x[row], run.states.y[row], run.states.orientation[row]], axis=1)[columns]
    driven = {lanelet for x, y, theta in poses.tolist() for lanelet, *_ in road.matching(x, y, theta, 0.0, _ALONG)}
    changes = [
        place
        for place, (here, following) in enumerate(pairwise(route))
        if following in _beside(lanelets, int(np.searchsorted(lanelets.ids, here)))
    ]
    for place, end in pairwise([*changes, len(route) - 1]):
        if not driven.intersection(route[place + 1 : end + 1]):
            return f"it did not get from lanelet {route[place]} to lanelet {route[place + 1]} beside it"
    return ""


def _beside(lanelets: Lanelets, place: int) -> tuple[int, int]:
    return int(lanelets.adjacent_left[place]), int(lanelets.adjacent_right[place])


def _joined(*parts: str) -> str:
    return "; ".join(part for part in parts if part.strip())


def said_count(n: int, what: str) -> str:
    """A number of things, such as "1 time step" or "2 time steps"."""
    return f"{n} {what}{'s' * (n != 1)}"


def said_list(ids: tuple[int, ...]) -> str:
    """Ids in words, at most three of them: "12, 14 and 3 others"."""
    shown = [str(number) for number in (ids if len(ids) <= 3 else ids[:2])]
    if len(ids) > 3:
        shown.append(f"{len(ids) - 2} others")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def _stopped(run: RunRecord, agent: AgentRecord) -> str:
    row = int(np.searchsorted(run.states.participant_id, agent.id))
    columns = np.flatnonzero(run.states.valid[row])
    if not len(columns):
        return "had not started when the run was stopped"
    return (
        f"still driving when the run was stopped at {said_time(run, int(columns[-1]) + run.states.first_time_step)} s"
    )


def _lateness(run: RunRecord, agent: AgentRecord) -> str:
    """When it reached its goal, and how long after its time."""
    place = int(np.searchsorted(run.outcomes.agent_id, agent.id))
    reached, last = int(run.outcomes.time_step[place]), agent.goal_time_step[1]
    columns = [inside(run, agent, alternative) for alternative in agent.goal]
    in_time = any((c + run.states.first_time_step <= last).any() for c in columns)
    return (
        f"reached {'all conditions of its goal' if in_time else 'the goal area'} at {said_time(run, reached)} s, "
        f"{said_time(run, reached - last)} s after its last admissible time {said_time(run, last)} s"
    )


def _causes(run: RunRecord, agent: AgentRecord) -> tuple[str, ...]:
    """What cost an agent its time: the vehicle ahead or its longest stop; times without an admissible sample."""
    dt, done = run.scenario.dt, phases(run, agent)
    stop = max((phase for phase in done if phase.kind == "standing"), key=lambda phase: phase.n_steps, default=None)
    stood = stop.n_steps if stop is not None and stop.n_steps * dt >= _LONG else 0
    behind: dict[int, tuple[int, int]] = {}
    for phase in done:
        if phase.leader_id >= 0 and phase.order is None:
            total, standing = behind.get(phase.leader_id, (0, 0))
            behind[phase.leader_id] = total + phase.n_steps, standing + phase.n_steps * (phase.kind == "standing")
    number = max(behind, key=lambda number: (behind[number][0], -number), default=-1)
    total, standing = behind.get(number, (0, 0))
    none = no_safer_plan(run, agent.id)
    if total * dt >= _LONG and total >= stood:
        name, long = said_name(run, number), said_time(run, total)
        if standing == total:
            text = f"stood behind {name} for {long} s"
        elif standing * dt >= _LONG:
            text = f"behind {name} for {long} s, standing for {said_time(run, standing)} s"
        else:
            text = f"drove behind {name} for {long} s"
        return (text, none) if none and standing < total else (text,)
    if stop is not None and stood:
        return (said_stop(run, agent.id, stop),)
    return (none,) if none else ()


def said_stop(run: RunRecord, agent_id: int, stop: Phase) -> str:
    """A stop: how long, behind which vehicle, at which light, for which crossing participants, or without a sample."""
    seconds = said_time(run, stop.n_steps)
    lasted = f"stood for {seconds} s"
    if stop.order is not None:
        return f"{lasted} {said_order(run, *stop.order)}"
    if stop.leader_id >= 0:
        return f"stood behind {said_name(run, stop.leader_id)} for {seconds} s"
    if line := said_line(stop):
        return f"{lasted} {line}"
    if stop.left_lanelet_id >= 0:
        return f"{lasted} before the end of lanelet {stop.left_lanelet_id} without a gap in the lane beside"
    if stop.crossing_ids:
        return f"{lasted} while {said_list(stop.crossing_ids)} crossed its path"
    return f"{lasted} without a vehicle ahead{said_plans(run, agent_id, stop)}"


def said_plans(run: RunRecord, agent_id: int, stop: Phase) -> str:
    """Why an agent stood by its plans: no safer ones, quicker ones rejected most of the time, or as planned."""
    if none := no_safer_plan(run, agent_id, stop.first_time_step, stop.last_time_step):
        return f": {none}"
    plans, planned = run.plans, PLAN_STATUS.index("planned")
    within = (plans.time_step >= stop.first_time_step) & (plans.time_step <= stop.last_time_step)
    rows = np.flatnonzero((plans.agent_id == agent_id) & within & (plans.status == planned))
    held = plans.time_step[[row for row in rows.tolist() if plans.rejection[row]]]
    if 2 * len(held) < stop.n_steps:
        return ", as planned"
    return f", as quicker plans were rejected: {said_obstruction(run, agent_id, held)}"


def said_line(phase: Phase) -> str:
    """At which line an agent stood, or to which it came, and why it has to wait there; "" for none."""
    where = {"standing": "at", "driving": "towards"}.get(phase.kind, "before")
    if phase.red_lanelet_id >= 0:
        return f"{where} a red light (stop line of lanelet {phase.red_lanelet_id})"
    if phase.sign_lanelet_id >= 0:
        return f"{where} a stop sign (stop line of lanelet {phase.sign_lanelet_id})"
    return ""


def said_order(run: RunRecord, kind: str, by: int) -> str:
    """Where an agent was told to wait, and why."""
    name = said_name(run, by) if by >= 0 else "others"
    said = {"exit": f"no room behind it, because of {name}", "unseen": "it could not see whether others came"}
    why = said.get(kind, f"it gave way to {name}")
    return f"before a {'crosswalk' if kind == 'crosswalk' else 'junction'}: {why}"


def no_safer_plan(run: RunRecord, agent_id: int, first: int | None = None, last: int | None = None) -> str:
    """How long an agent had no better plan than emergency braking between two time steps; "" for less than a second."""
    steps = emergency_steps(run, agent_id)
    steps = steps[(steps >= (steps.min(initial=0) if first is None else first))]
    steps = steps if last is None else steps[steps <= last]
    if not len(steps):
        return ""
    pieces = np.split(steps, np.flatnonzero(np.diff(steps) > 1) + 1)
    longest = max(len(piece) for piece in pieces)
    if longest * run.scenario.dt < _LONG:
        return ""
    seconds, count = said_time(run, longest), said_count(len(steps), "time step")
    why = said_obstruction(run, agent_id, next(piece for piece in pieces if len(piece) == longest))
    return f"no safer plan for {seconds} s (emergency braking at {count}){why and f': {why}'}"


def said_obstruction(run: RunRecord, agent_id: int, time_steps: Ints) -> str:
    """What rejected better plans at most of some time steps, and where it did so first; "" if that is not known."""
    plans = run.plans
    rows = np.flatnonzero((plans.agent_id == agent_id) & np.isin(plans.time_step, time_steps))
    counts = Counter(plans.rejection[row] for row in rows.tolist() if plans.rejection[row])
    if not counts:
        return ""
    rejection = counts.most_common(1)[0][0]
    row = next(row for row in rows.tolist() if plans.rejection[row] == rejection)
    x, y, overhang = (float(c[row]) for c in (plans.rejection_x, plans.rejection_y, plans.rejection_overhang))
    beyond = f", the cheapest by {overhang:.1f} m" if overhang >= _SMALLEST else ""
    return f"{said_rejection(rejection)}{beyond}" + (f" at ({x:.1f}, {y:.1f})" if np.isfinite(x) else "")


def said_rejection(rejection: str) -> str:
    """What rejected samples, in words that stand alone."""
    if rejection in _LIMITS:
        return f"{rejection} beyond the vehicle's limit"
    return _REJECTIONS.get(rejection, rejection)


def said_name(run: RunRecord, participant_id: int) -> str:
    """A participant by its id, pedestrians and two-wheelers with their kind."""
    kind = run.states.kinds[int(np.searchsorted(run.states.participant_id, participant_id))]
    return f"{kind} {participant_id}" if kind in _NAMED else str(participant_id)


def _collision(run: RunRecord, place: int) -> str:
    """Which of two participants ran into which, how fast, and whether the other one could react."""
    ended, states = run.outcomes, run.states
    number, partner, time_step = (int(c[place]) for c in (ended.agent_id, ended.partner_id, ended.time_step))
    row, other = (int(np.searchsorted(states.participant_id, i)) for i in (number, partner))
    text = _touched(contact_between(states, row, other, time_step, run.scenario.dt), said_name(run, partner))
    speed = float(ended.impact_speed[place])
    how_fast = f" at {speed:.1f} m/s" if np.isfinite(speed) else ""
    if states.is_agent[other]:
        what = ""
    elif states.is_static[other]:
        what = ", which is static"
    else:
        column = max(time_step - 1 - states.first_time_step, 0)
        stands = abs(float(states.velocity[other, column])) < _core.JUDGED_STANDSTILL_SPEED
        what = ", which replays its recording" + (" and stood" if stands else "")
    return f"{text}{how_fast}{what}"


def _touched(contact: Contact, name: str) -> str:
    """Which vehicle moved into which, and with which sides."""
    own, theirs = contact.sides
    moves, comes = (approach > _core.JUDGED_STANDSTILL_SPEED for approach in contact.approach)
    ends, sides = ("front", "rear"), ("left", "right")
    at_own = f"on its {own} side" if own in sides else f"at its {own}"
    if own in sides and theirs in sides:
        text = f"side contact with {name}"
    elif theirs == "rear" and comes and not moves:
        text = f"hit {at_own} by reversing {name}"
    elif own == "rear" and moves and not comes:
        text = f"reversed into {name if theirs in ends else f'the {theirs} side of {name}'}"
    elif (own, theirs) == ("front", "rear"):
        text = f"ran into {name} from behind" + (", which reversed" if comes else "")
    elif (own, theirs) == ("rear", "front"):
        text = f"hit from behind by {name}" + (" while reversing" if moves else "")
    elif (own, theirs) == ("front", "front"):
        text = f"frontal collision with {name}"
    elif own == "front":
        text = f"hit {at_own} by {name}" if comes and not moves else f"ran into the {theirs} side of {name}"
    elif theirs == "front" and (comes or not moves):
        text = f"hit {at_own} by {name}"
    else:
        text = f"its {own} touched the {theirs} of {name}"
    return text


def _departure(run: RunRecord, agent: AgentRecord, road: _core.RoadNetwork) -> str:
    """Where an agent left the road, and how far the corner furthest outside was beyond its edge."""
    states = run.states
    place = int(np.searchsorted(run.outcomes.agent_id, agent.id))
    row = int(np.searchsorted(states.participant_id, agent.id))
    column = int(run.outcomes.time_step[place]) - states.first_time_step
    angle = float(states.orientation[row, column])
    forward, left = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    half = 0.5 * np.array([states.length[row], states.width[row]])
    center = np.array([states.x[row, column], states.y[row, column]])
    corners = np.array([center + a * half[0] * forward + b * half[1] * left for a in (1, -1) for b in (1, -1)])
    outside = corners[~road.on_road(np.ascontiguousarray(corners))]
    if not len(outside):
        return f"touched the edge of the road at ({center[0]:.1f}, {center[1]:.1f})"
    beyond = _distances(road.road_edges, outside)
    x, y = outside[int(beyond.argmax())].tolist()
    return f"left the road at ({x:.1f}, {y:.1f}), {beyond.max():.1f} m beyond its edge"


def _distances(edges: Floats, points: Floats) -> Floats:
    """Distance of points from the nearest of some segments [m], shape (points,)."""
    start, side = edges[:, 0], edges[:, 1] - edges[:, 0]
    offset = points[:, None] - start
    part = np.clip((offset * side).sum(axis=2) / np.maximum((side**2).sum(axis=1), 1e-12), 0.0, 1.0)
    found: Floats = np.hypot(*np.moveaxis(offset - part[..., None] * side, 2, 0)).min(axis=1)
    return found
