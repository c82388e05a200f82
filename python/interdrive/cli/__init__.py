"""The command line, the only place that prints. Heavy modules are imported by the commands, not before.

Exit codes: 0 success; 1 an agent ended with planner_error, or `verify` found a difference; 2 input that cannot be used
    (one line on stderr); 70 a bug in interdrive (one line; INTERDRIVE_TRACEBACK=1 shows the traceback); 71 out of
    memory; 130 interrupted; 141 the output pipe was closed. Unexpected exceptions leave `main`, and
    `interdrive.__main__` turns them into the line for 70 or 71.
"""

from __future__ import annotations

import importlib
import logging
import os
import sys
from pathlib import Path
from typing import Any, NoReturn

import click

from interdrive.cli.terminal import say
from interdrive.errors import InterdriveError

INTERRUPTED, READER_GONE = 130, 141


class _Commands(click.Group):
    """A group that imports only the command that is called, and turns every error but bugs into one line and a code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of `--help`."""
        return [name for members in _GROUPS.values() for name in members]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of a name."""
        texts = {name: text for members in _GROUPS.values() for name, text in members.items()}
        if cmd_name not in texts:
            return None
        name = cmd_name.replace("-", "_")
        command: click.Command = getattr(importlib.import_module(f"interdrive.cli.{_HOME.get(name, name)}"), name)
        command.short_help = texts[cmd_name]
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, which suggests names that are similar to a wrong one."""
        self.commands = dict.fromkeys(self.list_commands(ctx), self)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Lists the commands by what they are for."""
        for title, members in _GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(list(members.items()))

    def main(self, *args: Any, **kwargs: Any) -> NoReturn:  # noqa: ANN401 - click's signature
        """Runs a command and exits; usage errors of click are one line, too."""
        kwargs["standalone_mode"] = False
        try:
            code = super().main(*args, **kwargs)
        except click.exceptions.NoArgsIsHelpError as error:
            error.show()
            code = error.exit_code
        except click.ClickException as error:
            code = _complain(error.format_message(), error.exit_code)
        except click.Abort:  # Ctrl-C or the end of the input at a question, or before a command began
            say("interrupted, nothing written", err=True)
            code = INTERRUPTED
        sys.exit(code if isinstance(code, int) else 0)

    def invoke(self, ctx: click.Context) -> int:
        """Returns the exit code of the chosen command."""
        # What it says about its cache is of no use to the user.
        logging.getLogger("matplotlib").addHandler(logging.NullHandler())
        try:
            # The user's planners and predictors may be in the working folder; installed packages take precedence.
            sys.path.append(str(Path.cwd()))
        except FileNotFoundError:
            return _complain("the working folder no longer exists; change to another one", 2)
        try:
            code = super().invoke(ctx)
            sys.stdout.flush()
        except InterdriveError as error:
            return _complain(str(error), error.exit_code)
        except KeyboardInterrupt as stop:
            # How far a simulation came matters only where it is kept.
            told = "" if hasattr(stop, "run") else str(stop)
            say(told or "interrupted, nothing written", err=True)
            return INTERRUPTED
        except BrokenPipeError:
            # The interpreter would flush stdout once more and complain.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return READER_GONE
        except OSError as error:
            return _complain(": ".join(str(part) for part in (error.filename, error.strerror or error) if part), 2)
        return code if isinstance(code, int) else 0


def _complain(text: str, code: int) -> int:
    say(f"error: {' '.join(text.split())}", err=True)
    return code


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="interdrive")
def main() -> None:
    """Drive real CommonRoad scenarios in which every vehicle plans for itself."""


#: Commands by what they are for, in the order of `interdrive --help`, with the line that says what they do there.
_GROUPS = {
    "Run": {
        "run": "Simulate a scenario in which vehicles plan for themselves.",
        "check": "Inspect scenario files and list possible agents.",
        "convert": "Convert a map or a recording of another tool to CommonRoad.",
        "problem": "Put planning problems on a map, from lane to lane.",
        "traffic": "Fill a map with generated traffic, as a scenario file.",
        "join": "Join consecutive recordings into one file.",
        "verify": "Repeat a run and compare all states.",
        "rerun": "Repeat the run of an older folder with this version.",
        "study": "Replay an encounter at three degrees of interaction.",
    },
    "Look at a run": {
        "report": "Write a run or a batch as an interactive HTML page.",
        "explain": "Explain why agents ended as they did.",
        "plot": "Draw a figure for a paper.",
        "criticality": "Measure how close traffic came to accidents.",
        "score": "Score agents from 0 to 100, with reasons.",
        "preventability": "Say what reference drivers would have avoided.",
        "solution": "Export a run as a CommonRoad solution.",
        "export": "Write the traffic of a run for other tools: OSI, CSV.",
    },
    "Compare": {
        "batch": "Run many scenarios with several planners.",
        "compare": "Compare the planners of a batch, with confidence intervals.",
        "sql": "Query the results of a batch with SQL.",
        "benchmark": "Score a planner on a fixed set of scenarios.",
        "panel": "Store what reference drivers reach on a set.",
        "search": "Search failures of a planner that are its fault.",
        "adversaries": "Check that bad drivers rank below honest ones.",
        "alks": "Drive the manoeuvres of UN R157 over a grid.",
        "predict-eval": "Compare predictions with recordings.",
        "realism": "Measure how far planners drive from recorded people.",
        "calibrate": "Fit a population of drivers to recordings.",
    },
    "Look up": {
        "settings": "List settings with defaults, units and meaning.",
        "planners": "List planners, or the settings of one.",
        "predictors": "List predictors, or the settings of one.",
        "drivers": "List populations of drivers, or show one.",
        "models": "List or install published weights.",
    },
}
#: Modules of commands that are not called as their command is.
_HOME = {"report": "page", "planners": "plugins", "predictors": "plugins"}

__all__ = ["main"]
