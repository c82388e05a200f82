"""What a fundamental diagram says of a planner: capacity, critical density, speed of jam waves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.studies.flow.measure import FlowStudy


@dataclass(frozen=True)
class Capacity:
    """The largest flow of a planner on a number of lanes, and what lies beside it.

    Attributes:
        planner: Its name.
        lanes: Number of lanes.
        free_speed: Mean speed at the least density [m/s].
        flow: Largest flow [1/h], per lane.
        density: At which it is [1/km].
        edge: "low" or "high" if that is the lowest or highest density of the study: the capacity is at least the flow,
            and lies beyond; "" if it lies between.
        wave_speed: Slope of the flow over the densities above that [km/h], speed of jam waves; nan for fewer than 2.
        spread: Largest standard deviation of speeds above that density [m/s]: stop-and-go waves; nan without any.
        collisions: Vehicles that collided, in all runs.
    """

    planner: str
    lanes: int
    free_speed: float
    flow: float
    density: float
    edge: str
    wave_speed: float
    spread: float
    collisions: int


def capacities(study: FlowStudy) -> tuple[Capacity, ...]:
    """One row per planner and number of lanes, in the order of the study."""
    rows = study.table.to_pylist()
    found = []
    for planner, lanes in dict.fromkeys((row["planner"], row["lanes"]) for row in rows):
        own = sorted(
            (row for row in rows if (row["planner"], row["lanes"]) == (planner, lanes)), key=lambda row: row["density"]
        )
        best = max(own, key=lambda row: row["flow"])
        jammed = own[own.index(best) + 1 :]
        slope = float("nan")
        if len(jammed) > 1:
            slope = float(np.polyfit([row["density"] for row in jammed], [row["flow"] for row in jammed], 1)[0])
        found.append(
            Capacity(
                planner=planner,
                lanes=lanes,
                free_speed=own[0]["speed"],
                flow=best["flow"],
                density=best["density"],
                edge="high" if best is own[-1] else "low" if best is own[0] else "",
                wave_speed=slope,
                spread=max((row["spread"] for row in jammed), default=float("nan")),
                collisions=sum(row["collisions"] for row in own),
            )
        )
    return tuple(found)
