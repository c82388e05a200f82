"""Bits: what an id does, and what neither threads, nor the number of worlds, nor many episodes may change."""

import hashlib
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from interdrive import envs


def driven(env, steps=200):
    """Digest of what an environment says to the same actions for some steps."""
    digest = hashlib.sha256()
    observation, _ = env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        # Half of the pedal and a tenth of the wheel, so that some episodes last.
        given = (rng.uniform(-1, 1, 2) * (0.5, 0.1)).astype(np.float32)
        digest.update(np.round(observation, 3).tobytes())
        observation, reward, ended, cut, info = env.step(given)
        digest.update(f"{reward:.3f} {ended} {cut} {info.get('outcome')}".encode())
        if ended or cut:
            observation, _ = env.reset()
    return digest.hexdigest()[:16]


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("Drive", "b4b96cc11ef06cda"),
        ("TJunction", "892929711d4bd8d7"),
        ("Merge", "782eea35fb398e91"),
        ("Highway", "ae5d0e3dcbb7c63a"),
        ("Intersection", "d812f3e2e4009a4e"),
    ],
)
def test_an_id_keeps_its_meaning_until_its_version_grows(name, digest):
    # What drives the others is not part of the meaning; planners become better.
    settings = {"scenarios": "t_junction"} if name == "Drive" else {"traffic": "recorded"}
    assert driven(gymnasium.make(f"interdrive/{name}-v1", **settings)) == digest


def worlds_driven(num_worlds, threads, steps=80):
    """What the first world says, if all worlds are given the same."""
    rows = envs.Rows(
        num_worlds, slots=3, scenarios=["t_junction", "intersection"], start="random", threads=threads, seed=3
    )
    rows.reset()
    rng = np.random.default_rng(1)
    kept = []
    for _ in range(steps):
        rows.step(np.repeat(rng.uniform(-1, 1, (1, 2)).astype(np.float32), rows.num_agents, axis=0))
        kept += [rows.observations[:3].copy(), rows.rewards[:3].copy(), rows.outcomes[:3].copy()]
    return kept


def test_a_world_is_the_same_alone_and_among_7_and_64():
    alone = worlds_driven(1, 1)
    for num_worlds, threads in [(7, 2), (64, 2), (64, 8)]:
        for one, other in zip(alone, worlds_driven(num_worlds, threads), strict=True):
            np.testing.assert_array_equal(one, other)


def test_500_steps_in_one_call_equal_those_of_single_environments():
    n, settings = 2, {"scenarios": ["t_junction", "lane_merge"], "start": "random", "traffic": "idm"}
    native = envs.DriveVectorEnv(num_envs=n, autoreset_mode=AutoresetMode.SAME_STEP, **settings)
    several = SyncVectorEnv([lambda: envs.DriveEnv(**settings)] * n, autoreset_mode=AutoresetMode.SAME_STEP)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(native.reset(seed=7)[0], several.reset(seed=7)[0])
    ends = 0
    for _ in range(500):
        given = (rng.uniform(-1, 1, (n, 2)) * (0.5, 0.1)).astype(np.float32)
        a, b = native.step(given), several.step(given)
        for ours, theirs in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
        ends += (a[2] | a[3]).sum()
    assert ends > 5


MANY_EPISODES = """
import resource
from interdrive import envs

rows = envs.Rows(64, scenarios="t_junction", slots=1, max_seconds=0.1, keep_final=True)
rows.reset()
addresses = [getattr(rows, name).ctypes.data for name in ("observations", "rewards", "masks")]

def played(resets):
    for _ in range(resets // 64):
        rows.step()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

before = played(5_000)
assert rows.truncations.all()
print(played(100_000) - before)
assert addresses == [getattr(rows, name).ctypes.data for name in ("observations", "rewards", "masks")]
"""


@pytest.mark.long
def test_many_episodes_need_no_more_memory_than_few():
    # In a process of its own: what else a process has done decides how its memory grows.
    command = [sys.executable, "-c", MANY_EPISODES]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    # kB; a kilobyte that stays per episode would be 100 MB.
    assert int(done.stdout) < 5_000
