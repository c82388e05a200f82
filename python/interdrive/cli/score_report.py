"""Output of `interdrive score`: tables of scores. Loads rich."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
from rich.markup import escape

from interdrive.benchmarks.ranking_tables import OWN, cell, rank_text
from interdrive.benchmarks.sets import traffic_name
from interdrive.cli.report import output, print_folder, print_table, table_of
from interdrive.cli.terminal import print_csv
from interdrive.comparison.scores import ZEROS
from interdrive.run.reasons import said_count
from interdrive.scoring.total import GATES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from interdrive.adversaries import Ranking
    from interdrive.benchmarks import Benchmark, BenchmarkSet, Row
    from interdrive.comparison.scores import PlannerScore
    from interdrive.scoring import Score

#: Kinds of traffic that the first table of a benchmark shows, and how many a table of rankings has beside numbers.
_COLUMNS_USUAL, _COLUMNS_AT_ONCE = 2, 3

#: Missing files of a benchmark that are listed.
_MISSING_MAX = 12

#: What tables say of agents without a row, and of replayed humans.
_LEFT_OUT = "left out: agents that a planner cannot drive, or whose recordings overlap those of others"
_REPLAYED = "recorded has no row among reacting traffic: replayed humans do not react"

#: What is said of adversaries.
_RANKS = {None: "vice never acts", True: "as it should", False: "too high"}

#: Parts of a score in the table, and their headings; scores in other forms beside it.
_PARTS = {
    "gates": "gates",
    "arrival": "arrival",
    "pace": "pace",
    "ttc_term": "contact",
    "hindrance": "hindrance",
    "comfort_term": "comfort",
}
_BESIDE = {"cls": "CLS", "epdms": "EPDMS"}

#: What is said of scores without a panel, and of those of earlier releases.
_ABSOLUTE = "absolute, without a panel: not comparable with scores against one"
_FORMER = "scored by an earlier release: score 1, which does not compare with today's score"


def print_scores(found: Score, name: str) -> None:
    """Prints the scores of a run, each with its parts and why it is not 100."""
    console = output()
    numbers = ("agent", "score", *_PARTS.values(), *_BESIDE.values(), "score 1")
    table = table_of((*numbers, "why"), right=numbers)
    gates = np.prod([found.terms[f"gate_{gate}"] for gate in GATES], axis=0)
    for row, number in enumerate(found.ids.tolist()):
        parts = (float(gates[row]) if part == "gates" else float(found.terms[part][row]) for part in _PARTS)
        table.add_row(
            str(number),
            _number(100.0 * found.score[row], 1),
            *(_number(part, 2) for part in parts),
            *(_number(100.0 * found.terms[form][row], 1) for form in _BESIDE),
            _number(100.0 * found.score_1[row], 1),
            escape("; ".join(found.reasons[row])),
            style="red" if found.score[row] == 0.0 else None,
        )
    if len(found.ids):
        print_table(console, table, 1)
    known = found.score[np.isfinite(found.score)]
    mean = f", mean score {100.0 * float(known.mean()):.1f}" if len(known) else ""
    console.print(
        f"{escape(name)}, {said_count(len(found.ids), 'agent')}{mean}, {int(found.in_time.sum())} in time, "
        f"{int((known == 0.0).sum())} at 0, {int(found.fault.sum())} at fault"
    )
    console.print(f"panel: {', '.join(found.panel)}" if found.panel else _ABSOLUTE)
    for note in found.notes:
        console.print(f"note: {escape(note)}", style="yellow", soft_wrap=True)


def print_adversaries(found: Ranking, folder: Path) -> None:
    """Prints honest drivers and adversaries with their differences; the last line says how many rank as they should."""
    console = output()
    honest = ", ".join(f"{name} {score:.1f}" for name, score in found.honest.items())
    console.print(f"honest drivers: {escape(honest)}", soft_wrap=True)
    numbers = ("score", "difference", "95 %", "drives with vice", "score there", "least honest there")
    table = table_of(("adversary", "base", *numbers, "ranks"), right=numbers)
    for one in found.verdicts:
        table.add_row(
            one.driver,
            one.base,
            _number(one.score, 1),
            _number(one.difference, 1),
            "" if math.isnan(one.low) else f"{one.low:.1f} to {one.high:.1f}",
            str(one.n_vice),
            _number(one.on_vice, 1),
            _number(one.least_honest, 1),
            _RANKS[one.holds] if math.isinf(one.loss_max) or one.holds else "loses too much",
            style="red" if one.holds is False else None,
        )
    print_table(console, table, 1)
    console.print(
        f"{said_count(found.n_drives, 'agent')} of {said_count(found.n_files, 'file')}, "
        f"{said_count(found.n_places, 'place')}; {escape(str(folder))}/adversaries.json",
        soft_wrap=True,
    )
    if found.n_trivial:
        console.print(f"left out: {said_count(found.n_trivial, 'agent')} whose goal is reached in time by standing")
    for note in found.notes:
        console.print(f"note: {escape(note)}", soft_wrap=True)
    if found.missing:
        console.print(f"partial: {len(found.missing)} files or agents are missing", style="yellow")
        for line in found.missing[:_MISSING_MAX]:
            console.print(f"- {escape(line)}", soft_wrap=True)
    console.print(f"{found.n_below} of {len(found.judged)} below")


def print_batch_scores(found: Sequence[PlannerScore], *, no_humans: bool, as_csv: bool) -> None:
    """Prints the scores of planners by traffic, and how many agents got 0 for what.

    `no_humans` says that replayed humans among reacting traffic were left out.
    """
    if as_csv:
        rows = [_planner_row(one) for one in found]
        print_csv(list(rows[0]) if rows else [], [list(row.values()) for row in rows])
        return
    console = output()
    several = len({(one.traffic, one.agents) for one in found}) > 1
    # What planners cannot drive has no row: then every planner stands on its own agents, and on those of all.
    lacking, differ = any(one.n_left_out for one in found), any(one.n_common != one.n_agents for one in found)
    texts = ("planner", *(("traffic", "agents under test") if several else ()))
    numbers = [
        *("score", "95 %", "score 1", "reached %", "at fault per 100", "nuPlan", "scenarios", "agents"),
        *("left out", "score of common", "common"),
    ]
    table = table_of((*texts, *numbers, "zeros"), right=numbers)
    for one in found:
        about = (escape(one.variant), *((one.traffic, one.agents) if several else ()))
        span = "" if math.isnan(one.low) else f"{one.low:.1f} to {one.high:.1f}"
        table.add_row(
            *about,
            _number(one.score, 1),
            span,
            "" if one.is_former else _number(one.score_1, 1),
            _number(one.reached, 1),
            _number(one.at_fault, 2),
            _number(one.at_fault_nuplan, 2),
            str(one.n_scenarios),
            str(one.n_agents),
            str(one.n_left_out) if lacking else "",
            *((_number(one.common, 1), str(one.n_common)) if differ else ("", "")),
            ", ".join(f"{count} {name}" for name, count in one.zeros.items()),
        )
    print_table(console, table, 3 if several else 1)
    if lacking:
        console.print(_LEFT_OUT + "; common: agents that all planners can drive" * differ)
    if no_humans:
        console.print(_REPLAYED)
    if any(one.is_former for one in found):
        console.print(_FORMER, style="yellow")
    else:
        panels = sorted({one.panel for one in found})
        console.print(_ABSOLUTE if panels == [""] else f"panel: {' | '.join(name or 'none' for name in panels)}")
    console.print("scores are means over files of the means of their agents, intervals over places (5 at least)")


def print_benchmark(found: Benchmark) -> None:
    """Prints the number of each planner with its table, rows of known planners, and what is missing."""
    console = output()
    numbers = [
        *(
            "R",
            "95 %",
            "NR",
            "R, score 1",
            "reached %",
            "at fault per 100",
            "TTC < 2 s %",
            "jerk",
            "plan ms",
            "scen.",
            "agents",
        ),
        *("left out", "common", "R of common", "NR of common"),
    ]
    table = table_of(("planner", "category", *numbers, "zeros"), right=numbers, tight=True)
    # What planners cannot drive has no row: then every planner stands on its own agents, and on those of all.
    every = (*found.table, *(row for row in found.reference if row.category == "all"))
    lacking, differ = any(row.n_left_out for row in every), any(row.n_common != row.n_agents for row in found.table)
    for row in every:
        is_reference = row in found.reference
        span = "" if math.isnan(row.low) else f"{row.low:.1f} to {row.high:.1f}"
        table.add_row(
            escape(row.planner) + (f" ({row.version})" if is_reference else ""),
            row.category,
            _number(row.score, 1),
            span,
            _number(row.non_reactive, 1),
            _number(row.score_1, 1),
            _number(row.reached, 1),
            _number(row.at_fault, 2),
            _number(row.ttc_critical, 1),
            _number(row.jerk, 2),
            _number(row.plan_ms, 2),
            str(row.n_scenarios),
            str(row.n_agents),
            str(row.n_left_out) if lacking else "",
            *(_shared(row) if differ and not is_reference else ("", "", "")),
            ", ".join(f"{count} {name}" for name, count in row.zeros.items()),
            style="dim" if is_reference else None,
        )
    print_table(console, table, 2)
    _print_ranking(console, found)
    console.print(f"set {found.set}, split {found.split}; R: among reacting traffic, NR: among replayed traffic")
    console.print(f"panel: {found.panel}" if found.panel else _ABSOLUTE)
    if lacking:
        console.print(_LEFT_OUT + "; common: agents that all planners of this command can drive" * differ)
    if any(row.planner == "recorded" for row in every):
        console.print(_REPLAYED)
    for note in found.notes:
        console.print(f"note: {escape(note)}", soft_wrap=True)
    if found.missing:
        console.print(f"partial, without rank: {len(found.missing)} files are missing", style="yellow")
        for line in found.missing[:_MISSING_MAX]:
            console.print(f"- {escape(line)}", soft_wrap=True)
    console.print(f"again: {escape(found.command)}", soft_wrap=True)
    print_folder(console, found.folder)


def _print_ranking(console: Console, found: Benchmark) -> None:
    """Prints the score in each kind of traffic, and how far the order of planners can be trusted."""
    ranking = found.ranking
    if ranking is None or (len(ranking.ranks) == 1 and len(found.traffic) <= _COLUMNS_USUAL):
        return
    # Missing files: no number has a rank.
    numbers = ["number", "95 %", *(() if found.missing else ("rank", "above next %", "separable"))]
    for first in range(0, len(found.traffic), _COLUMNS_AT_ONCE):
        kinds = found.traffic[first : first + _COLUMNS_AT_ONCE]
        heads = [traffic_name(kind) for kind in kinds]
        table = table_of(("planner", *numbers, *heads), right=[*numbers, *heads], tight=True)
        for one in ranking.ranks:
            span = "" if math.isnan(one.low) else f"{one.low:.1f} to {one.high:.1f}"
            above = "" if math.isnan(one.above_next) else f"{100.0 * one.above_next:.0f}"
            order = () if found.missing else (rank_text(one), above, one.letters)
            cells = [cell(one, kind) for kind in kinds]
            table.add_row(escape(one.planner), _number(one.number, 1), span, *order, *cells)
        print_table(console, table, 1)
    counted = ", ".join(traffic_name(kind) for kind in found.counted) or "none: traffic that counts was not driven"
    console.print(f"number: mean among {counted}; {OWN}: among its own copies")
    if ranking.sentence:
        console.print(ranking.sentence)
    if not ranking.is_sure:
        places = ", ".join(f"{n} {name}".rstrip() for name, n in ranking.n_places.items())
        console.print(f"too few places ({places}) for intervals of ranks and for letters")
    for (above_it, below_it), n in found.needed.items():
        console.print(f"{n} places would separate {escape(above_it)} and {escape(below_it)} if they were so far apart")


def print_set(found: BenchmarkSet) -> None:
    """Prints every file of a set: hash, name, split, where it comes from."""
    console = output()
    console.print(escape(found.text), soft_wrap=True)
    for file in found.files:
        about = " ".join(file.source) or "shipped"
        if file.passage is not None:
            about = f"steps {file.passage.first} to {file.passage.end - 1} of the recording {file.passage.recording}"
        console.print(
            f"{file.sha256} {file.name} {file.split} {file.category} {len(file.agents)} agents {escape(about)}".strip(),
            soft_wrap=True,
        )
    for recording in found.recordings.values():
        for part in recording.parts:
            about = " ".join(part.source)
            console.print(f"{part.sha256} {part.name} window of {recording.name} {escape(about)}", soft_wrap=True)
    console.print(f"{found.name}: {len(found.files)} files, sha256 of the set {found.sha256}", soft_wrap=True)


def _planner_row(one: PlannerScore) -> dict[str, object]:
    """All about a planner but its scenarios."""
    row = {item.name: getattr(one, item.name) for item in fields(one) if item.name not in ("zeros", "by_scenario")}
    return {**row, **{f"zero_{name}": one.zeros.get(name, 0) for name in ZEROS}}


def _shared(row: Row) -> tuple[str, str, str]:
    """Cells about agents that all planners of a benchmark can drive."""
    return str(row.n_common), _number(row.common, 1), _number(row.common_non_reactive, 1)


def _number(value: float, digits: int) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}f}"
