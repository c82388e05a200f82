"""Stable-Baselines3 takes our environments as they are."""

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from interdrive import InputError, envs, simulate
from interdrive.envs.sb3 import DriveVecEnv

PROBLEM = {"scenarios": "t_junction", "learners": [2001]}


@pytest.mark.parametrize("actions", [envs.Kinematic(), envs.KinematicGrid()], ids=["continuous", "discrete"])
def test_its_checker_has_nothing_to_say_about_flat_observations(actions):
    check_env(envs.DriveEnv(**PROBLEM, actions=actions))


# It would stack the columns of blocks of 2 dimensions, and says so.
@pytest.mark.filterwarnings("ignore:.*unconventional shape")
def test_its_checker_accepts_observations_by_block():
    check_env(envs.DriveEnv(**PROBLEM, **{"observation.form": "dict"}))


@pytest.mark.parametrize("form", ["flat", "dict"])
def test_worlds_in_one_call_equal_as_many_single_environments(form):
    settings = {"scenarios": ["t_junction", "lane_merge"], "start": "random", "observation.form": form}
    ours, theirs = DriveVecEnv(3, **settings), DummyVecEnv([lambda: envs.DriveEnv(**settings)] * 3)
    ours.seed(5)
    theirs.seed(5)
    rng = np.random.default_rng(0)
    equal(ours.reset(), theirs.reset())
    ends = 0
    for _ in range(200):
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        a, b = ours.step(actions), theirs.step(actions)
        equal(a[0], b[0])
        np.testing.assert_array_equal(a[1], b[1])
        np.testing.assert_array_equal(a[2], b[2])
        for i in np.flatnonzero(a[2]):
            mine, its = a[3][i], b[3][i]
            equal(mine.pop("terminal_observation"), its.pop("terminal_observation"))
            assert mine == its
        assert all(a[3][i] == {} for i in np.flatnonzero(~a[2]))
        ends += a[2].sum()
    assert ends > 3


def equal(a, b):
    if isinstance(a, dict):
        assert sorted(a) == sorted(b)
        for name in a:
            np.testing.assert_array_equal(a[name], b[name])
    else:
        np.testing.assert_array_equal(a, b)


def test_its_algorithm_learns_from_the_worlds_and_knows_how_episodes_end():
    env = VecMonitor(DriveVecEnv(8, **PROBLEM, max_seconds=5.0))
    model = PPO("MlpPolicy", env, n_steps=256, batch_size=256, n_epochs=1, seed=0, device="cpu")
    before = [one.detach().clone() for one in model.policy.parameters()]
    model.learn(2048)
    assert len(model.ep_info_buffer) > 10
    assert any(not np.array_equal(a, b.detach()) for a, b in zip(before, model.policy.parameters(), strict=True))


def test_single_worlds_cannot_be_changed():
    env = DriveVecEnv(2, **PROBLEM)
    assert env.get_attr("render_mode") == [None, None]
    env.env_method("update", **{"reward.collision": -2.0})
    with pytest.raises(InputError, match="update: cannot be called for single worlds"):
        env.env_method("update", indices=[0])
    with pytest.raises(InputError, match="all of them"):
        env.set_attr("threads", 2)
    with pytest.raises(InputError, match=r"actions: shape \(3, 2\) given, \(2, 2\) expected"):
        env.step(np.zeros((3, 2)))


def test_a_trained_model_is_a_planner_that_decides_as_the_model_does(tmp_path):
    env = VecMonitor(DriveVecEnv(4, **PROBLEM, traffic="idm", max_seconds=5.0))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, seed=0, device="cpu").learn(256)
    file = tmp_path / "ppo.safetensors"
    envs.export_stable_baselines(model, file)
    single = envs.DriveEnv(**PROBLEM, traffic="idm", record=True)
    observation, _ = single.reset(seed=0)
    info = {}
    while not info:
        observation, *_, info = single.step(model.predict(observation, deterministic=True)[0])
    planner = {"default": "idm", 2001: f"policy,file={file}"}
    run = simulate("t_junction", planner=planner, predictor="lane_following", threads=1)
    row = run.states.participant_id.tolist().index(2001)
    n = info["steps"] + 1
    np.testing.assert_allclose(run.states.x[row, :n], single.run().states.x[row, :n], atol=1e-3)


def test_a_model_with_other_layers_is_refused_by_their_names(tmp_path):
    model = SAC("MlpPolicy", DriveVecEnv(1, **PROBLEM), buffer_size=10, device="cpu")
    with pytest.raises(InputError, match=r"its layers are actor\.latent_pi\.0\.weight"):
        envs.export_stable_baselines(model, tmp_path / "sac.safetensors")
