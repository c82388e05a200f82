"""Tables of the driving benchmark as Markdown, and its rows as CSV."""

from __future__ import annotations

import csv
from collections import Counter, defaultdict
from dataclasses import astuple, fields
from typing import TYPE_CHECKING, Any

import measures
import numpy as np
from drives import LONG, Drive
from lane_changes import said
from measures import is_lost
from realism import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

#: A body that never reaches further beyond the lanelets stays on them [m].
ON_LANELETS = 0.1
#: Lines of a page between which the benchmark and its comparison write.
MARKERS = ("<!-- written by benchmarks/driving: begin -->", "<!-- written by benchmarks/driving: end -->")
SIDE_BY_SIDE = (
    "<!-- written by benchmarks/driving/side_by_side.py: begin -->",
    "<!-- written by benchmarks/driving/side_by_side.py: end -->",
)


def markers_of(section: str | None) -> tuple[str, str]:
    """Lines between which the tables of a section stand; of the first one without a name."""
    if section is None:
        return MARKERS
    begin, end = (f"<!-- written by benchmarks/driving, {section}: {word} -->" for word in ("begin", "end"))
    return begin, end


_HEADINGS = (
    *("category", "agents", "in time", "share", "reachable", "in time", "share", "body on lanelets"),
    "seconds lost",
    *("ran into agents", "replayed", "standing", "road edge", "violations", "lost events", "collision events"),
    *("slow > 10 s", "stand > 10 s"),
)
_TYPES: dict[str, Any] = {"str": str, "int": int, "float": float, "bool": lambda text: text == "True"}


