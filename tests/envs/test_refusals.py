"""What cannot be used is refused in one line that names it; what was given stays as it is."""

import importlib
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from interdrive import InputError, batch, envs
from interdrive.envs.vector import _mode
from interdrive.errors import MissingExtraError
from interdrive.testing import Car, problem, straight_road, world


def single(**settings):
    env = envs.DriveEnv(scenarios="t_junction", **settings)
    env.reset(seed=0)
    return env


def several(n=4, **settings):
    env = envs.DriveVectorEnv(n, scenarios="t_junction", **settings)
    env.reset(seed=0)
    return env


def choosing():
    return single(actions=envs.KinematicGrid())


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: several().step(np.zeros((3, 2))), "actions: shape (3, 2) given, (4, 2) expected"),
        (lambda: several(1).step([["a", "b"]]), "actions: numbers expected"),
        (lambda: several(2).step([[0, 0], [0]]), "actions: rows of different lengths given, shape (2, 2) expected"),
        (lambda: single().step(None), "actions: shape () given, (2,) expected"),
        (lambda: choosing().step(91), "actions: 91 at row 0, there are 0 to 90"),
        (lambda: choosing().step(-7), "actions: -7 at row 0, there are 0 to 90"),
        (lambda: choosing().step(2**40), "actions: 2147483647 at row 0, there are 0 to 90"),
        (lambda: choosing().step(1.7), "actions: whole numbers expected, not float64"),
        (lambda: several().reset(seed=-3), "seed must not be negative, is -3"),
        (lambda: several().reset(seed=[1, 2, 3, -4]), "seed must not be negative, is -4"),
        (lambda: several().reset(seed=[1, 2]), "seed: 2 given for 4 worlds"),
        (lambda: single().reset(seed="x"), "seed must be a whole number, is 'x'"),
        (
            lambda: several().reset(options={"reset_mask": [True, False]}),
            "reset_mask: 4 booleans expected, one per world",
        ),
        (lambda: several(autoreset_mode="OFF"), "autoreset_mode: OFF is not one of NEXT_STEP, SAME_STEP, DISABLED"),
        (lambda: single(learners=2.5), "learners: a number, 'all' or ids expected, not 2.5"),
        (lambda: single(learners=[]), "learners: a number, 'all' or ids expected, not []"),
        (lambda: single(learners=[77]), "learners: 77 cannot be an agent of t_junction"),
        (
            lambda: single(predictor="guess"),
            (
                "unknown predictor 'guess': there are constant_velocity, ground_truth, lane_following, neural, "
                "walenet, or module:object"
            ),
        ),
        (lambda: single().run(), "run: nothing was recorded; make the environment with record=True"),
        (lambda: single().recorded_actions(5), "agent 5: cannot be an agent of t_junction"),
    ],
)
def test_it_is_named(make, text):
    with pytest.raises(InputError) as refused:
        make()
    assert str(refused.value) == text


def test_a_folder_without_scenarios_is_named(tmp_path):
    with pytest.raises(InputError, match=f"^scenarios: none found in {tmp_path} "):
        envs.DriveEnv(scenarios=tmp_path)


def test_vehicles_that_are_not_recorded_for_long_enough_cannot_learn_from_random_steps_on():
    cars = [Car(5, 20.0, 0.0, 8.0, last=80), Car(7, 60.0, 0.0, 8.0, first=20, last=45)]
    brief = world(straight_road(300.0), cars=cars)
    with pytest.raises(InputError) as refused:
        envs.parallel_env(scenarios=brief, learners=[5, 7], start="random")
    assert str(refused.value) == "learners: 7: no first step of tiny from which on it drives for 3 s"


def test_one_of_four_worlds_that_has_ended_waits_for_its_reset():
    env = several(autoreset_mode="DISABLED", max_seconds=0.2)
    env.step(np.zeros((4, 2)))
    env.reset(options={"reset_mask": np.array([True, True, False, True])})
    env.step(np.zeros((4, 2)))
    with pytest.raises(InputError) as refused:
        env.step(np.zeros((4, 2)))
    assert str(refused.value) == "step: world 2 has ended; reset it (autoreset is off)"


def test_arrays_of_actions_stay_as_they_are():
    given = np.array([[3.0, -3.0]] * 4, np.float32)
    several().step(given)
    np.testing.assert_array_equal(given, [[3.0, -3.0]] * 4)


def test_modes_of_reset_need_a_gymnasium_that_has_them(monkeypatch):
    monkeypatch.delattr(gymnasium.vector, "AutoresetMode")
    monkeypatch.setattr(gymnasium, "__version__", "1.0.0")
    assert _mode("NEXT_STEP") == ("NEXT_STEP", None)
    with pytest.raises(InputError) as refused:
        envs.DriveVectorEnv(2, "SAME_STEP", scenarios="t_junction")
    assert str(refused.value) == "autoreset_mode SAME_STEP needs gymnasium 1.1; 1.0.0 is installed"


