"""What changes while a run is stepped: its world, and what answers in it outside the core."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from interdrive import _core
from interdrive.config.agent_config import core_agent
from interdrive.config.specs import bound_predictor
from interdrive.planners import Planner, Trajectory, native_planner
from interdrive.planners.called import CalledPlanners
from interdrive.run.logs import CandidateLog, Logs
from interdrive.simulation.preparation import prepared

if TYPE_CHECKING:
    from interdrive.config.schema import SimulationSettings
    from interdrive.native_settings import RulesSettings, ViewSettings
    from interdrive.scenario import Scenario
    from interdrive.scoring.hits import Hit
    from interdrive.simulation.preparation import Preparation
    from interdrive.sumo import traffic as sumo_traffic


class Progress:
    """A run on its way, from its first time step on.

    Attributes:
        made: What the run is made of.
        threads: Number of planning threads.
        world: The world of the core.
        called: Planners in Python.
        sumo: SUMO, if it drives traffic.
        logs: What is noted of every step.
        hits: Contacts after which agents drove on.
        touching: Pairs that overlapped when they entered.
    """

    def __init__(self, made: Preparation, threads: int, *, raises: bool, with_processes: bool) -> None:
        """Makes new planners, a new predictor, and the world at its first time step.

        Args:
            made: What the run is made of.
            threads: Number of planning threads.
            raises: Exceptions of planners pass through.
            with_processes: Planners in Python that allow it get processes of their own.
        """
        self.made, self.threads = made, threads
        settings, record, dt = made.settings, made.settings.record, made.scenario.dt
        self._n_predicted = max(1, round(settings.predictor.horizon / dt))
        self._predictor = bound_predictor(made.predictor, settings.predictor, made.core_scenario)
        self._raises = raises
        self.world, called = _world(made, threads)
        self.sumo = self._sumo(made)
        drivers = {i: dict(made.configs[i].driver) for i in called}
        self.called = CalledPlanners(called, made.planner_names, settings.step.planner_timeout_s, drivers)
        if with_processes and not raises:
            self._start_processes(made, threads)
        self.touching = self.world.entered_in_contact
        self.hits: list[Hit] = []
        self.logs = Logs(
            dt,
            v2x=bool(self.world.equipped),
            profile=record.profile,
            predictions=record.predictions,
            candidates=CandidateLog(dt, record.candidates, record.candidate_spacing, threads)
            if record.candidates
            else None,
        )

    def _sumo(self, made: Preparation) -> sumo_traffic.Traffic | None:
        """SUMO, if it drives traffic; its participants are placed in the world."""
        if made.scenario.sumo is None:
            return None
        from interdrive.sumo import traffic as sumo_traffic  # noqa: PLC0415 - few runs have it

        sumo = sumo_traffic.Traffic(made.scenario, made.agents, made.settings.sumo.radius, made.seed)
        self.world.place_outside(sumo.first(self.world.time_step))
        return sumo

    def _start_processes(self, made: Preparation, threads: int) -> None:
        """Moves planners in Python that allow it to separate processes."""
        willing = self.called.willing
        if not willing:
            return
        if self.sumo is not None:
            self.called.notes.append("planners in Python run in this process: SUMO drives traffic")
            return
        views = {i: config.view for i, config in made.stated.items()}
        rules = {i: config.rules for i, config in made.stated.items()}
        stage = partial(_staged, made.scenario, views, rules, made.settings, made.seed)
        self.called.move({i: made.configs[i].planner.make for i in willing}, stage, threads)

    def begin_step(self) -> _core.Step:
        """A step up to the plans of the core."""
        step = self.world.observe()
        forecast = self._predictor.native or self.predict(step.scene)
        self.world.plan(step, forecast, self._n_predicted)
        return step

    def predict(self, scene: _core.Scene) -> _core.Predictions:
        """The predictions of a scene."""
        return self._predictor.predict(self.world, scene, self._n_predicted)

    def plan_outside(self, step: _core.Step) -> None:
        """Adds the plans of planners in Python."""
        plan = self.called.plan_unguarded if self._raises else self.called.plan
        plan(self.world, step, self.logs)

    def advance(self, step: _core.Step, time_step: int) -> None:
        """Moves all participants, those of SUMO too."""
        self.world.advance(step, None if self.sumo is None else self.sumo.step(time_step, *self.world.next_of(step)))

    def stop(self) -> None:
        """Ends the processes of the run."""
        self.called.close()
        if self.sumo is not None:
            self.sumo.close()


def _world(made: Preparation, threads: int) -> tuple[_core.World, dict[int, Planner]]:
    """The world, and the planners of agents for whom the core has none."""
    called: dict[int, Planner] = {}
    handles = []
    for agent in made.agents:
        config = made.configs[agent.id]
        planner = config.planner.make()
        native_settings = native_planner(planner)
        if native_settings is None:
            called[agent.id] = planner
            precedence = config.rules.precedence and bool(getattr(planner, "obeys_rules", False))
            config = replace(config, rules=replace(config.rules, precedence=precedence))
        handles.append(core_agent(agent, config, native_settings))
    settings, record = made.settings, made.settings.record
    world = _core.World(
        made.core_scenario,
        handles,
        made.traffic.allowed(settings.step, made.scenario),
        threads=threads,
        record_views=record.views,
        v2x=settings.v2x,
        seed=made.seed,
        messages=record.messages,
        profile=record.profile,
        steps_without_agents=made.steps_without_agents,
    )
    return world, called


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
    made = prepared(
        scenario,
        agents=list(views) or 0,
        planner=_NeverAsked,
        predictor="constant_velocity",
        views=views,
        rules=rules,
        v2x=None,
        settings=settings,
        traffic=None,
        start=None,
        seed=seed,
        reachable=lambda *_: [],
        on_setup=lambda *_: None,
    )
    return _world(made, 1)[0]
