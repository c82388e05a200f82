"""A picture of the agents that lose most time: each where it falls behind its recording fastest.

    python benchmarks/driving --csv agents.csv
    python benchmarks/driving/worst.py agents.csv worst.png --folder ../shared/scenarios

At most two agents per scenario are drawn, of different queues, at the step after which their delay grows most within
three seconds. They are orange, their own recording at that step dashed; other agents are blue, replayed vehicles grey.
"""

from __future__ import annotations

import argparse
import csv
import os
from pathlib import Path
from typing import Any

import numpy as np
from causes import Delay
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from interdrive.plots.road import draw_scale, map_axes
from interdrive.plots.still import save_figure
from interdrive.plots.style import HALO, INK, MM, RECORDED_EDGE, STATIC, TRAFFIC, empty_figure
from interdrive.plots.vehicles import Footprints, placed
from interdrive.plots.view import View
from interdrive.simulation import Simulation

#: Time within which the delay grows most [s].
SPAN = 3.0
#: Side of a panel on paper [mm] and in the world [m], and of its caption [mm].
PANEL, SIDE, CAPTION = 36.0, 44.0, 8.0
COLUMNS = 5
AGENT, OTHER = "#d55e00", "#0072b2"


def chosen(rows: list[dict[str, str]], count: int) -> list[dict[str, str]]:
    """Reachable agents that are not in time, by time lost: one per head of a queue, at most two per scenario."""
    late = [row for row in rows if row["reachable"] == "True" and row["outcome"] != "goal_reached"]
    late.sort(key=lambda row: (-float(row["lost"]), row["scenario"], int(row["agent_id"])))
    found: dict[str, dict[str, dict[str, str]]] = {}
    for row in late:
        heads = found.setdefault(row["scenario"], {})
        if len(heads) < 2:
            heads.setdefault(row["head_id"], row)
    all_found = [row for heads in found.values() for row in heads.values()]
    return sorted(all_found, key=late.index)[:count]


def draw(figure: Figure, place: tuple[float, float, float, float], path: Path, row: dict[str, str]) -> None:
    """One panel: left, bottom, width and height are parts of the figure."""
    number = int(row["agent_id"])
    simulation = Simulation(path, threads=1)
    run = simulation.run()
    i = next(i for i, agent in enumerate(run.agents) if agent.id == number)
    states, obstacles, dt = run.states, run.scenario.obstacles, run.scenario.dt
    own = int(np.searchsorted(states.participant_id, number))
    delay, there = Delay.of(run, i, simulation.agents[i].route), np.flatnonzero(states.valid[own])
    span = round(SPAN / dt)
    column = int(max(there, key=lambda step: delay.growth(states.first_time_step + int(step), span)))
    view = View(0.0, (float(states.x[own, column]), float(states.y[own, column])), SIDE, SIDE)
    axes = map_axes(figure, place, run.scenario.lanelets, view)
    footprints = Footprints(run)
    for other in np.flatnonzero(states.valid[:, column]).tolist():
        traffic = STATIC if states.is_static[other] else OTHER if states.is_agent[other] else TRAFFIC
        color = AGENT if other == own else traffic
        lines = footprints.outlines(other, column, view)
        style: dict[str, Any] = {
            "facecolors": color,
            "edgecolors": INK if other == own else RECORDED_EDGE,
            "linewidths": 0.4,
        }
        axes.add_collection(PolyCollection(lines, zorder=4, **style), autolim=False)
        if not states.is_static[other]:
            mark = [footprints.heading_mark(other, column, view)]
            axes.add_collection(PolyCollection(mark, facecolors="white", zorder=4), autolim=False)
    recorded = np.flatnonzero(obstacles.ids == number)
    step = states.first_time_step + column
    if len(recorded) and 0 <= step < obstacles.x.shape[1] and np.isfinite(obstacles.x[recorded[0], step]):
        half = 0.5 * np.array([states.length[own], states.width[own]])
        corners = half * np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)])
        pose = [values[recorded[0], step] for values in (obstacles.x, obstacles.y, obstacles.orientation)]
        line = [view.picture_from_world(placed(corners, *pose))]
        dashed: dict[str, Any] = {"linestyles": [(0, (2, 1))], "linewidths": 0.8, "edgecolors": AGENT}
        axes.add_collection(PolyCollection(line, facecolors="none", zorder=5, **dashed), autolim=False)
    time, speed = (states.first_time_step + column) * dt, states.velocity[own, column]
    name = f"{row['scenario'].removesuffix('_T-1')} {number}"
    caption = f"{name}\n{time:.1f} s, {speed:.1f} m/s: {row['cause'] or 'none found'}"
    axes.set_title(caption, fontsize=5.0, color=INK, loc="left", pad=2.0, path_effects=HALO)
    draw_scale(axes, view, SIDE / PANEL, 6.0)


def main() -> None:
    """Reads the rows, drives their scenarios again, and writes the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", type=Path, metavar="CSV")
    parser.add_argument("picture", type=Path, metavar="PNG")
    parser.add_argument(
        "--folder", type=Path, default=Path(os.environ.get("INTERDRIVE_SCENARIOS", "../shared/scenarios"))
    )
    parser.add_argument("--count", type=int, default=10)
    arguments = parser.parse_args()
    with arguments.rows.open(newline="") as file:
        rows = chosen(list(csv.DictReader(file)), arguments.count)
    n_rows = -(-len(rows) // COLUMNS)
    width, height = COLUMNS * (PANEL + 1.0), n_rows * (PANEL + CAPTION)
    figure = empty_figure(width * MM, height * MM)
    for k, row in enumerate(rows):
        left, top = (k % COLUMNS) * (PANEL + 1.0) + 0.5, (k // COLUMNS) * (PANEL + CAPTION)
        place = (left / width, (height - top - CAPTION - PANEL + 1.0) / height, PANEL / width, PANEL / height)
        path = arguments.folder / row["category"] / f"{row['scenario']}.xml"
        draw(figure, place, path, row)
        print(f"{row['scenario']} {row['agent_id']}: {row['lost']} s lost, {row['cause']} ({row['head_id']})")
    save_figure(figure, arguments.picture)


if __name__ == "__main__":
    main()
