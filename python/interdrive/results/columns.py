"""The tables of a run folder and their columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interdrive.run import RULES
from interdrive.storage.tables import Column

if TYPE_CHECKING:
    from collections.abc import Mapping


#: Columns of every table. A "label" is a text from a short list and stored as such (dictionary encoded).
COLUMNS: Mapping[str, tuple[Column, ...]] = {
    "outcomes": (
        Column("agent_id", "integer", "participant id of the agent"),
        Column("planner", "label", "name of its planner"),
        Column("outcome", "label", "one of interdrive.run.OUTCOMES, or running"),
        Column("time_step", "integer", "time step at which it ended"),
        Column("time_s", "number", "the same in seconds [s]"),
        Column("partner_id", "integer", "the other participant of a collision", nullable=True),
        Column("off_road", "truth", "the collision was with the edge of the road"),
        Column("impact_speed", "number", "magnitude of the relative velocity at a collision [m/s]", nullable=True),
        Column("off_lanelets", "number", "largest overhang of the body beyond the lanelets, once it was on them [m]"),
        Column("off_lanelets_s", "number", "how long it was more than road.gap_tolerance [s]"),
        Column(
            "harm", "number", "probability of severe injuries (MAIS 3+) in the agent after a collision", nullable=True
        ),
        Column("partner_harm", "number", "the same in the other participant", nullable=True),
        Column(
            "impact_angle", "number", "direction to the other participant, seen from the agent [rad]", nullable=True
        ),
        Column("impact_area", "label", "front, left, right or rear of the agent", nullable=True),
        Column("message", "text", "what the simulation noted, such as the exception of a planner"),
        Column("reason", "text", "why it ended so, in words and numbers; empty if it reached its goal"),
        Column("traceback", "text", "of the exception that its planner raised; empty for none"),
    ),
    "states": (
        Column("time_step", "integer", ""),
        Column("time_s", "number", "the same in seconds [s]"),
        Column("participant_id", "integer", ""),
        Column("kind", "label", "car, truck, ... (interdrive.scenario.KINDS)"),
        Column("is_agent", "truth", "driven by a planner, otherwise replayed"),
        Column("x", "number", "centre of the footprint [m]"),
        Column("y", "number", "centre of the footprint [m]"),
        Column("orientation", "number", "heading [rad]"),
        Column("velocity", "number", "speed along the heading [m/s]"),
        Column("acceleration", "number", "[m/s²]", nullable=True),
        Column("yaw_rate", "number", "[rad/s]", nullable=True),
        Column("length", "number", "of the footprint [m]"),
        Column("width", "number", "of the footprint [m]"),
    ),
    "plans": (
        Column("time_step", "integer", "time step of the plan"),
        Column("agent_id", "integer", "agent of the plan"),
        Column("status", "label", "origin of the plan, one of interdrive.run.PLAN_STATUS"),
        Column("cost", "number", "cost of the chosen trajectory", nullable=True, infinite=True),
        Column("point", "integer", "point i is i * dt after time_step; a plan without points keeps one row, point 0"),
        Column("x", "number", "centre of the footprint [m]", nullable=True),
        Column("y", "number", "centre of the footprint [m]", nullable=True),
        Column("orientation", "number", "heading [rad]", nullable=True),
        Column("velocity", "number", "[m/s]", nullable=True),
        Column("acceleration", "number", "[m/s²]", nullable=True),
        Column(
            "rejection", "label", "what rejected most samples that the vehicle could drive; empty for ordinary plans"
        ),
        Column("rejection_x", "number", "centre in that contact or at the largest overhang [m]", nullable=True),
        Column("rejection_y", "number", "the same [m]", nullable=True),
        Column("rejection_overhang", "number", "of the cheapest sample off the road beyond it [m]", nullable=True),
    ),
    "views": (
        Column("observer_id", "integer", "the observing agent"),
        Column("seen_id", "integer", "the visible participant"),
        Column("first_time_step", "integer", "first time step of the visibility interval"),
        Column("last_time_step", "integer", "last time step of the interval, included"),
    ),
    "predictions": (
        Column("time_step", "integer", "time step of the prediction"),
        Column("participant_id", "integer", "predicted participant"),
        Column("sender_id", "integer", "agent that told it; null: the predictor", nullable=True),
        Column("age", "number", "age of what was told [s]; null: the predictor", nullable=True),
        Column("mode", "integer", "number of the mode"),
        Column("probability", "number", "of the mode"),
        Column("point", "integer", "the point is point * dt after time_step"),
        Column("x", "number", "mean of the footprint's centre [m]", nullable=True),
        Column("y", "number", "mean of the footprint's centre [m]", nullable=True),
        Column("variance_x", "number", "of the position in world axes [m²]", nullable=True),
        Column("covariance_xy", "number", "of the position in world axes [m²]", nullable=True),
        Column("variance_y", "number", "of the position in world axes [m²]", nullable=True),
    ),
    "candidates": (
        Column("time_step", "integer", "time step of the plan"),
        Column("agent_id", "integer", "agent of the plan"),
        Column("candidate", "integer", "number of the candidate among the kept ones of this plan"),
        Column("cost", "number", "total cost; null where it was not needed", nullable=True, infinite=True),
        Column("rejection", "label", "why it was rejected; empty where it was not"),
        Column("chosen", "truth", "whether it became the plan"),
        Column("point", "integer", "the point is point * dt after time_step"),
        Column("x", "number", "centre of the footprint [m]", nullable=True),
        Column("y", "number", "centre of the footprint [m]", nullable=True),
    ),
    "violations": (
        Column("source", "label", "agent, replayed (another vehicle), or recording (of an agent's vehicle)"),
        Column("participant_id", "integer", "participant that broke the rule"),
        Column("rule", "label", "one of interdrive.run.VIOLATIONS"),
        Column("first_time_step", "integer", "first time step of the violation"),
        Column("last_time_step", "integer", "last time step of the violation"),
        Column("lanelet_id", "integer", "lanelet below the vehicle, of the line, or into the area", nullable=True),
        Column("partner_id", "integer", "participant whose right of way it took", nullable=True),
        Column("x", "number", "centre of the vehicle at the first time step [m]"),
        Column("y", "number", "centre of the vehicle at the first time step [m]"),
        Column(
            "value",
            "number",
            "; ".join(f"{name}: {rule.value}" for name, rule in RULES.items()),
            own_unit="of the rule",
        ),
    ),
    "orders": (
        Column("agent_id", "integer", "agent that was told to wait before a junction or a crosswalk"),
        Column("first_time_step", "integer", "first time step of the order"),
        Column("last_time_step", "integer", "last time step of the order, included"),
        Column(
            "kind",
            "label",
            "yield, exit (no room behind it), queue (behind one that waits), follow (enter after another), crosswalk",
        ),
        Column("by_id", "integer", "participant because of which it waited", nullable=True),
        Column("stop_s", "number", "arc length on its reference path that its front was not to pass [m]"),
    ),
    "messages": (
        Column("time_step", "integer", "time step of sending"),
        Column("sender_id", "integer", "its sender"),
        Column("service", "label", "one of interdrive.run.SERVICES"),
        Column("bytes", "integer", "size [B]"),
        Column("objects", "integer", "number of objects in it"),
        Column("points", "integer", "number of points of its plan"),
        Column("in_range", "integer", "number of receivers in range"),
        Column("received", "integer", "number of receivers that it reaches"),
        Column("receiver_id", "integer", "a receiver in range; null in the row of the message itself", nullable=True),
        Column("arrived", "integer", "time step of arrival there; null where it is lost", nullable=True),
        Column("distance", "number", "distance of the receiver [m]", nullable=True),
    ),
    "agreements": (
        Column("holding_id", "integer", "agent that held before road that others need as well"),
        Column("going_id", "integer", "agent for which it held; null: the way behind was blocked", nullable=True),
        Column("first_time_step", "integer", "first time step in which it held"),
        Column("last_time_step", "integer", "last one, included"),
        Column("bar_x", "number", "where it was to stop [m]"),
        Column("bar_y", "number", "the same [m]"),
        Column("bar_heading", "number", "its heading there [rad]"),
        Column("claim", "integer", "number of its claim"),
    ),
    "routes": (
        Column("agent_id", "integer", "agent that follows the path"),
        Column("point", "integer", "number of the point"),
        Column("x", "number", "[m]"),
        Column("y", "number", "[m]"),
    ),
    "timing": (
        Column("time_step", "integer", ""),
        Column("phase", "label", "one of interdrive.run.PHASES; the phases of a time step add up to the step"),
        Column("seconds", "number", "wall time [s]"),
    ),
}


#: Tables that a run has only if its settings request them; run.json states under their names whether it does.
ON_DEMAND = ("views", "predictions", "candidates", "violations", "orders", "messages", "agreements")
