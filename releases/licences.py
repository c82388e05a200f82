"""Writes LICENSES-RUST.txt: the licences of all crates that are compiled into the wheel.

python releases/licences.py [--check]
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FILE = ROOT / "LICENSES-RUST.txt"
HEAD = "Crates that are compiled into interdrive, with their licences. Written by releases/licences.py: do not edit.\n"
NAMES = ("LICEN", "COPYING", "NOTICE", "UNLICENSE")


def compiled_in() -> list[dict[str, Any]]:
    """All crates that the wheel contains: normal dependencies of the binding on Linux and macOS, without our own."""
    targets = ("x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu", "x86_64-apple-darwin", "aarch64-apple-darwin")
    found = {}
    for target in targets:
        command = ["cargo", "metadata", "--format-version=1", "--locked", "--filter-platform", target]
        data = json.loads(subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout)
        packages = {package["id"]: package for package in data["packages"]}
        nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
        waiting = [key for key, package in packages.items() if package["name"] == "interdrive-python"]
        seen = set(waiting)
        while waiting:
            for dependency in nodes[waiting.pop()]["deps"]:
                is_macro = any("proc-macro" in one["kind"] for one in packages[dependency["pkg"]]["targets"])
                is_normal = any(kind["kind"] is None for kind in dependency["dep_kinds"])
                if is_normal and not is_macro and dependency["pkg"] not in seen:
                    seen.add(dependency["pkg"])
                    waiting.append(dependency["pkg"])
        found |= {key: packages[key] for key in seen if packages[key]["source"]}
    return sorted(found.values(), key=lambda package: (package["name"], package["version"]))


def texts_of(package: dict[str, Any]) -> list[str]:
    """The licence files that a crate brings along."""
    folder = Path(package["manifest_path"]).parent
    files = sorted(path for path in folder.iterdir() if path.name.upper().startswith(NAMES) and path.is_file())
    return [f"{path.name}:\n\n{path.read_text(encoding='utf-8').strip()}" for path in files]


def content() -> str:
    """The file; a text that several crates share stands once."""
    parts, first = [HEAD], {}
    for package in compiled_in():
        title = f"{package['name']} {package['version']} ({package['license']}), {package['repository'] or 'crates.io'}"
        own = texts_of(package)
        texts = [
            text
            if first.setdefault(text, package["name"]) == package["name"]
            else f"{text.partition(':')[0]}: word for word that of {first[text]}"
            for text in own
        ]
        texts = texts or [f"It brings no file; its authors: {', '.join(package['authors']) or 'unnamed'}."]
        parts.append("\n".join(("=" * 100, title, "=" * 100, "", "\n\n".join(texts), "")))
    return "\n".join(parts)


if __name__ == "__main__":
    if "--check" not in sys.argv:
        FILE.write_text(content(), encoding="utf-8")
    elif not FILE.exists() or FILE.read_text(encoding="utf-8") != content():
        sys.exit(f"{FILE.name} is not what Cargo.lock says: run python releases/licences.py")
