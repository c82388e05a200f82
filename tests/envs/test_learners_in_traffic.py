"""Learners among generated traffic: other vehicles in every episode, the same for the same seed."""

import pickle
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from interdrive import InputError, TrafficSettings, envs
from interdrive.run.flows import lane_flows
from interdrive.testing import Car, problem, straight_road, world

PROBLEM = 2001
TRAFFIC = "idm,rate=900,duration=20"


def road(**others):
    lanelets = straight_road(300.0, 2)
    lanelets = replace(lanelets, speed_limit=np.full(2, 15.0))
    return world(
        lanelets,
        steps=30,
        problems=[problem(PROBLEM, 40.0, 0.0, 10.0, goal=(280.0, 0.0), time_step=(1, 400))],
        **others,
    )


def made(traffic=TRAFFIC, scenario=None, **more):
    return envs.DriveEnv(
        scenarios=road() if scenario is None else scenario, traffic=traffic, record=True, max_seconds=8.0, **more
    )


def played(env, seed=None):
    """The run of an episode in which the learner keeps its speed."""
    env.reset(seed=seed)
    done = False
    while not done:
        *_, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
        done = terminated or truncated
    return env.run()


def test_a_learner_drives_among_vehicles_that_enter_and_are_there():
    run = played(made(), 1)
    generated = [agent.id for agent in run.agents if agent.origin == "generated"]
    assert len(generated) > 5
    first = run.states.valid[:, 0]
    assert first.sum() > 2, "the map is filled at first"
    assert np.isfinite(run.demand.entered[~np.isnan(run.demand.due)]).any()
    assert {name for i, name in zip(run.outcomes.agent_id, run.outcomes.planner, strict=True) if i in generated} == {
        "idm"
    }
    assert {row.side for row in lane_flows(run)} == {"in", "out"}
    assert run.settings["agents"] == [PROBLEM]


def test_every_episode_has_its_own_demand_and_a_seed_repeats_it():
    env = made()
    first, second = played(env, 3), played(env)
    assert first.digest != second.digest
    assert first.demand.due.tolist() != second.demand.due.tolist()
    assert [played(env, 3).digest, played(env).digest] == [first.digest, second.digest]


def test_copies_and_pickles_go_on_to_the_same_traffic():
    env = made()
    env.reset(seed=5)
    for other in (deepcopy(env), pickle.loads(pickle.dumps(env))):
        expected = deepcopy(env)
        assert played(other).digest == played(expected).digest


def test_neither_threads_nor_other_worlds_change_a_world():
    def driven(num_worlds, threads):
        rows = envs.Rows(num_worlds, scenarios=road(), learners=1, traffic=TRAFFIC, seed=2, threads=threads)
        rows.reset()
        kept = []
        for _ in range(150):
            rows.step(np.full_like(rows.actions, 0.1))
            kept.append(rows.observations[0].copy())
        return np.array(kept)

    alone = driven(1, 1)
    assert len(np.unique(alone[:, 0])) > 1
    for num_worlds, threads in ((3, 2), (5, 8)):
        np.testing.assert_array_equal(driven(num_worlds, threads), alone)


def test_recorded_vehicles_make_room_unless_they_are_kept():
    scenario = road(cars=[Car(7, 150.0, 0.0, 10.0, last=29)])
    assert 7 not in played(made(scenario=scenario), 1).states.participant_id
    kept = played(made(f"recorded,{TRAFFIC}", scenario), 1)
    assert 7 in kept.states.participant_id
    assert any(agent.origin == "generated" for agent in kept.agents)
    driven = played(made("idm", scenario, **{"simulation.traffic.rate": 600.0}), 1)
    assert {7, PROBLEM} < {agent.id for agent in driven.agents}


def test_an_episode_that_begins_later_has_traffic_from_then_on():
    scenario = world(straight_road(300.0, 2), steps=100, cars=[Car(7, 30.0, 3.5, 10.0, last=99)])
    env = made(f"recorded,{TRAFFIC}", scenario, learners=[7], start="random")
    runs = [played(env, seed) for seed in range(4)]
    assert max(run.states.first_time_step for run in runs) > 0
    for run in runs:
        begin = run.states.first_time_step * run.scenario.dt
        assert np.nanmin(run.demand.due) >= begin
        assert run.states.valid[:, 0].sum() > 2
        hours = run.states.n_steps * run.scenario.dt / 3600.0
        counted = [row for row in lane_flows(run) if row.side == "in"]
        assert sum(row.vehicles for row in counted) == np.isfinite(run.demand.entered[~np.isnan(run.demand.due)]).sum()
        assert all(row.flow == pytest.approx(row.vehicles / hours) for row in counted)


def test_other_traffic_comes_with_the_next_episode():
    env = made()
    env.reset(seed=4)
    env.update(traffic="idm,rate=300,duration=20,density=0")
    changed = played(env, 4)
    assert changed.digest == played(made("idm,rate=300,duration=20,density=0"), 4).digest
    with pytest.raises(InputError, match="recorded vehicles cannot come or go"):
        made("recorded", road(cars=[Car(7, 150.0, 0.0, 10.0, last=29)])).update(traffic=TRAFFIC)


@pytest.mark.parametrize(
    ("traffic", "words"),
    [
        ("rate=abc", "traffic.rate"),
        ("rate=-3", "must be at least 0"),
        ("rate=2400", "below 2400"),
        ("rate=600,durration=3", "durration"),
        ("rates=[77:300]", "lanelet 77 is no entry"),
        ("rate=0", "there is none"),
        ("recorded,rate=0", "there is none"),
        ("idmm,rate=600", "idmm"),
        ("recorded_path,rate=600", "recorded_path"),
        ({"rate": "abc"}, "traffic.rate"),
        (TrafficSettings(), "there is none"),
        ("idm,rate=600,warm_up=70", "warm_up"),
        ("rate=600,duration=90000", "step.max_steps"),
    ],
)
def test_traffic_that_cannot_be_is_refused_in_one_line(traffic, words):
    with pytest.raises(InputError, match=words) as caught:
        made(traffic)
    assert "\n" not in str(caught.value)


def test_a_map_without_planning_problems_says_who_can_learn():
    scenario = world(straight_road(300.0, 2), cars=[Car(7, 150.0, 0.0, 10.0, last=29)], steps=30)
    with pytest.raises(InputError, match="leaves only planning problems"):
        made(scenario=scenario)
