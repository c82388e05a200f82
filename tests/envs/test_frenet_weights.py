"""Actions that change the cost weights of the sampling planner."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

from interdrive import Frenet, InputError, envs, simulate
from interdrive.native_settings import FrenetWeights as CostWeights
from interdrive.native_settings import RewardWeights

PROBLEM = 2001
#: Behind ego, goal, route and partners: powers of four weights, 13 amounts, three flags.
POWERS, AMOUNTS, STATUS = slice(324, 328), slice(328, 341), slice(341, 344)


def at_the_junction(**settings):
    return envs.DriveEnv(scenarios="t_junction", learners=[PROBLEM], traffic="idm", record=True, **settings)


def driven(env, action):
    observation, _ = env.reset(seed=0)
    seen, info = [observation], {}
    while not info:
        observation, *_, info = env.step(np.asarray(action, np.float32))
        seen.append(observation)
    return np.array(seen), info


@pytest.mark.parametrize("change", ["absolute", "additive"])
def test_zeros_drive_exactly_as_the_planner_of_a_run(change):
    env = at_the_junction(actions=envs.FrenetWeights(change=change))
    _, info = driven(env, np.zeros(4))
    run = simulate("t_junction", planner={"default": "idm", PROBLEM: "frenet"}, predictor="lane_following")
    row, n = run.states.participant_id.tolist().index(PROBLEM), info["steps"] + 1
    for name in ("x", "y", "velocity", "orientation", "acceleration", "yaw_rate"):
        learned = getattr(env.run().states, name)
        np.testing.assert_array_equal(getattr(run.states, name)[row, :n], learned[row, :n], err_msg=name)


def test_other_weights_drive_as_a_planner_with_these_weights():
    env = at_the_junction(actions=envs.FrenetWeights())
    # 10 to the power of 0.5 in single precision is not quite that: powers of 1 and 0 are exact.
    driven(env, (0, -1, 1, 0))
    weights = CostWeights(distance_to_reference=0.5, lateral_jerk=2.0)
    run = simulate(
        "t_junction", planner={"default": "idm", PROBLEM: Frenet(weights=weights)}, predictor="lane_following"
    )
    row, learned = run.states.participant_id.tolist().index(PROBLEM), env.run().states
    n = min(learned.x.shape[1], run.states.x.shape[1])
    np.testing.assert_allclose(run.states.x[row, :n], learned.x[row, :n], atol=1e-6)


def test_the_learner_observes_its_weights_its_last_choice_and_how_that_came_about():
    env = at_the_junction(actions=envs.FrenetWeights(change="additive"))
    seen, _ = driven(env, (1, -1, 0, 0))
    assert seen.shape[1] == 344
    assert env.observation_space.contains(seen[0])
    np.testing.assert_array_equal(seen[0, STATUS], (0, 0, 1))
    assert not seen[0, POWERS].any()
    assert not seen[0, AMOUNTS].any()
    # A tenth of the first weight more and less, then two tenths.
    expected = [np.log10([1.1, 0.9]) / 3, np.log10([1.2, 0.8]) / 3]
    np.testing.assert_allclose(seen[1:3, POWERS][:, :2], expected, atol=1e-6)
    np.testing.assert_array_equal(seen[1, STATUS], (1, 0, 0))
    amounts = seen[1:-1, AMOUNTS]
    assert (amounts >= 0).all()
    assert (amounts <= 1).all()
    # Speed, place and jerk of what it chose differ from what it wants somewhere.
    assert amounts[:, :4].max() > 0.1


def test_a_change_of_weights_may_be_made_to_cost_something_once_in_a_decision():
    for change, expected in (("absolute", 0.5), ("additive", np.log10(1.1) / 2)):
        actions = envs.FrenetWeights(terms=("lateral_jerk", "prediction"), change=change)
        env = at_the_junction(actions=actions, decision_seconds=0.5, **{"reward.weight_change": -1.0})
        env.reset(seed=0)
        env.step(np.array([1, 0], np.float32))
        changed = env._engine.buffers.components[0, -1]
        assert changed == pytest.approx(expected, abs=1e-6)
    assert RewardWeights().weight_change == 0


def test_an_action_that_is_not_a_number_ends_only_its_own_agent():
    env = envs.parallel_env(scenarios="t_junction", actions=envs.FrenetWeights(), learners=2)
    env.reset(seed=0)
    actions = {"agent_0": np.array([0, np.nan, 0, 0], np.float32), "agent_1": np.zeros(4, np.float32)}
    *_, infos = env.step(actions)
    assert infos["agent_0"]["outcome"] == "planner_error"
    assert infos["agent_1"] == {}


@pytest.mark.parametrize("form", ["flat", "dict"])
def test_gymnasium_checks_weights(form):
    env = gymnasium.make("interdrive/TJunction-v1", actions=envs.FrenetWeights(), **{"observation.form": form})
    check_env(env.unwrapped, skip_render_check=True)
    if form == "dict":
        assert env.observation_space["planner"].shape == (20,)


def test_pettingzoo_checks_weights():
    parallel_api_test(envs.parallel_env(scenarios="t_junction", actions=envs.FrenetWeights()), num_cycles=150)


def test_neither_threads_nor_the_number_of_worlds_change_a_bit():
    found = []
    for num_worlds, threads in ((1, 1), (3, 2)):
        rows = envs.Rows(num_worlds, scenarios="t_junction", actions=envs.FrenetWeights(), threads=threads, seed=3)
        rows.reset()
        rng = np.random.default_rng(1)
        for _ in range(25):
            rows.step(np.repeat(rng.uniform(-1, 1, (1, 4)).astype(np.float32), rows.num_agents, axis=0))
        found.append(rows.observations[: rows.slots].copy())
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("terms", "text"),
    [
        (("lateral_velocity",), "actions: weight of lateral_velocity is 0 and cannot be scaled"),
        (("velocity_offset",), "actions: there is no weight velocity_offset"),
        (("jerks",), "actions: there is no weight jerks"),
        (("prediction", "prediction"), "actions: the weight of prediction occurs twice"),
    ],
)
def test_weights_that_cannot_be_changed_are_named(terms, text):
    with pytest.raises(InputError, match=text):
        at_the_junction(actions=envs.FrenetWeights(terms=terms))


def test_such_actions_cannot_be_exported(tmp_path):
    layers = {"action.weight": np.zeros((3, 324), np.float32), "action.bias": np.zeros(3, np.float32)}
    with pytest.raises(InputError, match="single-track model"):
        envs.export_policy(tmp_path / "policy.safetensors", layers, actions=envs.FrenetTarget())
