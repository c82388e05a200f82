"""Texts of others (messages of planners, names, results) reach no terminal as commands."""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from invented_run import invented_run
from rich.table import Table

import interdrive
from interdrive.batches import Answer
from interdrive.cli import main
from interdrive.cli.batch_report import print_answer
from interdrive.cli.report import output, print_criticality, print_run, print_table
from interdrive.cli.terminal import say, visible
from interdrive.criticality import evaluate

#: Clears the screen, sets the title of the window, writes backwards.
HOSTILE = "\x1b[2J\x1b]0;owned\x07\x9b31m\u202egnp\r\x00"
SHOWN = r"\x1b[2J\x1b]0;owned\x07\x9b31m\u202egnp\x0d\x00"

COMMANDS = Path(interdrive.__file__).parent / "cli"


@pytest.fixture(params=[False, True], ids=["into a file", "on a terminal"])
def console(request, monkeypatch):
    """What commands print to, with or without colours."""
    if request.param:
        monkeypatch.setenv("FORCE_COLOR", "1")
        monkeypatch.setenv("COLUMNS", "200")
    return request.param


def without_colours(printed: str) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", printed)


def test_characters_that_a_terminal_obeys_are_shown_and_all_others_stay():
    assert visible(HOSTILE) == SHOWN
    assert visible("größer\tals 3 m/s²\n漢字") == "größer\tals 3 m/s²\n漢字"
    assert visible("caf\udce9.xml") == r"caf\xe9.xml"


def test_messages_and_names_of_planners_in_the_table_of_a_run(capsys, console):
    run = invented_run()
    hostile = replace(
        run,
        outcomes=replace(run.outcomes, planner=("a", "b", "c", HOSTILE), message=("", "", "", HOSTILE)),
        notes=(HOSTILE,),
    )
    print_run(hostile, Path(f"out/{HOSTILE}"))
    printed = without_colours(capsys.readouterr().out)
    assert set(re.findall(r"[^\n -~\u2026]", printed)) == set()
    assert SHOWN in printed


def test_cells_and_columns_of_an_answer(capsys, console):
    print_answer(Answer((f"name {HOSTILE}",), ((HOSTILE,),)))
    printed = without_colours(capsys.readouterr().out)
    assert printed.count(SHOWN) == 2
    assert set(re.findall(r"[^\n -~]", printed)) == set()


def test_errors_name_hostile_files_on_one_harmless_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["run", "\x1b[2Jno\u202esuch.xml"])
    assert done.exit_code == 2
    assert done.stderr.startswith(r"error: \x1b[2Jno\u202esuch.xml: no such file")
    assert done.stderr[:-1].isprintable()


def test_a_line_is_printed_as_it_is_read(capsys):
    say(HOSTILE, err=True)
    assert capsys.readouterr() == ("", f"{SHOWN}\n")


@pytest.mark.parametrize("path", sorted(COMMANDS.glob("*.py")), ids=lambda path: path.name)
def test_no_command_prints_past_these_places(path):
    found = re.findall(
        r"click\.s?echo\(|(?<![\w.])print\(|\bConsole\(|\bstd(?:out|err)\.write\(", path.read_text(encoding="utf-8")
    )
    allowed = {"terminal.py": ["click.echo(", "stdout.write("]}
    assert found == allowed.get(path.name, [])


def test_rows_that_are_wider_than_the_terminal_are_printed_line_by_line(capsys, console):
    print_answer(Answer(("planner", "reason"), (("frenet", "w" * 500), ("idm", "short"))))
    printed = without_colours(capsys.readouterr().out)
    assert [line.split()[0] for line in printed.splitlines() if line[:1] != "w" and line.strip("w ")][:3] == [
        "row",
        "planner",
        "reason",
    ]
    assert "row 2\n  planner  idm" in printed


#: Names that differ only in their middles.
ALIKE = ("company.planners.cooperative:CautiousPlanner(0.5)", "company.planners.cooperative:CuriousPlanner(0.5)")


def numbers(printed):
    """How often each number stands as a whole between spaces."""
    return Counter(re.findall(r"(?<!\S)[-+]?\d[\d.]*(?!\S)", printed))


def printed_at(width, monkeypatch, capsys, print_it):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(width))
    print_it()
    return without_colours(capsys.readouterr().out)


def long_numbers():
    """Two planners that differ in the middle of their names, twelve measures, a reason that is one long word."""
    table = Table(box=None, header_style="bold", pad_edge=False, title="Means of all agents")
    table.add_column("planner")
    for k in range(12):
        table.add_column(f"measure {k} [m/s²]", justify="right")
    table.add_column("reason")
    for k, name in enumerate(ALIKE):
        table.add_row(name, *(f"{-123456.78 - 100 * j - k}" for j in range(12)), "x" * 150)
    print_table(output(), table, 1)


def run_with_large_ids():
    """Eight digits per participant, and planners that differ in the middle of their names."""
    run, more = invented_run(), 73_000_000
    outcomes = replace(
        run.outcomes,
        agent_id=run.outcomes.agent_id + more,
        partner_id=run.outcomes.partner_id + more,
        planner=(*ALIKE, *ALIKE),
    )
    states = replace(run.states, participant_id=run.states.participant_id + more)
    return replace(run, outcomes=outcomes, states=states)


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize(
    "print_it",
    [long_numbers, lambda: print_criticality(evaluate(invented_run()), "bend", Path("out"))],
    ids=["twelve measures", "criticality"],
)
def test_a_narrow_terminal_shows_every_number_that_a_wide_one_shows(monkeypatch, capsys, width, print_it):
    wide = printed_at(400, monkeypatch, capsys, print_it)
    narrow = printed_at(width, monkeypatch, capsys, print_it)
    assert len(numbers(wide)) > 5
    assert numbers(wide) - numbers(narrow) == Counter()
    assert "\u2026" not in narrow
    # Notes are left to the terminal to wrap, so that what is copied from them is whole.
    assert max(len(line) for line in narrow.splitlines() if not line.startswith("note:")) <= width


@pytest.mark.parametrize("width", [60, 80, 120])
def test_outcomes_of_a_run_keep_ids_and_times_in_narrow_terminals(monkeypatch, capsys, width):
    narrow = printed_at(width, monkeypatch, capsys, lambda: print_run(run_with_large_ids(), Path("out")))
    ids = [f"7300000{k}" for k in range(1, 5)]
    assert [one for one in ids if not numbers(narrow)[one]] == []
    assert "\u2026" not in narrow


@pytest.mark.parametrize("width", [60, 80, 120])
def test_names_that_differ_in_the_middle_stay_whole(monkeypatch, capsys, width):
    lines = printed_at(width, monkeypatch, capsys, long_numbers).splitlines()
    # Half of the terminal at most is for names, which go on in the next line.
    column = "".join(line[: min(width // 2, max(map(len, ALIKE)))].strip() for line in lines)
    assert [name for name in ALIKE if name not in column] == []


def test_tables_are_printed_in_one_way():
    past = {
        path.name: re.findall(r"\.print\(table\b", path.read_text(encoding="utf-8")) for path in COMMANDS.glob("*.py")
    }
    # An answer that is wider than the terminal is printed row by row; an inspection has words alone, which fold.
    assert {name: len(found) for name, found in past.items() if found} == {"batch_report.py": 1, "report.py": 1}
