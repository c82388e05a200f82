"""The input as arrays: roads, recorded traffic, planning problems; limits, inspection, choice of agents."""

from interdrive.scenario.control import SIGNALS, Priorities, Signal, StopLine, TrafficLight, Turn
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
    ScenarioSource,
)
from interdrive.scenario.shape import Shape
from interdrive.scenario.source_options import OptionValue, SourceOptions
from interdrive.scenario.sumo import SumoTraffic

__all__ = [
    "KINDS",
    "SIGNALS",
    "STATE_FIELDS",
    "GoalState",
    "Incoming",
    "InitialState",
    "Lanelets",
    "Obstacles",
    "OptionValue",
    "PlanningProblem",
    "Priorities",
    "Scenario",
    "ScenarioSource",
    "Shape",
    "Signal",
    "SourceOptions",
    "StopLine",
    "SumoTraffic",
    "TrafficLight",
    "Turn",
]


def __getattr__(name: str) -> object:
    """Tells the new name of what has been renamed."""
    if name == "Way":
        raise ImportError("interdrive.scenario.Way is now called interdrive.scenario.Turn", name=name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
