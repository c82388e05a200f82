"""Damaged run folders: every command says in one line what is wrong where, and writes nothing."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from damage import DAMAGES, edited
from interdrive.assessment import reopen
from interdrive.cli import main
from interdrive.results import load, save
from interdrive.run_settings import RecordSettings, SimulationSettings
from interdrive.simulation import Simulation, simulate
from interdrive.testing import Car, problem, straight_road, world

EVERYTHING = RecordSettings(views=True, predictions=True, candidates=2, candidate_spacing=0.0)

#: Commands that read run folders, the folder to be put in.
COMMANDS = (
    ("verify", "run"),
    ("report", "run", "--quiet"),
    ("criticality", "run", "--quiet"),
    ("plot", "run", "--kind", "velocity", "--quiet"),
)


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    """Two agents behind each other, one of whom drives on; everything recorded."""
    problems = [problem(agent, x, goal=(x + 20.0, 0.0), time_step=(0, 12)) for agent, x in ((1, 10.0), (2, 40.0))]
    scenario = world(straight_road(), cars=[Car(7, 90.0, velocity=12.0)], problems=problems, steps=12)
    run = simulate(
        scenario, agents="all", predictor="constant_velocity", settings=SimulationSettings(record=EVERYTHING)
    )
    return save(run, tmp_path_factory.mktemp("sound") / "run")


@pytest.fixture
def folder(sound, tmp_path, monkeypatch) -> Path:
    """A copy, called `run` in the working folder."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(sound, tmp_path / "run"))


def content(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


@pytest.mark.parametrize("command", COMMANDS[1:], ids=lambda command: command[0])
def test_the_folder_without_damage_is_accepted(folder, command):
    done = CliRunner().invoke(main, command)
    assert (done.exit_code, done.output) == (0, "")


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.name)
def test_damage_is_one_line_that_names_file_and_field(folder, capfd, damage):
    damage.do(folder)
    before = content(folder.parent)
    for command in COMMANDS:
        done = CliRunner().invoke(main, command)
        assert (done.exit_code, done.stdout) == (2, ""), (command, done.output, done.exception)
        assert done.stderr.startswith("error: run/"), command
        assert damage.words in done.stderr, command
        assert done.stderr.count("\n") == 1
        assert len(done.stderr) < 300
        assert capfd.readouterr() == ("", "")
    assert content(folder.parent) == before


def test_a_folder_without_row_counts_is_read_as_before(folder):
    edited(folder / "run.json", lambda info: info.pop("rows"))
    assert load(folder).states.num_rows > 0


def test_a_run_that_was_stopped_before_an_agent_had_started_is_sound(tmp_path):
    late = problem(2, 10.0, goal=(60.0, 0.0), time_step=(0, 60), start=20)
    scenario = world(straight_road(), problems=[problem(1, 10.0, goal=(60.0, 0.0), time_step=(0, 40)), late], steps=50)
    simulation = Simulation(scenario, agents="all", predictor="constant_velocity", threads=1)
    for _ in range(5):
        simulation.step()
    again = reopen(save(simulation.record(), tmp_path / "run"))
    assert again.states.valid.sum(axis=1).tolist() == [6, 0]
    assert [agent.start_time_step for agent in again.agents] == [0, 20]


def test_a_path_to_something_without_an_end_is_not_read(folder):
    edited(folder / "run.json", lambda info: info["scenario"].update(path="/dev/zero", sha256="0" * 64))
    done = CliRunner().invoke(main, ["verify", "run"])
    assert (done.exit_code, done.stderr) == (2, "error: /dev/zero: the scenario file has changed since the run\n")
    assert CliRunner().invoke(main, ["plot", "run", "--kind", "velocity"]).exit_code == 0
