"""interdrive with full planning beside highway-env 1.12 without any: 24 vehicles on a six-lane highway, in one run.

highway-env moves vehicles by rules (IDM and MOBIL) in Python; interdrive plans for every vehicle at every step with
`rollout`. The environment of the peer is made once from PyPI:

    .venv/bin/python benchmarks/peers/rule_based.py
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from environment import environment, measured
from handler import HERE, HIGHWAY, note, ours
from rows import Row, print_rows

REQUIREMENTS = ["highway-env==1.12", "numpy<3"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=24)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--repeat", type=int, default=3, help="runs of each, taking turns; the best median counts")
    arguments = parser.parse_args()
    python = environment("highway-env", REQUIREMENTS)
    recorded = Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios")) / HIGHWAY
    scenario = str(recorded) if recorded.is_file() else "highway"
    rows: dict[str, Row] = {}

    def add(row: Row) -> None:
        if row.name not in rows or row.step < rows[row.name].step:
            rows[row.name] = row

    for _ in range(arguments.repeat):
        options = {"vehicles": arguments.vehicles, "steps": arguments.steps, "started": time.time()}
        command = [str(python), str(HERE / "rule_based_inside.py")]
        command += [part for name, value in options.items() for part in (f"--{name}", str(value))]
        add(Row("highway-env 1.12, rules, no planning", measured(command, 300.0)))
        for threads in sorted({1, os.cpu_count() or 1}):
            found = ours(scenario, arguments.vehicles, threads, 1, arguments.steps, "rollout")
            add(Row(f"interdrive, rollout, {threads} thread{'s' * (threads > 1)}", found))
    print(f"{arguments.vehicles} vehicles; interdrive on {Path(scenario).stem}\n")
    print_rows(list(rows.values()), arguments.vehicles)
    theirs, *own = (row.step for row in rows.values())
    print(f"\nhighway-env takes {theirs / min(own):.2g} times as long per step as the best of interdrive.")
    if arguments.vehicles == 24 and recorded.is_file():
        note("highway_env_ratio", theirs / min(own))


if __name__ == "__main__":
    sys.exit(main())
