"""The tables of the runtime study as Markdown, for documents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.studies.runtime.summary import growth, summary_table
from interdrive.studies.runtime.targets import measured_targets, target_rows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.studies.runtime.measure import RuntimeStudy


#: Up to this load per core times are those of a quiet machine.
QUIET = 0.3
#: Parts of a step that tables show.
STEP_PARTS = ("predict", "plan", "collision", "update")


def targets_markdown(found: Mapping[str, float]) -> str:
    """Targets next to what was measured."""
    return _table(("what", "target", "measured", ""), "lrrl", target_rows(found))


def steps_markdown(study: RuntimeStudy) -> str:
    """Milliseconds per step of every scenario and number of agents."""
    several = study.threads
    header = (
        *("scenario", "agents", "1 thread", f"{several} threads", "ratio"),
        *STEP_PARTS,
        "Python",
    )
    return _table(header, "l" + (len(header) - 1) * "r", step_rows(study))


def step_rows(study: RuntimeStudy) -> list[tuple[str, ...]]:
    """A row per scenario and number of agents: medians (quartiles) and, with all threads, medians of the parts [ms]."""
    found: dict[tuple[Any, ...], dict[int, dict[str, Any]]] = {}
    for row in summary_table(study).to_pylist():
        found.setdefault((row["kind"], row["predictor"], row["agents"]), {})[row["threads"]] = row
    rows = []
    for (kind, predictor, agents), by_threads in found.items():
        name = kind if predictor == "lane_following" else f"{kind}, {predictor}"
        several = by_threads.get(study.threads)
        if several is None:
            continue
        alone = by_threads.get(1)
        parts = [f"{1e3 * several[part]:.2f}" for part in STEP_PARTS]
        ratio = f"{alone['median'] / several['median']:.2f}" if alone is not None else "–"
        share = f"{100 * several['python'] / several['median']:.1f} %"
        rows.append((name, str(agents), _spread(alone), _spread(several), ratio, *parts, share))
    return rows


def _spread(row: dict[str, Any] | None) -> str:
    if row is None:
        return "–"
    lower, median, upper = (f"{1e3 * row[name]:.3g}" for name in ("lower", "median", "upper"))
    return f"{median} ({lower}–{upper})"


def growth_markdown(study: RuntimeStudy) -> str:
    """How the time of a step grows in the town."""
    rows = []
    for threads in sorted({1, study.threads}):
        found = growth(study, threads)
        if found is None:
            continue
        per_agent = ", ".join(f"{1e6 * s / n:.0f} at {n}" for n, s in zip(found.agents, found.seconds, strict=True))
        rows.append((str(threads), per_agent, f"{found.exponent:.3f}", f"{found.to_linear:.2f}"))
    return _table(("threads", "µs per agent and step", "exponent", "growth to linear"), "rlrr", rows)


def document(study: RuntimeStudy) -> str:
    """All of it."""
    what = study.machine
    settings = study.settings
    where = f"{what['processor']}, {what['cores']} cores, {what['system']}, Python {what['python']}"
    busy = what["load"] > QUIET * what["cores"]
    parts = [
        f"{where}; up to {settings['steps']} steps per run, {settings['repetitions']} runs of each kind.",
        *([f"**The machine was busy** (load {what['load']:.1f} before): all times are too long."] if busy else []),
        targets_markdown(measured_targets(study)),
        "Milliseconds per step, median (quartiles); parts with all threads:",
        steps_markdown(study),
    ]
    if growth(study, study.threads) is not None:
        parts.append(growth_markdown(study))
    parts += [f"- {note}" for note in study.notes]
    return "\n\n".join(parts) + "\n"


def _table(header: Sequence[str], sides: str, rows: Sequence[Sequence[str]]) -> str:
    rule = "|".join("--:" if side == "r" else "---" for side in sides)
    lines = [" | ".join(cells) for cells in (header, *rows)]
    return "\n".join([f"| {lines[0]} |", f"|{rule}|", *(f"| {line} |" for line in lines[1:])])
