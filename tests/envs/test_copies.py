"""Copies of environments: they go on by themselves, to the same bits, here, in a fork and in another process."""

import copy
import multiprocessing
import pickle

import numpy as np
import pytest

from interdrive import InputError, envs

SHIPPED = {"scenarios": "t_junction", "traffic": "idm"}


def vector(**more):
    return envs.DriveVectorEnv(3, **SHIPPED, **more)


def actions_of(rng, env):
    return rng.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)


def driven(env, steps, seed):
    """What an environment says to the same actions for some steps."""
    rng, said = np.random.default_rng(seed), []
    for _ in range(steps):
        observation, reward, ended, cut, _ = env.step(actions_of(rng, env))
        said.append((observation.tobytes(), np.asarray(reward).tobytes(), np.asarray(ended).tobytes()))
        if np.ndim(ended) == 0 and (ended or cut):
            said.append(env.reset()[0].tobytes())
    return said


def begun(env, steps=15):
    env.reset(seed=4)
    driven(env, steps, 1)
    return env


@pytest.mark.parametrize("make", [lambda: envs.DriveEnv(**SHIPPED), vector, lambda: vector(threads=2)])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_to_the_same_bits_beyond_the_end_of_the_episode(make, copied):
    env = begun(make())
    first, second = copied(env), copied(env)
    expected = driven(env, 150, 2)
    assert driven(first, 150, 2) == expected
    driven(second, 20, 3)  # other actions
    assert driven(copied(second), 20, 2) == driven(second, 20, 2)


def test_a_copy_and_its_original_do_not_know_of_each_other():
    env = begun(envs.DriveEnv(**SHIPPED))
    other, twin = copy.deepcopy(env), copy.deepcopy(env)
    driven(other, 30, 3)
    assert driven(env, 30, 2) == driven(twin, 30, 2)


def test_copies_of_many_agents_go_on_alike():
    env = envs.parallel_env(**SHIPPED)
    env.reset(seed=2)

    def drive(one, steps=40):
        said = []
        for k in range(steps):
            if not one.agents:
                one.reset()
            found = one.step({name: np.full(2, 0.05 * (k % 3 - 1), np.float32) for name in one.agents})
            said.append({name: value.tobytes() for name, value in found[0].items()})
        return said

    drive(env, 10)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = drive(env)
    assert [drive(one) for one in copies] == [expected] * 2


def test_changed_settings_go_with_a_copy():
    env = begun(envs.DriveEnv(**SHIPPED))
    env.update(**{"reward.collision": -7.0, "traffic": "recorded"})
    driven(env, 60, 5)
    other = pickle.loads(pickle.dumps(env))
    assert driven(other, 60, 2) == driven(env, 60, 2)


def test_an_environment_is_copied_before_its_first_reset():
    one, other = envs.DriveEnv(**SHIPPED), copy.deepcopy(envs.DriveEnv(**SHIPPED))
    assert other.reset(seed=3)[0].tobytes() == one.reset(seed=3)[0].tobytes()


def test_what_was_done_for_too_long_is_not_pickled_before_the_next_reset(monkeypatch):
    monkeypatch.setattr("interdrive.envs.history._SIZE_MAX", 100)
    env = begun(envs.DriveEnv(**SHIPPED))
    with pytest.raises(InputError, match="reset it, or copy it"):
        pickle.dumps(env)
    env.reset()
    assert driven(pickle.loads(pickle.dumps(env)), 5, 2) == driven(copy.deepcopy(env), 5, 2)


def _send(connection, env):
    connection.send(driven(env, 10, 2))


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.parametrize("threads", [1, 2])
def test_an_environment_goes_on_in_a_child_process(method, threads):
    env = begun(vector(threads=threads))
    context = multiprocessing.get_context(method)
    ours, theirs = context.Pipe()
    child = context.Process(target=_send, args=(theirs, env))
    child.start()
    assert ours.poll(60.0), "the child hangs"
    assert ours.recv() == driven(env, 10, 2)
    child.join()


def test_a_refused_step_is_not_repeated_in_a_pickle():
    env = envs.DriveEnv(**SHIPPED)
    env.reset(seed=4)
    ended = False
    while not ended:
        _, _, terminated, truncated, _ = env.step(np.array([1.0, 0.3], np.float32))
        ended = terminated or truncated
    with pytest.raises(InputError):
        env.step(np.zeros(2, np.float32))
    other = pickle.loads(pickle.dumps(env))
    assert other.reset()[0].tobytes() == env.reset()[0].tobytes()
