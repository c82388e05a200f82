"""Arrays of a run: outcomes of agents, states of all participants, plans, and what else is recorded.

The fields of these records declare the columns of a run's tables, each once: name, type, unit, meaning and why a value
can be absent. Schemas, the run folder and its checks, the data set of a batch and the reference pages follow from them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from interdrive.run.rules import RULES, VIOLATIONS
from interdrive.scenario import KINDS
from interdrive.storage import Column, Record, Tabled, integer, label, number, text, truth
from interdrive.storage.html import html_head

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.storage import ArrowTable

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

#: What agents are told before junctions and crosswalks; the position is the code of the core. A yield is because of a
#: vehicle that uses the way across, an exit for want of room behind it, a queue because a vehicle ahead in the lane
#: waits. One that follows may enter, but not before another one has left. At a crosswalk an agent waits for a person.
#: Because of what is unseen it waits until it sees more.
ORDERS = ("go", "yield", "exit", "queue", "follow", "crosswalk", "unseen")

#: nuPlan's types of collisions.
COLLISION_TYPES = ("stopped_agent", "stopped_other", "rear", "front", "lateral")

#: Services of V2X messages; the position is the code in `Messages.service`.
SERVICES = ("cam", "mcm", "cpm")

#: How an agent knows of another participant; the position is the code in `View.via`.
VIA = ("sensors", "cam", "cpm", "hold")

#: The time of a row, beside its time step.
_TIME = Column("time_s", "number", "the same in seconds", "s")

#: Rows of a table that notebooks show.
_SHOWN_ROWS = 20

_BEYOND_END = "beyond its end"


class Tabular(Record, Tabled):
    """Arrays of a run that its folder stores as a table; `interdrive.Run` says how they become one."""

    _as_table: Callable[[], ArrowTable] | None = None

    #: What the rows are.
    _rows: ClassVar[str]

    def __repr__(self) -> str:
        name = next(name for name, column in self.stored.items() if column.axes == "row")
        return f"<{type(self).__name__}: {len(getattr(self, name))} {self._rows}>"

    def _repr_html_(self) -> str | None:
        """The first rows, for notebooks; None without a run."""
        if self._as_table is None:
            return None
        from html import escape  # noqa: PLC0415 - a long table of entities

        table = self.to_arrow()
        rows = table.slice(0, _SHOWN_ROWS).to_pylist()
        return f"<p>{escape(repr(self))}</p>{html_head(table.column_names, rows, table.num_rows)}"

    def to_arrow(self) -> ArrowTable:
        """The table that the run folder stores, as an Arrow table.

        Raises:
            TypeError: The arrays belong to no `interdrive.Run`.
        """
        if self._as_table is None:
            raise TypeError(f"{type(self).__name__} that belong to no run have no table")
        return self._as_table()


@dataclass(frozen=True, repr=False)
class Outcomes(Tabular):
    """Outcomes of agents; one row per agent, sorted by id."""

    _rows = "agents"

    agent_id: Ints = field(metadata=integer("participant id of the agent"))
    planner: tuple[str, ...] = field(metadata=label("name of its planner"))
    outcome: tuple[str, ...] = field(
        metadata=label("one of interdrive.run.OUTCOMES, or running", (*OUTCOMES, "running"))
    )
    time_step: Ints = field(metadata=integer("time step at which it ended"))
    _time = _TIME
    partner_id: Ints = field(
        metadata=integer("the other participant of a collision", null="no collision with a participant")
    )
    off_road: Bools = field(metadata=truth("the collision was with the edge of the road"))
    impact_speed: Floats = field(
        metadata=number("magnitude of the relative velocity at a collision", "m/s", null="no collision")
    )
    off_lanelets: Floats = field(
        metadata=number("largest overhang of the body beyond the lanelets, once it was on them", "m")
    )
    off_lanelets_s: Floats = field(metadata=number("how long it was more than road.gap_tolerance", "s"))
    message: tuple[str, ...] = field(metadata=text("what the simulation noted, such as the exception of a planner"))
    reason: tuple[str, ...] = field(
        metadata=text("why it ended so, in words and numbers; empty if it reached its goal")
    )
    traceback: tuple[str, ...] = field(metadata=text("of the exception that its planner raised; empty for none"))


@dataclass(frozen=True, repr=False)
class States(Tabular):
    """States of all participants at all time steps; rows sorted by participant id, nan and `valid` False where absent.

    Points are time steps.

    Attributes:
        first_time_step: Time step of column 0.
        is_static: Static obstacle, shape (participants,).
        valid: Whether the participant is present, shape (participants, time_steps).
    """

    _time_step = Column("time_step", "integer", "time step of the state")
    _time = _TIME
    participant_id: Ints = field(metadata=integer("id of the participant"))
    kinds: tuple[str, ...] = field(metadata=label("car, truck, ... (interdrive.scenario.KINDS)", KINDS, name="kind"))
    first_time_step: int
    is_agent: Bools = field(metadata=truth("driven by a planner, otherwise replayed"))
    is_static: Bools
    x: Floats = field(metadata=number("centre of the footprint", "m", axes="row and point"))
    y: Floats = field(metadata=number("centre of the footprint", "m", axes="row and point"))
    orientation: Floats = field(metadata=number("heading", "rad", axes="row and point"))
    velocity: Floats = field(metadata=number("speed along the heading", "m/s", axes="row and point"))
    acceleration: Floats = field(
        metadata=number("along the heading", "m/s²", null="the recording does not say", axes="row and point")
    )
    yaw_rate: Floats = field(
        metadata=number("change of the heading", "rad/s", null="the recording does not say", axes="row and point")
    )
    length: Floats = field(metadata=number("of the footprint", "m"))
    width: Floats = field(metadata=number("of the footprint", "m"))
    valid: Bools

    @property
    def n_steps(self) -> int:
        """Number of recorded time steps."""
        return int(self.x.shape[1])

    def __repr__(self) -> str:
        return f"<States: {len(self.participant_id)} participants over {self.n_steps} time steps>"


@dataclass(frozen=True, repr=False)
class Plans(Tabular):
    """All plans: one row per agent and time step, sorted by time step, then id."""

    _rows = "plans"

    time_step: Ints = field(metadata=integer("time step of the plan"))
    agent_id: Ints = field(metadata=integer("agent of the plan"))
    status: Ints = field(
        metadata=label("origin of the plan, one of interdrive.run.PLAN_STATUS", PLAN_STATUS, coded=True)
    )
    cost: Floats = field(
        metadata=number("cost of the chosen trajectory", "1", null="the planner has none", infinite=True)
    )
    _point = Column(
        "point", "integer", "point i is i * dt after time_step; a plan without points keeps one row, point 0"
    )
    x: Floats = field(metadata=number("centre of the footprint", "m", null=_BEYOND_END, axes="row and point"))
    y: Floats = field(metadata=number("centre of the footprint", "m", null=_BEYOND_END, axes="row and point"))
    orientation: Floats = field(metadata=number("heading", "rad", null=_BEYOND_END, axes="row and point"))
    velocity: Floats = field(metadata=number("speed along the heading", "m/s", null=_BEYOND_END, axes="row and point"))
    acceleration: Floats = field(metadata=number("along the heading", "m/s²", null=_BEYOND_END, axes="row and point"))
    rejection: tuple[str, ...] = field(
        metadata=label(
            "what rejected most samples that the vehicle could drive, or better plans of `rollout`; empty where"
            " nothing did"
        )
    )
    rejection_x: Floats = field(
        metadata=number("centre in that contact or at the largest overhang", "m", null="no such rejection")
    )
    rejection_y: Floats = field(metadata=number("the same", "m", null="no such rejection"))
    rejection_overhang: Floats = field(
        metadata=number("of the cheapest sample off the road beyond it", "m", null="no sample left the road")
    )
    turn: Floats = field(
        metadata=number(
            "what the agent shows by its blinkers: 1 left, 0 straight on at a fork, -1 right", "1", null="nothing"
        )
    )


@dataclass(frozen=True, repr=False)
class Views(Tabular):
    """Visibility intervals per observer and participant, sorted by observer, participant and time."""

    _rows = "intervals"

    observer_id: Ints = field(metadata=integer("the observing agent"))
    seen_id: Ints = field(metadata=integer("the visible participant"))
    first_time_step: Ints = field(metadata=integer("first time step of the visibility interval"))
    last_time_step: Ints = field(metadata=integer("last time step of the interval, included"))

    def seen_by(self, observer_id: int, time_step: int) -> list[int]:
        """Ids of the participants that the agent `observer_id` saw at `time_step`, ascending."""
        now = (self.first_time_step <= time_step) & (time_step <= self.last_time_step)
        seen: list[int] = self.seen_id[now & (self.observer_id == observer_id)].tolist()
        return seen


@dataclass(frozen=True, repr=False)
class RecordedPredictions(Tabular):
    """Predictions available to agents: one row per time step, participant and mode with a probability above 0.

    Rows are sorted by these. An agent has the rows of participants in its view. With V2X there are more rows, by
    participant, sender and age, for what was received, each once for all that received it. Points are about half a
    second apart.

    Attributes:
        covariance: Of the position in world axes [m²], shape (rows, points, 2, 2).
    """

    _rows = "modes"

    time_step: Ints = field(metadata=integer("time step of the prediction"))
    participant_id: Ints = field(metadata=integer("predicted participant"))
    sender_id: Ints = field(metadata=integer("agent that told it", null="the predictor"))
    age: Floats = field(metadata=number("age of what was told", "s", null="the predictor"))
    mode: Ints = field(metadata=integer("number of the mode"))
    probability: Floats = field(metadata=number("of the mode", "1"))
    point: Ints = field(metadata=integer("the point is point * dt after time_step", axes="point"))
    x: Floats = field(metadata=number("mean of the footprint's centre", "m", null=_BEYOND_END, axes="row and point"))
    y: Floats = field(metadata=number("mean of the footprint's centre", "m", null=_BEYOND_END, axes="row and point"))
    _variance_x = Column("variance_x", "number", "of the position in world axes", "m²", null=_BEYOND_END)
    _covariance_xy = Column("covariance_xy", "number", "of the position in world axes", "m²", null=_BEYOND_END)
    _variance_y = Column("variance_y", "number", "of the position in world axes", "m²", null=_BEYOND_END)
    covariance: Floats


@dataclass(frozen=True, repr=False)
class RecordedCandidates(Tabular):
    """Some of the candidates of sampling planners, sorted by time step, agent, then in the order of `CandidateLog`.

    Points are about half a second apart.
    """

    _rows = "candidates"

    time_step: Ints = field(metadata=integer("time step of the plan"))
    agent_id: Ints = field(metadata=integer("agent of the plan"))
    _candidate = Column("candidate", "integer", "number of the candidate among the kept ones of this plan")
    cost: Floats = field(metadata=number("total cost", "1", null="it was not needed", infinite=True))
    rejection: tuple[str, ...] = field(metadata=label("why it was rejected; empty where it was not"))
    chosen: Bools = field(metadata=truth("whether it became the plan"))
    point: Ints = field(metadata=integer("the point is point * dt after time_step", axes="point"))
    x: Floats = field(metadata=number("centre of the footprint", "m", null=_BEYOND_END, axes="row and point"))
    y: Floats = field(metadata=number("centre of the footprint", "m", null=_BEYOND_END, axes="row and point"))


@dataclass(frozen=True, repr=False)
class Timings(Tabular):
    """Wall time in long form: one row per time step and phase."""

    _rows = "phases of steps"

    time_step: Ints = field(metadata=integer("time step"))
    phase: tuple[str, ...] = field(
        metadata=label("one of interdrive.run.PHASES; the phases of a time step add up to the step")
    )
    seconds: Floats = field(metadata=number("wall time", "s"))


#: What is done for one plan: the core plans; or, for a planner in Python, its view is made, it is called, and its plan
#: is checked and written.
PLAN_PARTS = ("plan", "view", "call", "check")


@dataclass(frozen=True, repr=False)
class Profile(Tabular):
    """Time that the plans of single agents took, sorted by time step, agent and part."""

    _rows = "parts of plans"

    time_step: Ints = field(metadata=integer("time step of the plan"))
    agent_id: Ints = field(metadata=integer("agent of the plan"))
    part: tuple[str, ...] = field(
        metadata=label(
            "plan: the core plans. For a planner in Python: view, its view is made; call, its own code; check, its "
            "plan is checked and written",
            PLAN_PARTS,
        )
    )
    seconds: Floats = field(metadata=number("wall time on its thread, or in its process", "s"))


@dataclass(frozen=True, repr=False)
class Demand(Tabular):
    """Generated vehicles, one row each, sorted by id: when they wanted to enter, and when they did."""

    _rows = "vehicles"

    agent_id: Ints = field(metadata=integer("the vehicle"))
    lane_id: Ints = field(metadata=integer("lanelet by which it enters, or in which it is from the beginning"))
    kind: tuple[str, ...] = field(metadata=label("one of interdrive.scenario.KINDS", KINDS))
    due: Floats = field(metadata=number("when it wanted to enter", "s", null="it is there from the beginning"))
    entered: Floats = field(metadata=number("when it entered", "s", null="it has not entered"))
    left: Floats = field(metadata=number("when it left the map by its exit", "s", null="it has not"))
    exit_id: Ints = field(metadata=integer("last lanelet of its way"))
    route_length: Floats = field(metadata=number("length of its way", "m"))


@dataclass(frozen=True, repr=False)
class SumoParticipants(Tabular):
    """Participants that SUMO drove, one row each, sorted by id."""

    _rows = "participants"

    participant_id: Ints = field(metadata=integer("id of the participant in the run"))
    name: tuple[str, ...] = field(metadata=text("what SUMO calls it"))


@dataclass(frozen=True, repr=False)
class Violations(Tabular):
    """Violations of rules of the road, one row each; sorted by source, participant, rule and time."""

    _rows = "violations"

    SOURCES: ClassVar[tuple[str, ...]] = ("agent", "replayed", "recording")
    source: tuple[str, ...] = field(
        metadata=label("agent, replayed (another vehicle), or recording (of an agent's vehicle)", SOURCES)
    )
    participant_id: Ints = field(metadata=integer("participant that broke the rule"))
    rule: tuple[str, ...] = field(metadata=label("one of interdrive.run.VIOLATIONS", VIOLATIONS))
    first_time_step: Ints = field(metadata=integer("first time step of the violation"))
    last_time_step: Ints = field(metadata=integer("last time step of the violation"))
    lanelet_id: Ints = field(
        metadata=integer("lanelet below the vehicle, of the line, or into the area", null="there is none")
    )
    partner_id: Ints = field(
        metadata=integer("participant whose right of way it took", null="the rule is about no other participant")
    )
    x: Floats = field(metadata=number("centre of the vehicle at the first time step", "m"))
    y: Floats = field(metadata=number("centre of the vehicle at the first time step", "m"))
    value: Floats = field(
        metadata=number("; ".join(f"{name}: {rule.value}" for name, rule in RULES.items()), "of the rule")
    )

    def count(self, rule: str, source: str = "agent") -> int:
        """Number of violations of a rule by one source."""
        return sum(pair == (rule, source) for pair in zip(self.rule, self.source, strict=True))


@dataclass(frozen=True, repr=False)
class Orders(Tabular):
    """Orders to wait before junctions and crosswalks, one row per stretch of time, sorted by agent and time."""

    _rows = "orders"

    agent_id: Ints = field(metadata=integer("agent that was told to wait before a junction or a crosswalk"))
    first_time_step: Ints = field(metadata=integer("first time step of the order"))
    last_time_step: Ints = field(metadata=integer("last time step of the order, included"))
    kind: tuple[str, ...] = field(
        metadata=label(
            "yield, exit (no room behind it), queue (a vehicle ahead waits), follow (enter after another), crosswalk",
            ORDERS[1:],
        )
    )
    by_id: Ints = field(metadata=integer("participant because of which it waited", null="no single one"))
    stop_s: Floats = field(metadata=number("arc length on its reference path that its front was not to pass", "m"))


@dataclass(frozen=True, repr=False)
class Hits(Tabular):
    """Contacts that were not an agent's fault, after which it drove on and the other one left; by time and agent."""

    _rows = "hits"

    agent_id: Ints = field(metadata=integer("agent that was hit, and drove on"))
    by_id: Ints = field(metadata=integer("participant that hit it, and left"))
    time_step: Ints = field(metadata=integer("first time step after the contact, the last one of the other"))
    impact_speed: Floats = field(metadata=number("size of the relative velocity at the contact", "m/s"))
    collision_type: tuple[str, ...] = field(metadata=label("nuPlan's type of the collision", COLLISION_TYPES))


