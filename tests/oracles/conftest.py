"""What all oracles share: the real scenarios, and the table of comparisons that is printed at the end."""

from __future__ import annotations

import itertools
import os
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import pytest

from interdrive.errors import InputError
from interdrive.files import read_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from interdrive.scenario import Scenario

N_SCENARIOS_MIN = 40


@dataclass(frozen=True)
class Comparison:
    """One line of the table: what was compared how often, the largest deviation, and what is allowed."""

    what: str
    count: int
    largest: float
    tolerance: float
    unit: str
    remark: str = ""

    def line(self) -> str:
        numbers = f"{self.largest:10.3g} {self.tolerance:10.3g} {self.unit:<6}"
        return f"{self.what:<72} {self.count:>9} {numbers} {self.remark}".rstrip()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(__file__.rsplit("/", 1)[0]):
            item.add_marker(pytest.mark.oracle)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [report for outcome in ("passed", "failed") for report in terminalreporter.stats.get(outcome, [])]
    lines = [line for report in reports for name, line in report.user_properties if name == "comparison"]
    if lines:
        terminalreporter.section("comparisons")
        terminalreporter.write_line(f"{'':<72} {'count':>9} {'largest':>10} {'allowed':>10}")
        for line in lines:
            terminalreporter.write_line(line)


@pytest.fixture
def measured(request: pytest.FixtureRequest):
    """`measured(what, count, largest, tolerance, unit)` enters a line into the table and fails above the tolerance.

    A remark stands in the table; cases are listed if it fails.
    """

    def enter(
        what: str,
        count: int,
        largest: float,
        tolerance: float,
        unit: str,
        remark: str = "",
        cases: Iterable[object] = (),
    ) -> None:
        # Properties of a test travel with its report, also from another process.
        comparison = Comparison(what, count, float(largest), tolerance, unit, remark)
        request.node.user_properties.append(("comparison", comparison.line()))
        assert count > 0, f"{what}: nothing was compared"
        listed = "\n".join(str(one) for one in itertools.islice(cases, 30))
        assert largest <= tolerance, f"{what}: {largest} {unit}, allowed are {tolerance} {unit}\n{listed}"

    return enter


@cache
def _recorded(folder: Path) -> tuple[Scenario, ...]:
    found = []
    # Folders are kinds of traffic, so every second file is a fair half.
    step = 1 if os.environ.get("INTERDRIVE_ORACLES") == "all" else 2
    for path in sorted(folder.rglob("*.xml"))[::step]:
        try:
            found.append(read_scenario(path))
        except InputError:
            continue  # files without roads, which nothing can be compared on
    return tuple(found)


@pytest.fixture(scope="session")
def recorded(scenarios_folder: Path) -> tuple[Scenario, ...]:
    """Every second real scenario, or all with INTERDRIVE_ORACLES=all, of those that have roads."""
    scenarios = _recorded(scenarios_folder)
    assert len(scenarios) >= N_SCENARIOS_MIN
    return scenarios
