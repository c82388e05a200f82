"""One encounter at every level of interaction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import settings_of
from interdrive.config.specs import read_planner, read_predictor
from interdrive.errors import InputError
from interdrive.simulation import Simulation
from interdrive.studies.result import CaseStudy

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.config.agent_config import PlannersSpec
    from interdrive.config.schema import SettingsSpec
    from interdrive.config.specs import PlannerSpec, PredictorSpec
    from interdrive.files import ScenarioSpec


def case_study(
    scenario: ScenarioSpec,
    *,
    agent: int,
    other: int,
    planner: PlannerSpec = DEFAULT_PLANNER,
    predictor: PredictorSpec = "neural",
    settings: SettingsSpec | None = None,
    threads: int | None = None,
    on_step: Callable[[int, int, int, int], None] | None = None,
) -> CaseStudy:
    """Simulates an encounter of two vehicles at every level of interaction; all others replay their recording.

    Args:
        scenario: See `interdrive.ScenarioSpec`.
        agent: Id of a planning problem or recorded vehicle, which always plans.
        other: Id of the recorded vehicle whose behaviour is varied.
        planner: Planner of the agent and, in the interactive degree, of the other vehicle; see
            `interdrive.PlannerSpec`.
        predictor: Predictor of both; see `interdrive.PredictorSpec`.
        settings: Settings, or a mapping of dotted names.
        threads: Number of planning threads; None: the number of cores. Results do not depend on it.
        on_step: Called after every step with time step, driving agents, all agents, latest possible time step.

    Returns:
        The finished runs.

    Raises:
        InputError: The input cannot be used; one line, before anything is simulated.
        PredictorError: The predictor raised an exception or returned invalid predictions.
    """
    if agent == other:
        raise InputError(f"agent {agent} and the other vehicle must be two vehicles")

    def prepared(agents: list[int], planners: PlannersSpec) -> Simulation:
        return Simulation(source, agents=agents, planner=planners, predictor=expected, settings=chosen, threads=threads)

    chosen = settings_of(settings)
    driver, expected = read_planner(planner, chosen.planner), read_predictor(predictor, chosen.predictor)
    source: ScenarioSpec = scenario
    alone = prepared([agent], driver)
    source = alone.scenario
    # A planning problem that starts where a recorded vehicle is has become that vehicle.
    agent = alone.agents[0].id
    if agent == other:
        raise InputError(f"agent {agent} and the other vehicle are one vehicle: the planning problem starts there")
    obstacles = alone.scenario.obstacles
    recorded = obstacles.ids[obstacles.valid.any(axis=1) & ~obstacles.is_static]
    if other not in recorded:
        known = ", ".join(str(number) for number in recorded[recorded != agent][:20].tolist()) or "none"
        raise InputError(f"other vehicle {other}: it has no recording; vehicles with one: {known}")
    by_agent: dict[int, PlannerSpec] = {agent: driver, other: "velocity_adjusting"}
    simulations = {
        "deterministic": alone,
        "semi_deterministic": prepared([agent, other], by_agent),
        "interactive": prepared([agent, other], driver),
    }
    runs = {degree: simulation.run(on_step) for degree, simulation in simulations.items()}
    row = int(np.searchsorted(runs["interactive"].outcomes.agent_id, agent))
    return CaseStudy(alone.scenario, agent, other, runs["interactive"].outcomes.planner[row], runs)
