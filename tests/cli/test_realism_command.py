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


def test_bad_input_is_one_line(tmp_path):
    for arguments, words in (
        ((), "realism: no recordings"),
        (("t_junction",), "its traffic was not recorded"),
        (("t_junction", "--goals", "all"), "--goals all: expected timed, place, route, turns"),
        (("t_junction", "--starts", "one"), "--starts one: write times in seconds"),
    ):
        done = _run("realism", *arguments, "--out", tmp_path / "out")
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert words in done.stderr
