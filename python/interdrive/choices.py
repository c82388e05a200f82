"""Who plans for which agent: what the user wrote, as names and settings from which a run can be repeated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.planners import Frenet, PlannerSettings
from interdrive.planners import resolve as resolve_planner
from interdrive.predictors import ConstantVelocity, GroundTruth, LaneFollowing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.run_settings import SimulationSettings


def named(
    settings: SimulationSettings, planner: object, predictor: object
) -> tuple[SimulationSettings, object, object]:
    """Native records become settings and names, so that a run can be repeated from its names and settings."""
    if isinstance(planner, Frenet):
        settings = replace(settings, planner=replace(settings.planner, frenet=planner))
        planner = "frenet"
    if isinstance(predictor, ConstantVelocity):
        settings = replace(settings, predictor=replace(settings.predictor, constant_velocity=predictor))
        predictor = "constant_velocity"
    elif isinstance(predictor, LaneFollowing):
        settings = replace(settings, predictor=replace(settings.predictor, lane_following=predictor))
        predictor = "lane_following"
    elif isinstance(predictor, GroundTruth):
        predictor = "ground_truth"
    return settings, planner, predictor


def per_agent(planner: object, ids: list[int], settings: PlannerSettings) -> dict[int, object]:
    """The planner of every agent, checked."""
    if not isinstance(planner, dict):
        resolve_planner(planner, settings)
        return dict.fromkeys(ids, planner)
    choice: Mapping[object, object] = planner
    unknown = [key for key in choice if key != "default" and key not in ids]
    if unknown:
        raise InputError(f"agent {unknown[0]}: a planner is given for it, but it is not an agent")
    for value in choice.values():
        resolve_planner(value, settings)
    return {i: choice.get(i, choice.get("default", "frenet")) for i in ids}
