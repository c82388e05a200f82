"""What a simulation leaves behind, as arrays, and how they come about."""

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
