"""Results of a simulation: what it was asked for, its agents, and the arrays of `interdrive.run.arrays`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, TypedDict

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Floats
    from interdrive.run import arrays
    from interdrive.scenario import GoalState, Scenario, Shape

#: A value of a JSON document.
Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"


@dataclass(frozen=True)
class AgentRecord:
    """Constant properties of one agent during a run.

    Attributes:
        id: Participant id.
        planner: Name of its planner.
        origin: "planning problem", "recorded" or "generated".
        start_time_step: Time step at which it starts.
        goal: Alternatives, of which one must be met.
        route_lanelet_ids: Lanelets of its route in driving order.
        reference_path: Path that its planner follows [m], world frame, shape (points, 2).
    """

    id: int
    planner: str
    origin: str  # "planning problem", "recorded" or "generated"
    start_time_step: int
    goal: tuple[GoalState, ...]
    route_lanelet_ids: tuple[int, ...]
    reference_path: Floats

    def __repr__(self) -> str:
        return f"<AgentRecord {self.id}: {self.planner}, {self.origin}, from time step {self.start_time_step}>"

    @property
    def goal_time_step(self) -> tuple[int, int]:
        """First and last admissible time step of all alternatives; (0, 0) if the goal is not known."""
        steps = [alternative.time_step for alternative in self.goal] or [(0, 0)]
        return min(first for first, _ in steps), max(last for _, last in steps)

    @property
    def goal_areas(self) -> tuple[Shape, ...]:
        """Areas of all alternatives."""
        return tuple(area for alternative in self.goal for area in alternative.areas)


class RunSettings(TypedDict, total=False):
    """What repeats a run; run.json stores it.

    Attributes:
        agents: "all" or what else chose them.
        planner: One choice for all agents, or one per agent id: a name, or a table with its settings.
        views: Settings of views that differ from those of all, per agent id.
        rules: The same for the rules of the road.
        v2x: Whether agents have V2X where that was not drawn, per agent id.
        predictor: A name, or a table with its settings.
        repeatable: Whether the names above suffice; objects made in Python have none.
        seed: Seed of what is drawn.
        threads: Threads used; the results do not depend on them.
        settings: All settings by their dotted names.
    """

    agents: Json
    planner: Json
    views: Mapping[str, Mapping[str, Json]]
    rules: Mapping[str, Mapping[str, Json]]
    v2x: Mapping[str, bool]
    predictor: Json
    repeatable: bool
    seed: int | None
    threads: int
    settings: Mapping[str, Json]


@dataclass(frozen=True)
class RunRecord:
    """The arrays of a finished (or interrupted) simulation; `interdrive.Run` has methods besides.

    Attributes:
        scenario: The simulated scenario.
        settings: Everything needed to repeat the run, as plain values (written to run.json).
        agents: One record per agent, sorted by id.
        outcomes: Outcomes of all agents.
        states: States of all participants.
        plans: All plans.
        timings: Wall time per step and phase.
        notes: Remarks for the user, one line each (such as why a vehicle stayed recorded).
        digest: SHA-256 of all states; equal digests mean equal bits.
        finished: False if the run was stopped from outside.
        views: Visibility intervals; None unless `record.views` is set.
        predictions: Predictions available to agents; None unless `record.predictions` is set.
        candidates: Candidates of agents; None unless `record.candidates` is set.
        violations: Violations of rules of the road; None if `record.violations` is not set.
        orders: Orders to wait before junctions and crosswalks; None if no agent is told anything or `record.orders` is
            not set.
        messages: V2X messages; None unless `record.messages` is set.
        agreements: Which agents held for which; None unless agents negotiate.
        hits: Contacts after which the agent that was hit drove on; None unless `collision.not_at_fault` lets it.
        profile: How long the plans of single agents took; None unless `record.profile` is set.
        demand: Generated vehicles; None without generated traffic.
        sumo: Participants that SUMO drove; None without SUMO.
        cooperation: Totals of messages and of their use; None if no agent has V2X.
    """

    scenario: Scenario
    settings: RunSettings
    agents: tuple[AgentRecord, ...]
    outcomes: arrays.Outcomes
    states: arrays.States
    plans: arrays.Plans
    timings: arrays.Timings
    notes: tuple[str, ...]
    digest: str
    finished: bool = True
    views: arrays.Views | None = None
    predictions: arrays.RecordedPredictions | None = None
    candidates: arrays.RecordedCandidates | None = None
    violations: arrays.Violations | None = None
    orders: arrays.Orders | None = None
    messages: arrays.Messages | None = None
    agreements: arrays.Agreements | None = None
    hits: arrays.Hits | None = None
    profile: arrays.Profile | None = None
    demand: arrays.Demand | None = None
    sumo: arrays.SumoParticipants | None = None
    cooperation: Mapping[str, Json] | None = None
