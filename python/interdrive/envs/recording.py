"""Environments of one world: their episode as a run, to be saved, reported and judged; what recorded drivers did."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.config.binding import flatten
from interdrive.envs.actions import KinematicGrid
from interdrive.envs.engine import Drives
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic
from interdrive.run import Plans, Timings
from interdrive.run.assemble import agent_records, digest, first_states, outcomes_of, states_of
from interdrive.run.flows import demand_of
from interdrive.run.reasons import reasons
from interdrive.runs import Run
from interdrive.traffic import entered_at

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from interdrive.envs.engine import Engine
    from interdrive.run import RunSettings

#: What drives a learner, in tables.
LEARNER = "learner"


def _run_of(engine: Engine) -> Run:
    """The episode of the first world, as far as it has come.

    Raises:
        InputError: Nothing was recorded.
    """
    episode = engine.episodes[0]
    if not engine.setup.settings.record:
        raise InputError("run", "nothing was recorded; make the environment with record=True")
    if episode is None:
        raise InputError("run: reset first")
    stage, worlds = engine.stages[episode.stage], engine.worlds
    states = states_of(worlds.states(0))
    raw = worlds.outcomes(0)
    learners = {stage.agents[position].id for position in episode.learners}
    driven = set(raw["agent_id"].tolist())
    made, configs = stage.traffic(episode)
    configs = {**stage.configs, **configs}
    names = {i: LEARNER if i in learners else configs[i].planner.name for i in driven}
    outcomes = outcomes_of(raw, names, {})
    agents = [agent for agent in stage.agents if agent.id in driven]
    first = episode.time_step
    begun = [
        replace(agent, initial_state=replace(agent.initial_state, time_step=max(first, agent.initial_state.time_step)))
        for agent in agents
    ]
    firsts = first_states(states, [agent.id for agent in made.agents])
    begun += [
        agent if agent.queue is None or agent.id not in firsts else entered_at(agent, *firsts[agent.id])
        for agent in made.agents
    ]
    lanes = made.lane_ids, made.due, made.exit_ids, made.lengths
    entered = {number: state.time_step for number, state in firsts.items()}
    settings: RunSettings = {
        "agents": sorted(driven - made.drivers.keys()),
        "planner": {str(i): name for i, name in sorted(names.items()) if i not in made.drivers},
        "views": {},
        "rules": {},
        "predictor": str(engine.setup.predictor),
        "repeatable": False,
        "seed": episode.seed,
        "threads": 1,
        "settings": flatten(stage.config.settings),
    }
    run = Run(
        scenario=stage.scenario,
        settings=settings,
        agents=agent_records(begun, names),
        outcomes=outcomes,
        states=states,
        plans=Plans(**worlds.plans(0)),
        timings=Timings.empty(),
        notes=stage.scenario.notes,
        digest=digest(states),
        finished="running" not in outcomes.outcome,
        demand=None if stage.maker is None else demand_of(made.agents, lanes, entered, outcomes, stage.scenario.dt),
    )
    return replace(run, outcomes=replace(outcomes, reason=reasons(run, stage.road)))


class RecordedDrives(Drives):
    """What environments of one world offer."""

    def run(self) -> Run:
        """The episode until now; needs `record=True`."""
        return _run_of(self._engine)

    def recorded_actions(self, agent_id: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """What a recorded driver did, as actions of the single-track model.

        Args:
            agent_id: CommonRoad id of a vehicle with a recording.

        Returns:
            Actions, shape (time steps, 2), and whether each of them leads to within 0.1 m and 0.02 rad of the next
            recorded state, shape (time steps,).

        Raises:
            InputError: The actions of this environment cannot be inverted, or the vehicle has no recording.
        """
        engine = self._engine
        episode = engine.episodes[0]
        stage = engine.stages[0 if episode is None else episode.stage]
        ids = [agent.id for agent in stage.agents]
        if agent_id not in ids:
            raise InputError(f"agent {agent_id}", f"cannot be an agent of {stage.scenario.name}")
        actions = engine.setup.actions
        model = actions.model if isinstance(actions, KinematicGrid) else actions
        if not isinstance(model, Kinematic):
            raise InputError("recorded_actions", "only Kinematic and KinematicGrid can be inverted")
        return stage.core.recorded_actions(ids.index(agent_id), model)

    def render(self) -> None:
        """Does nothing; pictures come from `run()`."""

    def close(self) -> None:
        """Has nothing to close."""
