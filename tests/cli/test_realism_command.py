"""`interdrive realism` at the command line."""

import json
import subprocess
import sys

import interdrive as idr
from interdrive.testing import Car, straight_road, world


def _run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "interdrive", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_the_command_prints_tables_and_writes_a_folder(tmp_path):
    cars = [Car(101 + i, 40.0 * i, 0.0, 20.0) for i in range(4)]
    path = tmp_path / "DEU_Motorway-1_1_T-1.xml"
    idr.write_scenario(world(straight_road(600.0), cars=cars, steps=60, dt=0.2, name=path.stem), path)
    done = _run("realism", path, "--planner", "idm,idm_mobil", "--out", tmp_path / "out", "--long", "0", "--workers", 1)
    assert done.returncode == 0, done.stderr
    assert "every planner knows the recorded turns (goals: turns)" in " ".join(done.stdout.split())
    rows = json.loads((tmp_path / "out" / "realism.json").read_text())["rows"]
    assert [row["planner"] for row in rows] == ["idm", "idm_mobil", "recorded", "constant_velocity"]


def test_one_option_gives_drivers_to_all_planners(tmp_path):
    cars = [Car(101 + i, 40.0 * i, 0.0, 20.0) for i in range(4)]
    path = tmp_path / "DEU_Motorway-1_1_T-1.xml"
    idr.write_scenario(world(straight_road(600.0), cars=cars, steps=60, dt=0.2, name=path.stem), path)
    options = ("--rollouts", 1, "--starts", "1", "--long", 0, "--workers", 1, "--out", tmp_path / "out")
    done = _run("realism", path, "--planner", "idm,exponent=4,rollout", "--drivers", "house", *options)
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "out" / "realism.json").read_text())["rows"]
    assert [row["planner"] for row in rows[:2]] == ["idm,exponent=4,drivers=house", "rollout,drivers=house"]
    page = (tmp_path / "out" / "table.md").read_text()
    assert page.startswith("1 start in 1 file, 1 rollout; every planner"), "no plural of one"
    assert "|  to |" not in page, "an interval that is not known is empty"


def test_bad_input_is_one_line(tmp_path):
    for arguments, words in (
        ((), "realism: no recordings"),
        (("t_junction",), "its traffic was not recorded"),
        (("t_junction", "--goals", "all"), "--goals all: expected timed, place, route, turns"),
        (("t_junction", "--starts", "one"), "--starts one: write times in seconds"),
        (("t_junction", "--starts", ","), "--starts ,: write times in seconds"),
        (("t_junction", "--starts", "1,,2"), "--starts 1,,2: write times in seconds"),
        (("t_junction", "--starts", ""), "--starts : write times in seconds"),
        (("t_junction", "--starts", "1,1.0"), "--starts 1,1.0: a time is given twice"),
        (("highway", "--planner", "idm,drivers=calm", "--drivers", "house"), "idm,drivers=calm has drivers of its own"),
        (("highway", "--planner", "recorded", "--drivers", "house"), "planner recorded: drivers=house: it has none"),
    ):
        done = _run("realism", *arguments, "--out", tmp_path / "out")
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert words in done.stderr
