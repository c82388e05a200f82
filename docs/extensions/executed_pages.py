"""Runs the blocks of tutorials, compares what they print with what the page says, and keeps output and pictures.

A page of docs/tutorials is run from top to bottom in an empty folder: `python` blocks share their names, lines of
`console` blocks that begin with `$ ` are commands of interdrive, the other lines what they print. `# prints: TEXT` in a
block of Python is a line that it prints; `...` stands for anything, and the site shows what was printed in its place.
A block with a name after its language (```python NAME) is only written to that file, from which others import. Pictures
of the page are those that its run left, by their own name or, with `<!-- NAME is PATH -->`, at a path that may have
wildcards.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FOLDER = Path(__file__).parents[1] / "tutorials"
BLOCK = re.compile(r"^```(python|console)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"!\[[^\]]*\]\(pictures/([^)]+)\)")
PLACE = re.compile(r"^<!-- (\S+) is (\S+) -->$", re.MULTILINE)
#: Lines of output that the site shows of one command.
SHOWN = 24


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


def shown(printed: str) -> str:
    """Output as the site shows it: without space at the ends of lines, and not too long."""
    lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
    return "".join(f"{line}\n" for line in (lines if len(lines) <= SHOWN else [*lines[: SHOWN - 1], "..."]))


def run_commands(text: str, folder: Path) -> str:
    """Runs a console block and returns it with what was printed in place of `...`."""
    found = []
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, said = part.partition("\n")
        program, *arguments = shlex.split(command, comments=True)
        if program == "pip":
            found.append(f"$ {part}")
            continue  # the program is there already
        words = {"interdrive": ["-m", "interdrive"], "python": []}[program]
        done = subprocess.run(
            [sys.executable, *words, *arguments], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode or not agrees(done.stdout, said):
            raise PageError(f"$ {command}\nexit code {done.returncode}\n{done.stdout}\n{done.stderr}\npage:\n{said}")
        found.append(f"$ {command}\n{shown(done.stdout) if '...' in said else said}")
    return "".join(found)


def run_python(block: Block, names: dict[str, Any]) -> str:
    """Runs a block of Python in the working folder and returns it with what was printed in place of `...`."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(block.text, "<page>", "exec"), names)
    said = re.findall(r"^# prints: (.*)$", block.text, re.MULTILINE)
    if not agrees(printed.getvalue(), "\n".join(said)):
        raise PageError(f"printed:\n{printed.getvalue()}\npage:\n{said}")
    lines = printed.getvalue().splitlines()
    if len(said) != len(lines):
        return block.text
    return re.sub(r"^# prints: .*$", lambda _: f"# prints: {lines.pop(0)}", block.text, flags=re.MULTILINE)


def run(page: Path, pictures: Path) -> None:
    """Runs a page; copies its pictures and writes its blocks, as the site shows them, to STEM.json beside them."""
    text, before, made_blocks = page.read_text(encoding="utf-8"), Path.cwd(), []
    with tempfile.TemporaryDirectory() as made:
        folder, module = Path(made), ModuleType("page")  # dataclasses look for the module of a class
        sys.modules["page"], names = module, vars(module)
        os.chdir(folder)
        sys.path.insert(0, made)
        try:
            for block in blocks_of(text):
                if block.file:
                    (folder / block.file).write_text(block.text, encoding="utf-8")
                if block.language == "console":
                    made_blocks.append(run_commands(block.text, folder))
                else:
                    made_blocks.append(block.text if block.file else run_python(block, names))
        finally:
            os.chdir(before)
            sys.path.remove(made)
            for name in ("page", *(Path(block.file).stem for block in blocks_of(text) if block.file)):
                sys.modules.pop(name, None)
        pictures.mkdir(exist_ok=True)
        places = dict(PLACE.findall(text))
        for name in PICTURE.findall(text):
            left = sorted(folder.glob(places.get(name, name)))
            if not left:
                raise PageError(f"{page.name}: its run left no {places.get(name, name)}")
            shutil.copy(left[0], pictures / name)
        (pictures / f"{page.stem}.json").write_text(json.dumps(made_blocks), encoding="utf-8")


def stale(page: Path, pictures: Path) -> bool:
    """Whether it has to be run: never before, or it is newer than that."""
    mark = pictures / f"{page.stem}.json"
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


def with_output(text: str, made: list[str]) -> str:
    """A page with the blocks that its run made."""
    blocks = iter(made)

    def block(found: re.Match[str]) -> str:
        head = f"```{{code-block}} {found[1]}\n:caption: {found[2]}\n\n" if found[2] else f"```{found[1]}\n"
        return f"{head}{next(blocks)}```"

    return BLOCK.sub(block, text)


def show_output(_app: Sphinx, name: str, text: list[str]) -> None:
    """Puts what was printed into a tutorial that Sphinx has read."""
    made = FOLDER / "pictures" / f"{Path(name).name}.json"
    if name.startswith("tutorials/") and made.exists():
        text[0] = with_output(text[0], json.loads(made.read_text(encoding="utf-8")))


def setup(app: Sphinx) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", run_all)
    app.connect("source-read", show_output)
    return {"parallel_read_safe": True}
