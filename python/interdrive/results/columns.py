"""The tables of a run folder and their columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.criticality import AgentHarm
from interdrive.run import arrays
from interdrive.storage import Column, inserted

if TYPE_CHECKING:
    from collections.abc import Mapping

#: Columns of every table. A "label" is a text from a short list and stored as such (dictionary encoded).
COLUMNS: Mapping[str, tuple[Column, ...]] = {
    "outcomes": inserted(arrays.Outcomes.columns, AgentHarm.columns, before="message"),
    "states": arrays.States.columns,
    "plans": arrays.Plans.columns,
    "views": arrays.Views.columns,
    "predictions": arrays.RecordedPredictions.columns,
    "candidates": arrays.RecordedCandidates.columns,
    "violations": arrays.Violations.columns,
    "orders": arrays.Orders.columns,
    "messages": arrays.Messages.columns,
    "agreements": arrays.Agreements.columns,
    "hits": arrays.Hits.columns,
    "profile": arrays.Profile.columns,
    "demand": arrays.Demand.columns,
    "sumo": arrays.SumoParticipants.columns,
    "routes": (
        Column("agent_id", "integer", "agent that follows the path"),
        Column("point", "integer", "number of the point"),
        Column("x", "number", "of the point", "m"),
        Column("y", "number", "of the point", "m"),
    ),
    "timing": arrays.Timings.columns,
}


#: Tables that a run has only if its settings request them; run.json states under their names whether it does.
ON_DEMAND = (
    "views",
    "predictions",
    "candidates",
    "violations",
    "orders",
    "messages",
    "agreements",
    "hits",
    "profile",
    "demand",
    "sumo",
)
