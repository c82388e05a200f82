"""Learners that enter after the first step: when they join, what is seen of them, and that runs say the same."""

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils.conversions import parallel_to_aec

from interdrive import InputError, Trajectory, envs, simulate
from interdrive.testing import Car, problem, straight_road, world

STATES = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
COAST = np.zeros(2, np.float32)
#: Numbers of the ego block before those of the partners: 16 of the ego, 12 of the goal, 128 of the route.
PARTNERS = 156


def late(number, start, x, velocity=10.0, goal=(150.0, 0.0), latest=300):
    return problem(number, x, velocity=velocity, goal=goal, time_step=(0, latest), start=start)


def road_with(*problems, cars=()):
    return world(straight_road(300.0), problems=problems, cars=cars, steps=200)


def two():
    """1 starts at 50 m, 2 at 10 m at time step 24; both at 10 m/s."""
    return road_with(late(1, 0, 50.0), late(2, 24, 10.0))


def played(env, action=COAST, steps=1000):
    """What the dicts of an episode hold, one entry per step."""
    told = []
    while env.agents and len(told) < steps:
        told.append((*env.step(dict.fromkeys(env.agents, action)), list(env.agents)))
    return told


def sees_partners(observation):
    return observation[PARTNERS::14].sum()


class Replays:
    """Drives where another run drove."""

    def __init__(self, states, agent):
        self._row, self._states = states.participant_id.tolist().index(agent), states

    def plan(self, view, _):
        now = slice(view.time_step, view.time_step + 2)
        return Trajectory(**{name: getattr(self._states, name)[self._row, now].copy() for name in STATES[:-1]})


def is_driven_alike(env, scenario, learners, traffic="recorded"):
    """A run in which planners drive the learners as they drove: the same states and outcomes."""
    run = env.run()
    planners = {number: (lambda number=number: Replays(run.states, number)) for number in learners}
    agents = learners if traffic == "recorded" else "all"
    again = simulate(
        scenario,
        agents=agents,
        planner={"default": traffic, **planners},
        predictor="lane_following",
        settings={"rules.precedence": False},
    )
    n = run.states.x.shape[1]
    for name in STATES:
        np.testing.assert_array_equal(getattr(run.states, name), getattr(again.states, name)[:, :n], err_msg=name)
    for row, number in enumerate(run.outcomes.agent_id.tolist()):
        if number in learners:
            other = again.outcomes.agent_id.tolist().index(number)
            assert run.outcomes.outcome[row] == again.outcomes.outcome[other]
            assert run.outcomes.message[row] == again.outcomes.message[other]
    return again


def test_a_planning_problem_that_begins_later_joins_at_its_step():
    env = envs.parallel_env(scenarios=two())
    observations, _ = env.reset(seed=0)
    assert (list(observations), env.agents, env.possible_agents) == (["agent_0"], ["agent_0"], ["agent_0", "agent_1"])
    assert env.agent_ids == {"agent_0": 1, "agent_1": 2}
    told = played(env)
    # The 24th step leads to time step 24.
    assert all(list(part) == ["agent_0"] for step in told[:23] for part in step)
    observation, rewards, ends, cuts, infos, agents = told[23]
    assert list(observation) == list(rewards) == list(ends) == list(cuts) == list(infos) == agents
    assert agents == ["agent_0", "agent_1"]
    assert (rewards["agent_1"], ends["agent_1"], cuts["agent_1"], infos["agent_1"]) == (0.0, False, False, {})
    assert observation["agent_1"][0] == pytest.approx(10.0 / 40.0)
    # 150 - 5 - 10 m and 150 - 5 - 50 m at 10 m/s, each from its own start on.
    ends = {name: info for step in told for name, info in step[4].items() if info}
    assert {name: (info["outcome"], info["seconds"]) for name, info in ends.items()} == {
        "agent_0": ("goal_reached", pytest.approx(9.5, abs=0.11)),
        "agent_1": ("goal_reached", pytest.approx(13.5, abs=0.11)),
    }


def test_nobody_sees_a_learner_before_it_enters():
    env, alone = (
        envs.parallel_env(scenarios=road_with(*p)) for p in ((late(1, 0, 50.0), late(2, 24, 10.0)), (late(1, 0, 50.0),))
    )
    env.reset(seed=0)
    alone.reset(seed=0)
    for step, (ours, theirs) in enumerate(zip(played(env, steps=24), played(alone, steps=24), strict=True), 1):
        assert np.array_equal(ours[0]["agent_0"], theirs[0]["agent_0"]) == (step < 24)
    assert sees_partners(ours[0]["agent_0"]) == sees_partners(ours[0]["agent_1"]) == 1


