"""Results of peers as a table for people."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """A run: program, seconds per step, seconds to the first step, memory [bytes], outcomes."""

    name: str
    found: dict[str, Any]

    @property
    def step(self) -> float:
        """Median of the steps after the first [s]."""
        seconds = self.found["seconds"]
        return statistics.median(seconds[1:] or seconds)


def print_rows(rows: list[Row], n_agents: int) -> None:
    """A Markdown table."""
    print(
        "| who | steps timed | ms per step (median) | agents in real time | start to first step | memory | outcomes |"
    )
    print("|---|--:|--:|--:|--:|--:|---|")
    for row in rows:
        found = row.found
        outcomes = ", ".join(f"{count} {name}" for name, count in sorted(found["outcomes"].items())) or "–"
        print(
            f"| {row.name} | {len(found['seconds'])} | {1e3 * row.step:.3g} | {n_agents * 0.1 / row.step:.3g} "
            f"| {found['first_step']:.2f} s | {found['memory'] / 2**20:.0f} MiB | {outcomes} |"
        )
