"""Fails when agents drive worse than stored: python benchmarks/driving/guard.py; --update REASON stores new figures.

It drives the scenarios that `guard.json` names. What fails: the share of reachable agents in time is lower by more than
a point; more collisions between agents; an agent stands for more than 10 s in a scenario where none did; an agent
brakes or accelerates harder than its vehicle can. Every update adds a line to docs/research/log/driving.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drives import LONG, Drive, drive

from interdrive.config.schema import SimulationSettings
from interdrive.files import scenario_folders

ROOT = Path(__file__).resolve().parents[2]
STORED, PAGE = Path(__file__).with_name("guard.json"), ROOT / "docs" / "research" / "log" / "driving.md"
#: The line behind which updates are noted.
NOTES = "| in time | agents that collide with each other | scenarios with an agent that stands > 10 s | why |"
#: The share in time may be lower by this [percentage points].
SHARE_MAX = 1.0
#: No vehicle changes its speed faster: 11.5 m/s², and a little more while it recovers from a recorded start [m/s²].
HARDEST = 13.0


@dataclass(frozen=True)
class Figures:
    """What is stored of a scenario."""

    sha256: str
    reachable: tuple[int, ...]
    outcomes: dict[int, str]
    hit: int
    stands: tuple[int, ...]
    #: Agents that change their speed faster than a vehicle can; not stored, there must be none.
    jumps: tuple[int, ...] = ()
    #: Violations of rules of the road; not stored, but printed.
    violations: int = 0

    @classmethod
    def of(cls, sha256: str, drives: tuple[Drive, ...]) -> Figures:
        """Of a scenario that was driven."""
        return cls(
            sha256,
            tuple(one.agent_id for one in drives if one.reachable),
            {one.agent_id: one.outcome for one in drives},
            sum(one.partner == "agent" for one in drives),
            tuple(one.agent_id for one in drives if one.stood > LONG),
            tuple(one.agent_id for one in drives if one.hardest > HARDEST),
            sum(one.violations for one in drives),
        )

    @classmethod
    def read(cls, stored: dict[str, Any]) -> Figures:
        """From JSON."""
        outcomes = {int(agent): outcome for agent, outcome in stored["outcomes"].items()}
        return cls(stored["sha256"], tuple(stored["reachable"]), outcomes, stored["hit"], tuple(stored["stands"]))

    @property
    def in_time(self) -> int:
        """Reachable agents that reach their goal in time."""
        return sum(self.outcomes[agent] == "goal_reached" for agent in self.reachable)

    @property
    def collisions(self) -> int:
        """Agents that collide with anything."""
        return sum(outcome == "collision" for outcome in self.outcomes.values())


def share(figures: dict[str, Figures]) -> float:
    """Of reachable agents in time [%]."""
    reachable = sum(len(one.reachable) for one in figures.values())
    return 100.0 * sum(one.in_time for one in figures.values()) / max(reachable, 1)


def failures(before: dict[str, Figures], now: dict[str, Figures]) -> list[str]:
    """What got worse, one line each."""
    found = []
    if share(now) < share(before) - SHARE_MAX:
        found.append(f"{share(now):.1f} % of reachable agents are in time, {share(before):.1f} % were")
    hits = [sum(one.hit for one in figures.values()) for figures in (before, now)]
    if hits[1] > hits[0]:
        found.append(f"{hits[1]} agents collide with each other, {hits[0]} did")
    for name, one in now.items():
        if one.jumps:
            ids = ", ".join(map(str, one.jumps))
            found.append(f"{name}: a vehicle changes its speed by more than {HARDEST:g} m/s²: {ids}")
        if one.stands and not before[name].stands:
            ids = ", ".join(map(str, one.stands))
            found.append(f"{name}: a vehicle stands for more than {LONG:.0f} s, where none did: {ids}")
    return found


def changes(before: dict[str, Figures], now: dict[str, Figures]) -> list[str]:
    """Agents that end otherwise than stored."""
    return [
        f"{name}: agent {agent}: {before[name].outcomes.get(agent, 'absent')} -> {outcome}"
        for name, one in now.items()
        for agent, outcome in one.outcomes.items()
        if before[name].outcomes.get(agent) != outcome
    ]


def measured(folder: Path, stored: dict[str, Figures], workers: int) -> dict[str, Figures]:
    """All scenarios driven anew."""
    settings = SimulationSettings()
    with ProcessPoolExecutor(workers) as pool:
        futures = {
            name: pool.submit(drive, folder / name, "", one.reachable, "neural", settings, with_causes=False)
            for name, one in stored.items()
        }
        return {name: Figures.of(future.result().digest, future.result().drives) for name, future in futures.items()}


def store(figures: dict[str, Figures], why: str) -> None:
    """Writes the figures, and the reason into the page."""
    lines = [
        f'  "{name}": '
        + json.dumps(
            {
                "sha256": one.sha256,
                "reachable": one.reachable,
                "hit": one.hit,
                "stands": one.stands,
                "outcomes": one.outcomes,
            }
        )
        for name, one in figures.items()
    ]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    reachable = sum(len(one.reachable) for one in figures.values())
    in_time = sum(one.in_time for one in figures.values())
    hit, standing = sum(one.hit for one in figures.values()), sum(bool(one.stands) for one in figures.values())
    page = PAGE.read_text(encoding="utf-8")
    before, after = page.split(NOTES)
    head, *rest = after.split("\n\n", 1)
    note = f"\n| {in_time} of {reachable} ({share(figures):.1f} %) | {hit} | {standing} | {why.replace('|', '/')} |"
    PAGE.write_text(
        "\n\n".join([before + NOTES + head.rstrip("\n") + note, *rest]).rstrip("\n") + "\n", encoding="utf-8"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    default = next(iter(scenario_folders()), ROOT.parent / "shared" / "scenarios")
    parser.add_argument("folder", type=Path, nargs="?", default=default)
    parser.add_argument(
        "--update", metavar="REASON", help="store what is measured; the reason goes into docs/research/log/driving.md"
    )
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    stored = {name: Figures.read(one) for name, one in json.loads(STORED.read_text(encoding="utf-8")).items()}
    for name, one in stored.items():
        path = arguments.folder / name
        if not path.is_file():
            print(f"{path}: no such file; INTERDRIVE_SCENARIOS names the folder of scenarios", file=sys.stderr)
            return 2
        if hashlib.sha256(path.read_bytes()).hexdigest() != one.sha256:
            print(f"{path}: not the file whose figures are stored", file=sys.stderr)
            return 2
    now = measured(arguments.folder, stored, arguments.workers)
    print(*changes(stored, now), sep="\n")
    if arguments.update:
        store(now, arguments.update)
        return 0
    worse = failures(stored, now)
    collide, before = (sum(one.collisions for one in figures.values()) for figures in (now, stored))
    print(
        f"{share(now):.1f} % of reachable agents in time (stored: {share(stored):.1f} %), {collide} agents collide "
        f"(stored: {before}), {sum(one.violations for one in now.values())} violations"
    )
    print(*worse, sep="\n")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
