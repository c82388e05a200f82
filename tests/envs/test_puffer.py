"""PufferLib's contract, by what its environments must have and do; the library itself is not needed."""

import importlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from interdrive import InputError, envs
from interdrive.errors import MissingExtraError

NAMES = ("observations", "actions", "rewards", "terminals", "truncations", "masks")


class PufferEnv:
    """What the constructor of PufferLib 3 demands and sets."""

    def __init__(self, buf):
        assert self.num_agents >= 1
        assert self.single_observation_space.dtype == np.float32
        assert self.single_action_space is not None
        assert not hasattr(self, "observation_space")
        for name in NAMES:
            setattr(self, name, buf[name])


@pytest.fixture
def puffer(monkeypatch):
    monkeypatch.setitem(sys.modules, "pufferlib", SimpleNamespace(PufferEnv=PufferEnv))
    monkeypatch.delitem(sys.modules, "interdrive.envs.puffer", raising=False)
    yield importlib.import_module("interdrive.envs.puffer").DrivePuffer
    sys.modules.pop("interdrive.envs.puffer", None)


def buffers(rows):
    flags = {name: np.zeros(rows, np.bool_) for name in ("terminals", "truncations", "masks")}
    return {
        "observations": np.zeros((rows, 324), np.float32),
        "actions": np.zeros(rows, np.int32),
        "rewards": np.zeros(rows, np.float32),
        **flags,
    }


def test_the_core_writes_into_the_arrays_of_the_library(puffer):
    mine = buffers(6)
    env = puffer(2, slots=3, buf=mine, scenarios="t_junction", actions=envs.KinematicGrid())
    observations, infos = env.reset(seed=3)
    assert observations is mine["observations"]
    assert infos == []
    assert mine["masks"].all()
    assert np.abs(observations).sum(axis=1).all()
    told = env.step(np.full(6, 45))
    assert [id(one) for one in told[:4]] == [
        id(mine[name]) for name in ("observations", "rewards", "terminals", "truncations")
    ]
    assert told[4] == []


def test_it_drives_as_the_rows_do_and_tells_of_the_ends_in_a_list(puffer):
    settings = {"scenarios": ["t_junction", "lane_merge"], "start": "random"}
    env, rows = puffer(2, slots=4, **settings), envs.Rows(2, slots=4, **settings)
    env.reset(seed=5)
    rows.reset(seed=5)
    rng, ends = np.random.default_rng(0), 0
    for _ in range(150):
        actions = rng.uniform(-1, 1, (8, 2)).astype(np.float32)
        observations, rewards, _, _, infos = env.step(actions)
        rows.step(actions)
        np.testing.assert_array_equal(observations, rows.observations)
        np.testing.assert_array_equal(rewards, rows.rewards)
        assert infos == rows.infos()
        ends += len(infos)
    assert ends > 5


def test_arrays_that_do_not_fit_are_named(puffer):
    with pytest.raises(InputError) as refused:
        puffer(2, slots=2, buf=buffers(6), scenarios="t_junction", actions=envs.KinematicGrid())
    assert str(refused.value) == "buf.actions: shape [6] given, [4] expected"


def test_without_the_library_the_adapter_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pufferlib", None)
    monkeypatch.delitem(sys.modules, "interdrive.envs.puffer", raising=False)
    with pytest.raises(MissingExtraError, match="pip install pufferlib"):
        importlib.import_module("interdrive.envs.puffer")


def test_pictures_do_not_fit_into_its_array(puffer):
    with pytest.raises(InputError, match="PufferLib takes one array of numbers"):
        puffer(1, scenarios="t_junction", **{"observation.raster": True})
