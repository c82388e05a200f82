"""Actions in the frame of the path."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

from interdrive import InputError, envs
from interdrive._core import REWARDS
from interdrive.testing import bend, problem, straight_road, world

ZERO = np.zeros(3, np.float32)


def in_a_bend(**settings):
    start = problem(1, -40.0, velocity=8.0, goal=(30.0, 70.0), time_step=(1, 300))
    return envs.DriveEnv(scenarios=world(bend(), problems=[start]), record=True, **settings)


def on_a_road(velocity=10.0, **settings):
    start = problem(1, 20.0, velocity=velocity, goal=(170.0, 0.0), time_step=(1, 300))
    road = straight_road(300.0, lane_width=12.0)
    return envs.DriveEnv(scenarios=world(road, problems=[start]), record=True, **settings)


def driven(env, action, steps=1000):
    env.reset(seed=0)
    for _ in range(steps):
        *_, ended, cut, info = env.step(np.asarray(action, np.float32))
        if ended or cut:
            return info
    return {}


def test_three_zeros_follow_the_path_through_a_bend_where_pedals_and_wheel_leave_the_road():
    assert driven(in_a_bend(actions=envs.FrenetTarget()), ZERO)["outcome"] == "goal_reached"
    assert driven(in_a_bend(), ZERO[:2])["off_road"]


@pytest.mark.parametrize("aside", [-0.5, 0.25])
def test_the_first_number_is_the_place_beside_the_path(aside):
    env = on_a_road(actions=envs.FrenetTarget())
    driven(env, (aside, 0, 0), steps=80)
    states = env.run().states
    assert states.y[0, 80] == pytest.approx(3 * aside, abs=0.03)
    assert states.velocity[0, 80] == pytest.approx(10, abs=0.05)


def test_the_first_step_is_that_of_the_polynomials():
    env = on_a_road(actions=envs.FrenetTarget())
    driven(env, (0.5, 0.4, 1), steps=1)
    states = env.run().states
    share = 0.1 / 3
    speed = 10 + 2 * (3 * share**2 - 2 * share**3)
    drift = 1.5 * 30 * share**2 * (1 - share) ** 2 / 3
    assert states.velocity[0, 1] == pytest.approx(np.hypot(speed, drift), abs=1e-6)
    assert states.orientation[0, 1] == pytest.approx(np.arctan(drift / speed), abs=1e-6)


def test_what_the_vehicle_cannot_do_counts_as_limited():
    for action, share in (((0, 0, 1), 0), ((1, 0, -1), 1)):
        env = on_a_road(velocity=20.0, actions=envs.FrenetTarget())
        env.reset(seed=0)
        env.step(np.array(action, np.float32))
        components = dict(zip(REWARDS, env._engine.buffers.components[0], strict=True))
        assert components["limited"] == share


def test_an_action_that_is_not_a_number_ends_only_its_own_agent():
    env = envs.parallel_env(scenarios="t_junction", actions=envs.FrenetTarget(), learners=3)
    env.reset(seed=0)
    actions = {"agent_0": np.array([np.nan, 0, 0], np.float32), "agent_1": ZERO, "agent_2": ZERO}
    *_, infos = env.step(actions)
    assert infos["agent_0"]["outcome"] == "planner_error"
    assert infos["agent_1"] == infos["agent_2"] == {}


@pytest.mark.parametrize("form", ["flat", "dict"])
def test_gymnasium_checks_frenet_targets(form):
    env = gymnasium.make("interdrive/TJunction-v1", actions=envs.FrenetTarget(), **{"observation.form": form})
    check_env(env.unwrapped, skip_render_check=True)


def test_pettingzoo_checks_frenet_targets():
    parallel_api_test(envs.parallel_env(scenarios="t_junction", actions=envs.FrenetTarget()), num_cycles=300)


def rows_driven(threads, num_worlds):
    rows = envs.Rows(
        num_worlds, scenarios=["t_junction", "intersection"], actions=envs.FrenetTarget(), traffic="idm", slots=3,
        threads=threads, seed=3,
    )  # fmt: skip
    rows.reset()
    rng = np.random.default_rng(1)
    for _ in range(60):
        rows.step(np.repeat(rng.uniform(-1, 1, (1, 3)).astype(np.float32), rows.num_agents, axis=0))
    return rows.observations[:3].copy()


def test_neither_threads_nor_the_number_of_worlds_change_a_bit():
    for num_worlds, threads in ((2, 2), (7, 8)):
        np.testing.assert_array_equal(rows_driven(1, 1), rows_driven(threads, num_worlds))


def test_settings_that_do_not_fit_are_named():
    with pytest.raises(InputError, match="t_min: must be positive and at most 3"):
        envs.FrenetTarget(t_min=4.0)


def test_recorded_drivers_have_no_targets():
    env = envs.DriveEnv(scenarios="t_junction", actions=envs.FrenetTarget())
    with pytest.raises(InputError, match="only Kinematic and KinematicGrid can be inverted"):
        env.recorded_actions(1005)