@pytest.mark.parametrize("traffic", ["recorded", "idm", "frenet"])
def test_a_run_drives_late_learners_to_the_same_bits(traffic):
    cars = [Car(7, 120.0, 0.0, 8.0, last=150), Car(8, 5.0, 0.0, 8.0, first=60, last=150)]
    scenario = road_with(late(1, 0, 50.0), late(2, 24, 10.0), cars=cars)
    env = envs.parallel_env(
        scenarios=scenario, learners=[1, 2], traffic=traffic, record=True, **{"simulation.rules.precedence": False}
    )
    env.reset(seed=0)
    played(env, np.array([0.03, 0.0], np.float32))
    is_driven_alike(env, scenario, [1, 2], traffic)


def test_two_learners_enter_at_the_same_step():
    env = envs.parallel_env(scenarios=road_with(late(1, 0, 60.0), late(2, 9, 5.0), late(3, 9, 30.0)), record=True)
    env.reset(seed=0)
    told = played(env)
    assert [step[5] for step in told[7:9]] == [["agent_0"], ["agent_0", "agent_1", "agent_2"]]
    is_driven_alike(env, road_with(late(1, 0, 60.0), late(2, 9, 5.0), late(3, 9, 30.0)), [1, 2, 3])


def test_a_step_lasts_until_the_next_one_enters_if_all_others_have_ended():
    scenario = road_with(late(1, 0, 130.0), late(2, 100, 10.0))
    env = envs.parallel_env(scenarios=scenario, record=True)
    env.reset(seed=0)
    told = played(env)
    last = next(step for step in told if step[4]["agent_0"])
    assert (last[2], last[5]) == ({"agent_0": True, "agent_1": False}, ["agent_1"])
    assert last[4]["agent_0"]["seconds"] == pytest.approx(1.5, abs=0.11)
    assert len(told) == pytest.approx(15 + 135, abs=2)
    # What it observes last is where it ended, in its goal, and not what is there when the other one enters.
    alone = envs.parallel_env(scenarios=road_with(late(1, 0, 130.0)))
    alone.reset(seed=0)
    np.testing.assert_array_equal(last[0]["agent_0"], played(alone)[-1][0]["agent_0"])
    is_driven_alike(env, scenario, [1, 2])


@pytest.mark.parametrize("action", [(0.0, 0.0), (-1.0, 0.0)], ids=["both_coast", "both_brake"])
@pytest.mark.parametrize("x", [42.0, 48.0, 52.0, 54.0])
def test_a_learner_that_enters_where_another_stands_ends_as_in_a_run(action, x):
    scenario = road_with(late(1, 0, 50.0, 0.5, latest=90), late(2, 10, x, 9.0, latest=90))
    env = envs.parallel_env(scenarios=scenario, record=True)
    env.reset(seed=0)
    assert "agent_1" in played(env, np.array(action, np.float32), steps=10)[-1][0]
    played(env, np.array(action, np.float32))
    again = is_driven_alike(env, scenario, [1, 2])
    # Contact counts once they have separated; only the one that enters behind the other one runs into it.
    assert ("collision" in again.outcomes.outcome) == (x == 42.0)


def test_a_recorded_vehicle_that_is_named_joins_when_it_enters():
    cars = [Car(5, 40.0, 0.0, 8.0, last=80), Car(7, 5.0, 0.0, 8.0, first=20, last=80)]
    env = envs.parallel_env(scenarios=road_with(cars=cars), learners=[5, 7])
    env.reset(seed=0)
    assert [step[5] for step in played(env, steps=20)][-2:] == [["agent_0"], ["agent_0", "agent_1"]]
    # All others that are recorded later replay their recording.
    assert envs.parallel_env(scenarios=road_with(cars=cars)).possible_agents == ["agent_0"]


def test_an_episode_ends_before_a_learner_enters_only_if_its_time_is_over():
    env = envs.parallel_env(scenarios=road_with(late(1, 0, 130.0), late(2, 100, 10.0)), max_seconds=5.0)
    env.reset(seed=0)
    told = played(env)
    assert told[-1][5] == []
    assert [list(step[0]) for step in told] == [["agent_0"]] * len(told)
    with pytest.raises(InputError, match="reset first"):
        env.step({})
    assert list(env.reset()[0]) == ["agent_0"]


