"""Environments: what a step is, how episodes end, what is drawn, and that all of them say the same."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from interdrive import InputError, Trajectory, envs, simulate
from interdrive._core import REWARDS
from interdrive.native_settings import RewardWeights
from interdrive.testing import Car, problem, straight_road, world

#: Learns in the shipped scenarios.
PROBLEM = 2001


def actions(rng, *shape):
    return rng.uniform(-1, 1, shape).astype(np.float32)


def alone(**settings):
    """One car at 10 m/s on a straight road, 50 m before a goal of 10 m."""
    road = straight_road(300.0)
    start = problem(1, 20.0, velocity=10.0, goal=(70.0, 0.0), time_step=settings.pop("time_step", (1, 100)))
    cars = settings.pop("cars", ())
    return envs.DriveEnv(scenarios=world(road, problems=[start], cars=cars), **settings)


def driven(env, action, steps=1000):
    env.reset(seed=0)
    rewards = []
    for _ in range(steps):
        observation, reward, ended, cut, info = env.step(np.asarray(action, np.float32))
        rewards.append(reward)
        if ended or cut:
            return rewards, ended, cut, info, observation
        assert info == {}
    raise AssertionError("it never ends")


def test_coasting_reaches_the_goal_and_is_rewarded_for_the_way_and_the_goal():
    rewards, ended, cut, info, _ = driven(alone(), (0, 0))
    assert (ended, cut, info["outcome"], info["is_success"]) == (True, False, "goal_reached", True)
    # 45 m at 10 m/s to where the goal begins.
    assert info["seconds"] == pytest.approx(4.5, abs=0.11)
    assert info["distance"] == pytest.approx(45.0, abs=1.1)
    assert info["return"] == pytest.approx(2.0, abs=0.05)
    assert sum(rewards) == pytest.approx(info["return"], abs=1e-5)


@pytest.mark.parametrize(
    ("settings", "action", "outcome", "ended", "cut"),
    [
        ({}, (0, 0.2), "collision", True, False),  # off the road
        ({"cars": [Car(7, 45.0)]}, (0, 0), "collision", True, False),  # a car that stands
        ({"time_step": (1, 30)}, (-0.05, 0), "goal_reached_late", True, False),
        ({"time_step": (1, 20)}, (-1, 0), "time_limit", False, True),
        ({"time_step": (1, 20), "time_limit": "termination"}, (-1, 0), "time_limit", True, False),
        ({"time_step": (60, 100)}, (0, 0), "goal_missed", True, False),
        ({}, (np.nan, 0), "planner_error", True, False),
        ({"max_seconds": 1.0}, (0, 0), "running", False, True),
    ],
)
def test_reward_end_and_outcome_belong_to_one_step(settings, action, outcome, ended, cut):
    env = alone(**settings)
    rewards, was_ended, was_cut, info, _ = driven(env, action)
    assert (info["outcome"], was_ended, was_cut) == (outcome, ended, cut)
    assert info["steps"] == len(rewards)
    weights = env._engine.setup.settings.reward
    weighted = sum(getattr(weights, name) * amount for name, amount in info["components"].items())
    assert weighted == pytest.approx(info["return"], abs=1e-9)
    off_road = outcome == "collision" and not settings
    assert info["off_road"] is off_road
    assert info["partner_id"] == (7 if "cars" in settings else -1)
    with pytest.raises(InputError, match="reset first"):
        env.step(np.zeros(2, np.float32))


def test_a_decision_that_lasts_longer_adds_up_its_rewards():
    one, _, _, first, _ = driven(alone(), (0.1, 0))
    two, _, _, second, _ = driven(alone(decision_seconds=0.5), (0.1, 0))
    assert first == second
    assert sum(one[:5]) == pytest.approx(two[0], abs=1e-6)
    assert len(two) == -(-len(one) // 5)


def test_a_learner_reverses_only_if_it_starts_so_and_brakes_whatever_it_asks_for():
    start = problem(1, 20.0, velocity=-2.0, goal=(70.0, 0.0), time_step=(1, 100))
    env = envs.DriveEnv(scenarios=world(straight_road(300.0), problems=[start]), record=True, max_seconds=2.0)
    driven(env, [1.0, 0.0])
    speeds = env.unwrapped.run().states.velocity[0]
    # It brakes with 8 m/s², and then accelerates with 4 m/s².
    assert speeds[:5] == pytest.approx([-2.0, -1.2, -0.4, 0.0, 0.4])
    driven(env, [-1.0, 0.0])
    assert env.unwrapped.run().states.velocity[0, 3:].max() == env.unwrapped.run().states.velocity[0, 3:].min() == 0.0


def test_a_learner_that_rolls_backwards_loses_progress_and_pays_for_its_speed_but_for_no_headway():
    start = problem(1, 20.0, velocity=-4.0, goal=(70.0, 0.0), time_step=(1, 100))
    road = replace(straight_road(300.0), speed_limit=np.array([3.0]))
    scenario = world(road, problems=[start], cars=[Car(7, 25.5)])
    weights = RewardWeights(headway=-1.0, overspeed=-1.0)
    env = envs.DriveEnv(scenarios=scenario, reward=weights)
    env.reset(seed=0)
    env.step(np.array([1.0, 0.0], np.float32))
    amounts = dict(zip(REWARDS, env._engine.buffers.components[0], strict=True))
    # From 4.0 to 3.2 m/s backwards with 8 m/s², 45 m before the goal.
    assert amounts["progress"] == pytest.approx(-0.36 / 45.0, rel=0.1)
    assert amounts["overspeed"] == pytest.approx(0.1 * (3.2 / 3.0 - 1.0))
    assert amounts["acceleration"] == pytest.approx(0.1 * (8.0 / 4.0) ** 2)
    assert amounts["headway"] == 0.0
    assert min(amount for name, amount in amounts.items() if name != "progress") >= 0.0


def test_a_learner_that_rolls_backwards_into_a_car_pays_for_the_speed_of_the_impact():
    start = problem(1, 20.0, velocity=-4.0, goal=(70.0, 0.0), time_step=(1, 100))
    env = envs.DriveEnv(scenarios=world(straight_road(300.0), problems=[start], cars=[Car(7, 15.2)]))
    *_, info, _ = driven(env, (1.0, 0.0))
    assert (info["outcome"], info["partner_id"]) == ("collision", 7)
    # After 0.3 m with 8 m/s².
    assert info["components"]["collision_speed"] == pytest.approx(0.1 * math.sqrt(4.0**2 - 2.0 * 8.0 * 0.3), abs=1e-3)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_many_worlds_in_one_call_equal_as_many_single_environments(mode):
    n, settings = 3, {"scenarios": ["t_junction", "lane_merge"], "start": "random"}
    native = envs.DriveVectorEnv(num_envs=n, autoreset_mode=mode, **settings)
    several = SyncVectorEnv([lambda: envs.DriveEnv(**settings)] * n, autoreset_mode=mode)
    rng = np.random.default_rng(0)
    a, b = native.reset(seed=5), several.reset(seed=5)
    np.testing.assert_array_equal(a[0], b[0])
    ends = 0
    for _ in range(500):
        given = actions(rng, n, 2)
        a, b = native.step(given), several.step(given)
        for ours, theirs in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
        assert sorted(a[4]) == sorted(b[4])
        if "final_obs" in a[4]:
            for i in np.flatnonzero(a[4]["_final_obs"]):
                np.testing.assert_array_equal(a[4]["final_obs"][i], b[4]["final_obs"][i])
        over = a[2] | a[3]
        ends += over.sum()
        if mode == AutoresetMode.DISABLED and over.any():
            a, b = (env.reset(options={"reset_mask": over}) for env in (native, several))
            np.testing.assert_array_equal(a[0], b[0])
    assert ends > 3


def rows_driven(threads, num_worlds, steps=60):
    rows = envs.Rows(
        num_worlds,
        scenarios=["t_junction", "intersection"],
        start="random",
        traffic="idm",
        slots=3,
        threads=threads,
        seed=3,
    )
    rows.reset()
    rng = np.random.default_rng(1)
    kept = []
    for _ in range(steps):
        rows.step(np.repeat(actions(rng, 1, 2), rows.num_agents, axis=0))
        kept.append([rows.observations.copy(), rows.rewards.copy(), rows.outcomes.copy(), rows.agent_ids.copy()])
    return kept


def test_results_do_not_depend_on_threads_or_on_the_number_of_worlds():
    one = rows_driven(1, 4)
    for threads, num_worlds in [(2, 4), (8, 4), (2, 7)]:
        for ours, theirs in zip(one, rows_driven(threads, num_worlds), strict=True):
            for a, b in zip(ours, theirs, strict=True):
                np.testing.assert_array_equal(a, b[: len(a)])


def test_episodes_are_repeated_by_their_seed():
    def whole(seed):
        env = envs.parallel_env(scenarios=["t_junction", "lane_merge"], learners=3, start="random")
        rng, kept = np.random.default_rng(0), []
        env.reset(seed=seed)
        for _ in range(2):
            while env.agents:
                told = env.step({name: actions(rng, 2) for name in env.agents})
                kept.append((told[0], told[1]))
            env.reset()
        return kept

    a, b, other = whole(4), whole(4), whole(5)
    assert len(a) == len(b)
    for (first, rewards), (second, again) in zip(a, b, strict=True):
        assert rewards == again
        assert all(np.array_equal(first[name], second[name]) for name in first)
    assert len(other) != len(a) or other[0][1] != a[0][1]


def test_agents_that_end_leave_and_their_actions_are_ignored():
    env = envs.parallel_env(scenarios="t_junction")
    _, infos = env.reset(seed=0)
    # TorchRL makes tensors of all infos if there are any at a reset, and cannot make them of words.
    assert infos == {name: {} for name in env.agents}
    assert [env.agent_ids[name] for name in env.agents] == sorted(env.agent_ids.values())
    ids = dict(env.agent_ids)
    rng = np.random.default_rng(0)
    n, state = len(env.agents), env.state()
    assert state.shape == (len(env.possible_agents) * 324,)
    while len(env.agents) == n:
        observations, _, terminations, truncations, infos = env.step(
            {name: actions(rng, 2) for name in env.possible_agents}
        )
    gone = [name for name in terminations if terminations[name] or truncations[name]]
    assert gone
    assert not set(gone) & set(env.agents)
    assert all(np.abs(observations[name]).sum() > 0 and infos[name]["outcome"] for name in gone)
    assert [infos[name]["agent_id"] for name in gone] == [ids[name] for name in gone]
    row = env.possible_agents.index(gone[0])
    assert not env.state().reshape(-1, 324)[row].any()


def test_rows_are_written_into_arrays_of_the_caller_and_tell_of_the_end():
    mine = np.zeros((8, 324), np.float32)
    rows = envs.Rows(2, slots=4, scenarios="t_junction", buf={"observations": mine}, keep_final=True)
    assert rows.reset(seed=0) is mine
    assert rows.masks.all()
    rng = np.random.default_rng(0)
    ended = []
    while len(ended) < 20:
        rows.step(actions(rng, 8, 2))
        for info in rows.infos():
            ended.append(info)
            row = info["row"]
            assert rows.terminals[row] != rows.truncations[row]
            assert np.abs(rows.final_observations[row]).sum() > 0
        quiet = ~(rows.terminals | rows.truncations)
        assert not mine[~rows.masks & quiet].any()
    assert rows.observations is mine
    assert {info["outcome"] for info in ended} <= {
        "collision",
        "goal_reached",
        "goal_missed",
        "time_limit",
        "goal_reached_late",
    }


class Replays:
    """Drives where another run drove."""

    def __init__(self, states, agent):
        self._row = states.participant_id.tolist().index(agent)
        self._states = states

    def plan(self, view, _):
        now = slice(view.time_step, view.time_step + 2)
        names = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
        return Trajectory(**{name: getattr(self._states, name)[self._row, now].copy() for name in names})


@pytest.mark.parametrize("traffic", ["frenet", "idm", "idm_mobil", "velocity_adjusting", "recorded"])
@pytest.mark.parametrize("scenario", ["t_junction", "lane_merge"])
@pytest.mark.parametrize("precedence", [False, True])
def test_an_environment_and_a_run_of_the_same_drives_have_the_same_bits(scenario, traffic, precedence):
    """With orders at junctions, too: a learner gets none, and others do not count on it."""
    rules = {"rules.precedence": precedence}
    orders = {f"simulation.{name}": value for name, value in rules.items()}
    env = envs.DriveEnv(scenarios=scenario, learners=[PROBLEM], traffic=traffic, record=True, **orders)
    *_, info, _ = driven(env, (0.05, 0))
    run = env.run()
    agents = "all" if traffic != "recorded" else [PROBLEM]
    again = simulate(
        scenario,
        agents=agents,
        planner={"default": traffic, PROBLEM: lambda: Replays(run.states, PROBLEM)},
        predictor="lane_following",
        threads=1,
        settings={"step.max_steps": info["steps"], **rules},
    )
    n = info["steps"] + 1
    for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid"):
        np.testing.assert_array_equal(
            getattr(run.states, name)[:, :n], getattr(again.states, name)[:, :n], err_msg=name
        )
    assert run.outcomes.outcome[run.outcomes.agent_id.tolist().index(PROBLEM)] == info["outcome"]


def test_recorded_drivers_act_as_the_model_needs_to_follow_them():
    env = envs.DriveEnv(scenarios="t_junction", learners=[1005])
    given, valid = env.recorded_actions(1005)
    assert given.shape == (len(valid), 2)
    assert valid.mean() > 0.8
    observation, _ = env.reset(seed=0)
    ended = cut = False
    step = 0
    while not (ended or cut) and valid[step]:
        observation, _, ended, cut, _ = env.step(given[step])
        step += 1
    assert observation.any()
    assert step > 20


def test_a_learner_does_not_observe_what_others_will_do():
    cars = [Car(7, 60.0, 0.0, 8.0, last=100)]
    later = [Car(7, 60.0, 0.0, 8.0, last=20)]
    seen = []
    for recorded in (cars, later):
        env = alone(cars=recorded)
        seen.append([env.reset(seed=0)[0]] + [env.step(np.zeros(2, np.float32))[0] for _ in range(20)])
    np.testing.assert_array_equal(seen[0], seen[1])


def test_a_learner_does_not_observe_what_another_is_about_to_do():
    seen = []
    for pedal in (1.0, -1.0):
        env = envs.parallel_env(scenarios="lane_merge", learners=2)
        observed = [env.reset(seed=0)[0]["agent_0"]]
        for step in range(6):
            given = {"agent_0": np.zeros(2), "agent_1": np.array([0.0 if step < 5 else pedal, 0.0])}
            observed.append(env.step(given)[0]["agent_0"])
        seen.append(np.array(observed))
    # The sixth decision shows after it was taken, not when the other had made up its mind.
    np.testing.assert_array_equal(seen[0][:6], seen[1][:6])
    assert not np.array_equal(seen[0][6], seen[1][6])


def test_scenarios_are_divided_by_place_and_both_parts_together_are_all():
    names = ["ZAM_A-1_1", "ZAM_A-1_2", "ZAM_B-1_1", "ZAM_C-1_1", "ZAM_D-2_1", "ZAM_E-1_1"]
    base = world(straight_road(300.0), problems=[problem(1, 20.0, goal=(70.0, 0.0), time_step=(1, 100))])
    from dataclasses import replace

    from interdrive.envs.settings import setup_of
    from interdrive.envs.stages import stages_of

    scenarios = [replace(base, name=name) for name in names]

    def part(which):
        setup = setup_of({"scenarios": scenarios, "part": which, "test_share": 0.5}, learners=1)
        return [stage.scenario.name for stage in stages_of(setup)]

    train, test = part("train"), part("test")
    assert sorted(train + test) == names
    assert train
    assert test
    assert ("ZAM_A-1_1" in train) == ("ZAM_A-1_2" in train)


def test_updates_hold_from_the_next_episode_on():
    env = alone()
    before = driven(env, (0, 0))[3]["return"]
    env.update(**{"reward.goal_reached": 5.0})
    assert driven(env, (0, 0))[3]["return"] == pytest.approx(before + 4.0)
    with pytest.raises(InputError, match="cannot be changed"):
        env.update(threads=2)


def test_gymnasium_makes_the_native_environment_and_its_wrappers_work():
    env = gymnasium.make_vec("interdrive/TJunction-v1", num_envs=2, vectorization_mode="vector_entry_point")
    assert isinstance(env.unwrapped, envs.DriveVectorEnv)
    wrapped = gymnasium.wrappers.NormalizeObservation(
        gymnasium.wrappers.RecordEpisodeStatistics(envs.DriveEnv(scenarios="t_junction"))
    )
    wrapped.reset(seed=0)
    info = {}
    while not info:
        *_, info = wrapped.step(np.array([0.5, 0.1], np.float32))
    assert info["episode"]["l"] == info["steps"]


def test_failures_raise_what_is_drawn_by_the_hardest_sampler():
    sampler = envs.Hardest()
    sampler.begin(2)
    for _ in range(20):
        sampler.ended(0, ["goal_reached"], [{}])
        sampler.ended(1, ["collision"], [{}])
    rng = np.random.default_rng(0)
    share = np.mean([sampler.draw(rng) for _ in range(2000)])
    assert share == pytest.approx(0.75, abs=0.05)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (envs.DriveEnv, "scenarios: must be given: files, folders or names of shipped scenarios"),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", learners=2),
            "learners: DriveEnv has one, 2 given; use parallel_env",
        ),
        (
            lambda: envs.parallel_env(scenarios="t_junction", learners=9),
            "learners: no scenario has 9 vehicles that can learn; the most is 8 (t_junction)",
        ),
        (
            lambda: envs.parallel_env(scenarios=["t_junction", "lane_merge", "highway"], learners=[PROBLEM]),
            "learners: ids need exactly one scenario, 3 given",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", **{"reward.colision": 1.0}),
            "reward.colision: unknown; did you mean reward.collision?",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", decision_seconds=0.15),
            "decision_seconds: 0.15 is not a multiple of dt = 0.1 (t_junction)",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", render_mode="human"),
            'render_mode: "human" is not offered; use run()',
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", part="test", test_share=0.0),
            'part: none of 1 scenarios belongs to "test"',
        ),
        (
            lambda: envs.Rows(1, scenarios="t_junction", buf={"rewards": np.zeros(8)}),
            "buf.rewards: float64 given, float32 expected",
        ),
        (
            lambda: envs.Rows(1, scenarios="t_junction", buf={"observations": np.zeros((8, 648), np.float32)[:, ::2]}),
            "buf.observations: not C-contiguous",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction").step(np.zeros(2, np.float32)),
            "step: reset first",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction").reset(seed=-1),
            "seed must not be negative, is -1",
        ),
        (
            lambda: envs.DriveEnv(scenarios="t_junction", actions=envs.KinematicGrid(accelerations=4)),
            "actions: a grid of 4 x 13 has no middle; both must be odd",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(make, text):
    with pytest.raises(InputError) as refused:
        make()
    assert str(refused.value) == text


def test_wrong_actions_are_refused_and_change_nothing():
    rows = envs.Rows(1, slots=4, scenarios="t_junction", actions=envs.KinematicGrid())
    rows.reset()
    before = rows.observations.copy()
    with pytest.raises(InputError, match="actions: 91 at row 3, there are 0 to 90"):
        rows.step(np.array([0, 0, 0, 91], np.int32))
    with pytest.raises(InputError, match=r"actions: shape \(3,\) given, \(4,\) expected"):
        rows.step(np.zeros(3, np.int32))
    np.testing.assert_array_equal(rows.observations, before)
    env = envs.parallel_env(scenarios="t_junction")
    env.reset(seed=0)
    with pytest.raises(InputError, match='actions: "agent_9" is not one of the 8 possible agents'):
        env.step({"agent_9": np.zeros(2)})
    read_only = np.zeros(8, np.float32)
    read_only.setflags(write=False)
    with pytest.raises(InputError, match=r"buf\.rewards: read-only"):
        envs.Rows(1, scenarios="t_junction", buf={"rewards": read_only})
    worlds = envs.DriveVectorEnv(2, autoreset_mode="DISABLED", scenarios="t_junction", max_seconds=0.1)
    worlds.reset(seed=0)
    worlds.step(np.zeros((2, 2)))
    with pytest.raises(InputError, match=r"step: world 0 has ended; reset it \(autoreset is off\)"):
        worlds.step(np.zeros((2, 2)))


def test_terms_of_the_reward_are_those_of_the_settings():
    assert list(envs.RewardWeights.__dataclass_fields__) == REWARDS


def test_the_page_lists_every_number_that_is_observed():
    root = Path(__file__).parents[2]
    spec = importlib.util.spec_from_file_location("observation_page", root / "crates/python/observation.py")
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert page.PAGE.read_text(encoding="utf-8") == page.page()
