"""Instructions of the hot paths, counted by callgrind, against stored figures; wall time on shared machines is noise.

    python benchmarks/instructions.py            # compares; exit code 1 if a path needs more than it may
    python benchmarks/instructions.py --update   # stores what is counted now in benchmarks/instructions.json

Each path is run once and several times; the difference leaves out what preparing takes. Beside them, the plans of the
first steps of four recorded scenarios with 24 agents are counted in the installed package (below INTERDRIVE_SCENARIOS,
or ../shared/scenarios), where agents meet others as they do on real streets. Counts belong to a processor with AVX2
(the core has kernels of its own for it, and callgrind knows AVX2 but not AVX-512) and to a version of rustc: without
AVX2 nothing is compared, with another rustc the tolerance is wider. Needs valgrind, which is installed where
apt-get may do that; where it is missing the comparison is skipped with a message, which is a failure in CI (`CI=true`).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STORED = Path(__file__).with_suffix(".json")
#: Hot paths of crates/core/benches/instructions.rs, and how often each is done.
PATHS = {
    "plan": 4,
    "plan_frenet": 4,
    "predict_lane_following": 10,
    "predict_neural": 2,
    "contacts": 20,
    "step": 5,
    "step_messages": 5,
    "step_v2x": 5,
    "learn": 10,
}
#: Recorded scenarios whose plans are counted, and over how many steps.
RECORDED = {
    "plans_highway": "highway/USA_US101-23_1_T-1.xml",
    "plans_intersection": "intersection/USA_Lanker-2_8_T-1.xml",
    "plans_residential": "urban/DEU_Muc-12_1_T-1.xml",
    "plans_arterial": "urban/CHN_Sha-3_1_T-1.xml",
}
RECORDED_STEPS = 8
#: Runs in the measured process; until the simulation begins callgrind only looks on, which is ten times faster.
DRIVE = f"""
import os, subprocess, sys
from interdrive import Simulation
simulation = Simulation(sys.argv[1], agents=24, predictor="lane_following", threads=1)
subprocess.run(["callgrind_control", "-i", "on", str(os.getpid())], stdout=subprocess.DEVNULL, check=True)
for _ in range({RECORDED_STEPS}):
    simulation.step()
"""
#: A path may need so many instructions more than another one. Agents drive alike in these two; with requests they
#: drive otherwise, so what these cost shows in the count of `step_v2x` alone.
EXTRAS = {("step_messages", "step"): 650_000}
#: Counts may be larger by this share; idle threads and the order of memory make a difference of about 0.1 %, and what
#: the compiler puts into its callers up to 3 %, which a change elsewhere can turn around.
TOLERANCE, TOLERANCE_OTHER_RUSTC = 0.05, 0.15


def built() -> Path:
    """The binary with the hot paths."""
    profile = ["--profile", "quick"]  # that of the installed package
    command = [
        "cargo",
        "bench",
        "--quiet",
        *profile,
        "--package",
        "interdrive-core",
        "--bench",
        "instructions",
        "--no-run",
    ]
    done = subprocess.run([*command, "--message-format=json"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    paths = [one["executable"] for one in found if one.get("executable") and one["target"]["name"] == "instructions"]
    return Path(paths[-1])


def counted(binary: Path, path: str, times: int) -> int:
    """Instructions of a whole run."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", str(binary), path, str(times)]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if found is None or done.returncode:
        raise SystemExit(f"{path}: callgrind counted nothing:\n{done.stderr[-2000:]}")
    return int(found[1])


def counted_plans(scenario: Path) -> int:
    """Instructions of the plans of 24 agents per step, one thread."""
    callgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--instr-atstart=no"]
    command = [*callgrind, "--toggle-collect=*planning*World*plan*", sys.executable, "-c", DRIVE, str(scenario)]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    found = re.search(r"Collected : (\d+)", done.stderr)
    if found is None or done.returncode or found[1] == "0":
        raise SystemExit(f"{scenario.stem}: callgrind counted nothing:\n{done.stderr[-2000:]}")
    return round(int(found[1]) / RECORDED_STEPS)


