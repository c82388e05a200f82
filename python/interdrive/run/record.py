"""What a simulation leaves behind: outcome per agent, states of everybody, plans, timings. Arrays only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from interdrive.criticality import Criticality, CriticalitySettings
    from interdrive.scenario import Scenario

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

#: How an agent can end, in the order in which tables list them.
OUTCOMES = (
    "goal_reached",
    "goal_reached_late",
    "time_limit",
    "goal_missed",
    "infeasible",
    "collision",
    "planner_error",
)

#: How a plan came about; the position is the code in `Plans.status`.
PLAN_STATUS = ("none", "planned", "emergency_braking", "infeasible", "error")

#: Phases of a step, in their order; the timings of a step add up over them. "record" is what pictures ask for,
#: "collision" the search for contacts and road departures, "advance" all else of `World.step`.
PHASES = ("observe", "predict", "plan", "plan_python", "record", "collision", "advance")


@dataclass(frozen=True)
class Outcomes:
    """How every agent ended; one row per agent, sorted by id.

    Attributes:
        agent_id: Shape (agents,).
        planner: Name of the agent's planner.
        outcome: One of `OUTCOMES`; "running" if the run was stopped before the agent was done.
        time_step: Time step at which it ended.
        partner_id: The other participant of a collision; -1 for none (also for leaving the road).
        off_road: The collision was with the edge of the road.
        impact_speed: Size of the relative velocity at a collision [m/s]; nan without.
        message: For people: why infeasible, what a planner raised, ...
    """

    agent_id: Ints
    planner: tuple[str, ...]
    outcome: tuple[str, ...]
    time_step: Ints
    partner_id: Ints
    off_road: Bools
    impact_speed: Floats
    message: tuple[str, ...]


@dataclass(frozen=True)
class States:
    """States of all participants at all time steps; rows sorted by participant id, nan and `valid` False where absent.

    Attributes:
        ids: Shape (participants,).
        kinds: One of `interdrive.scenario.KINDS` each.
        first_time_step: Time step of column 0.
        is_agent: Driven by a planner (the others replay their recording), shape (participants,).
        is_static: Static obstacle, shape (participants,).
        length: Footprint length [m], shape (participants,). width: Footprint width [m].
        x: Centre [m], shape (participants, time_steps). y: Centre [m].
        orientation: Heading [rad]. velocity: Speed [m/s]. acceleration: [m/s²]. yaw_rate: [rad/s].
        valid: Present.
    """

    ids: Ints
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


@dataclass(frozen=True)
class Plans:
    """Every plan that was made: one row per agent and time step, sorted by time step, then id.

    Attributes:
        time_step: When the plan was made, shape (plans,).
        agent_id: Whose, shape (plans,).
        status: Index into `PLAN_STATUS`, shape (plans,).
        cost: Cost of the chosen trajectory, nan where the planner has none, shape (plans,).
        x: Centre [m], shape (plans, points); point i is i * dt later; nan beyond a plan's end.
        y: Centre [m]. orientation: [rad]. velocity: [m/s]. acceleration: [m/s²].
    """

    time_step: Ints
    agent_id: Ints
    status: Ints
    cost: Floats
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats


@dataclass(frozen=True)
class Views:
    """Who saw whom: one row per stretch of time steps without a break, sorted by observer, seen and time.

    Attributes:
        observer_id: The agent that saw, shape (stretches,).
        seen_id: The participant that it saw.
        first_time_step: First time step of the stretch.
        last_time_step: Last time step of the stretch, included.
    """

    observer_id: Ints
    seen_id: Ints
    first_time_step: Ints
    last_time_step: Ints

    def seen_by(self, observer_id: int, time_step: int) -> list[int]:
        """Ids of those whom an agent saw at a time step, ascending."""
        now = (self.first_time_step <= time_step) & (time_step <= self.last_time_step)
        seen: list[int] = self.seen_id[now & (self.observer_id == observer_id)].tolist()
        return seen


@dataclass(frozen=True)
class Predicted:
    """What agents planned against: one row per time step, participant and mode with a probability above 0, sorted so.

    Agents see those rows whose participant is in their view.

    Attributes:
        point: Points of a row, counted in time steps after `time_step`, about half a second apart, shape (points,).
        time_step: When it was predicted, shape (rows,).
        participant_id: Whose future, shape (rows,). mode: Number of the mode. probability: Of the mode.
        x: Mean of the footprint's centre [m], shape (rows, points); nan beyond the end. y: The same.
        covariance: Of the position in world axes [m²], shape (rows, points, 2, 2).
    """

    point: Ints
    time_step: Ints
    participant_id: Ints
    mode: Ints
    probability: Floats
    x: Floats
    y: Floats
    covariance: Floats


@dataclass(frozen=True)
class Considered:
    """Some of the candidates that sampling planners chose from, sorted by time step, agent, then as kept.

    Attributes:
        point: Points of a row, counted in time steps after `time_step`, about half a second apart, shape (points,).
        time_step: When, shape (rows,). agent_id: Whose, shape (rows,).
        cost: Total cost; nan where it was not needed, shape (rows,).
        rejection: Why the candidate was rejected, "" where it was not, one per row.
        chosen: It became the plan, shape (rows,).
        x: Centre of the footprint [m], shape (rows, points); nan beyond the end. y: The same.
    """

    point: Ints
    time_step: Ints
    agent_id: Ints
    cost: Floats
    rejection: tuple[str, ...]
    chosen: Bools
    x: Floats
    y: Floats


@dataclass(frozen=True)
class Timings:
    """Wall time in long form: one row per time step and phase.

    Attributes:
        time_step: Shape (rows,).
        phase: One of `PHASES` per row.
        seconds: Shape (rows,). The phases of a time step add up to the step.
    """

    time_step: Ints
    phase: tuple[str, ...]
    seconds: Floats


@dataclass(frozen=True)
class AgentRecord:
    """Facts about one agent that do not change during a run.

    `goal_areas`, `route_lanelet_ids` and `reference_path` (shape (points, 2) [m]) are for pictures and files.
    """

    id: int
    planner: str
    origin: str  # "planning problem" or "recorded"
    start_time_step: int
    goal_time_step: tuple[int, int]
    goal_areas: tuple[Any, ...]
    route_lanelet_ids: tuple[int, ...]
    reference_path: Floats


@dataclass(frozen=True)
class Run:
    """A finished (or interrupted) simulation.

    Attributes:
        scenario: What was simulated.
        settings: Everything needed to repeat the run, as plain values (written to run.json).
        agents: One record per agent, sorted by id.
        outcomes: How every agent ended.
        states: States of all participants.
        plans: Every plan.
        timings: Wall time per step and phase.
        notes: One line per thing the user should know (vehicles that stayed recorded, and why, ...).
        digest: SHA-256 of all states; equal digests mean equal bits.
        finished: False if the run was stopped from outside.
        views: Who saw whom; None unless `record.views` asked for it.
        predicted: What agents planned against; None unless `record.predictions` asked for it.
        considered: What they chose from; None unless `record.candidates` asked for it.
    """

    scenario: Scenario
    settings: dict[str, Any]
    agents: tuple[AgentRecord, ...]
    outcomes: Outcomes
    states: States
    plans: Plans
    timings: Timings
    notes: tuple[str, ...]
    digest: str
    finished: bool = True
    views: Views | None = None
    predicted: Predicted | None = None
    considered: Considered | None = None

    def criticality(
        self,
        ids: Sequence[int] | None = None,
        *,
        others: Sequence[int] | None = None,
        settings: CriticalitySettings | None = None,
        deceleration: Mapping[int, float] | None = None,
        threads: int | None = None,
    ) -> Criticality:
        """All criticality measures at every time step, of all agents by default.

        Arguments and errors are those of `interdrive.criticality.evaluate`.
        """
        from interdrive.criticality import evaluate  # noqa: PLC0415 - only who asks pays for it

        return evaluate(self, ids, others=others, settings=settings, deceleration=deceleration, threads=threads)
