"""A batch in words: how its runs ended, and which run a word means."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.batches.columns import NOT_ARRIVED
from interdrive.batches.store import BatchFolder
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

#: So many characters of a key are shown, unless two runs share them.
_SHORT = 8
#: So many runs are listed in an error.
_LISTED = 5
_COLUMNS = (
    *("key", "scenario", "planner", "predictor", "settings", "traffic", "agents", "seed", "status", "error", "kept"),
    *("agent_id", "under_test", "outcome", "seconds", "reason"),
)


@dataclass(frozen=True)
class TestedRun:
    """One run of a batch.

    Attributes:
        key: Its key. short: The first characters of it, which no other run shares.
        scenario: Name of its scenario.
        about: Planner, seed, and whatever else tells it from the other runs.
        status: One of `interdrive.batches.columns.STATUS`. error: Why it did not finish.
        folder: Its run folder, None if that was not kept.
        endings: How each agent under test ended, and whether it arrived; by id.
    """

    key: str
    short: str
    scenario: str
    about: str
    status: str
    error: str
    folder: Path | None
    endings: tuple[tuple[int, str, bool], ...]

    @property
    def line(self) -> str:
        """The run in one line."""
        name = f"{self.short}  {self.scenario}, {self.about}"
        if self.status != "finished":
            return f"{name}: {self.status}: {self.error}"
        counts = Counter(text.split()[2].rstrip(":") for _, text, _ in self.endings)
        return f"{name}: " + (", ".join(f"{n} {outcome}" for outcome, n in counts.most_common()) or "no agents")


def tested_runs(folder: str | Path) -> list[TestedRun]:
    """All runs of the batch in a folder, in the order of its table.

    Raises:
        ResultsError: The folder is no batch, damaged, or of another format.
    """
    batch = BatchFolder.open(folder)
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in batch.table(_COLUMNS).to_pylist():
        rows.setdefault(row["key"], []).append(row)
    differ = [
        name
        for name in ("planner", "predictor", "settings", "traffic", "agents", "seed")
        if name in ("planner", "seed") or len({one[0][name] for one in rows.values()}) > 1
    ]
    size = _SHORT
    while len({key[:size] for key in rows}) < len(rows):
        size += 1
    found = []
    for key, mine in rows.items():
        first = mine[0]
        kept = batch.recording(key) if first["kept"] else None
        found.append(
            TestedRun(
                key=key,
                short=key[:size],
                scenario=first["scenario"],
                about=", ".join(f"{name} {first[name]}" for name in differ if first[name] != ""),
                status=first["status"],
                error=first["error"],
                folder=kept if kept is not None and (kept / "run.json").is_file() else None,
                endings=tuple(_ending(row) for row in mine if row["under_test"] and row["agent_id"] is not None),
            )
        )
    return found


def _ending(row: dict[str, Any]) -> tuple[int, str, bool]:
    when = "" if row["seconds"] is None else f" at {row['seconds']:.1f} s"
    text = f"agent {row['agent_id']} {row['outcome']}{when}" + (f": {row['reason']}" if row["reason"] else "")
    return row["agent_id"], text, row["outcome"] not in NOT_ARRIVED


def run_named(runs: Sequence[TestedRun], word: str) -> TestedRun:
    """The run that a word means: the beginning of its key, or its scenario if that has one run only.

    Raises:
        InputError: None or several; the line lists some.
    """
    found = [run for run in runs if run.key.startswith(word)] or [run for run in runs if run.scenario == word]
    if len(found) == 1:
        return found[0]
    listed = "; ".join(f"{run.short} {run.scenario}, {run.about}" for run in (found or runs)[:_LISTED])
    more = "; ..." if len(found or runs) > _LISTED else ""
    if not found:
        raise InputError(f"run {word}: there is none in the batch; it has {listed or 'no runs'}{more}")
    raise InputError(f"run {word}: {len(found)} runs have that; name one by its key: {listed}{more}")
