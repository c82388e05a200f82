"""Parts of reference pages that are written from the program before every build: commands, columns, messages."""

from __future__ import annotations

import ast
import importlib
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
import pyarrow as pa

import interdrive
from interdrive.batches import COLUMNS as DATA_SET
from interdrive.cli import main
from interdrive.criticality.tables import COLUMNS as CRITICALITY
from interdrive.results.columns import COLUMNS
from interdrive.scoring.tables import COLUMNS as SCORE
from interdrive.storage import arrow_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from sphinx.application import Sphinx

    from interdrive.storage import Column

PACKAGE = Path(interdrive.__file__).parent
FOLDER = Path(__file__).parents[1] / "reference" / "generated"
#: A message with fewer letters of its own says nothing without what it fills in.
LETTERS = 8
#: Errors of input and results; all others are bugs or those of planners.
ERRORS = ("InputError", "NoRouteError", "PredictorError", "ResultsError", "MissingExtraError")


def cell(text: str) -> str:
    """Text for a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


def commands() -> str:
    """Every command as `--help` prints it."""
    parts = []
    for name in main.list_commands(click.Context(main)):
        command = main.get_command(click.Context(main), name)
        assert command is not None
        context = click.Context(command, info_name=f"interdrive {name}", terminal_width=100, max_content_width=100)
        parts.append(f"### interdrive {name}\n\n```text\n{command.get_help(context)}\n```\n")
        for below, one in getattr(command, "commands", {}).items():
            context = click.Context(one, info_name=f"interdrive {name} {below}", terminal_width=100)
            parts.append(f"#### interdrive {name} {below}\n\n```text\n{one.get_help(context)}\n```\n")
    return "\n".join(parts)


def columns(found: Sequence[Column]) -> str:
    """A table of columns with the types that the file has."""
    types = {field.name: field.type for field in arrow_table(found, {column.name: [] for column in found}).schema}
    rows = (
        f"| `{one.name}` | {name_of(types[one.name])} | {one.unit} | {cell(one.text)} | {cell(one.null)} |"
        for one in found
    )
    return "\n".join(("| column | type | unit | meaning | null where |", "|---|---|---|---|---|", *rows))


def name_of(kind: pa.DataType) -> str:
    """The type of the values, which a dictionary only stores differently."""
    return cell(str(kind.value_type if pa.types.is_dictionary(kind) else kind))


def run_folder() -> str:
    """The tables of a run folder."""
    every = {**COLUMNS, "criticality": CRITICALITY, "criticality_extremes": CRITICALITY, "score": SCORE}
    return "\n".join(f"## {name}.parquet\n\n{columns(found)}\n" for name, found in every.items())


def data_set() -> str:
    """The data set of a batch."""
    return f"{columns(DATA_SET)}\n"


def words_of(node: ast.expr) -> str:
    """The text of an argument of an error, with `...` for what is known only then."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(words_of(part) for part in node.values)
    if isinstance(node, ast.BinOp):
        return words_of(node.left) + words_of(node.right)
    return "…"


def raised(path: Path) -> Iterable[tuple[str, str]]:
    """Class and text of every error that a module makes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ERRORS and node.args:
            text = ": ".join(words_of(argument) for argument in node.args)
            if sum(letter.isalpha() for letter in text) >= LETTERS:
                yield node.func.id, text


def messages() -> str:
    """Every message of an error, by package."""
    parts = []
    for place in sorted(PACKAGE.iterdir()):
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place] * (place.suffix == ".py")
        rows = sorted({f"| {cell(text)} | `{name}` |" for path in files for name, text in raised(path)})
        if rows:
            parts.append(f"## {place.stem}\n\n| message | exception |\n|---|---|\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def constants(module: str) -> str:
    """The public constants of a module: the comment above them, and their value where it is words or a number."""
    folder = PACKAGE / module
    source = "\n".join(path.read_text(encoding="utf-8") for path in sorted(folder.rglob("*.py")))
    rows = []
    for name in sorted(importlib.import_module(f"interdrive.{module}").__all__):
        found = re.search(rf"^((?:#: .*\n)*){name}(?:: [^\n=]+)? = ", source, re.MULTILINE)
        if found is None:
            continue
        said = " ".join(line.removeprefix("#: ") for line in found[1].splitlines())
        value = getattr(importlib.import_module(f"interdrive.{module}"), name)
        values = value if isinstance(value, tuple) else (value,)
        plain = name.isupper() and all(isinstance(one, int | str) for one in values)
        shown = ", ".join(f"`{one}`" for one in values) if plain else ""
        rows.append(f"| `{name}` | {cell(said)} | {shown} |")
    return "\n".join(("## Constants", "", "| name | meaning | value |", "|---|---|---|", *rows, "")) if rows else ""


def write(_app: Sphinx) -> None:
    """Writes pages that changed, so that Sphinx reads only those again."""
    FOLDER.mkdir(exist_ok=True)
    pages = {"commands": commands, "run_folder": run_folder, "data_set": data_set, "messages": messages}
    modules = [path.stem for path in (FOLDER.parent / "modules").glob("*.md") if (PACKAGE / path.stem).is_dir()]
    pages |= {f"constants_{name}": partial(constants, name) for name in modules}
    for name, made in pages.items():
        path, text = FOLDER / f"{name}.md", made()
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}
