"""Tables of the commands: no empty columns, nothing cut, headings in one line where there is room."""

from __future__ import annotations

import io

import pytest
from click.testing import CliRunner
from drivers import Straight
from rich.console import Console
from rich.table import Table

from interdrive import save, simulate
from interdrive.cli import main
from interdrive.cli.report import print_study, print_table
from interdrive.studies import case_study
from interdrive.testing import Car, problem, straight_road, world


def printed(columns, rows, *, width=80, names=1):
    """Lines of a table; numbers are the columns whose heading ends in a unit."""
    console = Console(file=io.StringIO(), width=width)
    table = Table(box=None, pad_edge=False)
    for name in columns:
        table.add_column(name, justify="right" if name.endswith("]") else "left")
    for row in rows:
        table.add_row(*row)
    print_table(console, table, names)
    return [" ".join(line.split()) for line in console.file.getvalue().splitlines()]


def test_a_column_whose_cells_are_all_empty_is_left_out():
    rows = [("7", "", "2.0", ""), ("8", "", "3.0", " ")]
    assert printed(("agent", "errors", r"time \[s]", "why"), rows) == ["agent time [s]", "7 2.0", "8 3.0"]


@pytest.mark.parametrize("filled", [0, 1, 2])
def test_a_column_with_one_cell_that_is_not_empty_stays(filled):
    rows = [(str(k), "late" if k == filled else "") for k in range(3)]
    assert printed(("agent", "why"), rows)[0] == "agent why"


def test_a_cell_of_markup_around_nothing_is_empty():
    assert printed(("agent", "outcome", "with"), [("7", "[red][/]", "9")]) == ["agent with", "7 9"]


def test_an_empty_name_is_left_out_but_never_the_only_one():
    assert printed(("category", "planner", "score"), [("", "idm", "1")], names=2) == ["planner score", "idm 1"]
    assert printed(("planner", "score"), [("", "1")]) == ["planner score", "1"]


def test_a_table_without_rows_has_all_its_headings():
    assert printed(("agent", "why"), []) == ["agent why"]


def test_a_zero_is_not_empty():
    assert printed(("agent", r"harm \[1]"), [("7", "0")]) == ["agent harm [1]", "7 0"]


def test_a_column_that_is_left_out_takes_no_room_from_the_others():
    rows = [("7", "", "1234567.89", "1234567.89")]
    columns = ("agent", "a word that would need the room", r"first \[m]", r"second \[m]")
    assert printed(columns, rows, width=32) == ["agent first [m] second [m]", "7 1234567.89 1234567.89"]


@pytest.mark.parametrize(("width", "head"), [(40, ["agent time gone [s]"]), (14, ["time", "gone", "agent [s]"])])
def test_headings_stand_in_one_line_if_there_is_room(width, head):
    lines = printed(("agent", r"time gone \[s]"), [("7", "2.0")], width=width)
    assert lines == [*head, "7 2.0"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Agent 1 is alone on its road and reaches its goal."""
    agent = problem(1, 20.0, goal=(60.0, 0.0), time_step=(0, 90))
    run = simulate(world(straight_road(), problems=[agent]), planner=Straight, threads=1)
    return save(run, tmp_path_factory.mktemp("tables") / "run")


def heading(*arguments):
    done = CliRunner().invoke(main, [*map(str, arguments)])
    assert done.exit_code == 0, done.output
    return done.stdout.splitlines()[0].split()


def test_a_run_without_collisions_has_no_columns_about_them(tmp_path):
    assert heading("run", "lane_merge", "--out", tmp_path / "run") == ["agent", "outcome", "time", "[s]"]


def test_a_full_score_has_no_why_and_one_without_reacting_traffic_no_hindrance(folder):
    said = heading("score", folder, "--panel", "none")
    assert said == ["agent", "score", "gates", "arrival", "pace", "contact", "comfort", "CLS", "EPDMS", "score", "1"]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_table_of_a_study_has_its_units_and_no_number_is_cut(width, monkeypatch, tmp_path, capsys):
    agent = problem(1, 20.0, velocity=9.0, goal=(120.0, 0.0), time_step=(0, 150))
    scenario = world(straight_road(), cars=[Car(7, 45.0, velocity=6.0)], problems=[agent])
    study = case_study(scenario, agent=1, other=7, planner="idm", threads=1)
    monkeypatch.setattr("interdrive.cli.report.output", lambda: Console(width=width))
    print_study([study], [], tmp_path)
    said = capsys.readouterr().out
    words = said.split()
    assert {"deterministic", "semi-deterministic", "interactive", "DCE", "[m]", "TTC", "[s]"} <= {*words}
    assert "…" not in said
    assert max(len(line) for line in said.splitlines() if not line.startswith("results in")) <= width
    for row in study.table.to_pylist():
        assert f"{row['min_dce']:.2f}" in words
