"""When tables were measured, and whether the code has changed since: a note on their pages, and docs/research/ages.md.

python docs/extensions/ages.py                                   # lists them
python docs/extensions/ages.py --measured NAME [--version V]     # NAME was measured with the present code, today

docs/research/measured.toml names every group of tables: page and section, command, code, and when it was measured with
which version. The code is known by the SHA-256 of its files. The notes are made when the site is built.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import re
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
STORED, PAGE = ROOT / "docs/research/measured.toml", ROOT / "docs/research/ages.md"
SOURCES, COMMENT = ("*.py", "*.rs", "*.ts"), re.compile(rb"\s*(//|# |#:)")
HEAD = """# Age of the tables

Tables may differ now if their code has changed since. Run their command to know.

| tables | command | measured on | version | code since then |
|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Measured:
    """A group of tables: where, what, by which command, of which code, when, and the fingerprint of the code then.

    `section` is the heading on the page below which the tables stand; "" means all of the page.
    """

    name: str
    page: str
    what: str
    command: str
    code: tuple[str, ...]
    date: str
    version: str
    sha256: str
    section: str = ""

    def is_current(self, root: Path = ROOT) -> bool:
        """Whether the code is still that which was measured."""
        return fingerprint(self.code, root) == self.sha256

    def note(self) -> str:
        """What the page says about them."""
        since = "has not changed" if self.is_current() else "**has changed**"
        return (
            f":::{{note}}\nMeasured on {self.date} with interdrive {self.version}: `{self.command}`. "
            f"The code that it measures {since} since.\n:::\n"
        )


def noted(text: str, groups: list[Measured]) -> str:
    """A page with a note below the heading of each group of its tables."""
    for one in groups:
        heading = rf"^##+ {re.escape(one.section)}$" if one.section else r"^# .*$"
        text, count = re.subn(heading, lambda found, one=one: f"{found[0]}\n\n{one.note()}", text, count=1, flags=re.M)
        if not count:
            sys.exit(f"{one.page}: {STORED.name} has a section {one.section!r}, the page has not")
    return text


def fingerprint(code: tuple[str, ...], root: Path = ROOT) -> str:
    """SHA-256 of names and code of source files, of folders with everything in them; lines of comment are not code."""
    found = hashlib.sha256()
    for place in code:
        path = root / place
        files = [path] if path.is_file() else sorted(one for kind in SOURCES for one in path.rglob(kind))
        if not files:
            sys.exit(f"{STORED.name}: {place} holds no code")
        for file in files:
            lines = b"".join(line for line in file.read_bytes().splitlines(True) if not COMMENT.match(line))
            found.update(str(file.relative_to(root)).encode() + b"\0" + lines + b"\0")
    return found.hexdigest()


def stored() -> list[Measured]:
    """All groups of tables."""
    entries = tomllib.loads(STORED.read_text(encoding="utf-8"))
    return [Measured(name, **{**entry, "code": tuple(entry["code"])}) for name, entry in entries.items()]


def page() -> str:
    """The page."""
    rows = (
        f"| [{one.what}](../{one.page}) | `{one.command}` | {one.date} | {one.version} | "
        f"{'unchanged' if one.is_current() else '**changed**'} |"
        for one in stored()
    )
    return HEAD + "\n".join(rows) + "\n"


def stamp(name: str, version: str) -> None:
    """Notes that a group was measured today."""
    one = next((one for one in stored() if one.name == name), None)
    if one is None:
        sys.exit(f"{name}: no such tables; {STORED.name} has {', '.join(each.name for each in stored())}")
    text = STORED.read_text(encoding="utf-8")
    head, own, rest = re.split(rf"(\[{re.escape(name)}\]\n(?:[^\[\n].*\n)*)", text, maxsplit=1)
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    for key, value in (("date", today), ("version", version), ("sha256", fingerprint(one.code))):
        own = re.sub(rf'^{key} = ".*"$', f'{key} = "{value}"', own, flags=re.MULTILINE)
    STORED.write_text(head + own + rest, encoding="utf-8")


def write(_app: Sphinx) -> None:
    """Writes the page if it changed."""
    made = page()
    if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != made:
        PAGE.write_text(made, encoding="utf-8")


def note_in_page(_app: Sphinx, name: str, text: list[str]) -> None:
    """Adds the notes to a page that Sphinx has read."""
    text[0] = noted(text[0], [one for one in stored() if one.page == f"{name}.md"])


def setup(app: Sphinx) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", write)
    app.connect("source-read", note_in_page)
    return {"parallel_read_safe": True}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--measured", metavar="NAME", help="these tables were measured today with the present code")
    parser.add_argument(
        "--version", default=tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    )
    arguments = parser.parse_args()
    if arguments.measured:
        stamp(arguments.measured, arguments.version)
    older = [one for one in stored() if not one.is_current()]
    for one in older:
        print(f"{one.page}: {one.what}: older than {', '.join(one.code)}; measured on {one.date}: {one.command}")


if __name__ == "__main__":
    main()
