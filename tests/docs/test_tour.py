"""README and tour do what they say: their examples run, one after the other, and leave what they promise."""

from __future__ import annotations

import ast
import contextlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from PIL import Image

import interdrive as idr
from interdrive.batch_report import is_batch
from interdrive.cli import main
from interdrive.failure_search import is_search
from interdrive.results import holds_run

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
README, TOUR, FOLDER = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "docs/how_to/tour.md", "docs/reference/run_folder.md")
)
PYTHON = re.findall(r"```python\n(.*?)```", TOUR, re.DOTALL)
COMMANDS = [line[2:] for block in re.findall(r"```console\n(.*?)```", TOUR, re.DOTALL) for line in block.splitlines()]


def printed(code, folder):
    """What an example in Python prints."""
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.fixture(scope="module")
def console(tmp_path_factory):
    """The folder in which all commands ran, and what each of them printed."""
    folder, said = tmp_path_factory.mktemp("tour"), {}
    with contextlib.chdir(folder):
        for command in COMMANDS:
            program, *arguments = shlex.split(command)
            assert program == "interdrive"
            done = CliRunner().invoke(main, arguments)
            assert (done.exit_code, done.stderr) == (0, ""), command
            said[command] = done.stdout
    return folder, said


def told(code):
    """The run that a page says that its lines print."""
    return re.search(r"print\(run\)  # (<Run of .*>)", code)[1]


def test_the_lines_of_the_readme_run_and_leave_a_figure_and_a_run_folder(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    shown = printed(code, tmp_path).splitlines()
    assert shown == [told(code), "['agent_id', 'planner', 'outcome']"]
    assert (tmp_path / "velocity.pdf").read_bytes().startswith(b"%PDF")
    assert holds_run(tmp_path / "out" / "t_junction")


def test_the_moving_picture_of_the_readme_is_there_and_small():
    (picture,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert 10_000 < (ROOT / picture).stat().st_size < 1_000_000


def test_the_moving_picture_of_the_readme_can_be_drawn_anew(tmp_path):
    words = [sys.executable, ROOT / "docs" / "moving_picture.py", "--out", tmp_path / "few.gif", "--frames", "3"]
    subprocess.run(words, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    with Image.open(tmp_path / "few.gif") as few, Image.open(ROOT / "docs" / "figures" / "reacting.gif") as shown:
        assert (few.n_frames, few.size) == (3, shown.size)


def test_a_run_from_python_gives_outcomes_and_states(tmp_path):
    first, *table, shape = printed(PYTHON[0], tmp_path).splitlines()
    run = idr.simulate("t_junction", agents="all")
    assert first == repr(run) == told(PYTHON[0])
    assert all(any(f" {agent.id} " in row for row in table) for agent in run.agents), "a row for each of them"
    assert shape == str(run.states.x.shape)
    assert (tmp_path / "velocity.pdf").read_bytes().startswith(b"%PDF")


def test_a_run_step_by_step_is_saved(tmp_path):
    assert printed(PYTHON[1], tmp_path) == ""
    found = idr.load(tmp_path / "out" / "lane_merge")
    assert len(found.agents) == 3
    assert found.settings["predictor"] == "constant_velocity"


def test_every_agent_gets_its_planner(tmp_path):
    planners = ast.literal_eval(printed(PYTHON[2], tmp_path))
    assert planners.pop(1001) == "idm"
    assert planners.pop(1002) == "frenet"
    assert set(planners.values()) == {"rollout"}
    assert len(planners) > 2


def test_the_planner_of_the_reader_keeps_the_contract(tmp_path):
    assert PYTHON[3:] == PYTHON[3:4], "an example that no test looks at"
    ends = ast.literal_eval(printed(PYTHON[3], tmp_path))
    assert ends["an empty road"] == "goal_reached"
    assert len(ends) == 7
    assert "planner_error" not in ends.values()


def test_every_command_leaves_what_it_is_told_to_make(console):
    folder, said = console
    made = {Path(words[words.index("--out") + 1]) for words in map(shlex.split, COMMANDS) if "--out" in words}
    runs = {path for path in made if holds_run(folder / path)}
    assert runs == {Path("out/t_junction"), Path("out/mixed"), Path("out/views")}
    assert {path for path in made if is_batch(folder / path)} == {Path("out/batch")}
    assert (folder / "out" / "velocity.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "out" / "predictions" / "measures.parquet").is_file()
    assert is_search(folder / "out" / "search")
    assert (folder / "out" / "search" / "report.html").is_file()
    others = {Path("out") / name for name in ("batch", "velocity.pdf", "predictions", "search")}
    assert made - runs == others
    assert [text[:6] for command, text in said.items() if command.startswith("interdrive verify")] == ["equal:"] * 2


def test_a_run_folder_holds_the_files_that_the_reference_lists(console):
    folder, _ = console
    rows = re.findall(r"^\| (`[^|]*) \| (.*) \|$", FOLDER, re.MULTILINE)
    described = {name for names, _ in rows for name in re.findall(r"`([\w.]+)`", names)}
    found = {path.name for run in ("t_junction", "views") for path in (folder / "out" / run).iterdir()}
    tables = ("predictions", "candidates", "messages", "agreements", "hits", "profile")
    tables += ("preventability", "preventability_drives", "demand", "sumo")
    on_demand = {f"{table}.parquet" for table in tables}
    assert described - on_demand - {"run.mp4"} == found


def test_settings_of_an_agent_reach_its_run(console):
    folder, _ = console
    mixed, views = (idr.load(folder / "out" / name) for name in ("mixed", "views"))
    chosen = dict(zip(mixed.outcomes.agent_id.tolist(), mixed.outcomes.planner, strict=True))
    assert (chosen[1001], chosen[1002]) == ("idm", "frenet")
    assert mixed.settings["planner"]["1002"] == {"planner": "frenet", "level": 1}
    assert views.settings["views"]["2001"]["occlusion"] is True
    assert len(views.views.observer_id)
