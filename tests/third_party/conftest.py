"""Third-party planners, in an environment of their own that has their extras: `make third_party`."""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import TYPE_CHECKING

import pytest

import interdrive as idr

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.runs import Run

#: Real scenarios and the agents that drive in the tests: a T-junction, two merges, a few vehicles of a dense highway.
REAL = {
    "t_junction/ZAM_Tjunction-1_42_T-1.xml": "all",
    "merge/ZAM_Merge-1_1_T-1.xml": "all",
    "merge/ZAM_Zip-1_56_T-1.xml": "all",
    "highway/USA_US101-23_1_T-1.xml": 2,
}
#: Ends that no test of these scenarios allows.
BAD = ("collision", "infeasible", "planner_error")


@cache
def _driven(path: Path, planner: str, agents: str | int) -> Run:
    # "raise" keeps planners in this process: what they import takes seconds in each.
    return idr.simulate(path, agents=agents, planner=planner, threads=1, on_planner_error="raise")


@pytest.fixture(scope="session")
def driven(scenarios_folder):
    """`driven(scenario, planner)`: the finished run of a real scenario, made once."""

    def drive(scenario: str, planner: str) -> Run:
        return _driven(scenarios_folder / scenario, planner, REAL[scenario])

    return drive


@pytest.fixture(scope="session")
def ends():
    """How often each outcome happened; fails with the messages if one did that never may."""

    def count(run: Run) -> Counter[str]:
        found = Counter(run.outcomes.outcome)
        told = list(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, run.outcomes.message, strict=True))
        assert not any(found[outcome] for outcome in BAD), told
        return found

    return count
