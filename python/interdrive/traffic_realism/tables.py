"""Rows as tables of text, for terminals, Markdown and the page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.traffic_realism.measures import HORIZONS, QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.traffic_realism.result import Realism
    from interdrive.traffic_realism.summary import Row


@dataclass(frozen=True)
class Sheet:
    """A table of text.

    Attributes:
        title: What it says.
        head: Names of the columns; the first two are texts, the others numbers.
        rows: Cells.
        note: What stands below it.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def sheets(found: Realism) -> Iterator[Sheet]:
    """Scores, the classifier, safety, and distances beside their floor."""
    yield Sheet(
        "Where vehicles are: energy score [m] and its 95 % interval, CRPS of speed [m/s]",
        ("place", "planner", "vehicles", *(f"energy {h} s" for h in HORIZONS), "interval 5 s", "CRPS 5 s"),
        tuple(
            (
                *_named(row),
                str(row.vehicles),
                *(_text(row.energy[h]) for h in HORIZONS),
                _interval(row.energy_interval[5]),
                _text(row.crps[5]),
            )
            for row in found.rows
        ),
        "Less is better; analog says what can be reached without knowing the road or the others.",
    )
    floors = {floor.place: floor for floor in found.floors}
    yield Sheet(
        "Whether a classifier tells them from people: area under the curve",
        ("place", "planner", "along, gaps", "speeds, gaps", "across", "all"),
        (
            *(
                (*_named(row), *(_text(row.auc[name]) for name in ("lon_gap", "coarse", "lat", "all")))
                for row in found.rows
            ),
            *(
                (place, "floor", *(_text(floor.auc.get(name)) for name in ("lon_gap", "coarse", "lat", "all")))
                for place, floor in floors.items()
            ),
        ),
        "0.5: not at all, 1: always. Values of one table can be compared: they grow with data and features.",
    )
    yield Sheet(
        "What happens to them, per 100 vehicles; how drivers differ",
        (
            *("place", "planner", "hard braking", "collisions", "off road", "in long drives", "off road there"),
            *("not admitted", "spread", "persistence"),
        ),
        tuple(
            (
                *_named(row),
                *(_text(value) for value in (row.braked, row.collisions, row.departures)),
                *(_text(value) for value in (row.long_collisions, row.long_departures, 100.0 * row.not_admitted)),
                *(_text(value) for value in (row.persistence.spread, row.persistence.persistence)),
            )
            for row in found.rows
        ),
    )
    yield Sheet(
        "Distributions: Wasserstein distance from the recording; lane changes per km, and the lag gap at them",
        (
            *("place", "planner", *(f"{name.replace('_', ' ')} [{unit}]" for name, unit in QUANTITIES.items())),
            *("changes", "lag gap [m]", "of"),
        ),
        (
            *(
                (
                    *(*_named(row), *(_text(row.wasserstein[name], 3) for name in QUANTITIES)),
                    *(_text(row.lane_changes), _text(row.lag_gap, 1), str(row.lag_gaps)),
                )
                for row in found.rows
            ),
            *(
                (
                    *(place, "floor, 90 %"),
                    *(_text(floor.wasserstein.get(n, (None, None))[1], 3) for n in QUANTITIES),
                    *("", "", ""),
                )
                for place, floor in floors.items()
            ),
        ),
        "Halves of the recording are farther apart than the floor in one of ten splits. The lag gap is the median gap "
        "behind vehicles that change lanes; of fewer than 100 it decides nothing.",
    )


def markdown(found: Realism) -> str:
    """All tables as Markdown, with what was measured and the notes."""
    parts = [found.about, ""]
    for sheet in sheets(found):
        marks = ("---", "---", *(["--:"] * (len(sheet.head) - 2)))
        lines = (sheet.head, marks, *sheet.rows)
        parts += [f"## {sheet.title}", "", *(f"| {' | '.join(line)} |" for line in lines), "", sheet.note, ""]
    return "\n".join([*parts, *(f"- {note}" for note in found.notes)]).rstrip() + "\n"


def _named(row: Row) -> tuple[str, str]:
    return (
        row.place if row.is_claim else f"{row.place} (few)",
        f"{row.planner} (fitted here)" if row.is_fitted else row.planner,
    )


def _interval(ends: tuple[float, float]) -> str:
    return "" if any(map(math.isnan, ends)) else f"{_text(ends[0])} to {_text(ends[1])}"


def _text(value: float | None, digits: int = 2) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.{digits}f}"
