"""Results of a simulation: outcomes of agents, states of all participants, plans, timings. Arrays only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, TypeAlias, TypedDict

from interdrive.storage import as_pandas, as_polars

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np
    import pandas as pd
    import polars as pl
    from numpy.typing import NDArray

    from interdrive.scenario import GoalState, Scenario, Shape
    from interdrive.storage import ArrowTable

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

#: A value of a JSON document.
Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"

#: Outcomes of agents, in the order of tables.
OUTCOMES = (
    "goal_reached",
    "goal_reached_late",
    "time_limit",
    "goal_missed",
    "infeasible",
    "collision",
    "planner_error",
)

#: Origin of a plan; the position is the code in `Plans.status`.
PLAN_STATUS = ("none", "planned", "emergency_braking", "infeasible", "error")

#: Phases of a step, in their order; the timings of a step add up over them. "record" is recording for figures,
#: "collision" the search for contacts and road departures, "advance" the rest of `World.step`.
PHASES = ("observe", "predict", "plan", "plan_python", "record", "collision", "advance")


class Tabular:
    """Arrays of a run that its folder stores as a table; `interdrive.Run` says how they become one."""

    _as_table: Callable[[], ArrowTable] | None = None

    #: A field with an entry per row, and what the rows are.
    _rows: ClassVar[tuple[str, str]]

    def __repr__(self) -> str:
        name, rows = self._rows
        return f"<{type(self).__name__}: {len(getattr(self, name))} {rows}>"

    def to_arrow(self) -> ArrowTable:
        """The table that the run folder stores, as an Arrow table.

        Raises:
            TypeError: The arrays belong to no `interdrive.Run`.
        """
        if self._as_table is None:
            raise TypeError(f"{type(self).__name__} that belong to no run have no table")
        return self._as_table()

    def to_pandas(self) -> pd.DataFrame:
        """The table that the run folder stores, as a pandas data frame.

        Raises:
            MissingExtraError: pandas is not installed.
        """
        return as_pandas(self.to_arrow())

    def to_polars(self) -> pl.DataFrame:
        """The table that the run folder stores, as a polars data frame.

        Raises:
            MissingExtraError: polars is not installed.
        """
        return as_polars(self.to_arrow())


@dataclass(frozen=True, repr=False)
class Outcomes(Tabular):
    """Outcomes of agents; one row per agent, sorted by id.

    Attributes:
        agent_id: Shape (agents,).
        planner: Name of the agent's planner.
        outcome: One of `OUTCOMES`; "running" if the run was stopped before the agent had an outcome.
        time_step: Time step at which it ended.
        partner_id: The other participant of a collision; -1 for none (also for leaving the road).
        off_road: The collision was with the edge of the road.
        impact_speed: Magnitude of the relative velocity at a collision [m/s]; nan without a collision.
        off_lanelets: Largest overhang of the body beyond the lanelets [m], from when all of it was first on them; with
            any judge of the road.
        off_lanelets_s: How long it was more than `road.gap_tolerance` [s].
        message: What the simulation noted, such as the exception of a planner.
        reason: Why, in words and numbers, from what was recorded; "" if it reached its goal.
        traceback: Of the exception that its planner raised; "" for none.
    """

    _rows = ("agent_id", "agents")

    agent_id: Ints
    planner: tuple[str, ...]
    outcome: tuple[str, ...]
    time_step: Ints
    partner_id: Ints
    off_road: Bools
    impact_speed: Floats
    off_lanelets: Floats
    off_lanelets_s: Floats
    message: tuple[str, ...]
    reason: tuple[str, ...]
    traceback: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class States(Tabular):
    """States of all participants at all time steps; rows sorted by participant id, nan and `valid` False where absent.

    Attributes:
        participant_id: Shape (participants,).
        kinds: One of `interdrive.scenario.KINDS` each.
        first_time_step: Time step of column 0.
        is_agent: Driven by a planner (the others replay their recording), shape (participants,).
        is_static: Static obstacle, shape (participants,).
        length: Footprint length [m], shape (participants,). width: Footprint width [m].
        x: Centre [m], shape (participants, time_steps). y: Centre [m].
        orientation: Heading [rad]. velocity: Speed [m/s]. acceleration: [m/s²]. yaw_rate: [rad/s].
        valid: Whether the participant is present.
    """

    participant_id: Ints
    kinds: tuple[str, ...]
    first_time_step: int
    is_agent: Bools
    is_static: Bools
    length: Floats
    width: Floats
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    yaw_rate: Floats
    valid: Bools

    @property
    def n_steps(self) -> int:
        """Number of recorded time steps."""
        return int(self.x.shape[1])

    def __repr__(self) -> str:
        return f"<States: {len(self.participant_id)} participants over {self.n_steps} time steps>"


@dataclass(frozen=True, repr=False)
class Plans(Tabular):
    """All plans: one row per agent and time step, sorted by time step, then id.

    Attributes:
        time_step: Time step of the plan, shape (plans,).
        agent_id: Agent of the plan, shape (plans,).
        status: Index into `PLAN_STATUS`, shape (plans,).
        cost: Cost of the chosen trajectory, nan where the planner has none, shape (plans,).
        x: Centre [m], shape (plans, points); point i is i * dt after the plan; nan beyond its end.
        y: Centre [m]. orientation: [rad]. velocity: [m/s]. acceleration: [m/s²].
        rejection: What rejected most of the samples that the vehicle could drive, such as "collision with 305"; "" for
            ordinary plans and planners that do not say, one per plan.
        rejection_x: Centre in that contact, or where the overhang is largest [m]; nan for none, shape (plans,).
        rejection_y: The same.
        rejection_overhang: How far the cheapest sample off the road reaches beyond the lanelets [m]; nan for none.
    """

    _rows = ("time_step", "plans")

    time_step: Ints
    agent_id: Ints
    status: Ints
    cost: Floats
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    rejection: tuple[str, ...]
    rejection_x: Floats
    rejection_y: Floats
    rejection_overhang: Floats


@dataclass(frozen=True, repr=False)
class Views(Tabular):
    """Visibility intervals per observer and participant, sorted by observer, participant and time.

    Attributes:
        observer_id: The observing agent, shape (intervals,).
        seen_id: The visible participant.
        first_time_step: First time step of the interval.
        last_time_step: Last time step of the interval, included.
    """

    _rows = ("observer_id", "intervals")

    observer_id: Ints
    seen_id: Ints
    first_time_step: Ints
    last_time_step: Ints

    def seen_by(self, observer_id: int, time_step: int) -> list[int]:
        """Ids of the participants that the agent `observer_id` saw at `time_step`, ascending."""
        now = (self.first_time_step <= time_step) & (time_step <= self.last_time_step)
        seen: list[int] = self.seen_id[now & (self.observer_id == observer_id)].tolist()
        return seen


@dataclass(frozen=True, repr=False)
class RecordedPredictions(Tabular):
    """Predictions available to agents: one row per time step, participant and mode with a probability above 0.

    Rows are sorted by these. An agent has the rows of participants in its view. With V2X there are more rows, by
    participant, sender and age, for what was received, each once for all that received it.

    Attributes:
        point: Points of a row, counted in time steps after `time_step`, about half a second apart, shape (points,).
        time_step: Time step of the prediction, shape (rows,).
        participant_id: Predicted participant, shape (rows,). mode: Number of the mode. probability: Of the mode.
        x: Mean of the footprint's centre [m], shape (rows, points); nan beyond the end. y: The same.
        covariance: Of the position in world axes [m²], shape (rows, points, 2, 2).
        sender_id: Agent that told its plan, or of this participant; -1: the predictor, shape (rows,).
        age: Age of what was told [s]; nan for the predictor.
    """

    _rows = ("time_step", "modes")

    point: Ints
    time_step: Ints
    participant_id: Ints
    mode: Ints
    probability: Floats
    x: Floats
    y: Floats
    covariance: Floats
    sender_id: Ints
    age: Floats


@dataclass(frozen=True, repr=False)
class RecordedCandidates(Tabular):
    """Some of the candidates of sampling planners, sorted by time step, agent, then in the order of `CandidateLog`.

    Attributes:
        point: Points of a row, counted in time steps after `time_step`, about half a second apart, shape (points,).
        time_step: Time step of the plan, shape (rows,). agent_id: Agent, shape (rows,).
        cost: Total cost; nan where it was not needed, shape (rows,).
        rejection: Reason of the rejection, "" where the candidate was not rejected, one per row.
        chosen: Whether it became the plan, shape (rows,).
        x: Centre of the footprint [m], shape (rows, points); nan beyond the end. y: The same.
    """

    _rows = ("time_step", "candidates")

    point: Ints
    time_step: Ints
    agent_id: Ints
    cost: Floats
    rejection: tuple[str, ...]
    chosen: Bools
    x: Floats
    y: Floats


@dataclass(frozen=True, repr=False)
class Timings(Tabular):
    """Wall time in long form: one row per time step and phase.

    Attributes:
        time_step: Shape (rows,).
        phase: One of `PHASES` per row.
        seconds: Shape (rows,). The phases of a time step add up to the step.
    """

    _rows = ("time_step", "phases of steps")

    time_step: Ints
    phase: tuple[str, ...]
    seconds: Floats


@dataclass(frozen=True, repr=False)
class Violations(Tabular):
    """Violations of rules of the road, one row each; sorted by source, participant, rule and time.

    Attributes:
        source: One of `SOURCES`: an agent, a replayed vehicle, or the recording of a vehicle that became an agent.
        participant_id: Participant that broke the rule, shape (violations,).
        rule: One of `interdrive.run.VIOLATIONS`.
        first_time_step: First time step of the violation. last_time_step: Last one.
        lanelet_id: Lanelet below the vehicle, that of the line, or that on which it enters the area; -1 for none.
        partner_id: The participant whose right of way it took; -1 for none.
        x: Centre of the vehicle at the first time step [m]. y: Centre [m].
        value: What it is says `interdrive.run.RULES`, by rules.
    """

    _rows = ("source", "violations")

    SOURCES: ClassVar[tuple[str, ...]] = ("agent", "replayed", "recording")
    source: tuple[str, ...]
    participant_id: Ints
    rule: tuple[str, ...]
    first_time_step: Ints
    last_time_step: Ints
    lanelet_id: Ints
    partner_id: Ints
    x: Floats
    y: Floats
    value: Floats

    def count(self, rule: str, source: str = "agent") -> int:
        """Number of violations of a rule by one source."""
        return sum(pair == (rule, source) for pair in zip(self.rule, self.source, strict=True))


#: What agents are told before junctions and crosswalks; the position is the code of the core. A yield is because of a
#: vehicle that uses the way across, an exit for want of room behind it, a queue because a vehicle ahead in the lane
#: waits. One that follows may enter, but not before another one has left. At a crosswalk an agent waits for a person.
#: Because of what is unseen it waits until it sees more.
ORDERS = ("go", "yield", "exit", "queue", "follow", "crosswalk", "unseen")


@dataclass(frozen=True, repr=False)
class Orders(Tabular):
    """Orders to wait before junctions and crosswalks, one row per stretch of time, sorted by agent and time.

    Attributes:
        agent_id: The agent, shape (orders,).
        first_time_step: First time step of the stretch. last_time_step: Last one, included.
        kind: One of `ORDERS`, but for "go".
        by_id: The participant because of which it waits; -1 for none.
        stop_s: Arc length on its reference path that its front must not pass [m].
    """

    _rows = ("agent_id", "orders")

    agent_id: Ints
    first_time_step: Ints
    last_time_step: Ints
    kind: tuple[str, ...]
    by_id: Ints
    stop_s: Floats


#: Services of V2X messages; the position is the code in `Messages.service`.
SERVICES = ("cam", "mcm", "cpm")

#: How an agent knows of another participant; the position is the code in `View.via`.
VIA = ("sensors", "cam", "cpm", "hold")


@dataclass(frozen=True)
class Messages(Tabular):
    """V2X messages, sorted by time step, sender and service; a message's own row, then one per receiver in range.

    Attributes:
        time_step: Time step of sending, shape (rows,). sender_id: Its sender.
        service: Index into `SERVICES`.
        bytes: Size [B]. objects: Number of objects in it. points: Number of points of its plan.
        in_range: Number of receivers in range. received: Number of receivers that it reaches.
        receiver_id: A receiver in range; -1 in the row of the message itself.
        arrived: Time step of arrival there; -1: lost, or the row of the message itself.
        distance: Distance of the receiver [m]; nan in the row of the message itself.
    """

    time_step: Ints
    sender_id: Ints
    service: Ints
    bytes: Ints
    objects: Ints
    points: Ints
    in_range: Ints
    received: Ints
    receiver_id: Ints
    arrived: Ints
    distance: Floats


@dataclass(frozen=True)
class Agreements(Tabular):
    """Stretches of time in which an agent held for another one, by their first time step, then by who held.

    Attributes:
        holding_id: Agent that held, shape (rows,).
        going_id: Agent for which it held; -1: the way behind the road that others need was blocked.
        first_time_step: First time step. last_time_step: Last one, included.
        bar_x: Where its front was not to go beyond [m]. bar_y: The same. bar_heading: Heading there [rad].
        claim: Number of the claim of the agent that held.
    """

    holding_id: Ints
    going_id: Ints
    first_time_step: Ints
    last_time_step: Ints
    bar_x: Floats
    bar_y: Floats
    bar_heading: Floats
    claim: Ints


@dataclass(frozen=True)
class AgentRecord:
    """Constant properties of one agent during a run.

    Attributes:
        id: Participant id.
        planner: Name of its planner.
        origin: "planning problem" or "recorded".
        start_time_step: Time step at which it starts.
        goal: Alternatives, of which one must be met.
        route_lanelet_ids: Lanelets of its route in driving order.
        reference_path: Path that its planner follows [m], world frame, shape (points, 2).
    """

    id: int
    planner: str
    origin: str  # "planning problem" or "recorded"
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
        cooperation: Totals of messages and of their use; None if no agent has V2X.
    """

    scenario: Scenario
    settings: RunSettings
    agents: tuple[AgentRecord, ...]
    outcomes: Outcomes
    states: States
    plans: Plans
    timings: Timings
    notes: tuple[str, ...]
    digest: str
    finished: bool = True
    views: Views | None = None
    predictions: RecordedPredictions | None = None
    candidates: RecordedCandidates | None = None
    violations: Violations | None = None
    orders: Orders | None = None
    messages: Messages | None = None
    agreements: Agreements | None = None
    cooperation: Mapping[str, Json] | None = None
