"""One encounter in every degree of interaction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.simulation import Simulation
from interdrive.studies.measures import study_table

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from interdrive.results import ArrowTable
    from interdrive.run import Run
    from interdrive.run_settings import SimulationSettings
    from interdrive.scenario import Scenario

#: How much the other vehicle reacts: it replays its recording, it adjusts its speed on its recorded path, it plans as
#: the agent does.
DEGREES = ("deterministic", "semi_deterministic", "interactive")


@dataclass(frozen=True)
class CaseStudy:
    """One encounter in every degree of interaction.

    Attributes:
        scenario: What was simulated.
        agent: Id of the vehicle that always plans.
        other: Id of the vehicle whose behaviour is varied.
        planner: Name of the planner of the agent and, in the interactive degree, of the other vehicle.
        runs: One per degree, in the order of `DEGREES`. In the deterministic run the other vehicle is no agent.
    """

    scenario: Scenario
    agent: int
    other: int
    planner: str
    runs: Mapping[str, Run]

    @property
    def name(self) -> str:
        """Scenario and pair, as one word."""
        return f"{self.scenario.name}_{self.agent}_{self.other}"

    @property
    def table(self) -> ArrowTable:
        """One row per degree; the columns are those of `interdrive.studies.study_table`."""
        return study_table([self])


def case_study(
    scenario: Scenario | str | os.PathLike[str],
    *,
    agent: int,
    other: int,
    planner: object = "frenet",
    predictor: object = "neural",
    settings: SimulationSettings | None = None,
    threads: int | None = None,
    on_step: Callable[[int, int, int, int], None] | None = None,
) -> CaseStudy:
    """Simulates an encounter of two vehicles in every degree of interaction; everybody else replays the recording.

    Args:
        scenario: A `Scenario`, the path of a CommonRoad file, or the name of a shipped scenario.
        agent: Id of a planning problem or recorded vehicle, which always plans.
        other: Id of a recorded vehicle, whose behaviour is varied.
        planner: Of the agent and, in the interactive degree, of the other vehicle: name, record, object or factory.
        predictor: Of both: name, record, object or factory.
        settings: Settings; the defaults otherwise.
        threads: Threads that plan; the number of cores otherwise. Results do not depend on it.
        on_step: Called after every step with time step, agents driving, agents in all, latest possible time step.

    Returns:
        The finished runs.

    Raises:
        InputError: Anything about the input that cannot be used, in one line, before anything is simulated.
        PredictorError: The predictor raised or returned garbage.
    """
    if agent == other:
        raise InputError(f"agent {agent} and the other vehicle must be two vehicles")

    def prepared(agents: list[int], planners: object) -> Simulation:
        return Simulation(
            source, agents=agents, planner=planners, predictor=predictor, settings=settings, threads=threads
        )

    source: object = scenario
    alone = prepared([agent], planner)
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
    simulations = {
        "deterministic": alone,
        "semi_deterministic": prepared([agent, other], {agent: planner, other: "velocity_adjusting"}),
        "interactive": prepared([agent, other], planner),
    }
    runs = {degree: simulation.run(on_step) for degree, simulation in simulations.items()}
    row = int(np.searchsorted(runs["interactive"].outcomes.agent_id, agent))
    return CaseStudy(alone.scenario, agent, other, runs["interactive"].outcomes.planner[row], runs)
