"""Runs: steps of the core, in which predictors and planners in Python answer too; what is recorded."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from interdrive import _core
from interdrive.config.agent_config import agent_configs, core_agent, run_config, stored, temperament
from interdrive.config.binding import flatten
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import (
    RecordingSettings,
    RecordSettings,
    SimulationSettings,
    settings_of,
    with_start,
    with_traffic,
)
from interdrive.config.specs import bound_predictor, read_predictor
from interdrive.errors import InputError
from interdrive.files import open_scenario
from interdrive.planners import Planner, Trajectory, native_planner
from interdrive.planners.called import CalledPlanners
from interdrive.run import Plans, Views
from interdrive.run.assemble import (
    agent_records,
    digest,
    first_states,
    hits_of,
    named_by_sumo,
    outcomes_of,
    states_of,
    timings_of,
)
from interdrive.run.cooperation import agreements_of, cooperation_notes, messages_of
from interdrive.run.flows import demand_of
from interdrive.run.logs import CandidateLog, Logs
from interdrive.run.orders import orders_of
from interdrive.run.reasons import ended_early, reasons, said_count
from interdrive.run.violations import violations
from interdrive.runs import Run, RunInterrupted
from interdrive.scenario import Scenario, SourceOptions
from interdrive.scenario.agents import normalized, select
from interdrive.scenario.native import core_road, core_scenario, thread_count
from interdrive.traffic import Generated, TrafficMaker, entered_at, map_alone

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence, Set

    from interdrive.config.agent_config import PlannersSpec, RulesSpec, V2xSpec, ViewsSpec
    from interdrive.config.schema import SettingsSpec, TrafficSpec
    from interdrive.config.specs import PlannerSpec, PredictorSpec
    from interdrive.files import ScenarioSpec
    from interdrive.native_settings import RulesSettings, ViewSettings
    from interdrive.run import Demand, Orders, Outcomes, RunSettings, States
    from interdrive.run.assemble import FirstState
    from interdrive.scenario.agents import Agent
    from interdrive.scoring.hits import Hit
    from interdrive.sumo import traffic as sumo_traffic


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
        scenario: ScenarioSpec,
        *,
        agents: str | int | Sequence[int] = "all",
        planner: PlannersSpec = DEFAULT_PLANNER,
        predictor: PredictorSpec = "neural",
        views: ViewsSpec | None = None,
        rules: RulesSpec | None = None,
        v2x: V2xSpec | None = None,
        settings: SettingsSpec | None = None,
        traffic: TrafficSpec | None = None,
        start: int | None = None,
        seed: int = 0,
        threads: int | None = None,
        on_planner_error: Literal["end_agent", "raise"] = "end_agent",
        planner_processes: bool = True,
        on_setup: Callable[[str, int, int], None] | None = None,
    ) -> None:
        """Prepares agents, routes and the world.

        Args:
            scenario: See `interdrive.ScenarioSpec`.
            agents: "all", "reachable" (see `reachable_agents`), "problems", a number, or ids; see
                `interdrive.scenario.agents.select`. 0, with generated traffic: nothing of the file but its map and what
                never moves; otherwise recorded vehicles or those of SUMO drive alone, as long as `step.duration` says.
            planner: See `interdrive.PlannerSpec`; or a mapping from agent ids (and "default") to planners.
            predictor: Predictor of all agents; see `interdrive.PredictorSpec`.
            views: Mapping from agent ids (and "default") to views; all other agents have `settings.view`.
            rules: Mapping from agent ids (and "default") to the rules of the road that they obey; all other agents obey
                those of `settings.rules`.
            v2x: Mapping from agent ids (and "default") to whether they have V2X; `settings.v2x.penetration` decides
                about all other agents.
            settings: Settings, or a mapping of dotted names such as `{"view.sensor_radius": 40.0}`.
            traffic: Generated traffic, see `interdrive.TrafficSpec`; None: that of `settings.traffic`.
            start: Time step of the recording at which the run begins, as if the file had been cut there; None: that of
                `settings.recording`.
            seed: Seed for the choice of agents and for generated traffic.
            threads: Number of planning threads; None: the number of cores. Results do not depend on it.
            on_planner_error: "end_agent": an exception of a planner in Python ends its agent (`planner_error`);
                "raise": it passes through, for a debugger; planners then stay in this process, without a time limit.
            planner_processes: Planners in Python whose class has `parallel = True` get processes of their own; False:
                they stay in this process, which starts sooner. Results do not depend on it.
            on_setup: Called while agents are prepared, which takes seconds for a thousand generated vehicles, with what
                is done now, the number of those that are done, and of all; that is 0 where it is not known.

        Raises:
            InputError: The input cannot be used; one line states why.
        """
        self._on_setup = on_setup or (lambda what, done, total: None)
        self.threads = thread_count(threads)
        if on_planner_error not in ("end_agent", "raise"):
            raise InputError(f"on_planner_error must be 'end_agent' or 'raise', not {on_planner_error!r}")
        self._raises = on_planner_error == "raise"
        self._planner_processes = planner_processes
        if not 0 <= seed < 2**64:
            raise InputError(f"the seed must be from 0 to 2^64 - 1, is {seed}")
        config = run_config(with_start(with_traffic(settings_of(settings), traffic), start), planner)
        self._predictor_config = read_predictor(predictor, config.settings.predictor)
        recording, of_files = config.settings.recording, config.settings.source
        self.scenario = open_scenario(scenario, raw=recording.raw, start=recording.start, source=of_files)
        if self.scenario.source is not None:
            of_files = SourceOptions.read(dict(self.scenario.source.options))
        self.seed = seed
        recording = RecordingSettings(raw=self.scenario.raw, start=self.scenario.start)
        self.settings = replace(config.settings, recording=recording, source=of_files)
        self._agents_wanted = normalized(agents)
        if self.settings.traffic.is_on and self.scenario.sumo is not None:
            raise InputError(f"{self.scenario.name}: SUMO makes its traffic; leave out --traffic")
        if self.settings.traffic.is_on and self._agents_wanted == 0:
            self.scenario = map_alone(self.scenario)
        road_settings = self.settings.road
        self.road = core_road(self.scenario, road_settings)
        self._core_scenario = core_scenario(self.scenario, self.road)
        is_reachable = self._agents_wanted == "reachable"
        notes: list[str] = []
        chosen: list[Agent] = []
        if self._has_own_agents:
            chosen, notes = select(
                self.scenario,
                self.road,
                reachable_agents(self.scenario, self.settings) if is_reachable else self._agents_wanted,
                agent_settings=self.settings.agents,
                goal_settings=self.settings.goal,
                max_steps=self.settings.step.steps_at_most(self.scenario),
                seed=seed,
                temperament=temperament(config, seed),
            )
        self.traffic = self._generated(chosen)
        self.agents = sorted([*chosen, *self.traffic.agents], key=lambda agent: agent.id)
        self._notes = [*self.scenario.notes, *notes]
        recorded = set(self.scenario.obstacles.ids.tolist())
        step, traffic_settings = self.settings.step, self.settings.traffic
        self._steps_without_agents = 0 if self.agents else step.steps_without_agents(self.scenario, traffic_settings)
        if not self.agents and not self._steps_without_agents:
            raise InputError(f"{self.scenario.name}: has no traffic; without agents nothing happens")
        self._configs, notes = agent_configs(
            config, views or {}, rules or {}, v2x or {}, self.agents, recorded, self.seed, self.traffic.drivers
        )
        self._usual_planner = config.default.planner
        self._notes += notes
        self._called = CalledPlanners({}, {}, math.inf)
        self._sumo: sumo_traffic.Traffic | None = None
        self.reset()

    @property
    def _has_own_agents(self) -> bool:
        """Whether the file can have agents, and they are wanted."""
        scenario = self.scenario
        has_any = bool(scenario.planning_problems) or not scenario.obstacles.is_static.all()
        is_alone = self.settings.traffic.is_on and self._agents_wanted == "all"
        return self._agents_wanted != 0 and (has_any or not is_alone)

    def _generated(self, chosen: list[Agent]) -> Generated:
        """Generated traffic, besides the agents of the file."""
        settings = self.settings.traffic
        if not settings.is_on:
            return Generated()
        maker = TrafficMaker(self.scenario, self.road, settings, self.settings.step)
        return maker.made(self.seed, chosen, on_vehicle=partial(self._on_setup, "making traffic"))

    def __repr__(self) -> str:
        return f"<Simulation of {self.scenario.name}: {len(self.agents)} agents, time step {self.world.time_step}>"

    def reset(self) -> None:
        """Returns to the first time step, with new planners and a new predictor."""
        self._on_setup(f"preparing {said_count(len(self.agents), 'agent')}", 0, 0)
        self._n_predicted = max(1, round(self.settings.predictor.horizon / self.scenario.dt))
        self._predictor = bound_predictor(self._predictor_config, self.settings.predictor, self._core_scenario)
        self._called.close()
        self._called = CalledPlanners({}, {}, math.inf)
        called: dict[int, Planner] = {}
        handles = []
        for agent in self.agents:
            config = self._configs[agent.id]
            planner = config.planner.make()
            native_settings = native_planner(planner)
            if native_settings is None:
                called[agent.id] = planner
                precedence = config.rules.precedence and bool(getattr(planner, "obeys_rules", False))
                config = replace(config, rules=replace(config.rules, precedence=precedence))
            handles.append(core_agent(agent, config, native_settings))
        record = self.settings.record
        self.world = _core.World(
            self._core_scenario,
            handles,
            self.traffic.allowed(self.settings.step, self.scenario),
            threads=self.threads,
            record_views=record.views,
            v2x=self.settings.v2x,
            seed=self.seed,
            messages=record.messages,
            profile=record.profile,
            steps_without_agents=self._steps_without_agents,
        )
        self._start_sumo()
        drivers = {i: dict(self._configs[i].driver) for i in called}
        self._called = CalledPlanners(called, self._planner_names, self.settings.step.planner_timeout_s, drivers)
        self._start_processes()
        self._touching = self.world.entered_in_contact
        self._hits: list[Hit] = []
        dt = self.scenario.dt
        self._logs = Logs(
            dt,
            v2x=bool(self.world.equipped),
            profile=record.profile,
            predictions=record.predictions,
            candidates=CandidateLog(dt, record.candidates, record.candidate_spacing, self.threads)
            if record.candidates
            else None,
        )

    @property
    def time_step(self) -> int:
        """The present time step."""
        return self.world.time_step

    @property
    def is_done(self) -> bool:
        """Whether every agent has its outcome; without agents, whether the time is over."""
        return self.world.is_done

    @property
    def driving(self) -> list[int]:
        """Ids of the agents that are driving now, ascending."""
        return self.world.driving

    def step(self) -> None:
        """Simulates one time step: all agents observe, predict and plan on the same scene, then all move at once.

        Does nothing once the run is over (see `is_done`).

        Raises:
            PredictorError: The predictor raised an exception or returned invalid predictions.
        """
        if self.world.is_done:
            return
        world, time_step, logs = self.world, self.world.time_step, self._logs
        logs.begin(time_step)
        step = self._begin_step()
        missing = step.missing
        if self._raises:
            self._called.plan_unguarded(world, step, logs)
        else:
            self._called.plan(world, step, logs)
        step.mark()
        logs.add_plans(world, step, missing)
        driving = set(world.driving) if self.settings.collision.not_at_fault == "hitter_leaves" else set()
        world.advance(step, None if self._sumo is None else self._sumo.step(time_step, *world.next_of(step)))
        if driving:
            self._let_go_of_hit_agents(driving)
        if world.is_done:
            self.stop()
        logs.end(step)

    def _let_go_of_hit_agents(self, driving: Set[int]) -> None:
        """Lets agents that drove drive on after contacts that were not their fault; who hit them leaves."""
        raw = self.world.outcomes()
        ended = set(raw["agent_id"][raw["partner_id"] >= 0].tolist()) & driving - set(self.world.driving)
        if ended:
            from interdrive.scoring.hits import hits_among  # noqa: PLC0415 - few runs have contacts

            partners = dict(zip(raw["agent_id"].tolist(), raw["partner_id"].tolist(), strict=True))
            for hit in hits_among(self._recorded(Plans(**self.world.plans()), with_violations=True), ended):
                self.world.drive_on(hit.agent_id)
                self._hits.append(hit)
                if self._sumo is not None:
                    self._sumo.leave(partners[hit.agent_id])

    def _begin_step(self) -> _core.Step:
        """A step up to the plans of the core."""
        step = self.world.observe()
        forecast = self._predictor.native or self._predict(step.scene)
        self.world.plan(step, forecast, self._n_predicted)
        return step

    def _predict(self, scene: _core.Scene) -> _core.Predictions:
        return self._predictor.predict(self.world, scene, self._n_predicted)

    def _start_sumo(self) -> None:
        """Starts SUMO, if it drives traffic, and places its participants."""
        if self._sumo is not None:
            self._sumo.close()
        if self.scenario.sumo is not None:
            from interdrive.sumo import traffic as sumo_traffic  # noqa: PLC0415 - few runs have it

            self._sumo = sumo_traffic.Traffic(self.scenario, self.agents, self.settings.sumo.radius, self.seed)
            self.world.place_outside(self._sumo.first(self.world.time_step))

    def _start_processes(self) -> None:
        """Moves planners in Python that allow it to separate processes."""
        willing = self._called.willing
        if self._raises or not willing or not self._planner_processes:
            return
        if self._sumo is not None:
            self._called.notes.append("planners in Python run in this process: SUMO drives traffic")
            return
        own = {i: config for i, config in self._configs.items() if i not in self.traffic.drivers}
        views = {i: config.view for i, config in own.items()}
        rules = {i: config.rules for i, config in own.items()}
        stage = partial(_staged, self.scenario, views, rules, self.settings, self.seed)
        self._called.move({i: self._configs[i].planner.make for i in willing}, stage, self.threads)

    def run(self, on_step: Callable[[int, int, int, int], None] | None = None) -> Run:
        """Steps until every agent has its outcome; without agents, until the time is over.

        Args:
            on_step: Called after every step with time step, driving agents, all agents, latest possible time step.

        Returns:
            The finished run.

        Raises:
            RunInterrupted: Ctrl-C; the exception holds the run until then.
        """
        last = self.world.last_time_step or 0
        try:
            while not self.world.is_done:
                self.step()
                if on_step is not None:
                    on_step(self.world.time_step, len(self.world.driving), len(self.agents), last)
        except KeyboardInterrupt:
            self._logs.catch_up(self.world.time_step)
            self.stop()
            raise RunInterrupted(self.record()) from None
        return self.record()

    def stop(self) -> None:
        """Ends the processes of the run; no further step is possible where there were any."""
        self._called.close()
        if self._sumo is not None:
            self._sumo.close()

    def states(self) -> States:
        """The states of all participants until now."""
        return states_of(self.world.states())

    def outcomes(self) -> Outcomes:
        """How agents have ended until now, without reasons; `record` has them."""
        return outcomes_of(self.world.outcomes(), self._planner_names, self._called.tracebacks)

    def run_until_ended(self, agent_id: int) -> None:
        """Steps until one agent has its outcome; the others may still be driving then.

        Args:
            agent_id: The agent.

        Raises:
            InputError: It is not an agent of the run.
            PredictorError: The predictor raised an exception or returned invalid predictions.
        """
        rows = np.flatnonzero(self.world.outcomes()["agent_id"] == agent_id)
        if not len(rows):
            raise InputError(f"{agent_id} is not an agent of this run")
        while not self.world.is_done:
            self.step()
            is_driving = agent_id in self.world.driving
            if not is_driving and self.outcomes().outcome[int(rows[0])] != "running":
                break
        self._called.close()

    def record(self, *, explained: bool = True) -> Run:
        """The run until now, as arrays.

        Args:
            explained: With reasons of outcomes and, where `record.violations` says so, violations. Both take time.
        """
        # A run that is over makes no more plans.
        plans = Plans(**(self.world.hand_over_plans() if self.world.is_done else self.world.plans()))
        if not explained:
            return self._unexplained(plans)
        return self._recorded(plans, with_violations=self.settings.record.violations)

    def _recorded(self, plans: Plans, *, with_violations: bool) -> Run:
        run = self._unexplained(plans)
        broken = (
            violations(run, self.road, self.areas, self.world.obeying, self.world.entries())
            if with_violations
            else None
        )
        return replace(run, outcomes=replace(run.outcomes, reason=reasons(run, self.road)), violations=broken)

    def _unexplained(self, plans: Plans) -> Run:
        states = self.states()
        firsts = first_states(states, self.waiting)
        return self.assembled(states, plans, firsts, digest(states))

    def assembled(self, states: States, plans: Plans, firsts: Mapping[int, FirstState], digest: str) -> Run:
        """The run until now without reasons and violations, for one whose states and plans are not all in the world.

        Args:
            states: Its states.
            plans: Its plans.
            firsts: When and how each generated vehicle was there for the first time.
            digest: Of all its states.
        """
        outcomes, names = self.outcomes(), self._planner_names
        logs, now = self._logs, self.world.time_step
        return Run(
            scenario=self.scenario,
            settings=self._repeatable_settings(),
            agents=agent_records(self.as_entered(firsts), names),
            outcomes=outcomes,
            states=states,
            plans=plans,
            timings=timings_of(logs.times),
            notes=(
                *ended_early(outcomes, now, self.scenario.dt),
                *self._notes,
                *(() if self._sumo is None else self._sumo.notes()),
                *self._called.notes,
                *cooperation_notes(self.settings.v2x, self.world.equipped, plans, self.scenario.dt),
                *(
                    f"{a} and {b} overlap when they enter: their contact counts only after they have separated"
                    for a, b in self._touching
                ),
            ),
            digest=digest,
            finished=self.world.is_done,
            views=Views(**self.world.sightings()) if self.settings.record.views else None,
            orders=self.orders() if self.settings.record.orders else None,
            messages=messages_of(self.world.messages()) if self.settings.record.messages != "none" else None,
            agreements=agreements_of(self.world.agreements()) if self._negotiates else None,
            hits=hits_of(self._hits) if self.settings.collision.not_at_fault == "hitter_leaves" else None,
            cooperation=logs.cooperation(self.world),
            demand=self._demand(firsts, outcomes),
            sumo=None if self._sumo is None else named_by_sumo(self._sumo.names),
            profile=logs.profile(now),
            predictions=logs.predictions(now),
            candidates=logs.candidates(now),
        )

    def _demand(self, firsts: Mapping[int, FirstState], outcomes: Outcomes) -> Demand | None:
        made = self.traffic
        if not self.settings.traffic.is_on:
            return None
        lanes = made.lane_ids, made.due, made.exit_ids, made.lengths
        entered = {number: first.time_step for number, first in firsts.items()}
        return demand_of(made.agents, lanes, entered, outcomes, self.scenario.dt)

    def as_entered(self, firsts: Mapping[int, FirstState], wanted: Set[int] | None = None) -> list[Agent]:
        """The agents; those that have waited with the time and the speed at which they entered.

        Args:
            firsts: When and how those that may have waited (`waiting`) were there for the first time.
            wanted: Ids; None: all agents.
        """
        return [
            entered_at(agent, *firsts[agent.id]) if agent.id in firsts else agent
            for agent in self.agents
            if wanted is None or agent.id in wanted
        ]

    @cached_property
    def waiting(self) -> list[int]:
        """Ids of the agents that may enter later than stated: generated ones; with `step.entry_wait` others, too."""
        waits = self.settings.step.entry_wait > 0.0
        return [a.id for a in self.agents if a.origin == "generated" or (waits and not a.replays_before)]

    @cached_property
    def areas(self) -> Mapping[str, Any]:
        """Ground that several ways share, as `_core.Scenario.junctions` tells."""
        return self._core_scenario.junctions()

    @property
    def _planner_names(self) -> dict[int, str]:
        return {agent.id: self._configs[agent.id].planner.name for agent in self.agents}

    @property
    def _negotiates(self) -> bool:
        return self.settings.v2x.negotiate and bool(self.world.equipped)

    def orders(self) -> Orders | None:
        """What agents were told until now; None if none enters junctions by order and none has waited."""
        orders = orders_of(self.world.waits())
        return orders if self.world.obeying or len(orders.agent_id) else None

    def _repeatable_settings(self) -> RunSettings:
        return {
            "agents": self._agents_wanted,
            **stored(
                {i: config for i, config in self._configs.items() if i not in self.traffic.drivers},
                self._predictor_config,
                self.settings,
                self._usual_planner,
            ),
            "seed": self.seed,
            "threads": self.threads,
            "settings": flatten(self.settings),
        }


def reachable_agents(scenario: Scenario, settings: SimulationSettings | None = None) -> list[int]:
    """Ids of possible agents whose own recording reaches their goal in time, and of planning problems.

    All recorded vehicles replay their recordings (planner `recorded`), planning problems are driven by `frenet`. The
    recording must stay on the lanelets with its whole footprint (`road.judge=body`), hit nothing, and end in the goal.

    Args:
        scenario: The scenario.
        settings: Settings of the run.

    Raises:
        InputError: No vehicle can become an agent, or none is reachable.
    """
    own = settings or SimulationSettings()
    own = replace(own, road=replace(own.road, judge="body"), record=RecordSettings())
    problems = {
        agent.id for agent in Simulation(scenario, settings=own, threads=1).agents if agent.origin != "recorded"
    }
    planners: dict[int | str, PlannerSpec] = dict.fromkeys(problems, "frenet")
    run = simulate(scenario, planner={**planners, "default": "recorded"}, settings=own, threads=1)
    ended = zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True)
    found = [agent for agent, outcome in ended if outcome == "goal_reached" or agent in problems]
    if not found:
        raise InputError(f"{scenario.name}: no agent is reachable by its own recording")
    return found


def simulate(
    scenario: ScenarioSpec,
    *,
    agents: str | int | Sequence[int] = "all",
    planner: PlannersSpec = DEFAULT_PLANNER,
    predictor: PredictorSpec = "neural",
    views: ViewsSpec | None = None,
    rules: RulesSpec | None = None,
    v2x: V2xSpec | None = None,
    settings: SettingsSpec | None = None,
    traffic: TrafficSpec | None = None,
    start: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    on_planner_error: Literal["end_agent", "raise"] = "end_agent",
    on_step: Callable[[int, int, int, int], None] | None = None,
) -> Run:
    """Runs a scenario until every agent has its outcome; without agents, until the time is over.

    Args:
        scenario: Path of a CommonRoad file, name of a shipped scenario, `interdrive.Scenario`, or a pair of objects of
            commonroad-io.
        agents: "all", "reachable", "problems", a number, or ids; 0: none of the file.
        planner: A planner for all agents, or a mapping from agent ids (and "default") to planners; see
            `interdrive.PlannerSpec`.
        predictor: Predictor of all agents; see `interdrive.PredictorSpec`.
        views: Mapping from agent ids (and "default") to views; all other agents have `settings.view`.
        rules: Mapping from agent ids (and "default") to the rules of the road that they obey.
        v2x: Mapping from agent ids (and "default") to whether they have V2X.
        settings: Settings, or a mapping of dotted names such as `{"view.sensor_radius": 40.0}`.
        traffic: Generated traffic such as "rate=600" or `{"density": 20.0}`, see `interdrive.TrafficSpec`; None: that
            of `settings.traffic`.
        start: Time step of the recording at which the run begins, as if the file had been cut there: agents are those
            that are there then or enter later, time steps of the run begin at 0. None: that of `settings.recording`.
        seed: Seed for the choice of agents, for generated traffic and for the random numbers of cooperation.
        threads: Number of planning threads; None: the number of cores. Results do not depend on it.
        on_planner_error: "end_agent": an exception of a planner in Python ends its agent; "raise": it passes through.
        on_step: Called after every step with time step, driving agents, all agents, latest possible time step.

    Returns:
        The finished run.

    Raises:
        InputError: The input cannot be used; one line states why.
        PredictorError: The predictor raised an exception or returned invalid predictions.
    """
    simulation = Simulation(
        scenario,
        agents=agents,
        planner=planner,
        predictor=predictor,
        views=views,
        rules=rules,
        v2x=v2x,
        settings=settings,
        traffic=traffic,
        start=start,
        seed=seed,
        threads=threads,
        on_planner_error=on_planner_error,
    )
    return simulation.run(on_step)


class _NeverAsked:
    """Placeholder for the planners of a world that never steps."""

    def plan(self, view: _core.View, predictions: _core.Predictions) -> Trajectory:
        """Is never called."""
        raise NotImplementedError


def _staged(
    scenario: Scenario,
    views: dict[int, ViewSettings],
    rules: dict[int, RulesSettings],
    settings: SimulationSettings,
    seed: int,
) -> _core.World:
    """Rebuilds the world of a simulation with these agents, and its generated traffic, in another process."""
    return Simulation(
        scenario,
        agents=list(views) or 0,
        planner=_NeverAsked,
        views=views,
        rules=rules,
        settings=settings,
        seed=seed,
        threads=1,
    ).world
