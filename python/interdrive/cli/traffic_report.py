"""Printed tables of generated traffic."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from interdrive.cli.report import output, print_folder, print_table, table_of
from interdrive.cli.terminal import say
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from interdrive.run.flows import LaneFlow
    from interdrive.studies.flow import FlowStudy

#: No more lanes than this are shown.
_LANES_MAX = 40
#: Where a capacity lies from the density of the largest flow.
_BEYOND = {"": "", "low": " or less", "high": " or more"}


def print_flows(rows: Sequence[LaneFlow]) -> None:
    """Prints flow, speed and queues by lane; nothing without generated traffic."""
    if not rows:
        return
    console = output()
    numbers = ("lanelet", "due", "vehicles", "flow [1/h]", "speed [m/s]", "wait [s]", "queue")
    table = table_of(("", *numbers), right=numbers, tight=True, title="generated traffic by lane")
    for row in rows[:_LANES_MAX]:
        table.add_row(
            row.side,
            str(row.lane_id),
            "" if row.due < 0 else str(row.due),
            str(row.vehicles),
            f"{row.flow:.0f}",
            "" if math.isnan(row.speed) else f"{row.speed:.1f}",
            "" if math.isnan(row.wait) else f"{row.wait:.1f}",
            "" if row.queue < 0 else str(row.queue),
        )
    print_table(console, table, 2)
    left_out = sum(row.left_out for row in rows if row.side == "in")
    if left_out:
        still = f"{said_count(left_out, 'vehicle')} had still not entered at the end"
        console.print(f"{still}; {'its wait counts' if left_out == 1 else 'their waits count'} until then", style="dim")
    if len(rows) > _LANES_MAX:
        console.print(f"{len(rows) - _LANES_MAX} more lanes: interdrive.run.flows.lane_flows", style="dim")


def print_capacities(study: FlowStudy, folder: Path) -> None:
    """Prints capacity, critical density and jam waves by planner and number of lanes, and the path of the tables."""
    from interdrive.studies.flow import capacities  # noqa: PLC0415 - needs the simulation

    console = output()
    numbers = ("lanes", "free [km/h]", "capacity [1/h]", "at [1/km]", "jam waves [km/h]", "spread [m/s]", "collisions")
    table = table_of(("planner", *numbers), right=numbers, tight=True, title="per lane")
    rows = capacities(study)
    for row in rows:
        table.add_row(
            row.planner,
            str(row.lanes),
            f"{3.6 * row.free_speed:.0f}",
            f"{'at least ' if row.edge else ''}{row.flow:.0f}",
            f"{row.density:.0f}{_BEYOND[row.edge]}",
            "" if math.isnan(row.wave_speed) else f"{row.wave_speed:.1f}",
            "" if math.isnan(row.spread) else f"{row.spread:.1f}",
            str(row.collisions),
        )
    print_table(console, table, 1)
    if any(row.edge for row in rows):
        say("at least: the largest flow is at the lowest or highest density; the capacity lies beyond, widen --density")
    print_folder(console, folder)