def write_csv(drives: Sequence[Drive], path: Path) -> None:
    """One row per agent."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(field.name for field in fields(Drive))
        for one in drives:
            writer.writerow([f"{cell:.4g}" if isinstance(cell, float) else cell for cell in astuple(one)])


def read_csv(path: Path) -> list[Drive]:
    """The rows of a file that `write_csv` wrote.

    Raises:
        ValueError: A column is absent.
    """
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        absent = [f.name for f in fields(Drive) if f.name not in (reader.fieldnames or ())]
        if absent:
            raise ValueError(f"has no column {absent[0]}; an older benchmark wrote it")
        return [Drive(**{f.name: _TYPES[str(f.type)](row[f.name]) for f in fields(Drive)}) for row in reader]


def in_time(drives: Iterable[Drive]) -> int:
    """How many reach their goal in time."""
    return sum(one.outcome == "goal_reached" for one in drives)


def is_stuck(one: Drive) -> bool:
    """Slow for more than 10 s though its recording was not."""
    return one.slow > LONG >= one.recorded_slow


def by_category(drives: Iterable[Drive]) -> dict[str, list[Drive]]:
    """Rows of every category, and all of them as "all"."""
    grouped = defaultdict(list)
    for one in drives:
        grouped[one.category].append(one)
        grouped["all"].append(one)
    return dict(sorted(grouped.items(), key=lambda item: (item[0] == "all", item[0])))


def shares(drives: Sequence[Drive]) -> str:
    """Agents in time, by category."""
    lines = [
        f"| {' | '.join(_HEADINGS)} |",
        "|---|" + "--:|" * (len(_HEADINGS) - 1),
    ]
    for category, rows in by_category(drives).items():
        reachable = [one for one in rows if one.reachable]
        hits = Counter(one.partner for one in rows if one.outcome == "collision")
        lost = sum(one.lost for one in reachable if one.outcome != "goal_reached")
        cells = (
            *(category, len(rows), in_time(rows), _percent(rows)),
            *(len(reachable), in_time(reachable), _percent(reachable)),
            *(in_time(one for one in reachable if one.off_lanelets <= ON_LANELETS), f"{lost:.0f}"),
            *(hits[partner] for partner in ("agent", "replayed", "standing", "road edge")),
            *(sum(one.violations for one in rows), *_events(rows)),
            *(sum(map(is_stuck, rows)), sum(one.stood > LONG for one in rows)),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def _events(drives: Sequence[Drive]) -> tuple[int, int]:
    """How many events reachable agents were lost in, and how many had collisions."""
    collided = [one for one in drives if one.outcome == "collision"]
    return measures.count_events(filter(is_lost, drives)), measures.count_events(collided)


def manner(drives: Sequence[Drive]) -> str:
    """Pace, comfort, standing and violations by category, their intervals, and the recorded people beside them."""
    shown = (*measures.MANNER, measures.VIOLATIONS)
    lines = [f"| category | agents | {' | '.join(one.title for one in shown)} |", "|---|" + "--:|" * (len(shown) + 1)]
    for category, rows in by_category(drives).items():
        cells = [one.shown(measures.value(map(one.of, rows), one.quantile)) for one in shown]
        lines.append(f"| {category} | {len(rows)} | {' | '.join(cells)} |")
    what, of = measures.units(drives)
    cells = [_interval(one, measures.interval([measures.of_agents(one, drives)], of, one.quantile)) for one in shown]
    lines.append(f"| 95 % over {of.max(initial=-1) + 1} {what} | | {' | '.join(cells)} |")
    people = [one for one in drives if one.origin == "recorded"]
    cells = [
        one.shown(measures.value(map(one.recorded, people), one.quantile)) if one.recorded else "" for one in shown
    ]
    lines.append(f"| recorded people | {len(people)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _interval(measure: measures.Measure, bounds: tuple[float, float], sign: str = "") -> str:
    low, high = (measure.shown(bound, sign) for bound in bounds)
    return f"{low} to {high}" if low and high else ""


def violations(drives: Sequence[Drive]) -> str:
    """How many agents break which rule."""
    counts = Counter(rule for one in drives for rule in one.broken.split())
    return ", ".join(f"{rule} {n}" for rule, n in sorted(counts.items())) or "none"


def slow_problems(drives: Sequence[Drive]) -> str:
    """Planning problems beside free flow."""
    paces = [one for one in drives if one.origin != "recorded" and not np.isnan(one.pace)]
    slow = sum(map(measures.is_slow, paces))
    return f"{slow} of {len(paces)} planning problems are slower than {measures.SLOW_SHARE} of free flow"


def lane_changes(drives: Sequence[Drive]) -> str:
    """How agents and their recordings change lanes."""
    agents, people = (
        said(cells) for cells in zip(*((one.changes, one.recorded_changes) for one in drives), strict=True)
    )
    return f"Lane changes: agents {agents}; recorded people {people}"


def idle(drives: Sequence[Drive]) -> str:
    """Agents that stand at their end or with a free way, one by one."""
    rows = [
        f"{one.scenario} {one.agent_id}" + (f" ({one.stood_free:.1f} s free)" if one.stood_free > LONG else "")
        for one in drives
        if measures.stands_idle(one)
    ]
    return f"Agents that stand idle: {'; '.join(rows) or 'none'}"


def _percent(drives: Sequence[Drive]) -> str:
    return f"{100 * in_time(drives) / len(drives):.1f} %" if drives else ""


def outcomes(drives: Sequence[Drive]) -> str:
    """How reachable agents end, and the interval of the share in time."""
    counts = Counter(one.outcome for one in drives if one.reachable)
    narrowly = sum(one.reachable and 0 < one.late <= 1 for one in drives)
    ends = ", ".join(f"{name} {n}" for name, n in counts.most_common()) + f" ({narrowly} late by at most 1 s)"
    what, of = measures.units(drives)
    bounds = _interval(measures.IN_TIME, measures.interval([measures.of_agents(measures.IN_TIME, drives)], of, None))
    return ends + (f"; in time with 95 % confidence over {of.max() + 1} {what}: {bounds}" if bounds else "")


def causes(drives: Sequence[Drive]) -> str:
    """What held up reachable agents that are not in time, by cause; heads of queues are counted once."""
    grouped = defaultdict(list)
    for one in drives:
        if one.reachable and one.outcome != "goal_reached":
            grouped[one.cause or "none found"].append(one)
    ids = {(one.scenario, one.agent_id): one.reachable for one in drives}
    lines = [
        "| cause at the head of the queue | agents | heads | behind an unreachable head | seconds |",
        "|---|--:|--:|--:|--:|",
    ]
    for cause, rows in sorted(grouped.items(), key=lambda item: (-len(item[1]), item[0])):
        heads = {(one.scenario, one.head_id) for one in rows if one.head_id >= 0}
        behind = sum(
            one.head_id >= 0 and one.head_id != one.agent_id and not ids.get((one.scenario, one.head_id), False)
            for one in rows
        )
        seconds = sum(one.cause_seconds for one in rows if one.cause)
        lines.append(f"| {cause} | {len(rows)} | {len(heads)} | {behind} | {seconds:.0f} |")
    return "\n".join(lines)


def halves(drives: Sequence[Drive], half_of: dict[str, str]) -> str:
    """Reachable agents in time, by half of the places; `half_of` gives the half of a place."""
    lines = [
        "| half | reachable | in time | share | urban | in time | share | collisions | violations |",
        "|---|" + "--:|" * 8,
    ]
    for half in sorted(set(half_of.values())):
        both = [one for one in drives if half_of.get(one.place) == half]
        rows = [one for one in both if one.reachable]
        urban = [one for one in rows if one.category == "urban"]
        cells = (
            *(half, len(rows), in_time(rows), _percent(rows), len(urban), in_time(urban), _percent(urban)),
            *(sum(one.outcome == "collision" for one in both), sum(one.violations for one in both)),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def failing(drives: Sequence[Drive]) -> str:
    """Reachable agents that are not in time, by cause: how they end, and which ones (with the head of their queue)."""
    grouped = defaultdict(list)
    for one in drives:
        if one.reachable and one.outcome != "goal_reached":
            grouped[one.cause or "none found"].append(one)
    lines = ["| cause at the head of the queue | late by 1 s | 3 s | more | never | agents (head) |"]
    lines.append("|---|" + "--:|" * 4 + "---|")
    for cause, rows in sorted(grouped.items(), key=lambda item: (-len(item[1]), item[0])):
        ends = Counter(_lateness(one.late) for one in rows)
        named = defaultdict(list)
        for one in rows:
            queued = one.head_id not in (-1, one.agent_id)
            named[one.scenario].append(f"{one.agent_id} ({one.head_id})" if queued else str(one.agent_id))
        listed = "; ".join(f"{scenario} {', '.join(ids)}" for scenario, ids in sorted(named.items()))
        lines.append(f"| {cause} | {' | '.join(str(ends[i]) for i in range(4))} | {listed} |")
    return "\n".join(lines)


def _lateness(late: float) -> int:
    """Column of a delay: up to 1 s, up to 3 s, longer, never arrived (nan)."""
    # step times dt is a little over a whole second at times
    return next((i for i, bound in enumerate((1.0, 3.0, float("inf"))) if late <= bound + 1e-9), 3)


def put_into(page: str, text: str, markers: tuple[str, str] = MARKERS) -> str:
    """A page with the text between its two markers replaced.

    Raises:
        ValueError: if the page does not have both markers, once each and in order.
    """
    head, begin, rest = page.partition(markers[0])
    old, end, tail = rest.partition(markers[1])
    if not (begin and end) or markers[0] in old + tail or markers[1] in head + tail:
        raise ValueError(f"needs the lines {markers[0]} and {markers[1]}, once each and in this order")
    return f"{head}{begin}\n\n{text}\n\n{end}{tail}"


def realism(distances: dict[str, dict[str, float]]) -> str:
    """Distances to the recordings by category."""
    lines = [
        "| category | " + " | ".join(f"{name} [{unit}]" for name, unit in QUANTITIES.items()) + " |",
        "|---|" + "--:|" * len(QUANTITIES),
    ]
    for category, row in distances.items():
        lines.append(f"| {category} | " + " | ".join(f"{row[quantity]:.2f}" for quantity in QUANTITIES) + " |")
    return "\n".join(lines)


def failures(drives: Sequence[Drive]) -> str:
    """Reachable agents that are not in time and all collisions, one by one."""
    lines = [
        "| scenario | agent | outcome | late [s] | lost [s] | slow [s] | cause | head | ran into | impact [m/s] |",
        "|---|--:|---|--:|--:|--:|---|--:|---|--:|",
    ]
    for one in drives:
        if one.outcome == "collision" or (one.reachable and one.outcome != "goal_reached"):
            head = one.head_id if one.head_id not in (-1, one.agent_id) else ""
            cells = (
                *(one.scenario, f"{one.agent_id}{'' if one.reachable else ' (unreachable)'}", one.outcome),
                *(_number(one.late), _number(one.lost), _number(one.slow), one.cause, head),
                *(f"{one.partner} {one.partner_id if one.partner_id >= 0 else ''}", _number(one.impact_speed)),
            )
            lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def _number(value: float) -> str:
    return "" if value != value else f"{value:.1f}"  # noqa: PLR0124 - nan


def changes(old: Sequence[Drive], new: Sequence[Drive]) -> str:
    """Agents whose outcome differs between two builds or planners; `reachable` is that of the old one."""
    before = {(one.category, one.scenario, one.agent_id): one for one in old}
    pairs = [(before[key], one) for one in new if (key := (one.category, one.scenario, one.agent_id)) in before]
    headings = ("category", "reachable before", "in time before", "in time now", "gained", "lost")
    headings += ("collisions before", "collisions now", "violations before", "violations now")
    lines = [f"| {' | '.join(headings)} |", "|---|" + "--:|" * (len(headings) - 1)]
    for category in by_category(new):
        both = [(a, b) for a, b in pairs if category in (b.category, "all")]
        rows = [(a, b) for a, b in both if a.reachable]
        was, now = (in_time(pair[side] for pair in rows) for side in (0, 1))
        gained = sum(b.outcome == "goal_reached" != a.outcome for a, b in rows)
        cells = (
            *(category, len(rows), was, now, gained, was + gained - now),
            *(sum(pair[side].outcome == "collision" for pair in both) for side in (0, 1)),
            *(sum(pair[side].violations for pair in both) for side in (0, 1)),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += ["", paired(pairs)]
    lines += ["", "| scenario | agent | reachable | before | now | cause now |", "|---|--:|---|---|---|---|"]
    for a, b in pairs:
        if a.outcome != b.outcome:
            cells = (b.scenario, b.agent_id, "yes" if a.reachable else "no", _end(a), _end(b), b.cause)
            lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def paired(pairs: Sequence[tuple[Drive, Drive]]) -> str:
    """All measures of the same agents before and now, with intervals of their change; events are counted, too."""
    what, of = measures.units([a for a, _ in pairs])
    lines = [
        f"| measure | agents | before | now | change | 95 % over {of.max(initial=-1) + 1} {what} | more | less |",
        "|---|" + "--:|" * 7,
    ]
    for one in measures.ALL:
        found = np.array([(one.of(a), one.of(b)) for a, b in pairs], dtype=np.float64).reshape(-1, 2)
        there = ~np.isnan(found).any(axis=1)
        was, now = found[there].T
        values = [measures.value(side, one.quantile) for side in (was, now)]
        bounds = measures.interval([was, now], of[there], one.quantile)
        cells = (
            *(one.title, there.sum(), *map(one.shown, values), one.shown(values[1] - values[0], "+")),
            *(_interval(one, bounds, "+"), (now > was).sum(), (now < was).sum()),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    counts = zip(*(_events([pair[side] for pair in pairs]) for side in (0, 1)), strict=True)
    for title, (was, now) in zip(("events with lost agents", "events with collisions"), counts, strict=True):
        lines.append(f"| {title} | {len(pairs)} | {was} | {now} | {now - was:+d} | | | |")
    return "\n".join(lines)


def _end(one: Drive) -> str:
    return f"{one.outcome} {one.time:.1f} s" + (f" ({one.partner} {one.partner_id})" if one.partner else "")