def recorded_counts() -> dict[str, int]:
    """The same for the recorded scenarios; none, with a message, where they are missing, which is a failure in CI."""
    folders = os.environ.get("INTERDRIVE_SCENARIOS", str(ROOT.parent / "shared" / "scenarios"))
    folder = Path(folders.split(os.pathsep)[0])
    missing = [file for file in RECORDED.values() if not (folder / file).is_file()]
    if missing:
        why = f"plans of recorded scenarios are not counted: {folder} lacks {missing[0]}"
        if os.environ.get("CI") == "true":
            raise SystemExit(why)
        print(why)
        return {}
    with ThreadPoolExecutor(max_workers=2) as pool:
        return dict(zip(RECORDED, pool.map(lambda file: counted_plans(folder / file), RECORDED.values()), strict=True))


def counts(binary: Path) -> dict[str, int]:
    """Instructions per call of every path."""
    jobs = [(path, times) for path, n in PATHS.items() for times in (1, 1 + n)]
    with ThreadPoolExecutor(max_workers=2) as pool:
        found = dict(zip(jobs, pool.map(lambda job: counted(binary, *job), jobs), strict=True))
    return {path: round((found[path, 1 + n] - found[path, 1]) / n) for path, n in PATHS.items()}


def has_valgrind() -> bool:
    """Installs it where that can be done without asking."""
    if not shutil.which("valgrind") and shutil.which("apt-get"):
        install = "apt-get update -qq && apt-get install -y -qq --no-install-recommends valgrind"
        subprocess.run(["timeout", "300", "sh", "-c", install], capture_output=True, check=False)
    return shutil.which("valgrind") is not None


def has_avx2() -> bool:
    """The processor's flags say so."""
    try:
        return " avx2" in Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return False


def rustc() -> str:
    return subprocess.run(["rustc", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout.split()[1]


def compare(now: dict[str, int], stored: dict[str, int], tolerance: float) -> int:
    """Prints a table; the number of paths that need more than they may."""
    worse = 0
    print(f"| instructions per call | stored | now | change | at most +{100 * tolerance:.0f} % |")
    print("|---|--:|--:|--:|---|")
    for path, count in now.items():
        before = stored.get(path)
        change = count / before - 1.0 if before else float("nan")
        verdict = "not stored" if before is None else "more" if change > tolerance else "ok"
        if change < -tolerance:
            verdict = "fewer: store it with --update"
        worse += verdict == "more"
        print(f"| {path} | {before or 0:,} | {count:,} | {100 * change:+.1f} % | {verdict} |")
    return worse


def skipped(why: str) -> int:
    """Says why nothing is compared; the exit code, which in CI is that of a failure."""
    print(f"instruction counts are not compared: {why}")
    return int(os.environ.get("CI") == "true")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="store what is counted now")
    arguments = parser.parse_args()
    if not has_valgrind():
        return skipped("valgrind is missing (apt-get install valgrind)")
    if not has_avx2():
        return skipped("they belong to processors with AVX2, which this one lacks")
    now, version = counts(built()) | recorded_counts(), rustc()
    stored = json.loads(STORED.read_text(encoding="utf-8")) if STORED.is_file() else {"rustc": version, "counts": {}}
    if arguments.update:
        kept = stored["counts"] | now
        STORED.write_text(json.dumps({"rustc": version, "counts": kept}, indent=2) + "\n", encoding="utf-8")
    same = stored["rustc"] == version
    if not same:
        print(f"stored with rustc {stored['rustc']}, counted with {version}")
    worse = compare(now, stored["counts"], TOLERANCE if same else TOLERANCE_OTHER_RUSTC)
    for (path, base), most in EXTRAS.items():
        extra = now[path] - now[base]
        print(f"{path} needs {extra:,} instructions more than {base}, at most {most:,}")
        worse += extra > most
    if worse and not arguments.update:
        print("a hot path needs more instructions; if that is meant: python benchmarks/instructions.py --update")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
