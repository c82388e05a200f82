"""The tables of a run folder and their columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.criticality import AgentHarm
from interdrive.run.arrays import (
    Agreements,
    Messages,
    Orders,
    Outcomes,
    Plans,
    RecordedCandidates,
    RecordedPredictions,
    States,
    Timings,
    Views,
    Violations,
)
from interdrive.storage import Column, inserted

if TYPE_CHECKING:
    from collections.abc import Mapping

#: Columns of every table. A "label" is a text from a short list and stored as such (dictionary encoded).
COLUMNS: Mapping[str, tuple[Column, ...]] = {
    "outcomes": inserted(Outcomes.columns, AgentHarm.columns, before="message"),
    "states": States.columns,
    "plans": Plans.columns,
    "views": Views.columns,
    "predictions": RecordedPredictions.columns,
    "candidates": RecordedCandidates.columns,
    "violations": Violations.columns,
    "orders": Orders.columns,
    "messages": Messages.columns,
    "agreements": Agreements.columns,
    "routes": (
        Column("agent_id", "integer", "agent that follows the path"),
        Column("point", "integer", "number of the point"),
        Column("x", "number", "of the point", "m"),
        Column("y", "number", "of the point", "m"),
    ),
    "timing": Timings.columns,
}


#: Tables that a run has only if its settings request them; run.json states under their names whether it does.
ON_DEMAND = ("views", "predictions", "candidates", "violations", "orders", "messages", "agreements")
