"""The table of rules: what counts as a mutual wait, and what its columns hold, on invented and shipped scenarios."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import interdrive as idr
from interdrive import shipped_scenario
from interdrive.simulation import Simulation
from interdrive.testing import crossing, problem, world

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "driving"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


@pytest.fixture
def standing(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    yield __import__("standing")
    for name in ("standing", "drives", "causes", "realism"):
        sys.modules.pop(name, None)


class Stands:
    """Does not move."""

    def plan(self, view, predictions):
        ego, same = view.ego, np.ones(31)
        return idr.Trajectory(ego.x * same, ego.y * same, ego.orientation * same, 0.0 * same)


def east(number, x):
    return problem(number, x, 0.0, 0.0, goal=(60.0, 0.0), time_step=(0, 120))


def north(number, y):
    return problem(
        number, 0.0, y, 0.0, np.pi / 2, goal=(0.0, 60.0), goal_size=(4.0, 4.0), goal_orientation=np.pi / 2,
        time_step=(0, 120),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("problems", "waiting"),
    [
        ([east(1, -6.0), north(2, -6.0)], (1, 2)),
        ([east(1, -30.0), north(2, -6.0)], ()),  # Too far away.
        ([east(1, -6.0), east(2, -12.0)], ()),  # The second one waits for the first one only.
        ([east(1, -6.0), east(3, -12.0), north(2, -6.0)], (1, 2)),
        ([east(1, -6.0), north(2, 20.0)], ()),  # It has left the junction.
    ],
)
def test_agents_that_stand_for_ten_seconds_before_a_common_area_wait_for_each_other(standing, problems, waiting):
    simulation = Simulation(world(crossing(), problems=problems), planner=Stands, threads=1)
    assert standing.mutual_waits(simulation, simulation.run()) == waiting


def test_a_circle_may_lead_through_several_agents(standing):
    waits = np.zeros((1, 4, 4), dtype=bool)
    for one, other in ((0, 1), (1, 2), (2, 0), (3, 0)):
        waits[0, one, other] = True
    assert standing._in_circles(waits).tolist() == [[True, True, True, False]]


def test_the_table_has_recorded_drivers_beside_planners(tmp_path):
    (tmp_path / "lights").mkdir()
    shutil.copy(shipped_scenario("signals"), tmp_path / "lights")
    done = subprocess.run(
        [sys.executable, str(FOLDER / "rules.py"), str(tmp_path), "--drivers", "idm", "--workers", "1",
         "--rows", str(tmp_path / "rows.csv")],
        env=os.environ, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in done.stdout.splitlines() if "|" in line]
    recorded, idm = (dict(zip(rows[0], row, strict=True)) for row in rows[2:])
    assert (recorded["drivers"], idm["drivers"]) == ("recorded drivers", "idm")
    assert recorded["red lights passed"].startswith("0 of ") and idm["red lights passed"].startswith("0 of ")
    assert int(recorded["red lights passed"].split()[-1]) > 0
    assert idm["in time"] != "" and recorded["in time"] == ""
    with (tmp_path / "rows.csv").open(newline="") as file:
        listed = list(csv.DictReader(file))
    assert sum(row["source"] == "agent" and row["rule"] == "right_of_way" for row in listed) == int(idm["right of way"])
    assert {row["driver"] for row in listed} <= {"idm"}
