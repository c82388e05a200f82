"""Planners: where does an agent want to be over the next seconds?

A planner is anything with one method, `plan(view, predictions) -> Trajectory`. Native ones are plain records of
settings; all agents that use them are planned in one call of the core.
"""

from __future__ import annotations

from typing import Any

from interdrive.errors import InputError
from interdrive.planners.contract import Planner, Trajectory, write_plan
from interdrive.planners.native import (
    NATIVE,
    Frenet,
    FrenetComfort,
    FrenetWeights,
    PlannerSettings,
    native_planner,
)
from interdrive.plugins import find, made

__all__ = [
    "NATIVE",
    "Frenet",
    "FrenetComfort",
    "FrenetWeights",
    "Planner",
    "PlannerSettings",
    "Trajectory",
    "name_of",
    "native_planner",
    "resolve",
    "write_plan",
]


def resolve(planner: object, settings: PlannerSettings) -> object:
    """A native record or an object with `plan` from a name, `module:object`, record, object or factory.

    Raises:
        InputError: Unknown name (with the nearest valid one), or something that is no planner.
    """
    if isinstance(planner, str):
        if planner in NATIVE:
            return getattr(settings, planner)
        planner = find(planner, tuple(NATIVE), "planner")
    if not isinstance(planner, Frenet):
        planner = made(planner, "plan", "planner")
    if isinstance(planner, Frenet | Planner):
        return planner
    raise InputError(f"{planner!r} is no planner: it has no method plan(view, predictions)")


def name_of(choice: object) -> str:
    """Name of a planner or predictor for tables and for repeating a run."""
    if isinstance(choice, str):
        return choice
    if isinstance(choice, Frenet):
        return "frenet"
    named: Any = choice if isinstance(choice, type) or hasattr(choice, "__qualname__") else type(choice)
    return f"{named.__module__}:{named.__qualname__}"
