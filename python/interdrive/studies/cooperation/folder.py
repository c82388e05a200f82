"""The folder of a study of cooperation: its runs as a table, their summary, figure and page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.plots import save_figure
from interdrive.storage import check_folder, replacing, write_json, write_table
from interdrive.studies.cooperation.figure import cooperation_figure
from interdrive.studies.cooperation.summary import summary_table

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.studies.cooperation.measure import CooperationStudy

_MARK = "cooperation.json"
_PAGE = "cooperation.md"
_TABLES = tuple(f"{name}.{ending}" for name in ("table", "summary") for ending in ("parquet", "csv"))
_FIGURES = tuple(f"cooperation.{ending}" for ending in ("pdf", "png"))


def check_cooperation_target(folder: str | Path, *, overwrite: bool = False) -> Path:
    """The folder a study of cooperation can be saved to, as an absolute path; useful before it runs.

    Raises:
        ResultsError: if something is there that must not be replaced.
    """
    files = (*_TABLES, *_FIGURES, _MARK, _PAGE)
    return check_folder(folder, "study of cooperation", _MARK, lambda entry: entry.name in files, overwrite=overwrite)


def save_cooperation(study: CooperationStudy, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the folder of a study of cooperation, whole or not at all, and returns its path.

    It holds table and summary as Parquet and CSV, the figure cooperation as PDF and PNG, the page cooperation.md with
    the summary, and cooperation.json (planner, predictor, settings).

    Raises:
        ResultsError: if the folder cannot be used or written; one line with path and cause.
    """
    target = check_cooperation_target(folder, overwrite=overwrite)
    summary = summary_table(study)
    with replacing(target) as partial:
        partial.mkdir()
        for name, table in (("table", study.table), ("summary", summary)):
            for ending in ("parquet", "csv"):
                write_table(table, partial / f"{name}.{ending}")
        for name in _FIGURES:
            save_figure(cooperation_figure(study), partial / name)
        (partial / _PAGE).write_text(page(summary.to_pylist()), encoding="utf-8")
        write_json(
            {
                "planner": study.planner,
                "predictor": study.predictor,
                "settings": dict(study.settings),
                "notes": list(study.notes),
            },
            partial / _MARK,
        )
    return target


def page(rows: list[dict[str, Any]]) -> str:
    """The summary as Markdown tables: without occlusion, then with it."""
    hidden = [row for row in rows if row["occlusion"]]
    text = _table([row for row in rows if not row["occlusion"]], ("negotiation", "delay [s]", "loss"))
    return text + ("\nWith occlusion:\n\n" + _table(hidden, ("services",)) if hidden else "")


def _table(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> str:
    measures = ("in time", "change [points]", "time lost [s]", "collisions", "min. TTC [s]", "deadlocks")
    lines = [
        f"| equipped | {' | '.join((*columns, *measures))} |",
        "|---|" + "---|" * len(columns) + "--:|" * len(measures),
    ]
    for row in rows:
        ttc = "-" if row["min_ttc"] is None else f"{row['min_ttc']:.2f}"
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
            f" {'' if is_base else lost} | {round(row['collisions'], 2):g} | {ttc} | {round(row['deadlocks'], 2):g} |"
        )
    return "\n".join(lines) + "\n"
