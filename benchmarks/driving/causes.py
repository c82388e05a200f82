"""Why agents are late: the constraint that rejects faster samples, at the head of the queue.

An agent's delay at a place is how much later it gets there than its own recording. A cause is sampled every second
while the delay grows: of all samples that go further than the plan, the constraint that rejects most of them. If that
is a contact with an agent ahead that falls behind itself, the cause is looked for there, and so on to the head.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.runs import Run
    from interdrive.simulation import Simulation

    Floats = NDArray[np.float64]

#: Time between samples [s].
SPACING = 1.0
#: A delay that grows by less in that time does not count [s].
GROWTH_MIN = 0.05
#: A plan is as fast as wanted if it misses the desired speed by less [m/s].
WANTED = 0.5
#: Not more than this share of the faster samples is as good as none.
FEW = 0.05
#: A participant nearer ahead on the path than this [m], and this time at the present speed [s], is a leader.
LEADER_GAP, LEADER_TIME = 8.0, 2.0
#: ... if it is in the agent's corridor, which is wider than the agent by this on each side [m].
CORRIDOR = 0.3
#: Deceleration with which an agent comes to a stop before a barrier [m/s²].
BRAKING = 2.0
#: A place counts as reached from this far before it on [m].
REACHED = 0.5
#: A rejected sample comes farther than the plan if it does so by this [m].
FARTHER = 1.0
#: Causes by the words of a rejection; other words stand for themselves.
_CAUSES = {
    "off the road": "road edge",
    "curvature": "steering",
    "steering rate": "steering",
    "yaw rate": "steering",
}
#: Terms of the cost that other participants cause.
_OF_OTHERS = ("prediction", "distance_to_obstacles", "nearness", "margin")
#: Those that are limits of the vehicle.
_LIMITS = ("steering", "acceleration", "lateral acceleration", "negative speed")


@dataclass(frozen=True)
class Delay:
    """How far an agent is behind its recording [s], shape (steps,); a planning problem behind an even pace."""

    first_time_step: int
    seconds: Floats

    @classmethod
    def of(cls, run: Run, i: int, route: _core.Route) -> Delay:
        """Of one agent of a run."""
        agent, dt = run.agents[i], run.scenario.dt
        states, obstacles = run.states, run.scenario.obstacles
        row = int(np.searchsorted(states.participant_id, agent.id))
        there = np.flatnonzero(states.valid[row])
        driven = _progress(route, states.x[row, there], states.y[row, there])
        time = np.arange(len(there)) * dt
        recorded = np.flatnonzero(obstacles.ids == agent.id)
        deadline = (agent.goal_time_step[1] - agent.start_time_step) * dt
        if len(recorded):
            valid = np.flatnonzero(np.isfinite(obstacles.x[recorded[0]]))
            pace = _progress(route, obstacles.x[recorded[0], valid], obstacles.y[recorded[0], valid])
        else:
            steps = max(2, round(deadline / dt) + 1)
            entry = route.goal_entry_s if np.isfinite(route.goal_entry_s) else driven[-1]
            pace = np.linspace(driven[0], max(driven[0], entry), steps)
        # The last time at which the recording was not further yet.
        reached = np.searchsorted(pace, driven + REACHED, side="right")
        late = np.maximum(0.0, time - np.minimum(reached, len(pace) - 1) * dt)
        # An agent beyond the recording's end is not late there any more.
        late[driven + REACHED >= pace[-1]] = 0.0
        return cls(states.first_time_step + int(there[0]), late)

    def at(self, time_step: int) -> float:
        """At a time step, or at the nearest one."""
        return float(self.seconds[np.clip(time_step - self.first_time_step, 0, len(self.seconds) - 1)])

    def growth(self, time_step: int, steps: int) -> float:
        """How much it grows over some steps from a time step on [s]."""
        return self.at(time_step + steps) - self.at(time_step)


def _progress(route: _core.Route, x: Floats, y: Floats) -> Floats:
    """The furthest station so far of the points of a drive [m]."""
    station, _ = route.project(np.ascontiguousarray(x), np.ascontiguousarray(y))
    furthest: Floats = np.maximum.accumulate(np.where(np.isnan(station), -np.inf, station))
    return np.where(np.isfinite(furthest), furthest, 0.0)


def held_up_by(
    simulation: Simulation, delays: dict[int, Delay], agents: Sequence[int]
) -> dict[int, tuple[str, int, float]]:
    """Drives a simulation once more and says per agent: its main cause, the head of the queue, delay from it [s]."""
    steps = max(1, round(SPACING / simulation.scenario.dt))
    deadline = {agent.id: max(goal.time_step[1] for goal in agent.goal) for agent in simulation.agents}
    seconds: dict[int, dict[tuple[str, int], float]] = {agent: defaultdict(float) for agent in agents}
    simulation.reset()
    while not simulation.is_done:
        now = simulation.time_step
        falling_behind = {
            agent: growth
            for agent in simulation.driving
            if (growth := delays[agent].growth(now, steps)) >= GROWTH_MIN and now < deadline[agent]
        }
        if now % steps == 0 and falling_behind.keys() & set(agents):
            moment = _Moment(simulation, falling_behind.keys())
            for agent in sorted(falling_behind.keys() & set(agents)):
                seconds[agent][moment.head(agent)] += falling_behind[agent]
        simulation.step()
    return {
        agent: (*max(sorted(found), key=lambda cause: found[cause]), max(found.values()))
        for agent, found in seconds.items()
        if found
    }


class _Moment:
    """What agents could do at the present time step of a simulation."""

    def __init__(self, simulation: Simulation, falling_behind: Any) -> None:  # noqa: ANN401 - a view of keys
        self._world = simulation.world
        self._step = simulation.progress.begin_step()
        self._scene = self._step.scene
        self._driving, self._falling_behind = set(simulation.driving), set(falling_behind)
        self._found: dict[int, tuple[str, int]] = {}

    def head(self, agent: int) -> tuple[str, int]:
        """Cause and vehicle at the head of an agent's queue."""
        passed = []
        while True:
            passed.append(agent)
            cause, partner = self._cause(agent)
            if partner in passed:
                return "mutual wait", min(passed[passed.index(partner) :])
            if partner < 0 or partner not in self._falling_behind:
                return cause, agent
            agent = partner

    def _cause(self, agent: int) -> tuple[str, int]:
        """What rejects faster samples of an agent, and the vehicle that it would hit (-1: none)."""
        if agent not in self._found:
            self._found[agent] = self._looked_up(agent)
        return self._found[agent]

    def _looked_up(self, agent: int) -> tuple[str, int]:
        found = self._world.candidates(agent, self._step)
        if found is None or not len(found["cost"]):
            return "no samples", -1
        end, desired, chosen = found["end_velocity"], found["desired_velocity"], int(found["chosen"])
        planned = end[chosen] if chosen >= 0 else 0.0
        if planned > desired - WANTED:
            cause = "accelerating" if desired > planned + WANTED else "own speed"
            return self._behind_a_leader(agent) or (cause, -1)
        faster = np.flatnonzero(end > 0.5 * (planned + desired))
        reasons = [found["rejection"][i] for i in faster.tolist()]
        # Limits of the vehicle are looked at first, contacts and the road then: what stops those that come furthest.
        kinds = [_kind(why) for why in reasons]
        capable = [kind for kind in kinds if kind not in _LIMITS]
        if kinds.count("") > FEW * len(kinds) or not kinds:
            return self._preferred(agent, found, faster[[not why for why in reasons]])
        pool = [kind for kind in (capable if len(capable) > FEW * len(kinds) else kinds) if kind]
        most = max(sorted(set(pool)), key=pool.count)
        if most != "contact":
            return most, -1
        partners = [_contact(why) for why in reasons]
        hit = [partner for partner in partners if partner is not None]
        partner = max(sorted(set(hit)), key=hit.count)
        return self._encounter(agent, partner), partner

    def _preferred(self, agent: int, found: dict[str, Any], faster: NDArray[np.int64]) -> tuple[str, int]:
        """The cost term that keeps an agent from the cheapest of the faster samples that it could drive."""
        chosen = int(found["chosen"])
        if chosen < 0 or not len(faster):
            return self._held(agent, found) if chosen >= 0 else ("no plan", -1)
        best = faster[np.nanargmin(found["cost"][faster])]
        term = found["term_names"][int(np.nanargmax(found["terms"][best] - found["terms"][chosen]))]
        behind = self._behind_a_leader(agent) if term in _OF_OTHERS else None
        return behind or (f"cost of {term}", -1)

    def _held(self, agent: int, found: dict[str, Any]) -> tuple[str, int]:
        """What keeps an agent slow whose planner drives nothing faster: a leader, a barrier, or what it would touch."""
        if leader := self._behind_a_leader(agent):
            return leader
        ego = self._world.view(self._scene, agent).ego
        front = float(ego.route.project(np.array([ego.x]), np.array([ego.y]))[0][0]) + 0.5 * ego.vehicle.length
        reach = LEADER_GAP + LEADER_TIME * ego.velocity + ego.velocity**2 / (2.0 * BRAKING)
        barriers = ego.barriers
        near = [i for i in range(len(barriers)) if -REACHED <= barriers.s[i] - front < reach]
        if not near:
            return self._touched(agent, found) or ("neither leader nor barrier", -1)
        first = min(near, key=lambda i: float(barriers.s[i]))
        by = int(barriers.by_id[first])
        return barriers.reason[first].replace("_", " "), by if by in self._driving else -1

    def _touched(self, agent: int, found: dict[str, Any]) -> tuple[str, int] | None:
        """What the cheapest of the rejected samples touches, if one comes farther than the plan."""
        way = np.hypot(np.diff(found["x"]), np.diff(found["y"])).sum(axis=1)
        rejected = [i for i, why in enumerate(found["rejection"]) if why and way[i] > way[found["chosen"]] + FARTHER]
        if not rejected:
            return None
        reason = found["rejection"][min(rejected, key=lambda i: float(found["cost"][i]))]
        partner = _contact(reason)
        return (_kind(reason), -1) if partner is None else (self._encounter(agent, partner), partner)

    def _behind_a_leader(self, agent: int) -> tuple[str, int] | None:
        """The leader as a cause, if there is one."""
        view = self._world.view(self._scene, agent)
        ego = view.ego
        station, offset = ego.route.project(view.x[:, -1], view.y[:, -1])
        front = ego.route.project(np.array([ego.x]), np.array([ego.y]))[0][0] + 0.5 * ego.vehicle.length
        gap = station - 0.5 * view.length - front
        leads = (gap > -1.0) & (gap < LEADER_GAP + LEADER_TIME * ego.velocity) & (view.ids != agent)
        leads &= np.abs(offset) < 0.5 * (view.width + ego.vehicle.width) + CORRIDOR
        if not leads.any():
            return None
        partner = int(view.ids[np.where(leads, gap, np.inf).argmin()])
        return self._encounter(agent, partner), partner

    def _encounter(self, agent: int, partner: int) -> str:
        """How a participant stands in the way of an agent."""
        view = self._world.view(self._scene, agent)
        ego, row = view.ego, int(np.flatnonzero(view.ids == partner)[0])
        x, y = view.x[row, -1] - ego.x, view.y[row, -1] - ego.y
        cos, sin = np.cos(ego.orientation), np.sin(ego.orientation)
        ahead = cos * x + sin * y
        turned = abs((view.orientation[row, -1] - ego.orientation + np.pi) % (2.0 * np.pi) - np.pi)
        kind = "agent" if partner in self._driving else "replayed"
        if view.is_static[row] or view.velocity[row, -1] < 0.3:
            return f"standing {kind}"
        if turned > 0.75 * np.pi:
            return f"oncoming {kind}"
        if turned > 0.25 * np.pi:
            return f"crossing {kind}"
        return f"leading {kind}" if ahead > 0.5 * view.length[row] else f"{kind} beside or behind"


def _kind(reason: str) -> str:
    """A rejection as a cause; "contact" for any participant."""
    return "contact" if reason.startswith("collision") else _CAUSES.get(reason, reason)


def _contact(reason: str) -> int | None:
    """The participant that a rejected sample would hit."""
    return int(reason.rsplit(" ", 1)[-1]) if reason.startswith("collision") else None