@pytest.mark.parametrize(
    ("package", "module"), [("gymnasium", "interdrive.envs"), ("pettingzoo", "interdrive.envs.parallel")]
)
def test_a_package_that_is_missing_is_named_with_what_to_install(monkeypatch, package, module):
    for name in [name for name in sys.modules if name.startswith("interdrive.envs")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError) as refused:
        importlib.import_module(module)
    assert str(refused.value) == f'interdrive.envs needs {package}: pip install "interdrive[rl]"'


HUGE = 10**30


@pytest.mark.parametrize("make", [envs.DriveEnv, envs.DriveVectorEnv, envs.parallel_env, envs.Rows])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(
            (name, None)
            for name in ("scenarios", "traffic", "predictor", "actions", "observation", "reward", "simulation")
        ),
        *(
            (name, 3)
            for name in ("scenarios", "traffic", "predictor", "actions", "observation", "part", "start", "sampler")
        ),
        *(("scenarios", value) for value in ([3], [], b"x", {"a": 1}, [None], "nosuch", "\0")),
        *(("learners", value) for value in (None, 1.5, [], [True], 0, -1, "some", HUGE)),
        *(("traffic", value) for value in ([1], {"x": 3}, {1: 3}, "nosuch")),
        *(
            (name, value)
            for name in ("decision_seconds", "max_seconds")
            for value in ("x", [1], -1.0, 0.0, float("nan"))
        ),
        *(("threads", value) for value in ("a", None, 0, -1, 2.5, HUGE, True, [2])),
        *(("test_share", value) for value in ("x", -1, 2, float("nan"))),
        *((name, value) for name in ("record", "copy") for value in ("x", None, 3)),
        ("nosuch", 1),
    ],
)
def test_whatever_an_argument_is_there_is_one_line(make, name, value):
    known = {"sampler"} if make is envs.DriveEnv else set()
    wanted = InputError if name not in known else (InputError, TypeError)
    with pytest.raises(wanted) as refusal:
        make(**{"scenarios": "t_junction", name: value})
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("value", [None, "3", 2.5, True, float("nan"), 0, -1, HUGE, 1_000_001, [2], 1_000_000])
def test_impossible_numbers_of_worlds_are_refused_before_memory_is_taken(value):
    for make, name in ((envs.DriveVectorEnv, "num_envs"), (envs.Rows, "num_worlds")):
        with pytest.raises(InputError):
            make(scenarios="town" if value == 1_000_000 else "t_junction", **{name: value})


@pytest.mark.parametrize(
    "action",
    [None, "x", 3.0, [0.0], [0.0, 1.0, 2.0], ["0.5", "0.5"], [1j, 0.0], [[0.0, 0.0]], np.ma.masked_all(2), [None, 1]],
)
def test_whatever_an_action_is_there_is_one_line(action):
    env = envs.DriveEnv(scenarios="t_junction")
    env.reset(seed=0)
    with pytest.raises(InputError):
        env.step(action)


@pytest.mark.parametrize(("dt", "seconds"), [(0.04, 0.12), (0.2, 0.2), (0.1, 0.1), (0.03, 0.09), (1.0, 1.0)])
def test_an_action_lasts_about_a_tenth_of_a_second_whatever_the_time_step(dt, seconds):
    road = straight_road(400.0)
    drive = problem(1, 20.0, velocity=5.0, goal=(380.0, 0.0), time_step=(0, 2000))
    env = envs.DriveEnv(scenarios=replace(world(road, problems=[drive]), dt=dt), record=True)
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    assert env.run().states.x.shape[1] == 1 + 5 * round(seconds / dt)


@pytest.mark.parametrize("buf", [3, True, np.zeros(2), object(), "rewards", {"nosuch": np.zeros(2)}, {"rewards": 3}])
def test_arrays_that_cannot_be_written_are_refused_by_name(buf):
    with pytest.raises(InputError, match=r"buf|rewards"):
        envs.Rows(2, scenarios="t_junction", buf=buf)


def test_wrong_calls_of_environments_are_one_line():
    several_agents = envs.parallel_env(scenarios="t_junction")
    several_agents.reset(seed=0)
    for actions in (None, 3, []):
        with pytest.raises(InputError, match="one by name of each agent"):
            several_agents.step(actions)
    with pytest.raises(InputError, match="reset_mask"):
        several().reset(options=3)
    with pytest.raises(InputError, match="decision_seconds: must be positive"):
        single(decision_seconds=float("inf"))


@pytest.mark.parametrize("workers", ["a", [2], 2.5, True, 0, -1, 1025])
def test_impossible_numbers_of_workers_are_one_line(workers, tmp_path):
    with pytest.raises(InputError, match="workers: expected"):
        batch("t_junction", tmp_path / "out", workers=workers)
