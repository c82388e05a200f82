"""The story of an agent in words: what it did when, for which vehicles, its most critical moments, how it ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.criticality import evaluate, measure_named
from interdrive.errors import InputError
from interdrive.run.goals import said_time
from interdrive.run.phases import emergency_steps, phases
from interdrive.run.reasons import said_count, said_line, said_list, said_name, said_obstruction, said_order
from interdrive.run.rules import RULES
from interdrive.run.violations.drives import stretches

if TYPE_CHECKING:
    from interdrive.criticality import Criticality
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.run.phases import Phase

#: Measures whose most critical value a story tells.
_MEASURES = ("ttc", "thw", "dce", "pet")


def story(run: RunRecord, agent_id: int, criticality: Criticality | None = None) -> list[str]:
    """The story of an agent, one line each.

    Args:
        run: The run, with its plans.
        agent_id: The agent.
        criticality: Measures of the agent, if they were evaluated before.

    Raises:
        InputError: It is not an agent of the run.
    """
    agent = agent_named(run, agent_id)
    done = phases(run, agent)
    lines = [ending(run, agent_id), *(f"  {line}" for line in _goal(run, agent))]
    if not done:
        return [*lines, "  it never started"]
    lines += [f"  {_phase(run, agent, phase)}" for phase in done]
    braking = emergency_steps(run, agent_id)
    if len(braking):
        first = said_time(run, int(braking[0]))
        lines.append(f"  emergency braking at {said_count(len(braking), 'time step')}, the first at {first} s")
    found = criticality or evaluate(run, [agent_id])
    trace = run.outcomes.traceback[int(np.searchsorted(run.outcomes.agent_id, agent_id))]
    more = [*_blinkers(run, agent_id), *_broken(run, agent_id), *_critical(run, agent_id, found), *trace.splitlines()]
    return [*lines, *(f"  {line}" for line in more)]


def ending(run: RunRecord, agent_id: int) -> str:
    """How an agent ended, in one line, such as "agent 605: goal_missed at 10.1 s: in the goal area from ..."."""
    agent_named(run, agent_id)
    ended = run.outcomes
    place = int(np.searchsorted(ended.agent_id, agent_id))
    text = f"agent {agent_id}: {ended.outcome[place]} at {said_time(run, int(ended.time_step[place]))} s"
    return text + (f": {ended.reason[place]}" if ended.reason[place] else "")


def agent_named(run: RunRecord, agent_id: int) -> AgentRecord:
    """The agent with an id.

    Raises:
        InputError: There is no such agent; the line lists the agents.
    """
    found = next((agent for agent in run.agents if agent.id == agent_id), None)
    if found is None:
        ids = [agent.id for agent in run.agents]
        known = ", ".join(map(str, ids[:20])) + (", ..." if len(ids) > 20 else "")
        raise InputError(f"agent {agent_id}: not an agent of this run; its agents are {known or 'none'}")
    return found


def _goal(run: RunRecord, agent: AgentRecord) -> list[str]:
    origin = "a recorded vehicle" if agent.origin == "recorded" else f"a {agent.origin}"
    lines = [f"{origin}, planner {agent.planner}"]
    for goal in agent.goal:
        conditions = [f"goal from {said_time(run, goal.time_step[0])} to {said_time(run, goal.time_step[1])} s"]
        if goal.velocity is not None:
            conditions.append("{:.1f} to {:.1f} m/s".format(*goal.velocity))
        if goal.orientation is not None:
            low, high = np.degrees(goal.orientation)
            conditions.append(f"heading {0.5 * (low + high):.0f}° ± {0.5 * (high - low):.0f}°")
        lines.append(", ".join(conditions))
    return lines


def _phase(run: RunRecord, agent: AgentRecord, phase: Phase) -> str:
    """A phase in words: from when to when, what, behind which vehicle, how fast."""
    states, first = run.states, phase.first_time_step
    last = phase.last_time_step + 1  # until the state that its last plan led to
    row = int(np.searchsorted(states.participant_id, agent.id))
    speed = states.velocity[row, first - states.first_time_step : last + 1 - states.first_time_step]
    speed = speed[np.isfinite(speed)]
    speed = np.abs(speed) if phase.kind == "reversing" else speed
    text = f"{said_time(run, first):>5} to {said_time(run, last):>5} s  {phase.kind}"
    if phase.order is not None:
        text += f" {said_order(run, *phase.order)}"
    elif phase.leader_id >= 0:
        text += f" behind {said_name(run, phase.leader_id)}"
    elif line := said_line(phase):
        text += f" {line}"
    elif phase.left_lanelet_id >= 0:
        text += f" before the end of lanelet {phase.left_lanelet_id}, without a gap in the lane beside"
    elif phase.crossing_ids:
        text += f" while {said_list(phase.crossing_ids)} crossed its path"
    if phase.kind == "standing":
        return text
    most = f", at most {speed.max():.1f} m/s" if speed.max() > max(speed[0], speed[-1]) + 0.5 else ""
    why = said_obstruction(run, agent.id, np.arange(first, last)) if phase.kind == "emergency braking" else ""
    because = f"; most samples were rejected: {why}" if why else ""
    return f"{text}, from {speed[0]:.1f} to {speed[-1]:.1f} m/s{most}{because}"


def _blinkers(run: RunRecord, agent_id: int) -> list[str]:
    """When its blinkers showed which side."""
    mine = run.plans.agent_id == agent_id
    steps, turn = run.plans.time_step[mine], run.plans.turn[mine]
    shown = sorted((*stretch, side) for side in (1.0, -1.0) for stretch in stretches(turn == side))
    times = [(said_time(run, int(steps[first])), said_time(run, int(steps[last]) + 1)) for first, last, _ in shown]
    sides = ("left" if side > 0.0 else "right" for *_, side in shown)
    return [f"blinkers {side} from {first} to {last} s" for side, (first, last) in zip(sides, times, strict=True)]


def _broken(run: RunRecord, agent_id: int) -> list[str]:
    """The rules of the road that an agent broke, each once, in the order of their first times."""
    broken = run.violations
    if broken is None:
        return []
    mine = [
        place for place in np.flatnonzero(broken.participant_id == agent_id).tolist() if broken.source[place] == "agent"
    ]
    by_rule: dict[str, list[int]] = {}
    for place in sorted(mine, key=lambda place: int(broken.first_time_step[place])):
        by_rule.setdefault(broken.rule[place], []).append(place)
    lines = []
    for rule, (place, *others) in by_rule.items():
        partner = int(broken.partner_id[place])
        name = said_name(run, partner) if partner >= 0 else ""
        words = RULES[rule].words.format(value=float(broken.value[place]), partner=name)
        words = words.replace("\N{NO-BREAK SPACE}", " ")
        first, last = (int(steps[place]) for steps in (broken.first_time_step, broken.last_time_step))
        when = (
            f"at {said_time(run, first)}"
            if first == last
            else f"from {said_time(run, first)} to {said_time(run, last)}"
        )
        again = f", and {said_count(len(others), 'more time')}" if others else ""
        lines.append(f"broken rule {when} s: {words}{again}")
    return lines


def _critical(run: RunRecord, agent_id: int, found: Criticality) -> list[str]:
    """The most critical value of some measures, with time and partner."""
    lines = []
    row = found.row(agent_id)
    for name in _MEASURES:
        measure, extremes = measure_named(name), found.extremes[name]
        value, partner = float(extremes.value[row]), int(extremes.partner_id[row])
        if np.isfinite(value):
            met = f" with {said_name(run, partner)}" if partner >= 0 else ""
            when = said_time(run, int(extremes.time_step[row]))
            lines.append(f"least {measure.title} {measure.text(value, 1)}{met} at {when} s")
    return lines
