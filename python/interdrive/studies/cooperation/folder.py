"""The folder of a study of cooperation: its runs as a table, their summary, figure and page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.config.binding import flatten
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import SimulationSettings
from interdrive.plots import save_figure
from interdrive.results import software
from interdrive.storage import FolderKind, Origin, resolved, whole_folder, write_json, write_table
from interdrive.studies.cooperation.figure import cooperation_figure
from interdrive.studies.cooperation.summary import summary_table

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.studies.cooperation.measure import CooperationStudy

_MARK = "cooperation.json"
_PAGE = "cooperation.md"
_TABLES = tuple(f"{name}.{ending}" for name in ("table", "summary") for ending in ("parquet", "csv"))
_FIGURES = tuple(f"cooperation.{ending}" for ending in ("pdf", "png"))
_FILES = (*_TABLES, *_FIGURES, _MARK, _PAGE)

COOPERATION_FOLDER = FolderKind("study of cooperation", _MARK, lambda entry: entry.name in _FILES)


def save_cooperation(study: CooperationStudy, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the folder of a study of cooperation, whole or not at all, and returns its path.

    It holds table and summary as Parquet and CSV, the figure cooperation as PDF and PNG, the page cooperation.md with
    the summary, and cooperation.json (planner, predictor, settings).

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    summary, origin = summary_table(study), _origin(study)
    told = "".join(f"\n{line}\n" for line in origin.lines)
    with whole_folder(folder, COOPERATION_FOLDER, overwrite=overwrite) as partial:
        for name, table in (("table", study.table), ("summary", summary)):
            for ending in ("parquet", "csv"):
                write_table(table, partial / f"{name}.{ending}", origin)
        for name in _FIGURES:
            save_figure(cooperation_figure(study), partial / name)
        (partial / _PAGE).write_text(page(summary.to_pylist()) + told, encoding="utf-8")
        write_json(
            {
                "planner": study.planner,
                "predictor": study.predictor,
                "settings": dict(study.settings),
                "notes": list(study.notes),
                "inputs": dict(study.inputs),
                **software(),
            },
            partial / _MARK,
        )
    return resolved(folder)


def _origin(study: CooperationStudy) -> Origin:
    usual = flatten(SimulationSettings())
    settings = {name: value for name, value in study.settings.items() if value != usual.get(name)}
    chosen = {"planner": (study.planner, DEFAULT_PLANNER), "predictor": (study.predictor, "neural")}
    settings |= {name: value for name, (value, default) in chosen.items() if value != default}
    return Origin(settings, study.inputs)


def page(rows: list[dict[str, Any]]) -> str:
    """The summary as Markdown tables: without occlusion, then with it."""
    hidden = [row for row in rows if row["occlusion"]]
    text = _table([row for row in rows if not row["occlusion"]], ("negotiation", "delay [s]", "loss"))
    return text + ("\nWith occlusion:\n\n" + _table(hidden, ("services",)) if hidden else "")


def _table(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> str:
    measures = ("in time", "change [points]", "time lost [s]", "collisions", "TTC < 1.5 s", "deadlocks")
    lines = [
        f"| equipped | {' | '.join((*columns, *measures))} |",
        "|---|" + "---|" * len(columns) + "--:|" * len(measures),
    ]
    for row in rows:
        change = (
            f"{100 * row['reached_change']:+.1f} ({100 * row['reached_low']:+.1f}..{100 * row['reached_high']:+.1f})"
        )
        lost = f"{row['time_lost']:+.2f} ({row['time_low']:+.2f}..{row['time_high']:+.2f})"
        is_base = row["penetration"] == 0
        of = {
            "negotiation": "yes" if row["negotiate"] else "no",
            "delay [s]": f"{row['delay']:g}",
            "loss": f"{100 * row['loss']:.0f} %",
            "services": row["services"].replace("+", ", ").upper(),
        }
        lines.append(
            f"| {100 * row['penetration']:.0f} % | {' | '.join(of[name] for name in columns)} |"
            f" {100 * row['reached']:.1f} % | {'' if is_base else change} |"
            f" {'' if is_base else lost} | {round(row['collisions'], 2):g} |"
            f" {100 * row['ttc_share']:.2f} % | {round(row['deadlocks'], 2):g} |"
        )
    return "\n".join(lines) + "\n"
