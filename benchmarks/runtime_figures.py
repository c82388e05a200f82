"""The figures of the runtime study, for docs/research/performance.md."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.plots.style import AGENTS, FONT, INK, MM, PAGE, empty_figure, plain
from interdrive.studies.runtime import growth, summary_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.studies.runtime import RuntimeStudy

_PANEL = 52.0 * MM
#: Duration of a step in real time [ms].
_REAL_TIME = 100.0


def runtime_figure(study: RuntimeStudy) -> Figure:
    """Time per step over the number of agents, 180 mm wide, one panel per scenario.

    Medians with quartiles, with one thread and with several; dashed the time of planning alone, which is that of the
    slowest batch, since every thread plans for a batch of the agents; the line of real time.
    """
    rows = summary_table(study).to_pylist()
    predictor = {row["scenario"]: row["predictor"] for row in reversed(rows)}
    # Of a scenario that was driven with several predictors, the first one is drawn.
    rows = [row for row in rows if row["predictor"] == predictor[row["scenario"]]]
    scenarios = list(dict.fromkeys((row["kind"], row["scenario"]) for row in rows))
    across = min(3, len(scenarios)) or 1
    down = -(-len(scenarios) // across) or 1
    figure = empty_figure(PAGE, down * _PANEL + 6.0 * MM, layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, (kind, scenario) in zip(panels, scenarios, strict=False):
        _draw_scenario(panel, [row for row in rows if row["scenario"] == scenario], study.threads)
        panel.set_title(kind if kind == scenario else f"{kind}\n{scenario}", fontsize=FONT)
    for place, panel in enumerate(panels):
        panel.set_visible(place < len(scenarios))
        if place % across == 0:
            panel.set_ylabel("time per step [ms]", fontsize=FONT)
        if place >= len(scenarios) - across:
            panel.set_xlabel("agents", fontsize=FONT)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=FONT, frameon=False)
    return figure


def _draw_scenario(panel: Axes, rows: list[dict[str, Any]], several: int) -> None:
    for threads, colour in zip(sorted({1, several}), AGENTS, strict=False):
        own = sorted((row for row in rows if row["threads"] == threads), key=lambda row: row["agents"])
        if not own:
            continue
        agents = np.array([row["agents"] for row in own])
        lower, median, upper, plan = (
            1e3 * np.array([row[name] for row in own]) for name in ("lower", "median", "upper", "plan")
        )
        name = f"{threads} thread{'s' * (threads > 1)}"
        panel.fill_between(agents, lower, upper, color=colour, alpha=0.2, linewidth=0)
        panel.plot(agents, median, "o-", color=colour, linewidth=1.0, markersize=2.2, label=f"step, {name}")
        panel.plot(agents, plan, "--", color=colour, linewidth=0.8, label=f"planning per batch, {name}")
    panel.axhline(_REAL_TIME, color=INK, linewidth=0.8, linestyle=":", label="real time")
    panel.set_xscale("log", base=2)
    panel.set_yscale("log")
    shown = sorted({row["agents"] for row in rows})
    panel.set_xticks(shown, [str(n) for n in shown])
    panel.minorticks_off()
    plain(panel)


def growth_figure(study: RuntimeStudy) -> Figure | None:
    """Time per step over the number of agents at constant density, with the fitted power; None without a town."""
    grown = {threads: growth(study, threads) for threads in sorted({1, study.threads})}
    if not any(grown.values()):
        return None
    figure = empty_figure(0.5 * PAGE, _PANEL + 10.0 * MM, layout="constrained")
    panel = figure.subplots()
    ticks: set[int] = set()
    for (threads, found), colour in zip(grown.items(), AGENTS, strict=False):
        if found is None:
            continue
        agents = np.array(found.agents, dtype=np.float64)
        ticks.update(found.agents)
        panel.plot(agents, 1e3 * np.array(found.seconds), "o", color=colour, markersize=3.0)
        label = f"{threads} thread{'s' * (threads > 1)}: agents$^{{{found.exponent:.2f}}}$"
        panel.plot(agents, 1e3 * found.factor * agents**found.exponent, color=colour, linewidth=1.0, label=label)
    panel.axhline(_REAL_TIME, color=INK, linewidth=0.8, linestyle=":", label="real time")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xticks(sorted(ticks), [str(n) for n in sorted(ticks)])
    panel.minorticks_off()
    panel.set_xlabel("agents", fontsize=FONT)
    panel.set_ylabel("time per step [ms]", fontsize=FONT)
    panel.legend(fontsize=FONT, frameon=False)
    plain(panel)
    return figure
