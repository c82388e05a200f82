"""Generated traffic by lane for the page of a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, cast

from interdrive.run.flow_profiles import flow_profiles, window_edges
from interdrive.run.flows import lane_flows

if TYPE_CHECKING:
    from interdrive.report.contract import Flows, LaneTraffic
    from interdrive.run import RunRecord
    from interdrive.run.flow_profiles import FlowProfile
    from interdrive.run.flows import LaneFlow


def flows_of(run: RunRecord) -> Flows | None:
    """Flow, speed and queue of every lane; None without generated traffic."""
    rows = lane_flows(run)
    if not rows:
        return None
    edges = window_edges(run)
    profiles = flow_profiles(run, rows, edges)
    lanes = [_lane(row, profile) for row, profile in zip(rows, profiles, strict=True)]
    return {"edges": [round(edge, 3) for edge in edges.tolist()], "lanes": lanes}


def _lane(row: LaneFlow, profile: FlowProfile) -> LaneTraffic:
    return {
        "lane": row.lane_id,
        "side": cast("Literal['in', 'out']", row.side),
        "due": None if row.due < 0 else row.due,
        "vehicles": row.vehicles,
        "flow": round(float(row.flow), 1),
        "speed": _rounded(row.speed),
        "wait": _rounded(row.wait),
        "queue": None if row.queue < 0 else row.queue,
        "flows": [round(value, 1) for value in profile.flow.tolist()],
        "speeds": [_rounded(value) for value in profile.speed.tolist()],
        "queues": [None if math.isnan(value) else round(value) for value in profile.queue.tolist()],
    }


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 2)
