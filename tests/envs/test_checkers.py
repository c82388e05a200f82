"""Environments keep the contracts of gymnasium and PettingZoo, in the words of their own checkers."""

import importlib
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils.conversions import parallel_to_aec

from interdrive import envs
from interdrive.errors import MissingExtraError


@pytest.mark.parametrize("actions", [envs.Kinematic(), envs.KinematicGrid()], ids=["continuous", "discrete"])
@pytest.mark.parametrize("form", ["flat", "dict"])
def test_gymnasium_checks_the_environment(actions, form):
    env = gymnasium.make("interdrive/TJunction-v1", actions=actions, **{"observation.form": form})
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("form", ["flat", "dict"])
def test_gymnasium_checks_pictures_and_all_other_observations(form):
    wanted = {"observation.edges": 8, "observation.predictions": True, "observation.raster": True}
    env = gymnasium.make("interdrive/TJunction-v1", **wanted, **{"observation.form": form})
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", sorted(envs.IDS))
def test_every_id_makes_an_environment(name):
    settings = {"scenarios": "t_junction"} if name == "interdrive/Drive-v1" else {}
    env = gymnasium.make(f"interdrive.envs:{name}", **settings)
    assert env.spec.max_episode_steps is None
    observation, info = env.reset(seed=0)
    assert observation.shape == (324,)
    assert info == {}
    assert np.abs(observation).max() <= 1


@pytest.mark.parametrize("learners", [2, 8, "all"])
def test_pettingzoo_checks_the_parallel_environment(learners):
    def made():
        return envs.parallel_env(scenarios="t_junction", learners=learners)

    parallel_api_test(made(), num_cycles=1000)
    parallel_seed_test(made)
    api_test(parallel_to_aec(made()), num_cycles=100)


def test_without_stable_baselines_its_adapter_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "interdrive.envs.sb3", raising=False)
    with pytest.raises(MissingExtraError, match="pip install stable-baselines3"):
        importlib.import_module("interdrive.envs.sb3")
