"""Arguments that several commands share: scenario names, settings, folders."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.config.plugins import read_choice
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from interdrive.config.plugins import Choice
    from interdrive.storage import FolderKind


#: `--raw` of all commands that read scenario files.
raw_option = click.option(
    "--raw", is_flag=True, help="Read recordings as they are in the file, without repairs (recording.raw)."
)


#: `--source` of all commands that read files of other tools.
source_option = click.option(
    "--source",
    "source",
    metavar="NAME=VALUE",
    multiple=True,
    help="How a file of another tool is read (source.NAME): map, dt, keep, ...; see `interdrive convert --help`.",
)


def assigned(assignments: Sequence[str], *, raw: bool = False, source: Sequence[str] = ()) -> dict[str, str]:
    """Values of `--set` by dotted name, and those of `--raw` and `--source`."""
    values = {"recording.raw": "true"} if raw else {}
    for option, prefix, texts in (("--set", "", assignments), ("--source", "source.", source)):
        for text in texts:
            name, equals, value = text.partition("=")
            if not equals:
                raise InputError(f"{option} {text}: write it as name=value")
            values[f"{prefix}{name.strip()}"] = value.strip()
    return values


@contextmanager
def named_options(options: Mapping[str, object]) -> Iterator[None]:
    """Names the option in the error of an argument."""
    try:
        yield
    except InputError as error:
        name, colon, message = str(error).partition(": ")
        if not colon or options.get(name) is None:
            raise
        raise InputError(f"--{name} {options[name]}: {message}") from error.__cause__


def choices_by_agent(texts: Sequence[str]) -> dict[int, Choice]:
    """Choices of `--agent` by id."""
    found: dict[int, Choice] = {}
    for text in texts:
        number, equals, choice = text.partition("=")
        try:
            agent = int(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"--agent {text}: write it as ID=PLANNER[,NAME=VALUE...]")
        if agent in found:
            raise InputError(f"--agent {text}: agent {agent} is named twice")
        try:
            found[agent] = read_choice(choice, "planner")
        except InputError as error:
            raise error.within(f"--agent {number}") from None
    return found


def id_list(option: str, text: str) -> list[int]:
    """Ids as written behind an option: 12,34."""
    try:
        return [int(number) for number in text.split(",")]
    except ValueError:
        raise InputError(f"{option} {text}: write them as 12,34") from None


@contextmanager
def claimed_folder(
    out: str | None,
    name: str,
    kind: FolderKind,
    *,
    overwrite: bool = False,
    inputs: Iterable[str | Path] = (),
    tables: bool = True,
) -> Iterator[Path]:
    """Claims the folder of `--out`, or a new one under out/, numbered if necessary; yields its absolute path.

    Args:
        out: The folder, or None.
        name: Of the new folder.
        kind: What it is to hold.
        overwrite: The folder of `--out` may be replaced.
        inputs: Files that are read, none of which may be replaced.
        tables: Check now that tables can be written.

    Raises:
        ResultsError: Tables cannot be written, another process has claimed it, it cannot be used, or an input lies in
            it.
    """
    from interdrive.storage import check_tables, claimed, claimed_new  # noqa: PLC0415 - numpy

    if tables:
        check_tables()
    if out is None:
        with claimed_new(Path("out") / name, kind) as folder:
            yield folder
    else:
        with claimed(out, kind, overwrite=overwrite, inputs=inputs) as folder:
            yield folder


def named_files(*values: object) -> list[Path]:
    """The files among texts, also within mappings and sequences: weights, policies, configuration.

    Args:
        values: Options and settings as they were given; texts of choices may hold several, PLANNER,NAME=FILE.
    """
    found: list[Path] = []
    for value in values:
        if isinstance(value, Mapping):
            found += named_files(*value.values())
        elif isinstance(value, list | tuple):
            found += named_files(*value)
        elif isinstance(value, str):
            for text in (value, *(part.partition("=")[2] for part in value.split(","))):
                with suppress(OSError, RuntimeError, ValueError):  # too long, no such user, no path at all
                    if text and (path := Path(text).expanduser()).is_file():
                        found.append(path)
    return found


def shown(folder: Path) -> Path:
    """The folder for display: relative to the working folder if it is inside it."""
    here = Path.cwd()
    return folder.relative_to(here) if folder.is_relative_to(here) else folder
