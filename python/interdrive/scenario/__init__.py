"""The input as arrays: roads, recorded traffic, planning problems; limits, inspection, choice of agents."""

from interdrive.scenario.control import SIGNALS, Priorities, Signal, StopLine, TrafficLight, Way
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
)
from interdrive.scenario.shape import Shape

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
    "Priorities",
    "Scenario",
    "Shape",
    "Signal",
    "StopLine",
    "TrafficLight",
    "Way",
]
