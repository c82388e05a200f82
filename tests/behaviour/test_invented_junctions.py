"""Right of way in many small random worlds, and at a ramp: what hidden agents, threads and their order change.

Limit 10 m/s, cars are 4.5 m long.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.behaviour.test_right_of_way import ARMS, EAST_WAY, RULES, car, lanes
from tests.support.junction_lanes import network, straight

import interdrive as idr
from interdrive.native_settings import ViewSettings
from interdrive.scenario.control import Priorities
from interdrive.simulation import Simulation
from interdrive.testing.worlds import problem, world


def crowd(rng, least=2):
    """Agents on the four arms of a two-way cross, at random distances and speeds."""
    arms = rng.permutation(4)[: rng.integers(least, 5)]
    return [
        car(int(arm) + 1, ARMS[arm], float(rng.uniform(2.0, 45.0)), float(rng.uniform(2.0, 10.0)), -3.15, 400)
        for arm in arms
    ]


def orders_and_sight(problems, radius):
    """Agent -> its order; pairs of agents of which the first sees the second."""
    views = {one.id: ViewSettings(sensor_radius=radius) for one in problems}
    made = world(lanes(*ARMS), problems=problems)
    simulation = Simulation(made, views=views, settings=RULES, threads=1)
    scene = simulation.world.scene()
    orders, sees = {}, set()
    for agent in simulation.driving:
        view = simulation.world.view(scene, agent)
        orders[agent] = (view.ego.stop_s, view.ego.stop_release, view.ego.stop_by)
        sees |= {(agent, int(other)) for other in view.ids}
    return orders, sees


@pytest.mark.parametrize("block", range(4))
def test_who_does_not_see_an_agent_has_the_same_order_bit_by_bit_if_that_is_gone(block):
    compared = held = 0
    for seed in range(25 * block, 25 * (block + 1)):
        problems = crowd(np.random.default_rng(seed), least=3)
        orders, sees = orders_and_sight(problems, 32.0)
        for gone in problems:
            rest = [one for one in problems if one is not gone]
            alone, _ = orders_and_sight(rest, 32.0)
            unaware = [one.id for one in rest if (one.id, gone.id) not in sees]
            assert {i: alone[i] for i in unaware} == {i: orders[i] for i in unaware}, (seed, gone.id)
            compared += len(unaware)
            held += sum(orders[i][2] is not None for i in unaware)
    assert compared > 25 and held > 0, "there are agents that do not see others, some of which wait"


@pytest.mark.parametrize("seed", [3, 8])
def test_threads_and_the_order_of_agents_change_no_state_order_or_violation(seed):
    problems = crowd(np.random.default_rng(seed), least=4)
    # Agent 1 does not obey the limit of its lane, so that there are violations.
    lanelets = replace(lanes(*ARMS), speed_limit=np.array([1.0, 10.0, 10.0, 10.0]))
    runs = [
        idr.simulate(world(lanelets, problems=some), settings=RULES, rules={1: {"speed": False}}, threads=threads)
        for some, threads in ((problems, 1), (problems[::-1], 2), (problems[2:] + problems[:2], 8))
    ]
    assert runs[0].orders.to_arrow().num_rows > 0
    assert runs[0].violations.count("speeding") > 0
    for other in runs[1:]:
        assert other.digest == runs[0].digest
        assert other.orders.to_arrow().equals(runs[0].orders.to_arrow())
        assert other.violations.to_arrow().equals(runs[0].violations.to_arrow())


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_from_a_ramp_that_meets_a_road_an_agent_takes_no_right_of_way(planner):
    slanted = 0.25 * np.pi
    centers = {
        1: straight((-150.0, 0.0), (0.0, 0.0)),
        2: straight((-71.0, -71.0), (0.0, 0.0)),
        3: straight((0.0, 0.0), (200.0, 0.0)),
    }
    way = np.array([np.cos(slanted), np.sin(slanted)])
    goal = {"goal": (130.0, 0.0), "goal_size": (40.0, 3.5), "time_step": (0, 400)}
    problems = [problem(10 + k, -40.0 - 35.0 * k, 0.0, 10.0, **goal) for k in range(3)]
    problems.append(problem(20, *(-45.0 * way), 8.0, slanted, **goal))
    scenario = replace(
        world(network(centers, {1: (3,), 2: (3,)}, speed_limit=10.0), problems=problems),
        priorities=Priorities(minor=(2,), priority_side="right"),
    )
    run = idr.simulate(scenario, planner=planner, settings=RULES, threads=1)
    assert set(run.outcomes.outcome) == {"goal_reached"}
    assert run.violations.count("right_of_way") == 0
    passed = {int(i): int(np.argmax(run.states.x[row] > 0.0)) for row, i in enumerate(run.states.participant_id)}
    assert passed[10] < min(passed[i] for i in (11, 12, 20)), "the first one on the road is not held up"
    if planner == "rollout":
        on_road = [run.states.velocity[row][run.states.valid[row]] for row in range(3)]
        assert max(-np.diff(velocity).min() / 0.1 for velocity in on_road) < 3.1, (
            "m/s², comfortable, for one that waits"
        )


def test_a_lawful_drive_has_no_row():
    run = idr.simulate(world(lanes(EAST_WAY), problems=[car(1, EAST_WAY, 20.0)]), settings=RULES, threads=1)
    assert run.violations.to_arrow().num_rows == 0
