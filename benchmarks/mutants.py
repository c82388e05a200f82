"""Breaks the core on purpose, one small change at a time, and counts how many changes its unit tests notice.

cargo-mutants says which changes there are (.cargo/mutants.toml). It would build the core once per change, which takes
hours; this builds it once with all changes inside, each behind a number that the environment variable `MUTANT` selects.

    python3 benchmarks/mutants.py                      # all files of .cargo/mutants.toml
    python3 benchmarks/mutants.py formulas overlap      # files whose path holds one of these words
    python3 benchmarks/mutants.py --again              # only the changes that were missed last time

Names what was missed; exit code 1 if less than 90 % was noticed.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "target/mutants_at_once"
TREE = WORK / "tree"
SOURCES = "crates/core/src/"
CORE = ROOT / "crates/core"
WANTED = 0.9
# Beginnings of the names of the tests that judge what lies in a module.
JUDGES = {
    "criticality": ["criticality::"],
    "collision": ["collision::", "geometry::shape::"],
    "geometry": ["geometry::shape::", "collision::"],
    "world": ["world::"],
    "scenario": ["scenario::", "world::"],
    "plan": ["plan::frenet::"],
}
SWITCH = """
#[doc(hidden)]
pub mod mutant {
    static ACTIVE: std::sync::LazyLock<usize> =
        std::sync::LazyLock::new(|| std::env::var("MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0));
    pub fn active() -> usize {
        *ACTIVE
    }
}
"""
TOKEN = re.compile(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\])*\"|'(?:\\.[^']*|[^'\\])'|\w+|.", re.DOTALL)


@dataclasses.dataclass
class Mutant:
    """A change. Places are offsets in its file."""

    number: int
    name: str
    file: str
    function: tuple[int, int]
    span: tuple[int, int]
    replacement: str
    verdict: str = ""

    @property
    def module(self) -> str:
        """As Rust names it."""
        return self.file.removeprefix(SOURCES).removesuffix(".rs").replace("/", "::")


def listed(words: list[str]) -> list[Mutant]:
    """All changes that cargo-mutants knows in the files that are wanted."""
    command = ["cargo", "mutants", "--list", "--json", "-p", "interdrive-core"]
    answer: list[dict[str, Any]] = json.loads(
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
    )
    mutants = []
    for number, one in enumerate(answer, 1):
        if words and not any(word in one["file"] for word in words):
            continue
        lines = [0, *(m.end() for m in re.finditer("\n", (ROOT / one["file"]).read_text()))]

        def places(span: dict[str, dict[str, int]], lines: list[int] = lines) -> tuple[int, int]:
            start, end = (lines[place["line"] - 1] + place["column"] - 1 for place in (span["start"], span["end"]))
            return start, end

        function = places(one["function"]["span"])
        mutants.append(Mutant(number, one["name"], one["file"], function, places(one["span"]), one["replacement"]))
    return mutants


def body(text: str, function: tuple[int, int]) -> tuple[int, int]:
    """What is between the braces of a function."""
    depth, is_past_name = 0, False
    for token in TOKEN.finditer(text, *function):
        match token.group():
            case "(" | "[":
                depth += 1
            case ")" | "]":
                depth -= 1
            case "fn" if depth == 0:
                is_past_name = True
            case "{" if depth == 0 and is_past_name:
                return token.end(), function[1] - 1
    raise ValueError(text[slice(*function)])


def with_all(text: str, mutants: list[Mutant]) -> tuple[str, list[tuple[int, int, Mutant]]]:
    """A file with all its changes inside, and the lines (first, last) of each."""
    outermost: list[tuple[int, int]] = []
    for function in sorted({m.function for m in mutants}, key=lambda f: (f[0], -f[1])):
        if not outermost or function[0] >= outermost[-1][1]:
            outermost.append(function)
    # Copies of what has a hundred changes inside would take long to build; offsets stay as they are.
    text = re.sub(r"#\[inline[^\]]*\]", lambda attribute: " " * len(attribute.group()), text)
    out, done, places = "", 0, []
    for function in outermost:
        start, end = body(text, function)
        out += text[done:start] + "\nmatch crate::mutant::active() {\n"
        for mutant in mutants:
            if function[0] <= mutant.function[0] < function[1]:
                first = out.count("\n") + 1
                changed = text[start : mutant.span[0]] + mutant.replacement + " " + text[mutant.span[1] : end]
                out += f"{mutant.number} => {{\n{changed}\n}}\n"
                places.append((first, out.count("\n"), mutant))
        out += f"_ => {{{text[start:end]}}}\n}}\n"
        done = end
    return out + text[done:], places


def write(path: Path, text: str) -> None:
    """Leaves a file alone that has that content already, so that cargo does not build it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def copy_tree(changed: set[str]) -> None:
    """The core without its benchmarks and the files that are going to be changed."""
    kept = {TREE / file for file in changed}
    for source in [ROOT / "Cargo.toml", ROOT / "Cargo.lock", *(ROOT / "crates").rglob("*")]:
        copy = TREE / source.relative_to(ROOT)
        if source.suffix in (".rs", ".toml", ".lock") and copy not in kept:
            kept.add(copy)
            text = source.read_text()
            if source == CORE / "Cargo.toml":
                # Tests of the library need nothing of this; criterion takes long to build.
                text = re.sub(r"\[(dev-dependencies|\[bench\])\][^\[]*(\n|$)", "\n", text)
            write(copy, f"#![allow(warnings)]\n{text}{SWITCH}" if source == CORE / "src/lib.rs" else text)
    for stale in set((TREE / "crates").rglob("*.rs")) - kept:
        stale.unlink()


def built(mutants: list[Mutant]) -> Path:
    """The test program with all changes inside. Changes that are not Rust get the verdict `unviable`."""
    files = {m.file for m in mutants}
    copy_tree(files)
    command = [
        "cargo",
        "test",
        "--no-run",
        "--lib",
        "-p",
        "interdrive-core",
        "--profile",
        "mutants",
        "--message-format",
        "json",
    ]
    environment = os.environ | {"CARGO_TARGET_DIR": str(ROOT / "target")}
    while True:
        places: dict[str, list[tuple[int, int, Mutant]]] = {}
        for file in files:
            viable = [m for m in mutants if m.file == file and m.verdict != "unviable"]
            text, places[file] = with_all((ROOT / file).read_text(), viable)
            write(TREE / file, text)
        run = subprocess.run(command, cwd=TREE, env=environment, capture_output=True, text=True, check=False)
        messages = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
        if run.returncode == 0:
            return Path(next(m["executable"] for m in messages if m.get("executable")))
        errors = [m["message"] for m in messages if m.get("message", {}).get("level") == "error"]
        unviable = {
            mutant.number
            for error in errors
            for span in error["spans"]
            for first, last, mutant in places.get(span["file_name"], [])
            if span["is_primary"] and first <= span["line_start"] <= last
        }
        if not unviable:
            raise SystemExit("\n".join(error["rendered"] for error in errors) or run.stderr)
        for mutant in mutants:
            mutant.verdict = "unviable" if mutant.number in unviable else mutant.verdict
        print(f"{len(unviable)} changes are not Rust", flush=True)


def judge(program: Path, mutant: Mutant, limits: dict[str, float]) -> Mutant:
    """Runs the tests of its own module, then those of its area."""
    area = mutant.module.partition("::")[0]
    mutant.verdict = "missed"
    for names in ([mutant.module + "::"], JUDGES[area]):
        command = [program, "--test-threads=1", "-q", *names]
        environment = os.environ | {"MUTANT": str(mutant.number)}
        try:
            run = subprocess.run(
                command,
                cwd=CORE,
                env=environment,
                check=False,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=limits[area],
            )
        except subprocess.TimeoutExpired:
            mutant.verdict = "timeout"
            break
        if run.returncode != 0:
            mutant.verdict = "caught"
            break
    return mutant


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="files whose path holds one of these")
    parser.add_argument("--again", action="store_true", help="only those that were missed last time")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="tests that run at the same time")
    arguments = parser.parse_args()
    stored = WORK / "verdicts.json"
    before: dict[str, str] = json.loads(stored.read_text()) if stored.exists() else {}
    mutants = listed(arguments.words)
    for mutant in mutants if arguments.again else []:
        mutant.verdict = before.get(mutant.name, "")
    program = built(mutants)
    before |= {m.name: m.verdict for m in mutants if m.verdict == "unviable"}
    limits = {}
    for area in sorted({m.module.partition("::")[0] for m in mutants}):
        start = time.monotonic()
        subprocess.run(
            [program, "--test-threads=1", "-q", *JUDGES[area]], cwd=CORE, check=True, stdout=subprocess.DEVNULL
        )
        limits[area] = 20.0 + 5.0 * (time.monotonic() - start)
        print(f"{area}: {time.monotonic() - start:.1f} s without a change", flush=True)
    wanted = [m for m in mutants if m.verdict in ("", "missed")]
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for mutant in pool.map(lambda m: judge(program, m, limits), wanted):
            before[mutant.name] = mutant.verdict
            stored.write_text(json.dumps(before, indent=0))
            if mutant.verdict == "missed":
                print(f"missed: {mutant.name.removeprefix(SOURCES)}", flush=True)
    print("| file | changes | noticed | share |\n|---|---|---|---|")
    viable = [m for m in mutants if m.verdict != "unviable"]
    for name in [*dict.fromkeys(m.file for m in viable), ""]:
        here = [m for m in viable if m.file.startswith(name)]
        noticed = sum(m.verdict != "missed" for m in here)
        print(f"| {name.removeprefix(SOURCES) or 'all'} | {len(here)} | {noticed} | {noticed / len(here):.0%} |")
    sys.exit(sum(m.verdict != "missed" for m in viable) < WANTED * len(viable))


if __name__ == "__main__":
    main()
