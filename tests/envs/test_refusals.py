"""What cannot be used is refused in one line that names it; what was given stays as it is."""

import importlib
import sys

import gymnasium
import numpy as np
import pytest

from interdrive import InputError, envs
from interdrive.envs.vector import _mode
from interdrive.errors import MissingExtraError
from interdrive.testing import Car, straight_road, world


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
        (lambda: several(autoreset_mode="OFF"), "autoreset_mode: OFF is none of NEXT_STEP, SAME_STEP, DISABLED"),
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


def test_a_vehicle_that_enters_later_cannot_learn_from_the_first_step_on():
    late = world(
        straight_road(300.0), cars=[Car(5, 20.0, 0.0, 8.0, last=80), Car(7, 60.0, 0.0, 8.0, first=20, last=80)]
    )
    with pytest.raises(InputError) as refused:
        envs.DriveEnv(scenarios=late, learners=[7])
    assert str(refused.value) == f"learners: 7 does not drive at the first step of {late.name}"


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
