"""The order of a step, written once: observe, predict, plan, advance, record."""

from __future__ import annotations

import hashlib
import os
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.agents import AgentSettings, GoalSettings, normalized, select
from interdrive.errors import InputError, InterdriveError, PredictorError
from interdrive.files import read_scenario, scenario_from_commonroad, shipped_scenario, shipped_scenarios
from interdrive.handles import core_road, core_scenario, core_shape
from interdrive.planners import Frenet, Planner, PlannerSettings, name_of, native_planner, write_plan
from interdrive.planners import resolve as resolve_planner
from interdrive.predictors import ConstantVelocity, GroundTruth, LaneFollowing, PredictorSettings, native
from interdrive.predictors import resolve as resolve_predictor
from interdrive.run import PHASES, AgentRecord, Outcomes, Plans, Run, Snapshot, States, Timings
from interdrive.scenario import KINDS, Scenario
from interdrive.settings import flatten

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

#: Names of the core's outcome codes.
_OUTCOME_NAMES = (
    "running",
    "goal_reached",
    "goal_reached_late",
    "time_limit",
    "goal_missed",
    "infeasible",
    "collision",
    "planner_error",
)


@dataclass(frozen=True)
class ViewSettings:
    """What an agent sees.

    Attributes:
        sensor_radius: Participants further away (centre to centre) are not seen [m].
    """

    sensor_radius: float = 80.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not self.sensor_radius > 0:
            raise InputError(f"view.sensor_radius must be positive, not {self.sensor_radius}")


@dataclass(frozen=True)
class StepSettings:
    """How the world steps.

    Attributes:
        replan_every: A new plan every so many time steps; in between the last one is followed.
        grace_factor: A late agent may go on until its time limit, counted from its start, times this factor.
        history_steps: Number of past time steps that a scene shows.
    """

    replan_every: int = 1
    grace_factor: float = 1.7
    history_steps: int = 30

    def __post_init__(self) -> None:
        """Checks the ranges."""
        for name, most in (("replan_every", 10_000), ("grace_factor", 1_000), ("history_steps", 10_000)):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise InputError(f"step.{name} must be at least 1 and at most {most}, not {value}")


@dataclass(frozen=True)
class RoadSettings:
    """What counts as road.

    Attributes:
        gap_tolerance: Gaps between lanelets up to this width count as road, and a footprint may overhang the edge
            by this much [m].
        open_end_length: Where the map ends but the road does not (lanelets without successor or predecessor), it
            goes on straight for this length [m].
    """

    gap_tolerance: float = 0.1
    open_end_length: float = 120.0

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not 0 < self.gap_tolerance < 1:
            raise InputError(f"road.gap_tolerance must be between 0 and 1 m, not {self.gap_tolerance}")
        if not self.open_end_length >= 0:
            raise InputError(f"road.open_end_length must not be negative, is {self.open_end_length}")


@dataclass(frozen=True)
class SimulationSettings:
    """All settings of a run; the dotted names are those of `--set` and of the configuration file."""

    agents: AgentSettings = field(default_factory=AgentSettings)
    goal: GoalSettings = field(default_factory=GoalSettings)
    planner: PlannerSettings = field(default_factory=PlannerSettings)
    predictor: PredictorSettings = field(default_factory=PredictorSettings)
    view: ViewSettings = field(default_factory=ViewSettings)
    step: StepSettings = field(default_factory=StepSettings)
    road: RoadSettings = field(default_factory=RoadSettings)


#: More threads than any machine has cores; the system would run out of them.
_THREADS_MAX = 1024

#: What `planner` may be: a name, a native record, an object with `plan`, a factory without arguments; or one of these
#: per agent id, with the key "default" for all others.
PlannerChoice = object


