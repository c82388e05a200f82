"""A learner learns: the one of the tutorial follows a bend that doing nothing leaves.

It is written in numpy, so that this needs no library for learning.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from interdrive import envs
from interdrive.testing import bend, problem, world

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
#: Longer decisions, so that their effects can be seen; leaving the road is cheap, so that standing does not pay.
SETTINGS = {"decision_seconds": 0.5, "reward.off_road": -0.2}


@pytest.fixture
def learner_of(monkeypatch):
    """The class that the tutorial shows."""
    spec = importlib.util.spec_from_file_location("pages", ROOT / "docs/extensions/executed_pages.py")
    pages = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "pages", pages)
    spec.loader.exec_module(pages)
    names = {}
    page = (ROOT / "docs/tutorials/learning.md").read_text(encoding="utf-8")
    exec(next(block.text for block in pages.blocks_of(page) if block.file == "learner.py"), names)
    return names["Learner"]


def starts(n, seed):
    """A car in a bend of radius 30 m or before it, each time at another place, speed, offset and heading."""
    rng = np.random.default_rng(seed)
    found = []
    for i in range(n):
        along, offset, turn, velocity = rng.uniform((-40, -0.4, -0.05, 5), (30, 0.4, 0.05, 9))
        angle, radius = max(along, 0.0) / 30.0, 30.0 - offset
        x, y = min(along, 0.0) + radius * np.sin(angle), 30.0 - radius * np.cos(angle)
        goal = {"goal": (30.0, 60.0), "goal_size": (20.0, 3.5), "goal_orientation": np.pi / 2}
        car = problem(1, x, y, velocity, angle + turn, **goal, time_step=(1, 300))
        found.append(world(bend(), problems=[car], name=f"bend_{i}"))
    return found


def successes(scenarios, drive):
    """How many reach the goal of as many scenarios."""
    found = []
    for scenario in scenarios:
        env = envs.DriveEnv(scenarios=scenario, **SETTINGS)
        observation, info = env.reset(seed=0)
        while not info:
            observation, *_, info = env.step(drive(observation[None])[0])
        found.append(info["is_success"])
    return sum(found)


def test_the_learner_of_the_tutorial_learns_to_follow_a_bend_from_starts_that_it_has_not_seen(learner_of):
    unseen = starts(64, seed=1)
    assert successes(unseen, lambda _: np.zeros((1, 2), np.float32)) == 0
    rows = envs.Rows(32, scenarios=starts(64, seed=0), max_seconds=25.0, seed=0, **SETTINGS)
    learner = learner_of(rows)
    learner.learn(40)  # about 80,000 decisions
    assert successes(unseen, learner.mean) >= 60


def test_drivers_are_counted_by_how_they_end(monkeypatch, capsys, tmp_path):
    spec = importlib.util.spec_from_file_location("compare", ROOT / "examples/rl/compare.py")
    compare = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(compare)
    still = tmp_path / "still.safetensors"
    envs.export_policy(still, {"action.weight": np.zeros((2, 324)), "action.bias": np.array([-1.0, 0.0])})
    monkeypatch.setattr(compare, "SETS", {"M": ["lane_merge"]})
    monkeypatch.setattr(compare, "PLANNERS", ())
    monkeypatch.setattr(sys, "argv", ["compare.py", str(still)])
    compare.main()
    rows = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()]
    goals = {row[2]: row[3] for row in rows[2:]}
    # Of seven cars four go straight on, and one more only has to follow its path; braking leads nowhere.
    assert goals == {"random": "0%", "nothing": "57%", "hold speed": "71%", "still": "0%"}
