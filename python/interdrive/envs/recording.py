"""A finished episode as a run, to be saved, reported and judged; and what recorded drivers did."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.config.binding import flatten
from interdrive.envs.actions import KinematicGrid
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic
from interdrive.run import Plans, Timings
from interdrive.run.assemble import agent_record, digest, outcomes_of, states_of
from interdrive.run.reasons import reasons
from interdrive.runs import Run

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from interdrive.envs.engine import Engine
    from interdrive.run import RunSettings

#: What drives a learner, in tables.
LEARNER = "learner"


def run_of(engine: Engine) -> Run:
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
    names = {i: LEARNER if i in learners else stage.configs[i].planner.name for i in driven}
    outcomes = outcomes_of(raw, names, {})
    agents = [agent for agent in stage.agents if agent.id in driven]
    first = episode.time_step
    begun = [
        replace(agent, initial_state=replace(agent.initial_state, time_step=max(first, agent.initial_state.time_step)))
        for agent in agents
    ]
    settings: RunSettings = {
        "agents": sorted(driven),
        "planner": {str(i): name for i, name in sorted(names.items())},
        "views": {},
        "rules": {},
        "predictor": str(engine.setup.predictor),
        "repeatable": False,
        "seed": 0,
        "threads": 1,
        "settings": flatten(engine.setup.settings.simulation),
    }
    run = Run(
        scenario=stage.scenario,
        settings=settings,
        agents=tuple(agent_record(agent, names[agent.id]) for agent in begun),
        outcomes=outcomes,
        states=states,
        plans=Plans(**worlds.plans(0)),
        timings=Timings.empty(),
        notes=stage.scenario.notes,
        digest=digest(states),
        finished="running" not in outcomes.outcome,
    )
    return replace(run, outcomes=replace(outcomes, reason=reasons(run, stage.road)))


def recorded_actions(engine: Engine, agent_id: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """What a recorded driver did, as actions of the single-track model.

    Args:
        engine: Worlds of one scenario, or with an episode.
        agent_id: CommonRoad id.

    Returns:
        Actions of shape (time steps, 2), and shape (time steps,): they lead to within 0.1 m and 0.02 rad of the next
        recorded state.

    Raises:
        InputError: It cannot be an agent, or actions are not those of the model.
    """
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