class Simulation:
    """A scenario whose agents plan for themselves, step by step.

    Example:
        >>> simulation = Simulation("t_junction", agents="all")  # doctest: +SKIP
        >>> while not simulation.is_done:  # doctest: +SKIP
        ...     simulation.step()
        >>> run = simulation.record()  # doctest: +SKIP
    """

    def __init__(
        self,
        scenario: Scenario | str | os.PathLike[str] | object,
        *,
        agents: str | int | Sequence[int] = "all",
        planner: PlannerChoice = "frenet",
        predictor: object = "lane_following",
        settings: SimulationSettings | None = None,
        seed: int = 0,
        threads: int | None = None,
        snapshots_of: int | None = None,
    ) -> None:
        """Prepares agents, routes and the world.

        Args:
            scenario: A `Scenario`, the path of a CommonRoad file, the name of a shipped scenario, or a
                `commonroad.scenario.scenario.Scenario` (alone or as a pair with its planning problem set).
            agents: "all", a number, or ids; see `interdrive.agents.select`.
            planner: Name, record, object, factory, or a mapping from agent id (and "default") to these.
            predictor: Name, record, object or factory.
            settings: Settings; the defaults otherwise.
            seed: For the choice of agents.
            threads: Threads that plan; the number of cores otherwise. Results do not depend on it.
            snapshots_of: Agent whose candidates and predictions are kept for pictures.

        Raises:
            InputError: Anything about the input that cannot be used, in one line.
        """
        if threads is not None and not 1 <= threads <= _THREADS_MAX:
            raise InputError(f"threads must be at least 1 and at most {_THREADS_MAX}, not {threads}")
        if seed < 0:
            raise InputError(f"the seed must not be negative, is {seed}")
        self.settings = settings or SimulationSettings()
        self.scenario = _scenario(scenario)
        self.seed, self.threads = seed, threads or os.cpu_count() or 1
        self._snapshots_of = snapshots_of
        self.settings, planner, predictor = _named(self.settings, planner, predictor)
        self._agents_wanted, self._predictor_choice = normalized(agents), predictor
        road_settings = self.settings.road
        self.road = core_road(self.scenario, road_settings.gap_tolerance, road_settings.open_end_length)
        self._core_scenario = core_scenario(self.scenario, self.road)
        self.agents, notes = select(
            self.scenario,
            self.road,
            self._agents_wanted,
            agent_settings=self.settings.agents,
            goal_settings=self.settings.goal,
            seed=seed,
        )
        self._notes = [*self.scenario.notes, *notes]
        if snapshots_of is not None and snapshots_of not in {agent.id for agent in self.agents}:
            raise InputError(f"agent {snapshots_of}: pictures of its candidates are asked for, but it is not an agent")
        self._choices = _choices(planner, [agent.id for agent in self.agents], self.settings.planner)
        self.reset()

    def reset(self) -> None:
        """Back to the first time step; planners and predictor are made anew."""
        self._predictor = resolve_predictor(self._predictor_choice, self.settings.predictor)
        self._native_predictor = native(self._predictor, self.settings.predictor, self._core_scenario)
        self._python_planners: dict[int, Planner] = {}
        handles = []
        for agent in self.agents:
            record = resolve_planner(self._choices[agent.id], self.settings.planner)
            native_record = native_planner(record)
            if native_record is None:
                self._python_planners[agent.id] = record  # type: ignore[assignment]
            state = agent.initial_state
            handles.append(
                _core.Agent(
                    agent.id,
                    KINDS.index(agent.kind),
                    core_shape(agent.shape),
                    agent.vehicle,
                    (state.x, state.y, state.orientation, state.velocity, state.acceleration, state.yaw_rate),
                    state.time_step,
                    agent.native_goal,
                    agent.route,
                    native_record,
                    self.settings.view.sensor_radius,
                )
            )
        step = self.settings.step
        self.world = _core.World(
            self._core_scenario,
            handles,
            grace_factor=step.grace_factor,
            replan_every=step.replan_every,
            history_steps=step.history_steps,
            threads=self.threads,
        )
        self._touching = self.world.entered_in_contact
        self._timings: list[tuple[int, tuple[float, ...]]] = []
        self._snapshots: list[Snapshot] = []

    @property
    def time_step(self) -> int:
        """Now."""
        return self.world.time_step

    @property
    def is_done(self) -> bool:
        """Every agent has its outcome."""
        return self.world.is_done

    @property
    def driving(self) -> list[int]:
        """Ids of the agents that drive now, ascending."""
        return self.world.driving

    def step(self) -> None:
        """One time step: everybody observes, predicts and plans on the same scene, then all move at once.

        Once every agent has its outcome, nothing happens any more.

        Raises:
            PredictorError: The predictor raised or returned garbage.
        """
        if self.world.is_done:
            return
        world, clock, marks = self.world, time.perf_counter, [time.perf_counter()]
        time_step = world.time_step
        scene = world.scene()
        marks.append(clock())
        predictions = self._predict(scene)
        marks.append(clock())
        plans = world.plan(scene, predictions)
        marks.append(clock())
        self._plan_python(scene, predictions, plans)
        marks.append(clock())
        if self._snapshots_of is not None and self._snapshots_of in world.driving:
            self._snapshots.append(_snapshot(world, scene, predictions, self._snapshots_of))
        marks.append(clock())
        world.step(plans)
        marks.append(clock())
        self._timings.append((time_step, tuple(np.diff(marks).tolist())))

    def _predict(self, scene: _core.Scene) -> _core.Predictions:
        horizon = max(1, round(self.settings.predictor.horizon / self.scenario.dt))
        if self._native_predictor is not None:
            return self.world.predict(self._native_predictor, scene, horizon)
        try:
            predictions = self._predictor.predict(scene)  # type: ignore[attr-defined]
        except Exception as error:
            raise PredictorError(f"the predictor raised at time step {scene.time_step}: {error!r}") from error
        if not isinstance(predictions, _core.Predictions) or predictions.time_step != scene.time_step:
            raise PredictorError(
                f"the predictor returned {type(predictions).__name__} at time step {scene.time_step}, "
                "Predictions of that time step expected"
            )
        return predictions

    def _plan_python(self, scene: _core.Scene, predictions: _core.Predictions, plans: _core.Plans) -> None:
        for agent_id in plans.missing:
            try:
                view = self.world.view(scene, agent_id)
                seen = predictions.of(np.append(view.ids, agent_id))
                trajectory = self._python_planners[agent_id].plan(view, seen)
                write_plan(plans, agent_id, trajectory, view)
            except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever a planner raises costs its own agent only
                text = str(error) if isinstance(error, InterdriveError) else f"{type(error).__name__}: {error}"
                plans.fail(agent_id, f"planner of agent {agent_id} at time step {scene.time_step}: {text}")

    def run(self, on_step: Callable[[int, int, int, int], None] | None = None) -> Run:
        """Steps until every agent has its outcome.

        Args:
            on_step: Called after every step with time step, agents driving, agents in all, latest possible time step.

        Returns:
            The finished run.
        """
        last = self.world.last_time_step or 0
        while not self.world.is_done:
            self.step()
            if on_step is not None:
                on_step(self.world.time_step, len(self.world.driving), len(self.agents), last)
        return self.record()

    def record(self) -> Run:
        """What happened so far, as arrays."""
        states = _states(self.world.states())
        outcomes = self.world.outcomes()
        plans = self.world.plans()
        names = {agent.id: name_of(self._choices[agent.id]) for agent in self.agents}
        return Run(
            scenario=self.scenario,
            settings=self._repeatable_settings(),
            agents=tuple(_agent_record(agent, names[agent.id]) for agent in self.agents),
            outcomes=Outcomes(
                agent_id=outcomes["agent_id"],
                planner=tuple(names[i] for i in outcomes["agent_id"].tolist()),
                outcome=tuple(_OUTCOME_NAMES[code] for code in outcomes["kind"].tolist()),
                time_step=outcomes["time_step"],
                partner_id=outcomes["partner_id"],
                off_road=outcomes["off_road"],
                impact_speed=outcomes["impact_speed"],
                message=tuple(outcomes["message"]),
            ),
            states=states,
            plans=Plans(**plans),
            timings=_timings(self._timings),
            notes=(
                *self._notes,
                *(
                    f"{a} and {b} touch when they enter: their contact counts only after they have separated"
                    for a, b in self._touching
                ),
            ),
            digest=digest(states),
            finished=self.world.is_done,
            snapshots=tuple(self._snapshots),
        )

    def _repeatable_settings(self) -> dict[str, Any]:
        planners = {str(i): name_of(choice) for i, choice in self._choices.items()}
        same = len(set(planners.values())) == 1
        return {
            "agents": self._agents_wanted,
            "planner": next(iter(planners.values())) if same else planners,
            "predictor": name_of(self._predictor_choice),
            "repeatable": all(isinstance(c, str) for c in (*self._choices.values(), self._predictor_choice)),
            "seed": self.seed,
            "threads": self.threads,
            "settings": flatten(self.settings),
        }


