"""The input as arrays: roads, recorded traffic, planning problems; limits, inspection, choice of agents."""

from interdrive.scenario.control import SIGNALS, Signal, StopLine, TrafficLight
from interdrive.scenario.model import (
    KINDS,
    STATE_FIELDS,
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
    "SIGNALS",
    "STATE_FIELDS",
    "GoalState",
    "Incoming",
    "InitialState",
    "Lanelets",
    "Obstacles",
    "PlanningProblem",
    "Scenario",
    "Shape",
    "Signal",
    "StopLine",
    "TrafficLight",
]
