"""Texts of others (messages of planners, names, results) reach no terminal as commands."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from invented_run import invented_run

import interdrive
from interdrive.batches import Answer
from interdrive.cli import main
from interdrive.cli.batch_report import print_answer
from interdrive.cli.report import print_run
from interdrive.cli.terminal import say, visible

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
    # CSV that a file or another program reads is printed as it is.
    allowed = {"terminal.py": ["click.echo("], "sql.py": ["stdout.write("], "score_report.py": ["stdout.write("]}
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
