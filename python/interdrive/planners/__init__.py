"""Planners: where does an agent want to be over the next seconds?

A planner is anything with one method, `plan(view, predictions) -> Trajectory`. Native ones are plain records of
settings; all agents that use them are planned in one call of the core.
"""

from __future__ import annotations

from interdrive.planners.contract import Planner, Trajectory
from interdrive.planners.native import (
    NATIVE,
    RECORDS,
    Frenet,
    FrenetComfort,
    FrenetWeights,
    Idm,
    IdmMobil,
    PlannerSettings,
    Recorded,
    VelocityAdjusting,
    native_name,
    native_planner,
    native_record,
)

__all__ = [
    "NATIVE",
    "RECORDS",
    "Frenet",
    "FrenetComfort",
    "FrenetWeights",
    "Idm",
    "IdmMobil",
    "Planner",
    "PlannerSettings",
    "Recorded",
    "Trajectory",
    "VelocityAdjusting",
    "native_name",
    "native_planner",
    "native_record",
]
