"""Damaged run folders: every command says in one line what is wrong where, and writes nothing."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from damage import DAMAGES, edited, with_cell

from interdrive.cli import main
from interdrive.config.schema import RecordSettings, SimulationSettings
from interdrive.report import write_run_report
from interdrive.report.contents import run_contents
from interdrive.report.packing import Packer
from interdrive.results import read_results, save
from interdrive.runs import reopen
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
    """Two agents behind each other, one of which drives on; everything recorded."""
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


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (("report", "run"), "run/report.html"),
        (("report", "run", "--out", "page.html"), "page.html"),
        (("criticality", "run"), "run/criticality.parquet"),
        (("criticality", "run", "--out", "made"), "made/criticality_extremes.parquet"),
        (("plot", "run", "--kind", "velocity", "--out", "figure.pdf"), "figure.pdf"),
    ],
)
def test_no_command_writes_through_a_link(folder, command, name):
    Path("precious").write_text("precious")
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).symlink_to(folder.parent / "precious")
    assert CliRunner().invoke(main, [*command, "--quiet"]).exit_code == 0
    assert Path("precious").read_text() == "precious"
    assert not Path(name).is_symlink()


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("measure", "luck", "measure: 'luck' is not one of hw, thw, ttc"),
        ("time_step", 10**6, "out of order"),
        ("participant_id", -(2**60), "participant_id: -1152921504606846976 in row 9 is too large"),
    ],
)
def test_a_page_says_that_the_table_of_criticality_is_damaged(folder, column, value, words):
    assert CliRunner().invoke(main, ["criticality", "run", "--quiet"]).exit_code == 0
    path = folder / "criticality.parquet"
    pq.write_table(with_cell(column, value, 9)(pq.read_table(path)), path)
    [said] = [entry["text"] for entry in run_contents(folder).header["missing"] if entry["what"] == "criticality"]
    assert "criticality.parquet: " in said
    assert words in said


def test_texts_of_others_stay_texts_in_a_page(folder):
    hostile = "</script><script>alert(1)</script><!--\x1b[2J\u2028"
    path = folder / "outcomes.parquet"
    pq.write_table(with_cell("message", hostile)(pq.read_table(path)), path)
    edited(folder / "run.json", lambda info: info["notes"].append(hostile))
    page = write_run_report(folder).read_text(encoding="utf-8")
    assert page.count("<script") == page.count("</script>") == 3
    assert "<!--" not in page.partition("<body>")[2].partition("<script>")[0]
    found = re.search(r'id="header">(.*?)</script>', page, re.DOTALL)
    assert json.loads(found[1])["info"]["notes"][-1] == hostile


def test_a_page_holds_no_nan(folder):
    path = folder / "outcomes.parquet"
    pq.write_table(with_cell("impact_speed", float("nan"))(pq.read_table(path)), path)
    page = write_run_report(folder).read_text(encoding="utf-8")

    def refuse(constant):
        raise AssertionError(constant)

    header = json.loads(re.search(r'id="header">(.*?)</script>', page, re.DOTALL)[1], parse_constant=refuse)
    assert {person.get("impact_speed") for person in header["participants"]} == {None}


def test_a_folder_without_row_counts_is_read_as_before(folder):
    edited(folder / "run.json", lambda info: info.pop("rows"))
    assert read_results(folder).states.num_rows > 0


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
    assert done.exit_code == 2
    assert done.stderr.startswith("error: /dev/zero: the scenario of the run cannot be read (it is a pipe or a device")
    assert CliRunner().invoke(main, ["plot", "run", "--kind", "velocity"]).exit_code == 0


def test_numbers_too_large_for_a_resolution_are_packed_all_the_same():
    packer = Packer()
    packer.add("x", np.array([[0.0, 1e9, np.nan]]), unit=0.01, steps=True)
    assert packer.header["x"]["type"] == "f32"