@pytest.mark.parametrize("traffic", ["recorded", "idm"])
def test_a_single_learner_that_is_late_begins_at_its_step(traffic):
    cars = [Car(7, 60.0, 0.0, 6.0, last=200)]
    scenario = road_with(late(2, 24, 10.0), cars=cars)
    env = envs.DriveEnv(
        scenarios=scenario, learners=[2], traffic=traffic, record=True, **{"simulation.rules.precedence": False}
    )
    observation, info = env.reset(seed=0)
    assert (observation[0], info) == (pytest.approx(10.0 / 40.0), {})
    assert sees_partners(observation) == 1
    # Seconds to the latest end of the goal: 300 - 24 steps, clipped; 64.4 m ahead the other one.
    ahead = observation[PARTNERS + 1] * 80.0
    assert ahead == pytest.approx(50.0 + 2.4 * 6.0, abs=0.1 if traffic == "recorded" else 8.0)
    steps, ended = 0, False
    while not ended:
        _, _, terminated, truncated, info = env.step(np.array([-0.1, 0.0], np.float32))
        steps, ended = steps + 1, terminated or truncated
    assert info["steps"] == steps
    if traffic != "recorded":
        is_driven_alike(env, scenario, [2], traffic)


def test_every_class_takes_a_scenario_in_which_all_are_late():
    scenario = road_with(late(1, 30, 50.0), late(2, 24, 10.0))
    assert envs.parallel_env(scenarios=scenario).reset(seed=0)[0].keys() == {"agent_1"}
    assert envs.DriveVectorEnv(3, scenarios=scenario).reset(seed=0)[0][:, 0].tolist() == [0.25] * 3
    rows = envs.Rows(1, scenarios=scenario)
    rows.reset()
    assert (rows.masks.tolist(), rows.agent_ids.tolist(), rows.outcomes.tolist()) == ([False, True], [1, 2], [-1, 0])


def test_a_recording_in_which_nobody_drives_at_first_begins_with_the_first():
    cars = [Car(5, 20.0, 0.0, 8.0, first=3, last=80), Car(6, 50.0, 0.0, 8.0, first=3, last=80)]
    env = envs.parallel_env(scenarios=road_with(cars=cars))
    env.reset(seed=0)
    assert env.agent_ids == {"agent_0": 5, "agent_1": 6}


def test_a_decision_ends_when_a_learner_enters_that_has_to_decide():
    env = envs.parallel_env(scenarios=two(), decision_seconds=1.0, record=True)
    env.reset(seed=0)
    told = played(env, np.array([0.1, 0.0], np.float32))
    # 10, 10 and 4 time steps, then it decides for the first time.
    assert [step[5] for step in told[:3]] == [["agent_0"], ["agent_0"], ["agent_0", "agent_1"]]
    assert told[2][0]["agent_1"][0] == pytest.approx(10.0 / 40.0)
    again = is_driven_alike(env, two(), [1, 2])
    row = again.states.participant_id.tolist().index(2)
    # 4 m/s² times 0.1 from its first step on.
    assert again.states.velocity[row, 25] == pytest.approx(10.04, abs=1e-6)


def test_the_last_observation_is_that_of_the_end_within_a_decision():
    def last(seconds):
        env = envs.DriveEnv(
            scenarios=road_with(late(1, 0, 50.0), cars=[Car(7, 160.0, last=200)]),
            learners=[1],
            decision_seconds=seconds,
        )
        env.reset(seed=0)
        ended = False
        while not ended:
            observation, _, ended, _, info = env.step(COAST)
        return observation, info["steps"]

    (one, steps), (seven, again) = last(0.1), last(0.7)
    assert steps == again
    np.testing.assert_array_equal(one, seven)


def rows_of(threads, **more):
    """Four worlds: scenarios with and without late learners are drawn."""
    scenarios = [two(), road_with(late(1, 0, 50.0)), road_with(late(1, 0, 130.0), late(2, 60, 10.0), late(3, 60, 40.0))]
    return envs.Rows(4, scenarios=scenarios, threads=threads, traffic="idm", seed=1, **more)


