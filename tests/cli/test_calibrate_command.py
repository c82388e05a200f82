"""`interdrive calibrate` and `interdrive drivers` at the command line."""

import signal
import subprocess
import sys
import time

import pytest

import interdrive as idr
from interdrive.testing import Car, straight_road, world


def _command(*arguments):
    return [sys.executable, "-m", "interdrive", *map(str, arguments)]


def _run(*arguments):
    return subprocess.run(_command(*arguments), capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    cars = [Car(101 + i, 30.0 * i, 0.0, 15.0 + i % 3) for i in range(12)]
    path = tmp_path_factory.mktemp("recording") / "DEU_Motorway-1_1_T-1.xml"
    idr.write_scenario(world(straight_road(900.0), cars=cars, steps=60, dt=0.2, name=path.stem), path)
    return path


@pytest.mark.long
def test_a_killed_calibration_goes_on_and_ends_with_the_same_bytes(file, tmp_path):
    options = ("--stage", "A", "--evaluations", 400, "--quiet")
    whole = _run("calibrate", file, "--out", tmp_path / "whole", *options)
    assert whole.returncode == 0, whole.stderr
    killed = subprocess.Popen(_command("calibrate", file, "--out", tmp_path / "killed", *options))
    log = tmp_path / "killed" / "evaluations.jsonl"
    while killed.poll() is None and not (log.exists() and log.read_bytes().count(b"\n") > 20):
        time.sleep(0.005)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert 20 < log.read_bytes().count(b"\n") < 400
    assert not (tmp_path / "killed" / "drivers.toml").exists()
    again = _run("calibrate", file, "--out", tmp_path / "killed", *options)
    assert again.returncode == 0, again.stderr
    for name in ("evaluations.jsonl", "drivers.toml", "calibration.json"):
        assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


def test_the_command_prints_what_it_found_and_its_drivers_can_be_looked_at_and_used(file, tmp_path):
    done = _run("calibrate", file, "--out", tmp_path / "fit", "--stage", "A", "--evaluations", 15)
    assert done.returncode == 0, done.stderr
    assert "Drivers of idm, fitted on DEU_Motorway" in done.stdout
    assert "DEU_Motorway: not judged: the population was fitted on this place" in done.stdout
    drivers = tmp_path / "fit" / "drivers.toml"
    shown = _run("drivers", drivers, "--draw", 2)
    assert shown.returncode == 0, shown.stderr
    assert "places: DEU_Motorway" in shown.stdout
    assert _run("run", file, "--planner", f"idm,drivers={drivers}", "--out", tmp_path / "run").returncode == 0


def test_populations_are_listed():
    done = _run("drivers")
    assert done.returncode == 0, done.stderr
    for name in ("house", "calm", "brisk", "calibrated", "DEU_MONAEast, USA_US101"):
        assert name in done.stdout


def test_bad_input_is_one_line(file, tmp_path):
    for arguments, words in (
        (("calibrate", "--out", tmp_path / "out"), "calibrate: no recordings"),
        (("calibrate", "t_junction", "--out", tmp_path / "out"), "its traffic was not recorded"),
        (("calibrate", file, "--planner", "pdm", "--out", tmp_path / "out"), "planner pdm: cannot be calibrated"),
        (("calibrate", file, "--hold-out", "Rome", "--out", tmp_path / "out"), "hold_out: no recording of 'Rome'"),
        (("calibrate", file, "--hold-out", ",", "--out", tmp_path / "out"), "--hold-out ,: write places as"),
        (("calibrate", file, "--hold-out", "A,,B", "--out", tmp_path / "out"), "--hold-out A,,B: write places as"),
        (("calibrate", file, "--hold-out", "", "--out", tmp_path / "out"), "--hold-out : write places as"),
        (("calibrate", file, "--split", "no.toml", "--out", tmp_path / "out"), "split no.toml: cannot be read"),
        (("calibrate", file, "--folds", "place", "--out", tmp_path / "out"), "folds: DEU_Motorway is the only place"),
        (("drivers", "hose"), "there is no population 'hose'; did you mean house?"),
    ):
        done = _run(*arguments)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert words in done.stderr
    assert not (tmp_path / "out").exists()
