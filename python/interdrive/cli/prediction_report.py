"""Output of `interdrive predict-eval`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.markup import escape

from interdrive.cli.report import output, print_folder, print_notes, print_table, table_of
from interdrive.prediction_evaluation.split import TRAFFIC
from interdrive.prediction_evaluation.tables import ALL, ANY, MEAN, measures_table
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rich.console import Console

    from interdrive.prediction_evaluation import PredictionEvaluation


def print_prediction_evaluation(found: PredictionEvaluation, folder: Path) -> None:
    """Prints tables of at most 110 columns: distances, likelihood, calibration, standing vehicles and road."""
    console = output()
    table = measures_table(found).to_pylist()
    order = list(dict.fromkeys(row["category"] for row in table))
    table.sort(key=lambda row: order.index(row["category"]))
    rows = [row for row in table if row["traffic"] == ANY]
    meters = {f"{name} {h} s": (f"{name.lower()}{{}}_{h}", "{:.2f}") for name in ("ADE", "FDE") for h in (1, 2, 3)}
    for best, title in (("", "most probable mode [m]"), ("_best", "best mode [m]")):
        columns = {text: (name.format(best), form) for text, (name, form) in meters.items()}
        _print_measures(console, rows, title, columns | {"missed": (f"miss_rate{best}", "{:.1%}")}, count="samples_3")
    likelihood = {"1 s": "nll_1", "2 s": "nll_2", "3 s": "nll_3", "mean": "nll", "3 s, median": "nll_median_3"}
    _print_measures(
        console,
        rows,
        "negative log-likelihood [nats]",
        {text: (name, "{:.2f}") for text, name in likelihood.items()},
        count="samples_3",
    )
    kinds = (("", "region"), (" m", "moving"), (" e", "ellipse"))
    inside = {f"{mass} %{mark}": (f"{name}_{mass}_3", "{:.1%}") for mark, name in kinds for mass in (50, 90, 99)}
    title = "positions at 3 s inside regions of highest density, of moving vehicles (m), inside ellipses (e)"
    _print_measures(console, rows, title, inside)
    _print_measures(
        console,
        rows,
        "displacement predicted for 3 s of vehicles that stay, and of all that stand [m]; predicted off the road",
        {
            "stay": ("stays_samples", "{}"),
            "median": ("stays_median", "{:.2f}"),
            "95 %": ("stays_p95", "{:.2f}"),
            "stand": ("stands_samples", "{}"),
            "median ": ("stands_median", "{:.2f}"),
            "95 % ": ("stands_p95", "{:.2f}"),
            "off road": ("off_road", "{:.1%}"),
        },
    )
    _print_by_traffic(console, [row for row in table if row["traffic"] != ANY])
    counts = f"{len(found.samples)} samples from {said_count(len(found.files), 'file')}"
    console.print(f"{counts}, every {found.settings['every']} time steps")
    print_notes(console, found.notes, "evaluation.json")
    print_folder(console, folder)


def _print_measures(
    console: Console,
    rows: Sequence[Mapping[str, Any]],
    title: str,
    columns: Mapping[str, tuple[str, str]],
    count: str = "",
) -> None:
    """Prints a row per category and predictor; `columns` maps headings to the name of a measure and its format."""
    numbers = (*(["samples"] if count else []), *columns)
    table = table_of(("category", "predictor", *numbers), right=numbers, tight=True, title=title)
    before = None
    for row in rows:
        is_first, before = row["category"] != before, row["category"]
        cells = [row["category"] if is_first else "", escape(row["predictor"]), *([str(row[count])] if count else [])]
        cells += ["" if row[name] is None else form.format(row[name]) for name, form in columns.values()]
        table.add_row(*cells, style="bold" if row["category"] in (ALL, MEAN) else "")
    print_table(console, table, 2)
    console.print()


def _print_by_traffic(console: Console, rows: Sequence[Mapping[str, Any]]) -> None:
    """Prints a row per kind of traffic, category and predictor, if the kind of traffic is known."""
    columns = {
        "samples": ("samples_3", "{}"),
        "FDE 1 s": ("fde_1", "{:.2f}"),
        "3 s": ("fde_3", "{:.2f}"),
        "best": ("fde_best_3", "{:.2f}"),
        "missed": ("miss_rate", "{:.1%}"),
        "nll": ("nll_3", "{:.2f}"),
        "nll, median": ("nll_median_3", "{:.2f}"),
        **{f"{mass} % m": (f"moving_{mass}_3", "{:.1%}") for mass in (50, 90, 99)},
    }
    for traffic in TRAFFIC:
        part = [row for row in rows if row["traffic"] == traffic and row["category"] != MEAN]
        if not part:
            continue
        if len({row["category"] for row in part}) == 2:
            part = [row for row in part if row["category"] != ALL]
        title = f"{traffic} traffic: FDE of the most probable and, at 3 s, the best mode [m]; at 3 s nll, regions"
        _print_measures(console, part, title, columns)
