"""Planners, which compute the trajectory of an agent over the next seconds.

A planner is any object with a method `plan(view, predictions) -> Trajectory`. Native planners are plain records of
settings; the core plans for all their agents in one call.
"""

from __future__ import annotations

from interdrive.native_settings import (
    R157,
    Cc,
    Comfort,
    Frenet,
    FrenetComfort,
    FrenetWeights,
    Fsm,
    Idm,
    IdmMobil,
    Lawful,
    Pdm,
    Rollout,
    RolloutWeights,
    Rss,
    VelocityAdjusting,
)
from interdrive.planners.contract import Planner, Trajectory
from interdrive.planners.native import (
    NATIVE,
    RECORDED_PATH,
    RECORDS,
    NativePlanner,
    PlannerSettings,
    Recorded,
    native_planner,
)

__all__ = [
    "NATIVE",
    "R157",
    "RECORDED_PATH",
    "RECORDS",
    "Cc",
    "Comfort",
    "Frenet",
    "FrenetComfort",
    "FrenetWeights",
    "Fsm",
    "Idm",
    "IdmMobil",
    "Lawful",
    "NativePlanner",
    "Pdm",
    "Planner",
    "PlannerSettings",
    "Recorded",
    "Rollout",
    "RolloutWeights",
    "Rss",
    "Trajectory",
    "VelocityAdjusting",
    "native_planner",
]