def test_rows_of_late_learners_are_masked_until_they_enter_on_any_number_of_threads():
    def driven(threads):
        rows, kept = rows_of(threads, keep_final=True), []
        rows.reset()
        rng = np.random.default_rng(0)
        for _ in range(300):
            rows.step(rng.uniform(-0.3, 0.3, rows.actions.shape).astype(np.float32))
            arrays = (
                rows.observations,
                rows.rewards,
                rows.masks,
                rows.outcomes,
                rows.agent_ids,
                rows.final_observations,
            )
            kept.append([array.copy() for array in arrays])
        return kept

    one = driven(1)
    for threads in (2, 8):
        for ours, theirs in zip(one, driven(threads), strict=True):
            for a, b in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(a, b)
    joined = 0
    for before, (observations, rewards, masks, outcomes, ids, _) in pairwise(one):
        assert not observations[~masks].any()
        # The outcome of a learner that ended in this call is told beside the next episode.
        assert {-1} >= set(outcomes[(ids == -1) & (before[4] == -1)].tolist())
        entered = ~before[2] & masks & (before[4] == ids) & (before[3] == -1)
        assert not rewards[entered].any()
        joined += entered.sum()
    assert joined > 5


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vectorised_worlds_with_late_learners_equal_single_environments(mode):
    settings = {"scenarios": [two(), road_with(late(2, 24, 10.0), cars=[Car(7, 60.0, 0.0, 6.0)])], "traffic": "idm"}
    native = envs.DriveVectorEnv(3, autoreset_mode=mode, **settings)
    several = SyncVectorEnv([lambda: envs.DriveEnv(**settings)] * 3, autoreset_mode=mode)
    a, b = native.reset(seed=5), several.reset(seed=5)
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(200):
        np.testing.assert_array_equal(a[0], b[0])
        given = rng.uniform(-0.5, 0.5, (3, 2)).astype(np.float32)
        a, b = native.step(given), several.step(given)
        for ours, theirs in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
        over = a[2] | a[3]
        ends += over.sum()
        if mode == AutoresetMode.DISABLED and over.any():
            a, b = (env.reset(options={"reset_mask": over}) for env in (native, several))
    assert ends > 3


@pytest.mark.parametrize("before", [10, 23, 24, 30], ids=lambda n: f"after_{n}_steps")
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_from_before_and_after_the_entry_go_on_alike(before, copied):
    env = envs.parallel_env(scenarios=two(), traffic="idm")
    env.reset(seed=0)
    played(env, steps=before)
    other = copied(env)
    ours, theirs = (played(one, np.array([0.02, 0.0], np.float32)) for one in (env, other))
    assert len(ours) == len(theirs)
    for a, b in zip(ours, theirs, strict=True):
        assert a[1:] == b[1:]
        assert all(np.array_equal(a[0][name], b[0][name]) for name in {**a[0], **b[0]})
    assert other.agent_ids == env.agent_ids


def test_episodes_with_late_learners_are_repeated_by_their_seed():
    env = envs.parallel_env(scenarios=[two(), road_with(late(1, 5, 50.0))], learners=1)
    episodes = []
    for seed in (3, 4, 3):
        env.reset(seed=seed)
        told = []
        for _ in range(3):
            told += [step[1] for step in played(env)]
            env.reset()
        episodes.append(told)
    assert episodes[0] == episodes[2]


def test_one_of_n_drawn_learners_may_enter_later():
    env = envs.parallel_env(scenarios=two(), learners=2)
    env.reset(seed=0)
    assert (len(env.possible_agents), env.agents) == (2, ["agent_0"])
    drawn = set()
    single = envs.DriveEnv(scenarios=two())
    for seed in range(10):
        single.reset(seed=seed)
        drawn.add(int(single._engine.buffers.agent_ids[0]))
    assert drawn == {1, 2}


def test_late_learners_take_part_from_random_first_steps_on():
    cars = [Car(7, 60.0, 0.0, 6.0, last=100)]
    env = envs.parallel_env(scenarios=road_with(late(2, 24, 10.0), cars=cars), start="random")
    met = set()
    for seed in range(20):
        env.reset(seed=seed)
        played(env, steps=40)
        met |= set(env.agent_ids.values())
    assert met == {2, 7}


@pytest.mark.parametrize(
    "actions", [envs.FrenetWeights(), envs.FrenetTarget(), envs.KinematicGrid()], ids=lambda a: type(a).__name__
)
def test_late_learners_have_every_kind_of_action(actions):
    env = envs.parallel_env(scenarios=two(), actions=actions)
    env.reset(seed=0)
    middle = 45 if isinstance(actions, envs.KinematicGrid) else np.zeros(env.action_space("agent_0").shape, np.float32)
    outcomes = {name: info["outcome"] for step in played(env, middle) for name, info in step[4].items() if info}
    assert outcomes == {"agent_0": "goal_reached", "agent_1": "goal_reached"}


@pytest.mark.parametrize("observation", [{}, {"observation.raster": True, "observation.predictions": True}])
def test_the_checkers_of_others_accept_late_learners(observation):
    def made():
        return envs.parallel_env(scenarios=road_with(late(1, 0, 130.0), late(2, 24, 10.0)), **observation)

    parallel_api_test(made(), num_cycles=1000)
    parallel_seed_test(made)
    if not observation:  # Dictionaries make it warn.
        api_test(parallel_to_aec(made()), num_cycles=100)
    check_env(envs.DriveEnv(scenarios=road_with(late(2, 24, 10.0)), **observation), skip_render_check=True)
