"""Runs: steps of the core, in which predictors and planners in Python answer too."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import RecordSettings, SimulationSettings
from interdrive.errors import InputError
from interdrive.run import Plans
from interdrive.run.assemble import states_of
from interdrive.run.reasons import said_count
from interdrive.runs import Run, RunInterrupted
from interdrive.scenario.native import thread_count
from interdrive.simulation.preparation import prepared
from interdrive.simulation.progress import Progress
from interdrive.simulation.record import explained_run, outcomes_until_now, unexplained_run

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence, Set

    from interdrive import _core
    from interdrive.config.agent_config import PlannersSpec, RulesSpec, V2xSpec, ViewsSpec
    from interdrive.config.schema import SettingsSpec, TrafficSpec
    from interdrive.config.specs import PlannerSpec, PredictorSpec
    from interdrive.files import ScenarioSpec
    from interdrive.run import Outcomes, States
    from interdrive.scenario import Scenario


class Simulation:
    """A scenario whose agents plan for themselves, step by step.

    Example:
        >>> simulation = Simulation("t_junction", agents="all")  # doctest: +SKIP
        >>> while not simulation.is_done:  # doctest: +SKIP
        ...     simulation.step()
        >>> run = simulation.record()  # doctest: +SKIP

    Attributes:
        preparation: What the run is made of.
        progress: What changes while it is stepped.
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
        self._with_processes = planner_processes
        made = prepared(
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
            reachable=reachable_agents,
            on_setup=self._on_setup,
        )
        self.preparation = made
        self.scenario, self.settings, self.seed = made.scenario, made.settings, made.seed
        self.road, self.agents, self.traffic = made.road, made.agents, made.traffic
        self.progress = self._begun()

    def __repr__(self) -> str:
        return f"<Simulation of {self.scenario.name}: {len(self.agents)} agents, time step {self.world.time_step}>"

    def reset(self) -> None:
        """Returns to the first time step, with new planners and a new predictor."""
        self.progress.stop()
        self.progress = self._begun()

    def _begun(self) -> Progress:
        self._on_setup(f"preparing {said_count(len(self.agents), 'agent')}", 0, 0)
        return Progress(self.preparation, self.threads, raises=self._raises, with_processes=self._with_processes)

    @property
    def world(self) -> _core.World:
        """The world of the core."""
        return self.progress.world

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
        progress, world, time_step = self.progress, self.world, self.world.time_step
        progress.logs.begin(time_step)
        step = progress.begin_step()
        missing = step.missing
        progress.plan_outside(step)
        step.mark()
        progress.logs.add_plans(world, step, missing)
        driving = set(world.driving) if self.settings.collision.not_at_fault == "hitter_leaves" else set()
        progress.advance(step, time_step)
        if driving:
            self._let_go_of_hit_agents(driving)
        if world.is_done:
            self.stop()
        progress.logs.end(step)

    def _let_go_of_hit_agents(self, driving: Set[int]) -> None:
        """Lets agents that drove drive on after contacts that were not their fault; who hit them leaves."""
        world, progress = self.world, self.progress
        raw = world.outcomes()
        ended = set(raw["agent_id"][raw["partner_id"] >= 0].tolist()) & driving - set(world.driving)
        if ended:
            from interdrive.scoring.hits import hits_among  # noqa: PLC0415 - few runs have contacts

            partners = dict(zip(raw["agent_id"].tolist(), raw["partner_id"].tolist(), strict=True))
            run = explained_run(progress, Plans(**world.plans()), with_violations=True)
            for hit in hits_among(run, ended):
                world.drive_on(hit.agent_id)
                progress.hits.append(hit)
                if progress.sumo is not None:
                    progress.sumo.leave(partners[hit.agent_id])

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
            self.progress.logs.catch_up(self.world.time_step)
            self.stop()
            raise RunInterrupted(self.record()) from None
        return self.record()

    def stop(self) -> None:
        """Ends the processes of the run; no further step is possible where there were any."""
        self.progress.stop()

    def states(self) -> States:
        """The states of all participants until now."""
        return states_of(self.world.states())

    def outcomes(self) -> Outcomes:
        """How agents have ended until now, without reasons; `record` has them."""
        return outcomes_until_now(self.progress)

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
        self.progress.called.close()

    def record(self, *, explained: bool = True) -> Run:
        """The run until now, as arrays.

        Args:
            explained: With reasons of outcomes and, where `record.violations` says so, violations. Both take time.
        """
        # A run that is over makes no more plans.
        plans = Plans(**(self.world.hand_over_plans() if self.world.is_done else self.world.plans()))
        if not explained:
            return unexplained_run(self.progress, plans)
        return explained_run(self.progress, plans, with_violations=self.settings.record.violations)


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