def simulate(
    scenario: Scenario | str | os.PathLike[str] | object,
    *,
    agents: str | int | Sequence[int] = "all",
    planner: PlannerChoice = "frenet",
    predictor: object = "lane_following",
    settings: SimulationSettings | None = None,
    seed: int = 0,
    threads: int | None = None,
    snapshots_of: int | None = None,
    on_step: Callable[[int, int, int, int], None] | None = None,
) -> Run:
    """Runs a scenario until every agent has its outcome; the arguments are those of `Simulation`.

    Returns:
        The finished run.

    Raises:
        InputError: Anything about the input that cannot be used, in one line.
        PredictorError: The predictor raised or returned garbage.
    """
    simulation = Simulation(
        scenario,
        agents=agents,
        planner=planner,
        predictor=predictor,
        settings=settings,
        seed=seed,
        threads=threads,
        snapshots_of=snapshots_of,
    )
    return simulation.run(on_step)


def digest(states: States) -> str:
    """SHA-256 over ids, masks and the bits of all states; equal digests mean equal runs."""
    total = hashlib.sha256()
    for array in (
        states.ids,
        states.valid,
        *(getattr(states, name) for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")),
    ):
        # Absent states are nan; one bit pattern for all of them.
        clean = np.where(np.isnan(array), 0.0, array) if array.dtype == np.float64 else array
        total.update(np.ascontiguousarray(clean).tobytes())
    return total.hexdigest()


def _scenario(source: object) -> Scenario:
    if isinstance(source, Scenario):
        return source
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if str(source) in shipped_scenarios() and not path.exists():
            path = shipped_scenario(str(source))
        return read_scenario(path)
    if isinstance(source, tuple):
        return scenario_from_commonroad(*source)
    return scenario_from_commonroad(source)


def _named(
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


def _choices(planner: object, ids: list[int], settings: PlannerSettings) -> dict[int, object]:
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


def _states(raw: dict[str, Any]) -> States:
    return States(kinds=tuple(KINDS[code] for code in raw.pop("kind").tolist()), **raw)


def _agent_record(agent: Any, planner: str) -> AgentRecord:  # noqa: ANN401 - interdrive.agents.Agent
    return AgentRecord(
        id=agent.id,
        planner=planner,
        origin=agent.origin,
        start_time_step=agent.initial_state.time_step,
        goal_time_step=(min(g.time_step[0] for g in agent.goal), max(g.time_step[1] for g in agent.goal)),
        goal_areas=tuple(area for alternative in agent.goal for area in alternative.areas),
        route_lanelet_ids=tuple(agent.route.lanelet_ids),
        reference_path=agent.route.reference_path,
    )


def _timings(rows: list[tuple[int, tuple[float, ...]]]) -> Timings:
    return Timings(
        time_step=np.repeat(np.array([time_step for time_step, _ in rows], dtype=np.int64), len(PHASES)),
        phase=PHASES * len(rows),
        seconds=np.array([seconds for _, phases in rows for seconds in phases], dtype=np.float64),
    )


def _snapshot(world: _core.World, scene: _core.Scene, predictions: _core.Predictions, agent_id: int) -> Snapshot:
    view = world.view(scene, agent_id)
    found = world.candidates(agent_id, scene, predictions)
    seen = np.isin(predictions.ids, view.ids)
    used = seen[:, None] & (predictions.probability > 0)
    rows, modes = np.nonzero(used)
    empty = np.empty((0, 0))
    return Snapshot(
        time_step=world.time_step,
        agent_id=agent_id,
        candidate_x=found["x"] if found else empty,
        candidate_y=found["y"] if found else empty,
        cost=found["cost"] if found else np.empty(0),
        rejection=tuple(found["rejection"]) if found else (),
        chosen=int(found["chosen"]) if found else -1,
        prediction_id=predictions.ids[rows],
        prediction_probability=predictions.probability[rows, modes],
        prediction_x=predictions.x[rows, modes],
        prediction_y=predictions.y[rows, modes],
        prediction_covariance=predictions.covariance[rows, modes],
    )
