"""The fundamental diagram. Loads matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.plots.style import AGENTS, FONT, MM, PAGE, empty_figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from interdrive.studies.flow.measure import FlowStudy

_HEIGHT = 70.0 * MM
#: Capacities of motorways [1/h], per lane: Treiber, Kesting, "Traffic Flow Dynamics", 2013.
MEASURED = (1700.0, 2450.0)


def flow_figure(study: FlowStudy) -> Figure:
    """Flow and speed over density, 180 mm wide: a colour per planner, dashed on two lanes and more.

    The grey band has the capacities that are measured on motorways.
    """
    rows: list[dict[str, Any]] = study.table.to_pylist()
    figure = empty_figure(PAGE, _HEIGHT, layout="constrained")
    flow, speed = figure.subplots(1, 2, sharex=True)
    flow.axhspan(*MEASURED, color="0.9", linewidth=0)
    for planner, lanes in dict.fromkeys((row["planner"], row["lanes"]) for row in rows):
        own = sorted(
            (row for row in rows if (row["planner"], row["lanes"]) == (planner, lanes)), key=lambda row: row["density"]
        )
        colour = AGENTS[study.planners.index(planner) % len(AGENTS)]
        look = {"color": colour, "linewidth": 1.0, "markersize": 2.5, "linestyle": "-" if lanes == 1 else "--"}
        density = [row["density"] for row in own]
        name = f"{planner}, {lanes} lane{'s' * (lanes > 1)}"
        flow.plot(density, [row["flow"] for row in own], marker="o", label=name, **look)
        speed.plot(density, [3.6 * row["speed"] for row in own], marker="o", **look)
    for panel, label in ((flow, "flow [1/h per lane]"), (speed, "mean speed [km/h]")):
        panel.set_xlabel("density [1/km per lane]", fontsize=FONT)
        panel.set_ylabel(label, fontsize=FONT)
        panel.set_xlim(left=0.0)
        panel.set_ylim(bottom=0.0)
        plain(panel)
    handles, labels = flow.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=FONT, frameon=False)
    return figure
