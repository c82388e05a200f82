"""Recorded drivers beside planners: which rules of the road they break, what they reach, whether they block each other.

    python benchmarks/driving/rules.py                             # in $INTERDRIVE_SCENARIOS or ../shared/scenarios
    python benchmarks/driving/rules.py --only 'DEU_*' --drivers idm 'rollout, no right of way'

Every vehicle that can be an agent is one. Prints a Markdown table; `--rows FILE` lists what was counted, one row each.
Results do not depend on the number of workers.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from fnmatch import fnmatchcase
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from drives import LONG, STANDING, longest
from standing import mutual_waits

from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InterdriveError
from interdrive.files import read_scenario, scenario_folders
from interdrive.run.violations.drives import driven, recorded
from interdrive.run.violations.lines import passings
from interdrive.simulation import Simulation, reachable_agents

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.run.violations.drives import Drives
    from interdrive.runs import Run

ROOT = Path(__file__).resolve().parents[2]
#: Faster than the limit by more than this share counts.
EXCESS = 0.1
#: Name in the table, planner, settings.
DRIVERS = {
    "rollout": ("rollout", {}),
    "rollout, no right of way": ("rollout", {"rules.precedence": False}),
    "rollout, no rules": ("rollout", {"rules.enabled": False}),
    "frenet": ("frenet", {}),
    "frenet, no right of way": ("frenet", {"rules.precedence": False}),
    "frenet, no rules": ("frenet", {"rules.enabled": False}),
    "idm": ("idm", {}),
    "idm, no right of way": ("idm", {"rules.precedence": False}),
    "idm_mobil": ("idm_mobil", {}),
    "idm_mobil, no right of way": ("idm_mobil", {"rules.precedence": False}),
}
RECORDED = "recorded drivers"
#: Columns of the table and what is counted for them; those with a total are shown as "n of total".
COLUMNS = {
    "red lights passed": ("red_light", "lights"),
    "stop signs passed": ("stop_sign", "stop signs"),
    "over the limit by 10 %": ("over", "limited"),
    "right of way": ("right_of_way", ""),
    "keep clear": ("keep_clear", ""),
    "wrong way": ("wrong_way", ""),
    "solid line": ("solid_line", ""),
    "mutual waits > 10 s": ("mutual", ""),
    "stand > 10 s": ("stand", ""),
    "in time": ("in time", "reachable"),
    "collisions with agents": ("hit agents", ""),
    "with others": ("hit others", ""),
    "road edge": ("off road", ""),
}


#: Columns of the list of rows.
ROW = ("driver", "scenario", "source", "rule", "vehicle", "first_step", "last_step", "lanelet", "partner", "value")

Row = tuple[str | int | float, ...]


def drive(
    path: Path, name: str, predictor: str, reachable: tuple[int, ...]
) -> tuple[dict[str, Counter[str]], list[Row]]:
    """What is counted for a planner, and for the recorded drivers of the same vehicles; violations and mutual waits."""
    planner, settings = DRIVERS[name]
    try:
        simulation = Simulation(
            path, planner=planner, predictor=predictor, settings=bind(SimulationSettings(), dict(settings)), threads=1
        )
        run = simulation.run()
    except InterdriveError:
        return {}, []
    counts = _counts(run, driven(run), "agent", simulation.road)
    ends = Counter(dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True)))
    counts["in time"] = sum(ends[agent] == "goal_reached" for agent in reachable)
    counts["reachable"] = len(reachable)
    is_agent = dict(zip(run.states.participant_id.tolist(), run.states.is_agent.tolist(), strict=True))
    ended = run.outcomes
    for outcome, partner, off_road in zip(ended.outcome, ended.partner_id.tolist(), ended.off_road, strict=True):
        if outcome == "collision":
            counts["off road" if off_road else "hit agents" if is_agent.get(partner) else "hit others"] += 1
    waiting = mutual_waits(simulation, run)
    counts["mutual"] = len(waiting)
    rows: list[Row] = [(name, path.stem, "agent", "mutual_wait", agent, "", "", "", "", "") for agent in waiting]
    rows += [(name, path.stem, *row) for row in _listed(run)]
    return {name: counts, RECORDED: _counts(run, recorded(run), "recording", simulation.road)}, rows


def reachable(path: Path) -> tuple[int, ...]:
    """Recorded vehicles whose recording reaches their goal in time; none if the file cannot be driven."""
    try:
        simulation = Simulation(path, threads=1)
        found = reachable_agents(read_scenario(path))
    except InterdriveError:
        return ()
    ids = {agent.id for agent in simulation.agents if agent.origin == "recorded"}
    return tuple(i for i in found if i in ids)


def _listed(run: Run) -> list[Row]:
    """The violations of a run."""
    found = run.violations
    assert found is not None
    numbers = (found.participant_id, found.first_time_step, found.last_time_step, found.lanelet_id, found.partner_id)
    return list(zip(found.source, found.rule, *(of.tolist() for of in numbers), found.value.tolist(), strict=True))


def _counts(run: Run, drives: Drives, source: str, road: _core.RoadNetwork) -> Counter[str]:
    """Violations of drives from one source, and of how many cases."""
    assert run.violations is not None
    counts = Counter(rule for rule, of in zip(run.violations.rule, run.violations.source, strict=True) if of == source)
    rows = [k for k, of in enumerate(drives.sources) if of == source]
    counts["agents"] = len(rows)
    for line in passings(drives, run.scenario, road):
        if drives.sources[line.vehicle] == source:
            counts["lights"] += bool(line.shown.any())
            counts["stop signs"] += line.line.has_stop_sign
    row, column = np.nonzero(drives.valid[rows])
    x, y, heading, speed = (
        table[rows][row, column] for table in (drives.x, drives.y, drives.orientation, drives.velocity)
    )
    limit, _ = road.lane_rules(x, y, heading)
    counts["limited"] = int(np.isfinite(limit).sum())
    counts["over"] = int((np.abs(speed) > (1.0 + EXCESS) * limit).sum())
    still = drives.valid & (np.abs(drives.velocity) < STANDING)
    counts["stand"] = sum(longest(still[k], drives.dt) > LONG for k in rows)
    return counts


def table(counted: dict[str, Counter[str]]) -> str:
    """Drivers in rows."""
    lines = [f"| drivers | agents | {' | '.join(COLUMNS)} |", "|---|" + "--:|" * (len(COLUMNS) + 1)]
    for name, counts in counted.items():
        cells = [str(counts["agents"])]
        for what, (wanted, total) in COLUMNS.items():
            if name == RECORDED and what in ("mutual waits > 10 s", "in time", *list(COLUMNS)[-3:]):
                cells.append("")
            elif wanted == "over":
                cells.append(f"{100 * counts[wanted] / max(counts[total], 1):.2f} %")
            else:
                cells.append(f"{counts[wanted]} of {counts[total]}" if total else str(counts[wanted]))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(prog="rules", description=(__doc__ or "").splitlines()[0])
    default = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    parser.add_argument("folder", type=Path, nargs="?", default=default, help="of folders, one per category")
    parser.add_argument("--drivers", nargs="+", choices=DRIVERS, default=list(DRIVERS), metavar="NAME")
    parser.add_argument("--predictor", default="neural")
    parser.add_argument("--only", metavar="PATTERN", default="*", help="only scenarios of such names, such as CHN_*")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rows", type=Path, metavar="FILE", help="also list violations and mutual waits (CSV)")
    arguments = parser.parse_args()
    files = sorted(path for path in arguments.folder.glob("*/*.xml") if fnmatchcase(path.stem, arguments.only))
    if not files:
        print(f"{arguments.folder}: no scenario (a folder of folders with .xml files is expected)", file=sys.stderr)
        return 2
    counted: dict[str, Counter[str]] = {RECORDED: Counter()}
    refused = 0
    rows: list[Row] = []
    with ProcessPoolExecutor(arguments.workers) as pool:
        known = list(pool.map(reachable, files))
        for name in arguments.drivers:
            results = list(pool.map(drive, files, repeat(name), repeat(arguments.predictor), known))
            refused = sum(not one for one, _ in results)
            counted[name] = sum((one.get(name, Counter()) for one, _ in results), Counter())
            counted[RECORDED] = sum((one.get(RECORDED, Counter()) for one, _ in results), Counter())
            rows += [row for _, listed in results for row in listed]
    if arguments.rows:
        with arguments.rows.open("w", newline="") as file:
            csv.writer(file).writerows([ROW, *rows])
    print(f"{table(counted)}\n\n{len(files)} scenarios, refused: {refused}; predictor {arguments.predictor}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
