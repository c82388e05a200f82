"""The same run, bit for bit, up to a moment, and then with a reference driver in the place of one agent."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from interdrive.config.agent_config import modules_named
from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring import preventability
from interdrive.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.runs import Run


def counterfactual(
    run: Run, agent_id: int, driver: str = "cc", *, at: int | None = None, trust: bool = False, threads: int | None = 1
) -> Run:
    """Repeats a run up to a time step, and goes on with a reference driver in the place of an agent.

    Unlike in `interdrive.scoring.preventability`, the driver sees danger by itself, and others react to what it does.

    Args:
        run: The run; its scenario is the simulated one.
        agent_id: The agent.
        driver: One of `interdrive.reference_drivers.DRIVERS`.
        at: Time step from which the driver plans; None: that at which the partner of the agent's collision came into
            its way.
        trust: Import planners and predictors that the run names as module:object.
        threads: Number of planning threads; results do not depend on it.

    Returns:
        The new run; its records name the planner with which the agent began, and it is not repeatable (`verify`).

    Raises:
        InputError: There is no such agent or driver, it has no collision to start from, `at` is not a time step of the
            run, or the run does not say how to repeat it.
    """
    if driver not in DRIVERS:
        raise InputError(f"there is no reference driver {driver}; there are {', '.join(DRIVERS)}")
    start = _taken_over(run, agent_id) if at is None else at
    if agent_id not in run.outcomes.agent_id.tolist():
        raise InputError(f"counterfactual: {agent_id} is not an agent of this run")
    wanted: Mapping[str, Any] = run.settings
    if not wanted.get("repeatable", True):
        raise InputError("counterfactual: the run had a Python object as planner, which nothing can repeat")
    code = modules_named(wanted["planner"], wanted["predictor"])
    if code and not trust:
        raise InputError(f"counterfactual: repeating this run imports code outside interdrive ({', '.join(code)})")
    simulation = Simulation(
        run.scenario,
        agents=wanted["agents"],
        planner=wanted["planner"],
        predictor=wanted["predictor"],
        views=wanted.get("views", {}),
        rules=wanted.get("rules", {}),
        v2x=wanted.get("v2x", {}),
        settings=bind(SimulationSettings(), wanted["settings"]),
        seed=wanted["seed"],
        threads=threads,
    )
    while simulation.time_step < start and not simulation.is_done:
        simulation.step()
    if simulation.time_step != start:
        raise InputError(f"counterfactual: time step {start} is not one of the run")
    simulation.world.replace_driver(agent_id, driver)
    # No settings name a driver that takes over, so nothing could repeat the run.
    found = simulation.run()
    return replace(found, settings={**found.settings, "repeatable": False})


def _taken_over(run: Run, agent_id: int) -> int:
    found = preventability(run, [agent_id])
    if "collision" not in found.kind:
        raise InputError(
            f"counterfactual: agent {agent_id} has no collision with another participant; give a time step"
        )
    return int(found.from_time_step[found.kind.index("collision")])
