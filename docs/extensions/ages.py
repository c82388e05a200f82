"""Which measured tables are older than the code they measure; the page docs/research/ages.md is made from it.

python docs/extensions/ages.py                                   # lists them
python docs/extensions/ages.py --measured NAME [--version V]     # NAME was measured with the present code, today

docs/research/measured.toml names every group of tables: page, command, code, and when it was measured with which
version. The code is known by the SHA-256 of its files.
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
HEAD = """# Age of the tables

Made when the site is built. Tables whose code has changed since may differ now: run their command to know.

| tables | command | measured on | version | code since then |
|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Measured:
    """A group of tables: where, what, by which command, of which code, when, and the fingerprint of the code then."""

    name: str
    page: str
    what: str
    command: str
    code: tuple[str, ...]
    date: str
    version: str
    sha256: str

    def is_current(self, root: Path = ROOT) -> bool:
        """Whether the code is still that which was measured."""
        return fingerprint(self.code, root) == self.sha256


def fingerprint(code: tuple[str, ...], root: Path = ROOT) -> str:
    """SHA-256 of names and contents of source files, of folders with everything in them."""
    found = hashlib.sha256()
    for place in code:
        path = root / place
        files = [path] if path.is_file() else sorted(one for kind in ("*.py", "*.rs") for one in path.rglob(kind))
        if not files:
            sys.exit(f"{STORED.name}: {place} holds no code")
        for file in files:
            found.update(str(file.relative_to(root)).encode() + b"\0" + file.read_bytes() + b"\0")
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


def setup(app: Sphinx) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", write)
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
