"""Every example runs and says what it is known to say."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[2] / "examples"
LAST_LINES = {
    "01_run.py": "7 of 8 agents reached their goal in time",
    "02_own_planner.py": "agent 1002 with a planner of its own: goal_reached",
    "03_degrees_of_interaction.py": "interactive: 1001 goal_reached, 1002 goal_reached, 1003 goal_reached, "
    "1004 goal_reached, 1005 goal_reached, 1006 goal_reached, 2001 goal_reached",
    "04_own_predictor.py": "with this predictor 8 of 8 agents reach their goal, 1 late",
    "05_batch.py": "idm_mobil: 46 agents, 93 % reached their goal in time",
    "06_environment.py": "collision: 7, off the road: 12",
    "08_obeying_planner.py": "26 of 26 agents reached their goal, 0 broke a rule",
}


def test_every_example_is_tested():
    assert sorted(path.name for path in FOLDER.glob("*.py")) == sorted(LAST_LINES)


@pytest.mark.parametrize("name", LAST_LINES)
def test_an_example_ends_with_its_known_line(name, tmp_path):
    done = subprocess.run(
        [sys.executable, FOLDER / name], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == LAST_LINES[name]
