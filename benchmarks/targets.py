"""Targets beside the latest measurements on this machine: by `make bench`, the study and the peers' scripts.

    python benchmarks/targets.py [STUDY]     # STUDY: folder of `interdrive study runtime`
    python benchmarks/targets.py STUDY --document   # writes tables and figures into docs/research/performance.md
    python benchmarks/targets.py --memory    # also measures the peak memory of a large run

What scripts measure is kept in out/measured.json. With `--document` their tables are taken from out/*.md, which
`make performance` writes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MEASURED = ROOT / "out" / "measured.json"
RESEARCH = ROOT / "docs" / "research"
DOCUMENT = RESEARCH / "performance.md"
FIGURES = ROOT / "docs" / "figures"
#: Sections that are made from files of the same name in out/, and their documents.
SECTIONS = {
    **dict.fromkeys(("floors", "start", "commands", "handler", "rule_based", "frenetix"), DOCUMENT),
    "environments": RESEARCH / "learning.md",
}


def note(name: str, value: float) -> None:
    """Keeps a measured number, in SI units, under the name of its target."""
    MEASURED.parent.mkdir(exist_ok=True)
    partial = MEASURED.with_suffix(f".{os.getpid()}")
    partial.write_text(json.dumps(noted() | {name: value}, indent=2) + "\n", encoding="utf-8")
    partial.rename(MEASURED)


def noted() -> dict[str, float]:
    """All numbers kept so far."""
    return json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.is_file() else {}


def filled(text: str, name: str, content: str) -> str:
    """A document with the part between `<!-- name -->` and `<!-- /name -->` replaced."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    if begin not in text or end not in text:
        raise SystemExit(f"there is no place {begin.strip()} ... {end} in the document")
    return re.sub(
        re.escape(begin) + ".*?" + re.escape(end), lambda _: f"{begin}{content.strip()}\n{end}", text, flags=re.S
    )


def write_document(study: Path | None, targets: str) -> None:
    """Puts tables and figures into docs/research/performance.md, and the table of environments into learning.md."""
    text = filled(DOCUMENT.read_text(encoding="utf-8"), "targets", targets)
    if study is not None:
        from runtime import document, read_study
        from runtime_figures import growth_figure, runtime_figure

        from interdrive.plots import save_figure

        found = read_study(study)
        text = filled(text, "study", document(found))
        for name, figure in (("runtime", runtime_figure(found)), ("growth", growth_figure(found))):
            if figure is not None:
                save_figure(figure, FIGURES / f"study_{name}.png")
    DOCUMENT.write_text(text, encoding="utf-8")
    for name, document in SECTIONS.items():
        made = MEASURED.with_name(f"{name}.md")
        if made.is_file():
            text = filled(document.read_text(encoding="utf-8"), name, made.read_text(encoding="utf-8"))
            document.write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", nargs="?", type=Path, help="folder of `interdrive study runtime`")
    parser.add_argument("--document", action="store_true", help="write docs/research/performance.md")
    parser.add_argument("--memory", action="store_true", help="measure the peak memory of a large run")
    arguments = parser.parse_args()
    from runtime import measured_targets, peak_memory, read_study, targets_markdown

    if arguments.memory:
        note("memory", peak_memory())
    found = noted()
    if arguments.study is not None:
        if not (arguments.study / "runtime.json").is_file():
            parser.error(f"{arguments.study}: this is no folder of `interdrive study runtime`")
        found |= measured_targets(read_study(arguments.study))
    targets = targets_markdown(found)
    print(targets)
    if arguments.document:
        write_document(arguments.study, targets)


if __name__ == "__main__":
    main()
