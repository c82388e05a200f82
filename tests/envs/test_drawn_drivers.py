"""Populations of drivers in learning environments: every episode draws its own, by the seed of the environment."""

import pickle
from copy import deepcopy

import numpy as np
import pytest

from interdrive import InputError, envs
from interdrive.testing import Car, straight_road, world

LEARNER = 10


@pytest.fixture(scope="module")
def road():
    cars = [Car(LEARNER + i, 30.0 * i, 0.0, 10.0, last=120) for i in range(4)]
    return world(straight_road(400.0), cars=cars, steps=120)


def made(road, traffic="idm,drivers=house", **more):
    return envs.DriveEnv(
        scenarios=road, learners=[LEARNER], traffic=traffic, start="first", record=True, max_seconds=4.0, **more
    )


def traffic(env, seed=None):
    """Positions of the others in an episode in which the learner does nothing, shape (vehicles, steps)."""
    env.reset(seed=seed)
    done = False
    while not done:
        *_, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
        done = terminated or truncated
    states = env.run().states
    return states.x[states.participant_id != LEARNER]


def test_episodes_have_other_drivers_and_seeds_repeat_them(road):
    env = made(road)
    first, second = traffic(env, 3), traffic(env)
    assert first.shape == second.shape
    assert np.nanmax(np.abs(first - second)) > 0.1, "m"
    assert np.array_equal(traffic(env, 3), first, equal_nan=True)
    assert np.array_equal(traffic(env), second, equal_nan=True)
    assert env.run().settings["seed"] > 0


def test_without_drivers_episodes_are_alike_and_draw_nothing_more(road):
    env = made(road, "idm")
    assert np.array_equal(traffic(env, 3), traffic(env), equal_nan=True)
    assert env.run().settings["seed"] == 0


def test_a_population_without_spread_is_the_planner_with_these_settings(road, tmp_path):
    path = tmp_path / "alike.toml"
    path.write_text("format = 1\n[parameters.time_gap]\nmedian = 2.0\n")
    drawn, alike = made(road, f"idm,drivers={path}"), made(road, "idm,time_gap=2.0")
    assert np.array_equal(traffic(drawn, 1), traffic(alike, 1), equal_nan=True)
    assert not np.array_equal(traffic(drawn, 1), traffic(made(road, "idm"), 1), equal_nan=True)


def test_an_agent_of_its_own_planner_may_have_drivers_while_others_replay(road):
    env = made(road, {11: "idm,drivers=house"})
    first, second = traffic(env, 0), traffic(env)
    assert not np.array_equal(first[0], second[0], equal_nan=True)
    assert np.array_equal(first[1:], second[1:], equal_nan=True)


def test_copies_and_pickles_go_on_with_the_same_drivers(road):
    env = made(road)
    env.reset(seed=5)
    for other in (deepcopy(env), pickle.loads(pickle.dumps(env))):
        expected = deepcopy(env)
        assert np.array_equal(traffic(other), traffic(expected), equal_nan=True)
    rows = [
        envs.Rows(4, scenarios=road, learners=[LEARNER], traffic="idm,drivers=house", seed=2, threads=n) for n in (1, 2)
    ]
    for one in rows:
        one.reset()
        for _ in range(20):
            one.step(np.zeros_like(one.actions))
    assert np.array_equal(rows[0].observations, rows[1].observations)


def test_other_traffic_drives_from_the_next_episode_on(road):
    env = made(road)
    env.reset(seed=4)
    env.update(traffic="idm,time_gap=2.5")
    changed = traffic(env)
    assert np.array_equal(changed, traffic(made(road, "idm,time_gap=2.5"), 4), equal_nan=True)
    env.update(traffic="idm,drivers=calm")
    drawn = [traffic(env) for _ in range(3)]
    assert not np.array_equal(drawn[1], drawn[2], equal_nan=True)


def test_drivers_that_do_not_fit_are_refused_in_one_line(road):
    for planner, words in (("recorded,drivers=house", "it has none"), ("idm,drivers=hose", "did you mean house")):
        with pytest.raises(InputError, match=words) as caught:
            made(road, planner)
        assert "\n" not in str(caught.value)