@dataclass(frozen=True, repr=False)
class Messages(Tabular):
    """V2X messages, sorted by time step, sender and service; a message's own row, then one per receiver in range."""

    _rows = "rows of messages"

    time_step: Ints = field(metadata=integer("time step of sending"))
    sender_id: Ints = field(metadata=integer("its sender"))
    service: Ints = field(metadata=label("one of interdrive.run.SERVICES", SERVICES, coded=True))
    bytes: Ints = field(metadata=integer("size", unit="B"))
    objects: Ints = field(metadata=integer("number of objects in it"))
    points: Ints = field(metadata=integer("number of points of its plan"))
    in_range: Ints = field(metadata=integer("number of receivers in range"))
    received: Ints = field(metadata=integer("number of receivers that it reaches"))
    receiver_id: Ints = field(metadata=integer("a receiver in range", null="the row of the message itself"))
    arrived: Ints = field(
        metadata=integer("time step of arrival there", null="it is lost, or the row of the message itself")
    )
    distance: Floats = field(metadata=number("distance of the receiver", "m", null="the row of the message itself"))


@dataclass(frozen=True, repr=False)
class Agreements(Tabular):
    """Stretches of time in which an agent held for another one, by first time step and holding agent."""

    _rows = "agreements"

    holding_id: Ints = field(metadata=integer("agent that held before road that others need as well"))
    going_id: Ints = field(metadata=integer("agent for which it held", null="the way was blocked"))
    first_time_step: Ints = field(metadata=integer("first time step in which it held"))
    last_time_step: Ints = field(metadata=integer("last one, included"))
    bar_x: Floats = field(metadata=number("where it was to stop", "m"))
    bar_y: Floats = field(metadata=number("the same", "m"))
    bar_heading: Floats = field(metadata=number("its heading there", "rad"))
