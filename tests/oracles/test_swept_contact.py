"""Contacts during a step, as worlds report them, against densely sampled motion in shapely."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from bodies import Body, body_of, distances, random_shape

from interdrive import _core
from interdrive.native_settings import CoreStepSettings, RoadSettings, RulesSettings, ViewSettings
from interdrive.scenario import Scenario, Shape

SUBSTEPS = 1000
#: Bodies that come nearer than this count as touching, says `first_contact`.
CONTACT = 1e-4
ROUNDING = 1e-8
FIELDS = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")


def between(start: np.ndarray, end: np.ndarray, fractions: np.ndarray) -> np.ndarray:
    """Poses on the way: straight at constant speed, turning the shorter way at a constant rate."""
    change = end - start
    change[2] = (change[2] + np.pi) % (2 * np.pi) - np.pi
    return start + np.asarray(fractions)[:, None] * change


class Motion:
    """Two bodies during one step."""

    def __init__(self, a: Body, a0: np.ndarray, a1: np.ndarray, b: Body, b0: np.ndarray, b1: np.ndarray) -> None:
        self.a, self.a0, self.a1, self.b, self.b0, self.b1 = a, a0, a1, b, b0, b1
        turns = [abs(between(p, q, np.ones(1))[0, 2] - p[2]) for p, q in ((a0, a1), (b0, b1))]
        self.travel = float(np.hypot(*((b1 - b0) - (a1 - a0))[:2])) + turns[0] * a.reach + turns[1] * b.reach

    def distance(self, fractions: np.ndarray) -> np.ndarray:
        poses = between(self.a0, self.a1, fractions), between(self.b0, self.b1, fractions)
        return distances(self.a, poses[0], self.b, poses[1])

    def may_touch(self) -> bool:
        """False where few samples are so far apart that nothing between them can reach the other body."""
        return all(
            self.distance(np.linspace(0.0, 1.0, n + 1)).min() <= 0.5 * self.travel / n + ROUNDING for n in (1, 8, 64)
        )

    def touches(self) -> bool:
        """Whether there is contact, without asking when."""
        if not self.may_touch():
            return False
        return bool((self.distance(np.linspace(0.0, 1.0, 201)) == 0).any()) or self.nearest(200)[0] == 0

    def nearest(self, substeps: int = SUBSTEPS) -> tuple[float, float]:
        """Smallest distance, and the first fraction with contact (nan without): samples, then ever finer ones."""
        fractions = np.linspace(0.0, 1.0, substeps + 1)
        sampled = self.distance(fractions)
        smallest, first = float(sampled.min()), np.nan
        touching = np.flatnonzero(sampled == 0)
        last = touching[0] if len(touching) else substeps + 1
        # Dips between samples: only where the distance could fall to the smallest one so far.
        inner = np.pad(sampled, 1, constant_values=np.inf)
        is_dip = (sampled <= inner[:-2]) & (sampled <= inner[2:])
        is_dip &= (sampled <= smallest + self.travel / substeps) & (np.arange(substeps + 1) < last)
        for i in np.flatnonzero(is_dip):
            low, high = fractions[max(i - 1, 0)], fractions[min(i + 1, substeps)]
            for _ in range(30):
                finer = np.linspace(low, high, 9)
                found = self.distance(finer)
                k = int(found.argmin())
                smallest = min(smallest, float(found[k]))
                if found[k] == 0:
                    return 0.0, self._first(fractions[max(i - 1, 0)], finer[k])
                low, high = finer[max(k - 1, 0)], finer[min(k + 1, 8)]
        if len(touching):
            first = self._first(fractions[max(last - 1, 0)], fractions[last])
        return smallest, first

    def _first(self, apart: float, touching: float) -> float:
        for _ in range(50):
            middle = 0.5 * (apart + touching)
            if self.distance(np.array([middle]))[0] == 0:
                touching = middle
            else:
                apart = middle
        return float(touching)


def plain(length: float, width: float) -> tuple[_core.RoadNetwork, _core.Route, _core.Goal]:
    """One enormous lane, so that no vehicle leaves the road; a goal that lies far in the future."""
    x = np.linspace(-0.5 * length, 0.5 * length, 101)
    bounds = [np.column_stack([x, np.full_like(x, side * 0.5 * width)]) for side in (1.0, -1.0)]
    road = _core.RoadNetwork(
        [1], [bounds[0]], [bounds[1]], [[]], [[]], [-1], [False], [-1], [False], [np.nan], [1],
        RoadSettings(open_end_length=0.0),
    )  # fmt: skip
    goal = _core.Goal([([], (10**6, 10**6), None, None)])
    return road, _core.Route.find(road, 0.0, 0.0, 0.0, 5.0, goal), goal


def recorded_obstacles(
    road: _core.RoadNetwork, ids: list[int], bodies: list[Body], poses: np.ndarray
) -> _core.Scenario:
    """Obstacles that follow the poses, shape (obstacles, steps, 3), and say that they stand."""
    zeros = np.zeros(poses.shape[:2])
    tables = [np.ascontiguousarray(poses[:, :, k]) for k in range(3)] + [zeros] * 3
    handles, n = [body.handle for body in bodies], len(ids)
    valid = np.ones(poses.shape[:2], dtype=bool)
    participants = _core.Participants(ids, handles, [False] * n, 0, *tables[:5], valid, tables[5])
    return _core.Scenario(0.1, road, participants, [1] * n)


def agent(i: int, body: Body, pose: np.ndarray, start: int, route: _core.Route, goal: _core.Goal) -> _core.Agent:
    """A vehicle without limits."""
    vehicle = _core.Vehicle(1, 4.5, 1.8, velocity_max=1e5)
    state = (*pose.tolist(), 0.0, 0.0, 0.0)
    return _core.Agent(i, 1, body.handle, vehicle, state, start, goal, route, None, ViewSettings(), RulesSettings())


def world_of(scenario: _core.Scenario, agents: list[_core.Agent]) -> _core.World:
    return _core.World(scenario, agents, CoreStepSettings(history_steps=1), threads=1)


def go(step: _core.Step, view: _core.View, start: np.ndarray, end: np.ndarray, speed: float) -> None:
    """A plan for one step that ends at a speed."""
    two = {name: np.array([start[k], end[k]]) for k, name in enumerate(FIELDS[:3])}
    step.set(view, **two, velocity=np.array([0.0, speed]), acceleration=np.zeros(2), yaw_rate=np.zeros(2), slides=True)


def judged(motions: list[Motion], partner_is_agent: bool) -> list[float]:
    """Fraction of the step at which each pair of one world is in contact, nan for none."""
    spacing, columns = 120.0, 20
    road, route, goal = plain(spacing * (columns + 2), spacing * (columns + 2))
    places = [
        (spacing * (k % columns - columns / 2), spacing * (k // columns - columns / 2), 0.0)
        for k in range(len(motions))
    ]
    moved = [[pose + np.array(p) for pose in (m.a0, m.a1, m.b0, m.b1)] for m, p in zip(motions, places, strict=True)]
    agents = [agent(2 * k, m.a, p[0], 0, route, goal) for k, (m, p) in enumerate(zip(motions, moved, strict=True))]
    if partner_is_agent:
        agents += [
            agent(2 * k + 1, m.b, p[2], 0, route, goal) for k, (m, p) in enumerate(zip(motions, moved, strict=True))
        ]
        scenario = recorded_obstacles(road, [], [], np.empty((0, 2, 3)))
    else:
        ids = [2 * k + 1 for k in range(len(motions))]
        scenario = recorded_obstacles(road, ids, [m.b for m in motions], np.array([[p[2], p[3]] for p in moved]))
    world = world_of(scenario, agents)
    assert world.entered_in_contact == []
    step = world.observe()
    for k, p in enumerate(moved):
        # All speeds grow from 0, the agent's to 1: the speed of impact is the fraction of the step.
        go(step, world.view(step.scene, 2 * k), p[0], p[1], 1.0)
        if partner_is_agent:
            go(step, world.view(step.scene, 2 * k + 1), p[2], p[3], 0.0)
    world.advance(step)
    outcomes = world.outcomes()
    found = {}
    for row, i in enumerate(outcomes["agent_id"].tolist()):
        assert not outcomes["off_road"][row]
        hit = outcomes["partner_id"][row] != -1
        assert not hit or outcomes["partner_id"][row] == i ^ 1
        found[i] = float(outcomes["impact_speed"][row]) if hit else np.nan
    return [found[2 * k] for k in range(len(motions))]


def random_motion(rng: np.random.Generator) -> Motion:
    """Two bodies that start apart; slow and fast, straight and spinning."""
    while True:
        a, b = body_of(random_shape(rng)), body_of(random_shape(rng))
        swift = rng.choice([0.3, 3.0, 10.0, 30.0])
        spin = rng.choice([0.0, 0.05, 0.5, 3.1])
        a0 = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
        a1 = a0 + np.array([*rng.uniform(-swift, swift, 2), rng.uniform(-spin, spin)])
        # The other one comes by where the first one is on its way.
        way = between(a0, a1, rng.uniform(0, 1, 1))[0]
        aim = way[:2] + rng.uniform(-1, 1, 2) * (a.reach + b.reach) * 0.8
        velocity, when = rng.uniform(-swift, swift, 2), rng.uniform(0, 1)
        b0 = np.array([*(aim - when * velocity), rng.uniform(-np.pi, np.pi)])
        b1 = np.array([*(aim + (1 - when) * velocity), b0[2] + rng.uniform(-spin, spin)])
        motion = Motion(a, a0, a1, b, b0, b1)
        if motion.distance(np.zeros(1))[0] > 0.01:
            return motion


def grazing(rng: np.random.Generator) -> Motion:
    """A random motion, shifted so that the bodies miss or touch each other by less than a millimetre."""
    while True:
        motion = random_motion(rng)
        bearing = rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(bearing), np.sin(bearing), 0.0])

        def shifted(offset: float, motion: Motion = motion, direction: np.ndarray = direction) -> Motion:
            shift = offset * direction
            return Motion(motion.a, motion.a0, motion.a1, motion.b, motion.b0 + shift, motion.b1 + shift)

        touching, apart = 0.0, 200.0
        if not motion.touches():
            continue
        for _ in range(26):
            middle = 0.5 * (touching + apart)
            if shifted(middle).touches():
                touching = middle
            else:
                apart = middle
        result = shifted(touching + rng.choice([-1e-3, -1e-4, -1e-5, 1e-5, 3e-4, 1e-3]))
        if result.distance(np.zeros(1))[0] > 2 * CONTACT:
            return result


@cache
def sampled_motions(make: Callable[[np.random.Generator], Motion], n: int) -> list[tuple[Motion, float, float]]:
    """Motions with their smallest distance and the first fraction with contact."""
    rng = np.random.default_rng([17, n])
    return [(motion, *motion.nearest()) for motion in (make(rng) for _ in range(n))]


@pytest.mark.parametrize("partner_is_agent", [True, False], ids=["two agents", "agent and recorded"])
@pytest.mark.parametrize(("make", "n", "name"), [(random_motion, 1000, "random"), (grazing, 150, "grazing")])
def test_contacts_during_a_step_are_those_of_dense_sampling(make, n, name, partner_is_agent, measured):
    sampled = sampled_motions(make, n)
    motions = [motion for motion, _, _ in sampled]
    found = [f for k in range(0, n, 400) for f in judged(motions[k : k + 400], partner_is_agent)]
    wrong, touching, late, deep, depth = [], 0, 0.0, 0.0, 0
    for k, ((motion, smallest, first), ours) in enumerate(zip(sampled, found, strict=True)):
        touching += smallest == 0
        if (smallest == 0 and np.isnan(ours)) or (smallest > CONTACT + ROUNDING and not np.isnan(ours)):
            wrong.append((k, smallest, ours))
        if not np.isnan(ours):
            depth += 1
            # At the reported fraction the bodies are within the tolerance; they are so not after they touch.
            deep = max(deep, float(motion.distance(np.array([ours]))[0]))
            late = max(late, 0.0 if np.isnan(first) else ours - first)
    who = "two agents" if partner_is_agent else "agent and recorded"
    measured(
        f"swept contact, {name}, {who}: different verdicts",
        n,
        len(wrong),
        0,
        "pairs",
        f"{touching} touch",
        wrong,
    )
    measured(f"swept contact, {name}, {who}: distance at the contact", depth, deep, CONTACT + ROUNDING, "m")
    measured(f"swept contact, {name}, {who}: contact later than sampled", depth, late, 1e-7, "steps")


def test_contacts_of_recorded_traffic_are_those_of_dense_sampling(recorded, measured):
    """All recorded vehicles drive as agents along their recordings; which pair touches first, and when?"""
    wrong, n, n_contacts, n_scenarios = [], 0, 0, 0
    for scenario in recorded:
        if (~scenario.obstacles.is_static).sum() < 2 or scenario.obstacles.n_steps < 2:
            continue
        n_scenarios += 1
        ours, theirs = replayed(scenario), sampled_contacts(scenario)
        n, n_contacts = n + len(ours), n_contacts + sum(end is not None for end in theirs.values())
        wrong += [(scenario.name, i, ours[i], theirs[i]) for i in ours if ours[i] != theirs[i]]
    assert n_scenarios >= 0.3 * len(recorded)
    remark = f"{n_scenarios} scenarios, {n_contacts} collide"
    measured("recorded traffic as agents: other partner or time step", n, len(wrong), 0, "agents", remark, wrong)


def _poses(scenario: Scenario) -> np.ndarray:
    o = scenario.obstacles
    poses = np.stack([o.x, o.y, o.orientation], axis=-1)
    return poses - np.append(np.nanmean(poses[:, :, :2], axis=(0, 1)), 0.0)


def replayed(scenario: Scenario) -> dict[int, tuple[int, int] | None]:
    """Time step and partner of every agent that collides."""
    o, poses = scenario.obstacles, _poses(scenario)
    size = 2.5 * np.nanmax(np.abs(poses[:, :, :2])) + 200.0
    road, route, goal = plain(size, size)
    bodies = [body_of(shape) for shape in o.shapes]
    moving = np.flatnonzero(~o.is_static).tolist()
    static = np.flatnonzero(o.is_static).tolist()
    obstacles = recorded_obstacles(road, o.ids[static].tolist(), [bodies[row] for row in static], poses[static])
    first = {row: int(np.flatnonzero(o.valid[row])[0]) for row in moving}
    assert all(np.diff(np.flatnonzero(o.valid[row])).max(initial=1) == 1 for row in moving)
    agents = [agent(int(o.ids[row]), bodies[row], poses[row, first[row]], first[row], route, goal) for row in moving]
    world, row_of = world_of(obstacles, agents), {int(o.ids[row]): row for row in moving}
    while not world.is_done:
        now, step = world.time_step, world.observe()
        for i in step.missing:
            row = row_of[i]
            if now + 1 < o.n_steps and o.valid[row, now + 1]:
                go(step, world.view(step.scene, i), poses[row, now], poses[row, now + 1], 0.0)
            else:
                step.fail(i, "the recording ends")
        world.advance(step)
    found = world.outcomes()
    assert not found["off_road"].any()
    ends = zip(found["agent_id"].tolist(), found["time_step"].tolist(), found["partner_id"].tolist(), strict=True)
    return {i: (step, partner) if partner != -1 else None for i, step, partner in ends}


def sampled_contacts(scenario: Scenario) -> dict[int, tuple[int, int] | None]:
    """The same by dense sampling: pairs that overlap when one of them enters count once they have been apart."""
    o, poses = scenario.obstacles, _poses(scenario)
    bodies = [body_of(shape) for shape in o.shapes]
    moving = set(np.flatnonzero(~o.is_static).tolist())
    ends: dict[int, tuple[int, int] | None] = {int(o.ids[row]): None for row in moving}
    gone: set[int] = set()
    excused: set[tuple[int, int]] = set()
    reach = np.array([body.reach for body in bodies])
    for step in range(o.n_steps):
        present = [row for row in range(len(bodies)) if o.valid[row, step] and row not in gone]
        entering = {row for row in present if step == 0 or not o.valid[row, step - 1]}
        for i, j in _near(poses, reach, present, step, 0.0) if entering else ():
            is_asked = {i, j} & entering and {i, j} & moving
            if is_asked and distances(bodies[i], poses[i, step], bodies[j], poses[j, step])[0] == 0:
                excused.add((i, j))
        if step + 1 == o.n_steps:
            break
        here = [row for row in present if o.valid[row, step + 1]]
        earliest: dict[int, tuple[float, int]] = {}
        still = set()
        for i, j in _near(poses, reach, here, step, _travels(poses, reach, step)):
            if not {i, j} & moving:
                continue
            motion = Motion(
                bodies[i], poses[i, step], poses[i, step + 1], bodies[j], poses[j, step], poses[j, step + 1]
            )
            if not motion.may_touch():
                continue
            smallest, first = motion.nearest()
            if smallest > 0:
                continue
            if (i, j) in excused:
                still.add((i, j))
                continue
            for row, partner in ((i, j), (j, i)):
                earliest[row] = min(earliest.get(row, (np.inf, -1)), (first, int(o.ids[partner])))
        excused = still
        for row in moving & set(earliest):
            ends[int(o.ids[row])] = (step + 1, earliest[row][1])
            gone.add(row)
    return ends


def _travels(poses: np.ndarray, reach: np.ndarray, step: int) -> np.ndarray:
    """How far any point of each body moves at most during a step [m]."""
    change = poses[:, step + 1] - poses[:, step]
    turn = (change[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return np.hypot(change[:, 0], change[:, 1]) + np.abs(turn) * reach


def _near(
    poses: np.ndarray, reach: np.ndarray, rows: list[int], step: int, travel: np.ndarray | float
) -> list[tuple[int, int]]:
    """Pairs whose bodies may touch if each moves so far."""
    widths = (reach + travel)[rows]
    x, y = poses[rows, step, 0], poses[rows, step, 1]
    apart = np.hypot(x[:, None] - x, y[:, None] - y) - widths[:, None] - widths
    first, second = np.nonzero(np.triu(apart <= 0, 1))
    return [(rows[i], rows[j]) for i, j in zip(first.tolist(), second.tolist(), strict=True)]


def test_the_sampling_itself_finds_a_short_touch():
    """The oracle's own check: two bars that cross for 1/5000 of the step are found between the samples."""
    bar = body_of(Shape("rectangle", 4.0, 0.002))
    start, end = np.array([-25.0, 0.0, np.pi / 2]), np.array([25.0, 0.0, np.pi / 2])
    still = np.array([0.0003, 0.0, np.pi / 2])
    smallest, first = Motion(bar, start, end, bar, still, still).nearest()
    assert smallest == 0
    assert first == pytest.approx(0.5 + (0.0003 - 0.002) / 50.0, abs=1e-9)
