"""Two floors under the time of a step: its arithmetic at this machine's peak, and its memory traffic at its bandwidth.

    python benchmarks/floors.py

Counts come from valgrind (lackey: operations and bytes by type; callgrind: cache misses), as differences of runs, for
one thread; the peaks from benchmarks/peak.c. An operation is one on a scalar or on 128 bits (what the compiler makes of
scalar code); one on 256 bits counts as four. Traffic of a level is what the level above it misses (lines of 64 bytes).
"""

from __future__ import annotations

import json
import re
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from instructions import built, has_valgrind

#: Hot path, how often for counting, how often for timing, what it is for people.
PATHS = (
    ("plan", 4, 400, "one plan, 7 others in reach"),
    ("step", 5, 50, "step of the T-junction, 8 agents"),
    ("step_town", 3, 50, "step of the town, 25 agents"),
)
BYTES = {"I8": 1, "I16": 2, "I32": 4, "I64": 8, "F32": 4, "F64": 8, "V128": 16, "V256": 32}
LINE = 64


@dataclass(frozen=True)
class Counted:
    """Of one call: operations on floating-point numbers, bytes by level, seconds."""

    operations: float
    registers: float
    cache: float
    memory: float
    seconds: float


def peak() -> dict[str, float]:
    """Operations per second in f64 and f32, and bytes per second by level, of one core."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "peak"
        source = Path(__file__).with_name("peak.c")
        subprocess.run(["cc", "-O3", "-mavx2", "-mfma", "-o", str(program), str(source)], check=True)
        found: dict[str, float] = json.loads(subprocess.run([str(program)], capture_output=True, check=True).stdout)
    return found


def valgrind(binary: Path, path: str, times: int) -> tuple[float, float, float, float]:
    """Operations, bytes loaded and stored, bytes missed in L1 and in the last level, of a whole run."""

    def run(*options: str) -> str:
        command = ["valgrind", *options, str(binary), path, str(times)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stderr

    counts = run("--tool=lackey", "--basic-counts=no", "--detailed-counts=yes")
    operations = moved = 0.0
    for name, *numbers in re.findall(r"\b([IFV]\d+) +([\d,]+) +([\d,]+) +([\d,]+)", counts):
        loads, stores, done = (float(number.replace(",", "")) for number in numbers)
        moved += BYTES.get(name, 0) * (loads + stores)
        operations += done * {"F32": 1, "F64": 1, "V128": 1, "V256": 4}.get(name, 0)
    misses = run("--tool=callgrind", "--cache-sim=yes", "--callgrind-out-file=/dev/null")
    first, last = (
        float(re.search(rf"{level} +misses: +([\d,]+)", misses)[1].replace(",", ""))  # type: ignore[index]
        for level in ("D1", "LLd")
    )
    return operations, moved, LINE * first, LINE * last


def seconds(binary: Path, path: str, times: int) -> float:
    """User CPU time of a whole run; the least of three."""
    found = []
    for _ in range(3):
        # Other clocks of the system count hundredths of a second.
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run([str(binary), path, str(times)], check=True)
        found.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    return min(found)


def counted(binary: Path, path: str, n: int, many: int) -> Counted:
    """Per call of a hot path."""
    once, more = valgrind(binary, path, 1), valgrind(binary, path, 1 + n)
    each = [(after - before) / n for before, after in zip(once, more, strict=True)]
    return Counted(*each, seconds=(seconds(binary, path, 1 + many) - seconds(binary, path, 1)) / many)


def main() -> int:
    if not has_valgrind():
        print("the floors are not measured: valgrind is missing (apt-get install valgrind)")
        return 0
    most, binary = peak(), built()
    print(
        f"Peak of one core: {1e-9 * most['f64']:.0f} billion operations per second in f64, {1e-9 * most['f32']:.0f} in "
        f"f32 (AVX2, multiply and add); {1e-9 * most['l1']:.0f} GB/s from L1, {1e-9 * most['l2']:.0f} GB/s from L2, "
        f"{1e-9 * most['memory']:.0f} GB/s from memory.\n"
    )
    print(
        "| one thread | operations | floor [µs] | L1 [kB] | floor [µs] | L2 [kB] | floor [µs] | memory [kB] "
        "| floor [µs] | measured [µs] | measured to highest floor |"
    )
    print("|---|" + 10 * "--:|")
    for path, n, many, what in PATHS:
        one = counted(binary, path, n, many)
        floors = (one.operations / most["f64"], one.registers / most["l1"])
        floors += (one.cache / most["l2"], one.memory / most["memory"])
        amounts = (one.operations, 1e-3 * one.registers, 1e-3 * one.cache, 1e-3 * one.memory)
        cells = " | ".join(f"{a:,.0f} | {1e6 * f:.3g}" for a, f in zip(amounts, floors, strict=True))
        print(f"| {what} | {cells} | {1e6 * one.seconds:.0f} | {one.seconds / max(floors):.0f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
