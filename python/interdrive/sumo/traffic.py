"""SUMO's participants as those of a run: ids, kinds, states of their centres; agents as vehicles of SUMO."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from interdrive import _core
from interdrive.scenario import KINDS, SIGNALS
from interdrive.scenario.control import shown_together
from interdrive.sumo.process import Process

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats, Ints
    from interdrive.scenario import Scenario
    from interdrive.scenario.agents import Agent

#: What `_core.World.advance` takes: new participants, ids, states of shape (ids, 6), ids of those that jumped.
Outside = tuple[list[tuple[int, int, float, float]], list[int], "Floats", list[int]]

#: Centre [m], heading [rad], speed [m/s], acceleration [m/s²] and yaw rate [rad/s] of a participant.
_State = tuple[float, float, float, float, float, float]
#: Domain and name of a participant of SUMO.
_Name = tuple[str, str]
#: Names of agents within SUMO begin with this; no other name does.
_PREFIX = "interdrive_agent_"
#: Kinds by SUMO's classes of vehicles.
KIND_OF_CLASS = {
    "passenger": "car", "private": "car", "evehicle": "car", "hov": "car",
    "truck": "truck", "trailer": "truck", "delivery": "truck",
    "bus": "bus", "coach": "bus",
    "motorcycle": "motorcycle", "moped": "motorcycle",
    "bicycle": "bicycle", "taxi": "taxi", "emergency": "priority_vehicle", "pedestrian": "pedestrian",
    "tram": "train", "rail": "train", "rail_urban": "train", "rail_electric": "train", "rail_fast": "train",
}  # fmt: skip
#: SUMO's letters for signals, small where vehicles yield to others; red is always small.
_LETTERS = {"red": "r", "yellow": "y", "green": "g", "dark": "o"}
#: A participant that comes farther than its speed allows by this jumps [m].
_JUMP = 0.5
#: Speed from which on a participant heads where it moves in its lane [m/s].
_HEADING_SPEED = 1.0
#: A participant that is nearer to an agent that enters leaves [m].
_CLEAR = 1.0
#: A participant that was there leaves if it is farther away than the radius by this [m].
_HYSTERESIS = 20.0


class _Known(NamedTuple):
    """A participant of SUMO that has been in the run, or is near."""

    kind: str
    length: float
    width: float


class Traffic:
    """SUMO's side of a run.

    Attributes:
        version: Version of SUMO.
        names: SUMO's name of every participant that was in the run, by id.
        jumps: How often participants jumped.
        cleared: SUMO's names of participants that left because an agent entered where they were.
    """

    def __init__(self, scenario: Scenario, agents: Sequence[Agent], radius: float, seed: int) -> None:
        """Starts SUMO.

        Args:
            scenario: One with `sumo`.
            agents: Of the run.
            radius: Participants of SUMO that are farther from every agent are left out [m].
            seed: Seed of the run.

        Raises:
            MissingExtraError: SUMO is not installed.
            InputError: SUMO refuses its files.
            SumoError: It does not start.
        """
        assert scenario.sumo is not None
        self._sumo, self._dt, self._radius = scenario.sumo, scenario.dt, radius
        self._agents = {agent.id: agent for agent in agents}
        taken = [*scenario.obstacles.ids.tolist(), *self._agents, *scenario.lanelets.ids.tolist(), 0]
        self._next_id = 10 ** len(str(max(taken)))
        self._lights = {light.id: light for light in scenario.traffic_lights}
        self._signals: list[Ints] = []
        self._n_shown = 0
        self._placed: set[int] = set()
        self._waiting = set(self._agents)
        self._near: set[_Name] = set()
        self._begin = 0
        self._kinds: dict[_Name, _Known] = {}
        self._there: dict[_Name, _State] = {}
        self._numbers: dict[_Name, int] = {}
        self._leaving: set[_Name] = set()
        self._gone: set[_Name] = set()
        self.names: dict[int, str] = {}
        self.jumps = 0
        self.cleared: list[str] = []
        self._process = Process(scenario.sumo, scenario.dt, seed, _PREFIX)
        self.version = self._process.version
        self._take(self._process.first)

    def first(self, time_step: int) -> Outside:
        """Participants of SUMO at the first time step, without those in the way of agents that enter now."""
        self._begin = time_step
        entering = [agent for agent in self._agents.values() if agent.initial_state.time_step == time_step]
        for agent in entering:
            self._clear(agent, _pose(agent))
        return self._outside([_pose(agent)[:2] for agent in self._agents.values()], [])

    def leave(self, number: int) -> None:
        """Lets a participant of SUMO leave before the next time step; another one is left alone."""
        for name, own in self._numbers.items():
            if own == number:
                self._leaving.add(name)

    def step(self, time_step: int, ids: Sequence[int], states: Floats) -> Outside:
        """SUMO's participants one time step later, after it has moved all at once.

        Args:
            time_step: Now.
            ids: Agents that go on.
            states: Where they will be, shape (ids, 6).

        Raises:
            SumoError: SUMO has ended.
        """
        poses = dict(zip(ids, states.tolist(), strict=True))
        new = [number for number in ids if number not in self._placed]
        if time_step > self._begin:
            for number in new:
                self._clear(self._agents[number], tuple(poses[number][:3]))
        fronts = {number: self._front(number, state) for number, state in poses.items()}
        request = {
            "ended": sorted(self._placed - set(ids)),
            "leaving": sorted(self._leaving),
            "new": [
                (number, *_size(self._agents[number]), *self._front(number, _pose(self._agents[number])))
                for number in new
            ],
            "agents": [(number, *fronts[number], max(0.0, poses[number][3])) for number in ids],
            "lights": self._shown(time_step),
        }
        self._placed = set(ids)
        # Some wait for longer than stated.
        self._waiting -= self._placed
        before = self._there
        self._gone |= self._leaving
        self._leaving = set()
        self._take(self._process.step(request, time_step))
        places = [*(tuple(state[:2]) for state in poses.values())]
        places += [_pose(agent)[:2] for number, agent in self._agents.items() if number in self._waiting]
        jumped = [name for name, one in self._there.items() if name in before and self._jumps(before[name], one)]
        return self._outside(places, jumped)

    def close(self) -> None:
        """Ends SUMO."""
        self._process.close()

    def notes(self) -> list[str]:
        """What users should know of it, one line each."""
        found = [f"traffic by SUMO {self.version}, seed {self._sumo.seed} and that of the run"]
        if self.jumps:
            found.append(
                f"SUMO's vehicles jumped {self.jumps} times by more than their speed allows: contacts on the way of a "
                "jump do not count"
            )
        if self.cleared:
            shown = ", ".join(self.cleared[:5]) + (", ..." if len(self.cleared) > 5 else "")
            found.append(f"SUMO's {shown} left because agents entered where they were")
        return found

    def _shown(self, time_step: int) -> list[tuple[str, list[tuple[int, str]]]]:
        """What SUMO's lights show now, by their names: letters at places of their states."""
        if time_step >= self._n_shown:
            self._n_shown = max(2 * time_step, 1000)
            self._signals = [
                shown_together([self._lights[i] for i in ids], self._n_shown) for _, _, ids, _ in self._sumo.lights
            ]
        found: dict[str, list[tuple[int, str]]] = {}
        for (name, place, _, yields), signals in zip(self._sumo.lights, self._signals, strict=True):
            letter = _LETTERS[SIGNALS[signals[time_step]]]
            found.setdefault(name, []).append((place, letter if yields or letter == "r" else letter.upper()))
        return list(found.items())

    def _take(self, answer: dict[str, Any]) -> None:
        """Where SUMO's participants are now."""
        for domain, label, kind, length, width in answer["new"]:
            self._kinds[domain, label] = _Known(KIND_OF_CLASS.get(kind, "unknown"), max(length, 0.1), max(width, 0.1))
        before, self._there = self._there, {}
        numbers = np.frombuffer(bytes.fromhex(answer["numbers"])).reshape(-1, 6).tolist()
        for (domain, label), (x, y, angle, across, speed, acceleration) in zip(answer["there"], numbers, strict=True):
            name = domain, label
            if name in self._gone:
                continue
            heading = math.radians(90.0 - angle)
            half = 0.5 * self._kinds[name].length
            dx, dy = self._sumo.offset
            turned = heading + (math.atan2(across, speed) if speed > _HEADING_SPEED else 0.0)
            turned = math.remainder(turned, math.tau)
            known = before.get(name)
            turning = 0.0 if known is None else math.remainder(turned - known[2], math.tau) / self._dt
            center = x - half * math.cos(heading) - dx, y - half * math.sin(heading) - dy
            self._there[name] = (*center, turned, speed, acceleration, turning)

    def _jumps(self, before: _State, now: _State) -> bool:
        way = math.dist(before[:2], now[:2])
        return way > max(before[3], now[3]) * self._dt + _JUMP

    def _outside(self, places: list[tuple[float, ...]], jumped: list[_Name]) -> Outside:
        """Those near agents, as the core takes them."""
        near = [name for name in sorted(self._there) if self._is_near(name, places)]
        new = [name for name in near if name not in self._numbers]
        for name in new:
            self._numbers[name] = self._next_id
            self.names[self._next_id] = name[1]
            self._next_id += 1
        self._near = set(near)
        near.sort(key=self._numbers.__getitem__)
        moved = [self._numbers[name] for name in jumped if name in self._near and name not in new]
        self.jumps += len(moved)
        states = np.array([self._there[name] for name in near], dtype=np.float64).reshape(len(near), 6)
        return [self._newcomer(name) for name in new], [self._numbers[name] for name in near], states, moved

    def _newcomer(self, name: _Name) -> tuple[int, int, float, float]:
        kind, length, width = self._kinds[name]
        return self._numbers[name], KINDS.index(kind), length, width

    def _is_near(self, name: _Name, places: list[tuple[float, ...]]) -> bool:
        if math.isinf(self._radius) or not self._agents:
            return True
        x, y = self._there[name][:2]
        reach = self._radius + (_HYSTERESIS if name in self._near else 0.0)
        return any(math.hypot(x - place[0], y - place[1]) <= reach for place in places)

    def _clear(self, agent: Agent, pose: tuple[float, ...]) -> None:
        """Removes participants in the way of an agent that enters."""
        own = _core.Shape.rectangle(*_size(agent))
        for name, one in sorted(self._there.items()):
            kind = self._kinds[name]
            reach = 0.5 * (math.hypot(*_size(agent)) + math.hypot(kind.length, kind.width)) + _CLEAR
            if math.dist(pose[:2], one[:2]) > reach:
                continue
            body = _core.Shape.rectangle(kind.length, kind.width)
            if own.distance((pose[0], pose[1], pose[2]), body, one[:3]) < _CLEAR:
                self._leaving.add(name)
                self.cleared.append(name[1])
                del self._there[name]

    def _front(self, number: int, state: Sequence[float]) -> tuple[float, float, float]:
        """Front of an agent in SUMO's coordinates, and SUMO's angle."""
        x, y, heading = state[:3]
        half, (dx, dy) = 0.5 * _size(self._agents[number])[0], self._sumo.offset
        angle = (90.0 - math.degrees(heading)) % 360.0
        return x + half * math.cos(heading) + dx, y + half * math.sin(heading) + dy, angle


def _pose(agent: Agent) -> tuple[float, float, float]:
    state = agent.initial_state
    return state.x, state.y, state.orientation


def _size(agent: Agent) -> tuple[float, float]:
    return agent.vehicle.length, agent.vehicle.width
