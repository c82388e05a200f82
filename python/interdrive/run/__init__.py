"""Results of a simulation as arrays, and their assembly."""

from interdrive.run.record import (
    OUTCOMES,
    PHASES,
    PLAN_STATUS,
    VIOLATIONS,
    AgentRecord,
    Json,
    Outcomes,
    Plans,
    RecordedCandidates,
    RecordedPredictions,
    RunRecord,
    RunSettings,
    States,
    Timings,
    Views,
    Violations,
)

__all__ = [
    "OUTCOMES",
    "PHASES",
    "PLAN_STATUS",
    "VIOLATIONS",
    "AgentRecord",
    "Json",
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
