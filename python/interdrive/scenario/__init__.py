"""The input as arrays: roads, recorded traffic, planning problems; its limits, what it holds, who can be an agent."""

from interdrive.scenario.model import (
    KINDS,
    GoalState,
    Incoming,
    InitialState,
    Lanelets,
    Obstacles,
    PlanningProblem,
    Scenario,
    Shape,
)

__all__ = [
    "KINDS",
    "GoalState",
    "Incoming",
    "InitialState",
    "Lanelets",
    "Obstacles",
    "PlanningProblem",
    "Scenario",
    "Shape",
]
