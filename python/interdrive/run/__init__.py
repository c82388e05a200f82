"""Results of a simulation as arrays, and their assembly."""

from interdrive.run.record import (
    OUTCOMES,
    PHASES,
    PLAN_STATUS,
    AgentRecord,
    Considered,
    Outcomes,
    Plans,
    Predicted,
    Run,
    States,
    Timings,
    Views,
)

__all__ = [
    "OUTCOMES",
    "PHASES",
    "PLAN_STATUS",
    "AgentRecord",
    "Considered",
    "Outcomes",
    "Plans",
    "Predicted",
    "Run",
    "States",
    "Timings",
    "Views",
]
