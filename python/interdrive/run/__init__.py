"""Results of a simulation as arrays, and their assembly."""

from interdrive.run.arrays import (
    ORDERS,
    OUTCOMES,
    PHASES,
    PLAN_STATUS,
    SERVICES,
    VIA,
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
from interdrive.run.record import AgentRecord, Json, RunRecord, RunSettings
from interdrive.run.rules import RULES, VIOLATIONS

__all__ = [
    "ORDERS",
    "OUTCOMES",
    "PHASES",
    "PLAN_STATUS",
    "RULES",
    "SERVICES",
    "VIA",
    "VIOLATIONS",
    "AgentRecord",
    "Agreements",
    "Json",
    "Messages",
    "Orders",
    "Outcomes",
    "Plans",
    "RecordedCandidates",
    "RecordedPredictions",
    "RunRecord",
    "RunSettings",
    "States",
    "Timings",
    "Views",
    "Violations",
]
