"""Drives all scenarios of a folder with every vehicle an agent and says how well.

    python benchmarks/driving                                      # in $INTERDRIVE_SCENARIOS or ../shared/scenarios
    python benchmarks/driving --csv new.csv --against old.csv      # agents that changed between two builds
    python benchmarks/driving --planner idm_mobil --csv idm_mobil.csv --against rollout.csv     # two planners, paired
    python benchmarks/driving --places A --set planner.rollout.horizon=4
    python benchmarks/driving --page docs/research/driving.md               # writes its tables into the page, too
    python benchmarks/driving ../real --page docs/research/driving.md --section "real recordings"

Prints Markdown. Results do not depend on the number of workers.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from fnmatch import fnmatchcase
from pathlib import Path

import tables
from drives import Drive, Driven, ReachableCache, drive
from places import halves, place_of, places, scenario_files
from realism import Samples, distances

from interdrive.config.binding import bind
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import SimulationSettings
from interdrive.files import scenario_folders

ROOT = Path(__file__).resolve().parents[2]
#: Paragraphs that say how it went; the others say why.
N_BRIEF = 4


def drive_all(
    files: list[Path], planner: str, predictor: str, settings: SimulationSettings, workers: int, cache: ReachableCache
) -> list[Driven]:
    """Drives all files; the large ones are begun first."""
    known = places()
    with ProcessPoolExecutor(workers) as pool:
        futures = {
            path: pool.submit(drive, path, place_of(path, known), cache.of(path), predictor, settings, planner=planner)
            for path in sorted(files, key=lambda path: (-path.stat().st_size, path))
        }
        driven = [futures[path].result() for path in files]
    cache.keep(driven)
    return driven


def paragraphs(drives: list[Drive], samples: list[Samples], half: dict[str, str]) -> list[str]:
    """All tables, the first `N_BRIEF` of which say how it went."""
    return [
        tables.shares(drives),
        f"Reachable agents: {tables.outcomes(drives)}. Agents that break a rule: {tables.violations(drives)}.",
        f"Manner of driving:\n\n{tables.manner(drives)}",
        ". ".join((tables.idle(drives), tables.slow_problems(drives), tables.lane_changes(drives), "")).rstrip(),
        f"By halves of the places:\n\n{tables.halves(drives, half)}",
        f"Reachable agents that are not in time, by cause:\n\n{tables.failing(drives)}",
        f"Seconds lost by cause:\n\n{tables.causes(drives)}",
        f"Distances to the recordings:\n\n{tables.realism(distances(samples))}",
    ]


def print_refused(driven: list[Driven]) -> None:
    """How many scenarios there were, and which of them could not be driven."""
    refused = [f"{one.path.parent.name}/{one.path.name}: {one.refused}" for one in driven if one.refused]
    print(f"\n{len(driven)} scenarios, refused: {len(refused)}", *refused, sep="\n- ")


def main() -> int:
    parser = argparse.ArgumentParser(prog="driving", description=(__doc__ or "").splitlines()[0])
    default = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    parser.add_argument("folder", type=Path, nargs="?", default=default, help="of scenarios, or of folders of them")
    parser.add_argument("--planner", default=DEFAULT_PLANNER, help="of all agents, as for interdrive run")
    parser.add_argument("--predictor", default="neural")
    parser.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="a setting of interdrive run")
    parser.add_argument("--places", choices="AB", help="only this half of the places")
    parser.add_argument("--only", metavar="PATTERN", help="only scenarios of such names, such as CHN_*")
    parser.add_argument("--csv", type=Path, default=ROOT / "out" / "driving" / "agents.csv", help="a row per agent")
    parser.add_argument("--against", type=Path, metavar="CSV", help="of another build: agents that changed are listed")
    parser.add_argument("--reachable", type=Path, default=ROOT / "out" / "driving" / "reachable.json", help="cache")
    parser.add_argument("--page", type=Path, metavar="FILE", help="tables also go between the markers of this page")
    parser.add_argument("--section", metavar="NAME", help="of the page, for another folder: outcomes and manner only")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    begun = time.perf_counter()
    files = scenario_files(arguments.folder)
    half = halves(files, known := places())
    if arguments.places:
        files = [path for path in files if half[place_of(path, known)] == arguments.places]
    files = [path for path in files if fnmatchcase(path.stem, arguments.only or "*")]
    if not files:
        print(f"{arguments.folder}: no scenario (.xml files are expected in it or in its folders)", file=sys.stderr)
        return 2
    markers = tables.markers_of(arguments.section)
    try:
        page = arguments.page and arguments.page.read_text(encoding="utf-8")
        if page:
            tables.put_into(page, "", markers)  # refused before minutes of driving, not after them
    except (OSError, ValueError) as error:
        print(f"{arguments.page}: {getattr(error, 'strerror', None) or error}", file=sys.stderr)
        return 2
    try:
        old = tables.read_csv(arguments.against) if arguments.against else None
    except (OSError, ValueError) as error:
        print(f"{arguments.against}: {getattr(error, 'strerror', None) or error}", file=sys.stderr)
        return 2
    settings = bind(SimulationSettings(), dict(one.split("=", 1) for one in arguments.set))
    cache = ReachableCache(arguments.reachable)
    driven = drive_all(files, arguments.planner, arguments.predictor, settings, arguments.workers, cache)
    drives = [row for one in driven for row in one.drives]
    tables.write_csv(drives, arguments.csv)
    written = paragraphs(drives, [sample for one in driven for sample in one.samples], half)
    print("\n\n".join(written))
    if page:
        text = "\n\n".join(written[:N_BRIEF] if arguments.section else written)
        now = arguments.page.read_text(encoding="utf-8")  # others may have written into it meanwhile
        arguments.page.write_text(tables.put_into(now, text, markers), encoding="utf-8")
    if old is not None:
        # Both sides with the digits of the file, or the same drives would differ.
        print(f"\n## Against {arguments.against.name}\n\n{tables.changes(old, tables.read_csv(arguments.csv))}")
    print(f"\n## Failures\n\n{tables.failures(drives)}")
    print_refused(driven)
    print(f"\n{time.perf_counter() - begun:.0f} s; a row per agent: {arguments.csv}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
