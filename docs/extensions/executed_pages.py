"""Runs the blocks of tutorials, compares what they print with what the page says, and keeps their pictures.

A page of docs/tutorials is run from top to bottom in an empty folder: `python` blocks share their names, lines of
`console` blocks that begin with `$ ` are commands of interdrive, the other lines what they print. `# prints: TEXT` at
the end of a block of Python is its last printed line; `...` in it stands for anything. `%run-file NAME` in the language
of a block (```python NAME) also writes the block to that file. Pictures of the page are those that its run left.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FOLDER = Path(__file__).parents[1] / "tutorials"
BLOCK = re.compile(r"^```(python|console)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"!\[[^\]]*\]\(pictures/([^)]+)\)")


class PageError(Exception):
    """A page does not do what it says."""


@dataclass(frozen=True)
class Block:
    """Code of a page: its language, the file that it is written to ("": none), and its text."""

    language: str
    file: str
    text: str


def blocks_of(page: str) -> list[Block]:
    """All that is run, in the order of the page."""
    return [Block(language, file, text) for language, file, text in BLOCK.findall(page)]


def agrees(printed: str, said: str) -> bool:
    """Whether every line of the page is printed, in order, with `...` for anything."""
    lines = iter(line.rstrip() for line in printed.splitlines())
    patterns = (
        re.escape(line.rstrip()).replace(r"\.\.\.", ".*") for line in said.splitlines() if line.strip() != "..."
    )
    return all(any(re.fullmatch(pattern, line) for line in lines) for pattern in patterns if pattern)


def run_commands(text: str, folder: Path) -> None:
    """Runs a console block."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, said = part.partition("\n")
        program, *arguments = shlex.split(command)
        if program == "pip":
            continue  # the program is there already
        words = {"interdrive": ["-m", "interdrive"], "python": []}[program]
        done = subprocess.run(
            [sys.executable, *words, *arguments], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode or not agrees(done.stdout, said):
            raise PageError(f"$ {command}\nexit code {done.returncode}\n{done.stdout}\n{done.stderr}\npage:\n{said}")


def run_python(block: Block, names: dict[str, Any]) -> None:
    """Runs a block of Python in the working folder."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(block.text, block.file or "<page>", "exec"), names)
    said = "\n".join(re.findall(r"^# prints: (.*)$", block.text, re.MULTILINE))
    if not agrees(printed.getvalue(), said):
        raise PageError(f"printed:\n{printed.getvalue()}\npage:\n{said}")


def run(page: Path, pictures: Path) -> None:
    """Runs a page and copies its pictures."""
    text, before = page.read_text(encoding="utf-8"), Path.cwd()
    with tempfile.TemporaryDirectory() as made:
        folder, names = Path(made), {"__name__": "page"}
        os.chdir(folder)
        sys.path.insert(0, made)
        try:
            for block in blocks_of(text):
                if block.file:
                    (folder / block.file).write_text(block.text, encoding="utf-8")
                if block.language == "console":
                    run_commands(block.text, folder)
                else:
                    run_python(block, names)
        finally:
            os.chdir(before)
            sys.path.remove(made)
        pictures.mkdir(exist_ok=True)
        for name in PICTURE.findall(text):
            if not (folder / name).exists():
                raise PageError(f"{page.name}: its run left no {name}")
            shutil.copy(folder / name, pictures / name)


def stale(page: Path, pictures: Path) -> bool:
    """Whether it has to be run: never before, or it is newer than that."""
    mark = pictures / f"{page.stem}.ran"
    return not mark.exists() or mark.stat().st_mtime < page.stat().st_mtime


def run_all(_app: Sphinx) -> None:
    """Runs all pages that changed; `make docs` after `make clean` runs every one."""
    pictures = FOLDER / "pictures"
    for page in sorted(FOLDER.glob("*.md")):
        if page.stem != "index" and stale(page, pictures):
            try:
                run(page, pictures)
            except Exception as error:
                raise PageError(f"{page.name}: {error}") from error
            (pictures / f"{page.stem}.ran").touch()


def setup(app: Sphinx) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", run_all)
    return {"parallel_read_safe": True}
